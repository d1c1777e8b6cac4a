//! The model against central differences, and the datum defect of ties, on a circular orbit with two stereo lines.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::{
    Axis, CalibrationState, Combination, Freedom, GroundPoint, LineCamera, LinePose, Offset,
    Parameter, Sight, Start, TieSight, solve, tie_sight,
};

const ORBIT_M: f64 = 3_746_000.0;
const GROUND_M: f64 = 3_396_000.0;
const PIXEL: f64 = 8e-5;
/// Tangent at the last sample.
const EDGE: f64 = 1_292.0 * PIXEL;

/// Rotations of the planet while the spacecraft flies a radian: a planet at rest, and Mars under this orbit of 6 960 s
/// a revolution.
const AT_REST: f64 = 0.0;
const TURNING: f64 = 0.078_5;

/// The spacecraft over the equator of a rotating planet, flying north, `angle` radians further on.
fn pose_over(turning: f64, angle: f64) -> LinePose {
    let at_rest = pose(angle);
    let turned =
        nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), -turning * angle).into_inner();
    LinePose {
        position_m: turned * at_rest.position_m,
        body_to_axes: at_rest.body_to_axes * turned.transpose(),
        ..at_rest
    }
}

/// The same over one at rest.
fn pose(angle: f64) -> LinePose {
    let (sin, cos) = angle.sin_cos();
    let up = Vector3::new(cos, 0.0, sin);
    let (along, down) = (Vector3::new(-sin, 0.0, cos), -up);
    LinePose {
        position_m: up * ORBIT_M,
        body_to_axes: Matrix3::from_rows(&[
            along.cross(&down).transpose(),
            along.transpose(),
            down.transpose(),
        ]),
        after_lines: angle * GROUND_M / 27.0,
    }
}

fn laboratory() -> CalibrationState {
    let line = |tangent: f64| LineCamera {
        offset: Offset::default(),
        m: vec![0.0, EDGE, 0.0],
        n: vec![tangent, 0.0, 0.0],
    };
    let ahead = 18.9_f64.to_radians().tan();
    CalibrationState {
        cameras: vec![line(ahead), line(-ahead)],
        ..CalibrationState::default()
    }
}

/// A number from -1 to 1, the same on every machine.
fn scattered(index: usize, purpose: usize) -> f64 {
    let turned = (index as f64 + 1.0) * [0.754_877_67, 0.569_840_29, 0.415_023_1][purpose % 3]
        + purpose as f64 * 0.131;
    2.0 * turned.fract() - 1.0
}

/// Where a line of a camera sees a point, by bisection of the flight: the angle of the orbit, and the sample.
fn seen(
    state: &CalibrationState,
    turning: f64,
    camera: usize,
    place_m: &Vector3<f64>,
) -> (f64, f64) {
    let tangent = |angle: f64| {
        let pose = pose_over(turning, angle);
        let line = &state.cameras[camera];
        let seen = line
            .offset
            .rotation()
            .tr_mul(&(pose.body_to_axes * (place_m - state.position_m(&pose))));
        (seen.x / seen.z, seen.y / seen.z)
    };
    let (mut low, mut high) = (-0.2, 0.2);
    let mut s = 0.0;
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        let (across, along) = tangent(middle);
        let line = &state.cameras[camera];
        s = (across - line.m[0] - line.m[2] * s * s) / line.m[1];
        if along > line.tangents(s).y {
            low = middle;
        } else {
            high = middle;
        }
    }
    (low, s)
}

/// Ties that `truth` sees over a planet at rest, with noise of `noise_px` pixels.
fn ties(truth: &CalibrationState, count: usize, noise_px: f64) -> Vec<GroundPoint> {
    ties_over(AT_REST, truth, count, noise_px)
}

/// The same over a rotating planet.
fn ties_over(
    turning: f64,
    truth: &CalibrationState,
    count: usize,
    noise_px: f64,
) -> Vec<GroundPoint> {
    let tie = |index: usize| {
        let (angle, side) = (0.07 * scattered(index, 0), 0.009 * scattered(index, 1));
        let height_m = 600.0 * (90.0 * angle).sin() + 300.0 * (400.0 * side).cos();
        let place_m = Vector3::new(
            angle.cos() * side.cos(),
            side.sin(),
            angle.sin() * side.cos(),
        ) * (GROUND_M + height_m);
        let sights = (0..truth.cameras.len()).map(|camera| {
            let (at, s) = seen(truth, turning, camera, &place_m);
            let noise = |purpose| {
                // Uniform with this standard deviation.
                noise_px * 3_f64.sqrt() * scattered(7 * index + camera, purpose)
            };
            Sight {
                camera,
                pose: pose_over(turning, at + noise(2) * 27.0 / GROUND_M),
                s: s + noise(0) / 1_292.0,
                sigma: [0.2 * PIXEL; 2],
            }
        });
        GroundPoint {
            sights: sights.collect(),
            known: None,
        }
    };
    (0..count).map(tie).collect()
}

fn askew() -> CalibrationState {
    let mut state = laboratory();
    state.cameras[0].offset = Offset {
        phi_rad: 0.02,
        omega_rad: -0.03,
        kappa_rad: 0.05,
    };
    state.cameras[0].m[2] = 1e-4;
    state.cameras[0].n[1] = -2e-4;
    state.drift_m_per_line = [0.01, 0.0, -0.02];
    state
}

#[test]
fn offset_rotation_has_the_order_of_the_paper() {
    let offset = askew().cameras[0].offset;
    let about = |axis: Vector3<f64>, angle: f64| {
        nalgebra::Rotation3::from_scaled_axis(axis * angle).into_inner()
    };
    let product = about(Vector3::y(), offset.phi_rad)
        * about(Vector3::x(), offset.omega_rad)
        * about(Vector3::z(), offset.kappa_rad);
    // Rounding.
    assert!((offset.rotation() - product).norm() < 1e-15);
}

#[test]
fn partials_agree_with_central_differences() {
    let state = askew();
    let layout = state.layout();
    let place_m = Vector3::new(3_395_400.0, 9_000.0, 60_000.0);
    for camera in 0..2 {
        let sight = Sight {
            camera,
            pose: pose(0.013 + 0.06 * camera as f64 - 0.03),
            s: 0.4,
            sigma: [1.0, 1.0],
        };
        let point = GroundPoint {
            sights: vec![sight],
            known: None,
        };
        let rows = sight.rows(&state, &place_m).unwrap();
        for index in 0..layout.len() {
            let step = match layout.parameter(index) {
                Parameter::Drift { .. } => 1e-3,
                _ => 1e-5,
            };
            let mut by = DVector::zeros(layout.len());
            by[index] = step;
            let [ahead, behind] = [by.clone(), -by]
                .map(|by| point.residuals(&state.moved(&by), &place_m).unwrap()[0]);
            let difference = (ahead - behind) / (2.0 * step);
            let partial = rows.by_parameters.column(index);
            // The third derivative times the step squared, and rounding over the step.
            let error = (difference - partial).norm();
            assert!(
                error <= 1e-7 * partial.norm().max(1e-8),
                "{:?}: {difference} {partial}",
                layout.parameter(index)
            );
        }
        for axis in 0..3 {
            let mut by_m = Vector3::zeros();
            by_m[axis] = 10.0;
            let [ahead, behind] =
                [by_m, -by_m].map(|by_m| point.residuals(&state, &(place_m + by_m)).unwrap()[0]);
            let error = ((ahead - behind) / 20.0 - rows.by_place.column(axis)).norm();
            assert!(error < 1e-12, "axis {axis}: {error} per metre");
        }
    }
}

/// Standard deviations from ties only, degrees, the largest first.
fn sigmas_deg(of: &TieSight) -> Vec<Option<f64>> {
    let sigmas = of.directions.iter();
    sigmas
        .map(|direction| direction.sigma_rad.map(f64::to_degrees))
        .collect()
}

#[test]
fn ties_leave_common_roll_differential_pitch_and_yaw_unseen() {
    let truth = laboratory();
    let sight = tie_sight(&ties(&truth, 206, 0.2), &truth).unwrap();
    assert_eq!(sight.unseen, 3);
    let named = |combination, axis| {
        let mut names = sight.unseen_names.iter();
        names.any(|of| of.combination == combination && of.axis == axis)
    };
    assert!(named(Combination::Common, Axis::Roll), "{sight:?}");
    assert!(named(Combination::Differential, Axis::Pitch), "{sight:?}");
    assert!(named(Combination::Differential, Axis::Yaw), "{sight:?}");
    assert_eq!(sight.unseen_names.len(), 3);
    // The other three are known as in the paper's table: about 0.1, 0.005 and 0.0001 degrees.
    let sigma_deg: Vec<f64> = sigmas_deg(&sight).into_iter().flatten().collect();
    let sigma_deg = &sigma_deg[sigma_deg.len() - 3..];
    for (found, expected) in sigma_deg.iter().zip([0.115, 0.005, 1e-4]) {
        let ratio = found / expected;
        assert!((0.3..3.0).contains(&ratio), "{sigma_deg:?} degrees");
    }
}

/// Between two looks a rotating planet moves across the flight: ties separate pitch and yaw of the lines, if only to
/// degrees over its equator, where a planet at rest hides them from all ties.
#[test]
fn ties_over_a_turning_planet_see_pitch_and_yaw_apart_to_degrees() {
    let truth = laboratory();
    let [at_rest, turning] = [AT_REST, TURNING].map(|turning| {
        let sight = tie_sight(&ties_over(turning, &truth, 206, 0.2), &truth).unwrap();
        println!("{:?}", sigmas_deg(&sight));
        sight
    });
    let [hidden_deg, seen_deg] = [&at_rest, &turning].map(|of| {
        let sigmas = sigmas_deg(of);
        sigmas[..3]
            .iter()
            .map(|of| of.unwrap_or(f64::INFINITY))
            .collect::<Vec<_>>()
    });
    assert!(
        hidden_deg.iter().all(|deg| *deg > 1_000.0),
        "{hidden_deg:?} degrees"
    );
    assert!(
        seen_deg[1..].iter().all(|deg| *deg < 10.0),
        "{seen_deg:?} degrees"
    );
    // The common roll turns all rays about the flight, whatever rotates below.
    assert!(seen_deg[0] > 10.0, "{seen_deg:?} degrees");
    let (name, share) = turning.directions[0].shares[0];
    assert_eq!(name.words(), "common roll");
    assert!(share.abs() > 0.99, "{share}");
}

/// A third line between the two: their differences have names of their own, and the common roll is equally
/// undetermined.
#[test]
fn three_lines_have_names_for_all_angles() {
    let mut truth = laboratory();
    let mut nadir = truth.cameras[0].clone();
    nadir.n[0] = 0.0;
    truth.cameras.push(nadir);
    let sight = tie_sight(&ties_over(TURNING, &truth, 206, 0.2), &truth).unwrap();
    println!("{:?}", sigmas_deg(&sight));
    assert_eq!(sight.unseen_words(), "common roll");
    assert_eq!(sight.directions.len(), 9);
    for direction in &sight.directions {
        // The components that are kept, those above a tenth: the others are at most eight hundredths of the square.
        let square: f64 = direction
            .shares
            .iter()
            .map(|(_, share)| share * share)
            .sum();
        assert!((0.91..1.0 + 1e-9).contains(&square), "{direction:?}");
    }
    let named = |name: &str| {
        let mut all = sight
            .directions
            .iter()
            .flat_map(|direction| &direction.shares);
        all.any(|(of, _)| of.words() == name)
    };
    assert!(
        named("differential pitch") && named("differential pitch of camera 3"),
        "{sight:?}"
    );
}

fn sigma(of: Parameter) -> f64 {
    match of {
        Parameter::Angle { .. } => 0.025_f64.to_radians(),
        Parameter::Drift { .. } => 0.01,
        _ => 50.0 * PIXEL,
    }
}

/// Lines that differ in roll and scale: the two-parameter step finds both, while freeing all angles biases them through
/// the scale.
#[test]
fn all_angles_take_a_scale_for_a_common_pitch() {
    let known = laboratory();
    let mut truth = laboratory();
    truth.cameras[0].offset.phi_rad = 0.05_f64.to_radians();
    truth.cameras[1].offset.phi_rad = -0.05_f64.to_radians();
    truth.cameras[0].m[1] += 2e-7 * 1_292.0;
    truth.cameras[1].m[1] -= 2e-7 * 1_292.0;
    let points = ties(&truth, 206, 0.0);
    let start = Start {
        known: &known,
        from: &known,
    };
    let layout = known.layout();
    let two = solve(&points, start, &Freedom::differential(layout, sigma)).unwrap();
    let [first, second] = [0, 1].map(|camera| two.state.cameras[camera].clone());
    // Exact points: the remainder is the pull of the prior.
    let error_px = (first.offset.phi_rad - truth.cameras[0].offset.phi_rad).abs() / PIXEL;
    assert!(error_px < 0.02, "{error_px} px");
    let scale_px = (first.m[1] - truth.cameras[0].m[1]).abs() / PIXEL;
    assert!(scale_px < 0.05, "{scale_px} px at the edge");
    assert!((first.offset.phi_rad + second.offset.phi_rad).abs() < 1e-12);
    assert!(first.offset.omega_rad.abs() < 1e-15 && second.offset.omega_rad.abs() < 1e-15);

    let angles = Freedom::each(layout, sigma, |of| matches!(of, Parameter::Angle { .. }));
    let all = solve(&points, start, &angles).unwrap();
    let pitch_deg = (all.state.cameras[0].offset.omega_rad + all.state.cameras[1].offset.omega_rad)
        .to_degrees()
        / 2.0;
    // Ties determine the common pitch to 0.005 degrees: the scale biases it by tens of pixels.
    assert!(pitch_deg.abs() > 0.05, "{pitch_deg} degrees");
}

#[test]
fn a_calibration_of_exact_points_is_exact_where_it_can_be_seen() {
    let known = laboratory();
    let truth = askew();
    let mut points = ties(&truth, 60, 0.0);
    for point in &mut points {
        let place_m = point.place(&truth).unwrap();
        point.known = Some(super::KnownPlace {
            place_m,
            whitening: Matrix3::identity(),
            shared: None,
        });
    }
    let wide = |of: Parameter| match of {
        Parameter::Angle { .. } => 0.2,
        other => sigma(other),
    };
    let freedom = Freedom::each(known.layout(), wide, |_| true);
    let start = Start {
        known: &known,
        from: &known,
    };
    let solved = solve(&points, start, &freedom).unwrap();
    for point in &points {
        let place_m = point.known.unwrap().place_m;
        for (sight, residual) in point
            .sights
            .iter()
            .zip(point.residuals(&solved.state, &place_m).unwrap())
        {
            // The pull of the priors, with points known to a metre.
            let off_px = residual.norm() / PIXEL;
            assert!(off_px < 0.02, "camera {}: {off_px} px", sight.camera);
        }
        let covariance = point
            .unaided()
            .covariance_m2(&solved.state, &solved.covariance, &place_m)
            .unwrap();
        // 0.2 px are 5 m on the ground and 11 m in height.
        let sigma_m = covariance.trace().sqrt();
        assert!((5.0..25.0).contains(&sigma_m), "{sigma_m} m");
    }
}

/// The covariance contains the change of the estimate by every shared error.
#[test]
fn shared_errors_of_control_are_in_the_covariance() {
    let known = laboratory();
    let groups = 4;
    let shared_m = [60.0, 6.0];
    // The estimate after shifts of a group along local axes, and its covariance; `None` without shared errors.
    let estimate = |shift: Option<(usize, usize)>, is_shared: bool| {
        let mut points = ties(&known, 40, 0.0);
        for (index, point) in points.iter_mut().enumerate() {
            let mut place_m = point.place(&known).unwrap();
            let axes = crate::ellipsoid::local_axes(&place_m);
            if let Some((_, axis)) = shift.filter(|(group, _)| *group == index % groups) {
                place_m += axes.row(axis).transpose() * shared_m[axis / 2];
            }
            let over = Vector3::new(0.01, 0.01, 0.1);
            point.known = Some(super::KnownPlace {
                place_m,
                whitening: Matrix3::from_diagonal(&over) * axes,
                shared: is_shared.then_some(super::SharedError {
                    group: index % groups,
                    sigma_m: shared_m,
                }),
            });
        }
        let start = Start {
            known: &known,
            from: &known,
        };
        let freedom = Freedom::each(known.layout(), sigma, |_| true);
        solve(&points, start, &freedom).unwrap()
    };
    let unshifted = estimate(None, true);
    let mut expected: DMatrix<f64> = estimate(None, false).covariance;
    for (group, axis) in (0..groups).flat_map(|group| [0, 1, 2].map(|axis| (group, axis))) {
        let moved = estimate(Some((group, axis)), true).state.vector() - unshifted.state.vector();
        expected += &moved * moved.transpose();
    }
    for index in 0..expected.ncols() {
        let [found, expected] = [&unshifted.covariance, &expected].map(|of| of[(index, index)]);
        let off = (found / expected).sqrt() - 1.0;
        assert!(off.abs() < 0.02, "{index}: {found} {expected}");
    }
}
