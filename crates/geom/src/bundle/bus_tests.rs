//! Spots of a laser on the bus of the cameras: derivatives, signs, and the partitioned equations against the dense
//! ones.

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

use super::{
    AttitudeClock, BundleOptions, CommonBus, HeightControl, Network, RecordedProfile,
    SharedRotation, Spot, View,
    height_tests::{CONTROLLED, are_those_of_the_dense_equations, surface_with},
    layout::Layout,
    solve,
    spots::SpotRow,
    tests::{layout, network},
    unknowns::{State, Unknown},
};
use crate::{
    boresight::BoresightAngles,
    collinearity::project,
    ellipsoid::local_axes,
    pushbroom::{Distortion, EulerPolynomial, ExteriorOrientation, Sighting},
    surface::SurfaceOptions,
};

/// From the camera to the laser's ground, roughly, metres.
const RANGE_M: f64 = 380e3;

/// Points of the network that the laser met.
const SHOTS: std::ops::Range<usize> = 0..4;

/// The network with a spot of each shot in the image during which it was fired, where the initial orientation sees it.
pub(super) fn with_spots() -> Network<EulerPolynomial> {
    let mut network = network();
    let spots = network.ranges.iter().map(|range| {
        let image = &network.images[range.image];
        let ground_m = &network.points[range.point].ground_m;
        let seen = Sighting::near(&image.base, &Distortion::NONE, 0.0, ground_m, 1e-3).unwrap();
        let seen = seen.solution;
        let axes = image.base.pose(range.x_lines).mars_to_camera;
        Spot {
            view: View {
                point: range.point,
                image: range.image,
                x_lines: seen.x,
                y_px: project(&seen.camera_m, image.focal_length_px).unwrap().y,
                sigma_px: Vector2::new(0.5, 0.4),
            },
            by_boresight_m: [0, 1].map(|axis| RANGE_M * axes.row(axis).transpose()),
        }
    });
    network.common_bus = Some(CommonBus {
        boresight: BoresightAngles {
            angles_rad: Vector2::new(6e-5, -4e-5),
            covariance_rad2: Matrix2::new(1e-8, -4e-9, -4e-9, 6e-9),
        },
        line_time_sigma_s: 0.045,
        profiles: vec![RecordedProfile {
            surface_profile: 1,
            axes: local_axes(&network.points[0].ground_m),
            sigma_m: Vector3::new(70.0, 60.0, 1.0),
            shared: Some(SharedRotation {
                image: 0,
                by_rotation_m: Vector3::new(9e4, -2e4, 3e3),
            }),
        }],
        recorded: SHOTS.map(|point| (point, 0)).collect(),
        spots: spots.collect(),
    });
    network
}

/// The state with these values of unknowns.
fn state_with(
    network: &Network<EulerPolynomial>,
    layout: &Layout<'_, EulerPolynomial>,
    value: impl Fn(Unknown) -> f64,
) -> State {
    let (_, mut start, _) = self::layout(network);
    for (column, unknown) in layout.columns.unknowns.iter().enumerate() {
        start.corrections[column] = value(*unknown);
    }
    State::new(network, &layout.columns, start.corrections, start.points_m)
}

/// Values away from the expected ones, of either sign.
fn away(unknown: Unknown) -> f64 {
    match unknown {
        Unknown::Orientation { coefficient, .. } if coefficient < 9 => 150.0,
        Unknown::Orientation { coefficient, .. } => 5e-4 * coefficient as f64,
        Unknown::TimeBias { .. } => 0.03,
        Unknown::RangeBias { .. } => -25.0,
        Unknown::AttitudeClock => 0.7,
        Unknown::ProfileShift { axis, .. } => 40.0 - 30.0 * axis as f64,
        Unknown::LineTime { .. } => -0.05,
        Unknown::Boresight { axis } => 3e-4 - 5e-4 * axis as f64,
    }
}

#[test]
fn derivatives_of_spots_equal_central_differences() {
    let network = with_spots();
    let (layout, _, _) = layout(&network);
    let spot_rows = |step: (Unknown, f64), index: usize| -> [SpotRow; 2] {
        let value = |unknown| away(unknown) + if unknown == step.0 { step.1 } else { 0.0 };
        let state = state_with(&network, &layout, value);
        layout.spot_rows(&state, index).unwrap().unwrap()
    };
    for (index, spot) in network
        .common_bus
        .as_ref()
        .unwrap()
        .spots
        .iter()
        .enumerate()
    {
        let image = spot.view.image;
        let analytic = spot_rows((Unknown::AttitudeClock, 0.0), index);
        let of_row = |row: &SpotRow, unknown: Unknown| match unknown {
            Unknown::Boresight { axis } => row.by_boresight[axis],
            Unknown::LineTime { .. } => row.by_line_time,
            Unknown::TimeBias { .. } => row.by_time,
            Unknown::Orientation { coefficient, .. } => row.row.by_image()[coefficient],
            _ => 0.0,
        };
        let unknowns = [
            (Unknown::Boresight { axis: 0 }, 1e-4),
            (Unknown::Boresight { axis: 1 }, 1e-4),
            (Unknown::LineTime { image }, 0.05),
            (Unknown::TimeBias { image }, 2e-3),
            (
                Unknown::Orientation {
                    image,
                    coefficient: 3,
                },
                4.0,
            ),
            (
                Unknown::Orientation {
                    image,
                    coefficient: 9,
                },
                1e-5,
            ),
            (
                Unknown::Orientation {
                    image,
                    coefficient: 12,
                },
                1e-5,
            ),
        ];
        for (unknown, step) in unknowns {
            let [ahead, behind] = [step, -step].map(|step| spot_rows((unknown, step), index));
            let scale = analytic.each_ref().map(|row| of_row(row, unknown).abs());
            for axis in 0..2 {
                // Computed values: misclosures with the sign turned.
                let change = behind[axis].row.misclosure - ahead[axis].row.misclosure;
                let numeric = change / (2.0 * step);
                let expected = of_row(&analytic[axis], unknown);
                // A share of the derivative: steps whose truncation and rounding are far below it.
                assert!(
                    (numeric - expected).abs() < 1e-5 * scale[0].max(scale[1]),
                    "{unknown}, {axis}: {numeric} {expected}"
                );
            }
        }
    }
}

#[test]
fn derivatives_by_the_shift_of_a_profile_equal_central_differences() {
    let network = with_spots();
    let (layout, _, _) = layout(&network);
    let misclosures = |axis: usize, step_m: f64| {
        let unknown = Unknown::ProfileShift { profile: 0, axis };
        let value = |of| away(of) + if of == unknown { step_m } else { 0.0 };
        let at = layout.linearise(state_with(&network, &layout, value));
        let (rows, misclosures) = super::tests::dense_rows(&layout, &at, 2);
        let column = layout.columns.unknowns.iter().position(|of| *of == unknown);
        (rows.column(column.unwrap()).into_owned(), misclosures)
    };
    for axis in 0..3 {
        let (analytic, _) = misclosures(axis, 0.0);
        let numeric = (misclosures(axis, -5.0).1 - misclosures(axis, 5.0).1) / 10.0;
        // Per metre, of 0.1: rounding of 4e6 m over 10 m.
        assert!((numeric - &analytic).amax() < 1e-9, "{axis}");
        assert!(analytic.norm() > 0.01);
    }
}

#[test]
fn spots_by_parts_equal_the_dense_equations() {
    for uses_relief in [false, true] {
        let mut network = with_spots();
        network.attitude_clock = Some(AttitudeClock {
            sigma_s: 1.0,
            turns_rad_s: vec![Vector3::new(1e-5, -8.7e-4, 2e-5); 3],
        });
        let options = SurfaceOptions {
            uses_relief,
            ..SurfaceOptions::default()
        };
        let surface = surface_with(&network, 35.0, &options);
        are_those_of_the_dense_equations(network, &surface);
    }
}

/// A shift of a profile is one error, whether heights or spots see it: the result does not depend on which of the two
/// it is an unknown of.
#[test]
fn a_profile_on_relief_lies_in_one_place() {
    let options = SurfaceOptions {
        uses_relief: true,
        ..SurfaceOptions::default()
    };
    let solved = |with_bus: bool| {
        let mut network = with_spots();
        let surface = surface_with(&network, 0.0, &options);
        network.heights = Some(HeightControl {
            surface,
            jitter: None,
            common_noise: None,
            compared: Vec::new(),
            observed: CONTROLLED.collect(),
        });
        let bus = network.common_bus.as_mut().unwrap();
        // Neither spots nor recorded coordinates: only heights see the shift.
        bus.spots.clear();
        bus.recorded.clear();
        bus.profiles[0].sigma_m = Vector3::new(70.0, 70.0, 1.0);
        bus.profiles[0].shared = None;
        if !with_bus {
            network.common_bus = None;
        }
        solve(&network, &BundleOptions::default()).unwrap()
    };
    let [implicit, own] = [false, true].map(solved);
    let shift = implicit.relief.as_ref().unwrap().profiles[1];
    assert_eq!(shift.profile, 1);
    let found = own.common_bus.as_ref().unwrap().profile_shifts_m[0];
    for (axis, found) in found.iter().enumerate() {
        // Shares of its standard deviation: robust weights depend on the variance of a height, which includes the shift
        // in one case and not in the other.
        let sigma_m = shift.root_cofactors_m[axis];
        let apart_m = found.value - shift.shift_m[axis];
        assert!(
            apart_m.abs() < 0.2 * sigma_m,
            "{axis}: {apart_m} of {sigma_m} m"
        );
        let apart_m = found.root_cofactor - sigma_m;
        assert!(
            apart_m.abs() < 0.05 * sigma_m,
            "{axis}: {apart_m} of {sigma_m} m"
        );
    }
    for point in CONTROLLED {
        let [one, other] = [&implicit, &own].map(|of| *of.points[point].as_ref().unwrap());
        let sigma_m = one.cofactor_m2.trace().sqrt();
        assert!(
            (one.ground_m - other.ground_m).norm() < 0.2 * sigma_m,
            "{point}"
        );
    }
}

/// A bus rolled by more than its attitude states: the laser met the ground elsewhere, and its spots reveal it.
#[test]
fn spots_tell_a_roll_that_ties_do_not_know() {
    const ROLL_RAD: f64 = 3e-4;
    let mut network = with_spots();
    for view in &mut network.views {
        let image = &network.images[view.image];
        let ground_m = &network.points[view.point].ground_m;
        let seen = Sighting::near(&image.base, &Distortion::NONE, 0.0, ground_m, 1e-3).unwrap();
        view.x_lines = seen.solution.x;
        view.y_px = project(&seen.solution.camera_m, image.focal_length_px)
            .unwrap()
            .y;
    }
    network.ranges.clear();
    // Only constant rotations are unknown: nothing else takes a share of the roll.
    for image in &mut network.images {
        let held = |index: usize| index < 9 || !index.is_multiple_of(3);
        image.sigmas = std::array::from_fn(|index| if held(index) { 0.0 } else { 1e-3 });
        image.time_bias_sigma_s = 0.0;
    }
    // In truth every image was rolled, so the true ground is to one side of the assumed ground: footprints are recorded
    // there, and tie points start in wrong positions.
    let moved_m = |point: usize| {
        let pose = network.images[0].base.pose(0.0);
        let across = pose.mars_to_camera.row(1).transpose();
        (network.points[point].ground_m - pose.position_m).norm() * ROLL_RAD * across
    };
    let moved_m: Vec<Vector3<f64>> = SHOTS.map(moved_m).collect();
    for (point, moved_m) in moved_m.iter().enumerate() {
        network.points[point].ground_m += moved_m;
        network.views.retain(|view| view.point != point);
    }
    let bus = network.common_bus.as_mut().unwrap();
    bus.profiles[0].sigma_m = Vector3::new(1.0, 1.0, 1.0);
    bus.profiles[0].shared = None;
    bus.profiles[0].axes = Matrix3::identity();
    bus.boresight = BoresightAngles::of_sigma(1e-6);
    let adjusted = solve(&network, &BundleOptions::default()).unwrap();
    // With that roll, the spots fall on ground farther along the y axis of the camera.
    for image in 0..2 {
        let roll_rad = adjusted.images[image].correction.rotation_rad[0].x;
        assert!(
            (roll_rad - ROLL_RAD).abs() < 0.25 * ROLL_RAD,
            "{image}: {roll_rad}"
        );
    }
    let bus = adjusted.common_bus.unwrap();
    assert!(bus.spots.iter().all(Option::is_some));
}

/// Neither spots nor records determine the profile: its position is that of the rotation of its image, with the
/// uncertainties of both.
#[test]
fn a_profile_follows_the_rotation_of_its_image() {
    let mut network = with_spots();
    let bus = network.common_bus.as_mut().unwrap();
    bus.spots.clear();
    bus.recorded.clear();
    let RecordedProfile {
        shared, sigma_m, ..
    } = bus.profiles[0];
    let adjusted = solve(&network, &BundleOptions::default()).unwrap();
    let image = &adjusted.images[0];
    let (roll_rad, by_roll_m) = (
        image.correction.rotation_rad[0].x,
        shared.unwrap().by_rotation_m,
    );
    let roll_sigma_rad = image.cofactors[(9, 9)].sqrt();
    assert!(roll_rad.abs() > 1e-6, "{roll_rad}");
    for (axis, found) in adjusted.common_bus.unwrap().profile_shifts_m[0]
        .iter()
        .enumerate()
    {
        // Metres: rounding of the equations' solution.
        assert!((found.value - by_roll_m[axis] * roll_rad).abs() < 1e-6);
        let expected_m = sigma_m[axis].hypot(by_roll_m[axis] * roll_sigma_rad);
        assert!((found.root_cofactor / expected_m - 1.0).abs() < 1e-9);
        // Nothing contradicts it.
        assert!(found.prior.unwrap().redundancy < 1e-9);
    }
}
