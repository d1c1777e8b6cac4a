//! The theoretical convergence of the two published iterations, and the points of Shan 2002.

use areograph_base::units::RADIANS_PER_DEGREE;
use areograph_geom::{
    attitude::OmegaPhiKappa,
    pushbroom::{ExteriorOrientation, FixedPoint, FrameFirst, Limits, Projector, Unseen},
};
use nalgebra::Vector3;

use super::{
    eos_2002::{FOCAL_LENGTH_PX, POINTS_KM, RIGHT},
    scene::{EOS_NADIR, EOS_OBLIQUE, GUSEV, Held, PAPER, Scene},
};

/// Ratio of successive steps after the first ones, and long before rounding.
fn contraction(steps: &[f64]) -> f64 {
    let late = steps
        .windows(2)
        .rev()
        .find(|pair| pair[0].abs() > 1e-3)
        .unwrap();
    late[1] / late[0]
}

#[test]
fn contraction_is_what_theory_says() {
    let fine = Limits {
        tolerance_lines: 1e-6,
        steps_max: 1_000,
    };
    for scene in [
        GUSEV,
        EOS_NADIR,
        EOS_OBLIQUE,
        Scene {
            summing: 2.0,
            ..EOS_NADIR
        },
    ] {
        let model = scene.euler(2);
        let x = 0.2 * f64::from(scene.lines);
        let at_s = x * scene.line_period_s();
        let point = scene.boresight_ground_m(at_s);
        let mut steps = Vec::new();
        let frame_first = FrameFirst::new(&model, scene.focal_length_px()).unwrap();
        frame_first
            .solve(&point, &fine, |step| steps.push(step))
            .unwrap();
        // ρ: line spacing on the ground over the ground size of a focal-plane pixel.
        let next = scene.boresight_ground_m(at_s + scene.line_period_s());
        let range_m = (model.pose(x).position_m - point).norm();
        let rho = (next - point).norm() / (range_m / scene.focal_length_px());
        let (r_a, expected) = (contraction(&steps), 1.0 - rho);
        assert!(
            (r_a - expected).abs() < 0.05 * expected.abs(),
            "A {r_a}, ρ {rho}"
        );

        let (pose, motion) = model.pose_and_rate(x);
        let away_m = point - pose.position_m;
        let axis = pose.mars_to_camera.row(0);
        let turning = motion.turn_rad.cross_matrix() * pose.mars_to_camera;
        let [_, linear, square] = model.path_m.coefficients;
        let expected = (turning.row(0).dot(&away_m.transpose())
            - 2.0 * x * axis.dot(&square.transpose()))
            / axis.dot(&linear.transpose());
        let mut steps = vec![];
        let fixed_point = FixedPoint::new(&model, scene.focal_length_px()).unwrap();
        fixed_point
            .solve_from(x + 1e4, &point, &fine, |step| steps.push(step))
            .unwrap();
        let r_b = contraction(&steps);
        if scene.held == Held::Nadir {
            assert!(
                (r_b - expected).abs() < 0.05 * expected.abs(),
                "B {r_b}, expected {expected}"
            );
            assert!((r_b - 0.10).abs() < 0.01, "B {r_b}"); // turn per line × range / flight per line
        } else {
            // Only Mars rotates under a held camera: a hundredth of the orbit's turn, and less.
            assert!(r_b.abs() < 1e-3, "B {r_b}");
        }
    }
}

#[test]
fn frame_first_diverges_with_the_raw_pitch_and_the_fixed_point_does_not_care() {
    let raw = Scene {
        summing: 1.0,
        ..EOS_NADIR
    };
    let model = raw.euler(2);
    let point = raw.boresight_ground_m(2.0);
    let frame_first = FrameFirst::new(&model, raw.focal_length_px()).unwrap();
    assert_eq!(
        frame_first.solve(&point, &PAPER, |_| {}),
        Err(Unseen::Diverged)
    );
    let fixed_point = FixedPoint::new(&model, raw.focal_length_px()).unwrap();
    assert!(fixed_point.solve(&point, &PAPER, |_| {}).is_ok());
    // With ρ near 2 the steps shrink by 6 % each: 186 of them.
    let slow = Scene {
        summing: 2.0,
        ..EOS_NADIR
    };
    let model = slow.euler(2);
    let frame_first = FrameFirst::new(&model, slow.focal_length_px()).unwrap();
    let point = slow.boresight_ground_m(-7.0);
    assert_eq!(
        frame_first.solve(&point, &PAPER, |_| {}),
        Err(Unseen::NotConverged)
    );
}

#[test]
fn all_methods_find_the_same_line() {
    let limits = Limits {
        tolerance_lines: 1e-3,
        steps_max: 1_000,
    };
    for scene in [GUSEV, EOS_NADIR, EOS_OBLIQUE] {
        let model = scene.euler(2);
        let projector = Projector::new(&model, f64::from(scene.lines)).unwrap();
        let fixed_point = FixedPoint::new(&model, scene.focal_length_px()).unwrap();
        let points_m = scene.profile_m(100, 305.0);
        for point in &points_m {
            let by_newton = projector.project(point).unwrap().x;
            let by_b = fixed_point.solve(point, &limits, |_| {}).unwrap().x;
            // Lines: tolerance / (1 − r) with r = 0.1.
            assert!((by_newton - by_b).abs() < 1.2e-3, "{by_newton} {by_b}");
        }
        let apart = scene.iterations(&points_m, &limits).apart_lines;
        assert!(apart < 3e-3, "{apart}"); // lines: tolerance / (1 − |r|) of both, |r| up to 0.56
    }
}

/// The first and the tenth point by the corrected table, lines and pixels.
const SEEN_2002: [(usize, f64, f64); 2] = [(0, -2681.9, 194.9), (9, -1879.7, 199.7)];

fn point_m(index: usize) -> Vector3<f64> {
    Vector3::from(POINTS_KM[index]) * 1e3
}

fn y_px(camera_m: &Vector3<f64>) -> f64 {
    -FOCAL_LENGTH_PX * camera_m.y / camera_m.z
}

#[test]
fn the_corrected_table_of_2002_looks_at_nadir() {
    let model = RIGHT.model();
    for (x, expected_deg) in [(-0.5 * RIGHT.lines, 0.125), (0.5 * RIGHT.lines, 0.116)] {
        let pose = model.pose(x);
        let boresight = pose.mars_to_camera.row(2).transpose();
        let off_nadir_deg = boresight.angle(&-pose.position_m) / RADIANS_PER_DEGREE;
        // The table prints angles to 1e-4 degrees and positions to a metre of 3776 km.
        assert!(
            (off_nadir_deg - expected_deg).abs() < 1e-3,
            "{off_nadir_deg}"
        );
        let flight = model.pose_and_rate(x).1.advance_m;
        let forward = -pose.mars_to_camera.row(0).transpose();
        assert!((forward.dot(&flight.normalize()) - 0.997).abs() < 1e-3); // three printed digits
    }
    // The textbook matrix with the same angles is the transpose, and looks elsewhere.
    let angles = OmegaPhiKappa {
        omega_rad: RIGHT.start_deg[0] * RADIANS_PER_DEGREE,
        phi_rad: RIGHT.start_deg[1] * RADIANS_PER_DEGREE,
        kappa_rad: RIGHT.start_deg[2] * RADIANS_PER_DEGREE,
    };
    let textbook = angles.camera_to_mars().row(2).transpose();
    let off_nadir_deg = textbook.angle(&-Vector3::from(RIGHT.start_km)) / RADIANS_PER_DEGREE;
    assert!(off_nadir_deg > 10.0, "{off_nadir_deg}");
}

#[test]
fn the_points_of_2002_fall_where_its_table_says() {
    let model = RIGHT.model();
    let frame_first = FrameFirst::new(&model, FOCAL_LENGTH_PX).unwrap();
    let fixed_point = FixedPoint::new(&model, FOCAL_LENGTH_PX).unwrap();
    let projector = Projector::new(&model, RIGHT.lines).unwrap();
    let mut lines = Vec::new();
    for (index, x, y) in SEEN_2002 {
        let point = point_m(index);
        let by_a = frame_first.solve(&point, &PAPER, |_| {}).unwrap();
        let by_b = fixed_point.solve(&point, &PAPER, |_| {}).unwrap();
        let by_newton = projector.project(&point).unwrap();
        for solution in [by_a, by_b, by_newton] {
            assert!((solution.x - x).abs() < 1.0, "{} for {x}", solution.x);
            assert!((y_px(&solution.camera_m) - y).abs() < 1.0);
        }
        assert!((by_a.x - by_b.x).abs() < 0.03, "{} {}", by_a.x, by_b.x);
        assert_eq!((by_a.evaluations, by_b.evaluations), (10, 5));
        lines.push(by_newton.x);
    }
    let apart_m = (point_m(9) - point_m(0)).norm();
    let spacing_m = apart_m / (lines[1] - lines[0]);
    assert!((spacing_m - 5.509).abs() < 0.005, "{spacing_m} m"); // points printed to a metre of 4.4 km
}

#[test]
fn the_misprinted_table_of_2002_is_rejected() {
    let model = RIGHT.misprinted().model();
    let projector = Projector::new(&model, RIGHT.lines).unwrap();
    let point = point_m(0);
    let y = y_px(&projector.project(&point).unwrap().camera_m);
    // Half the swath is 336 pixels (2048 detectors, summed by three, and a bit).
    assert!((y.abs() - 2657.0).abs() < 2.0, "{y}");
}

#[test]
fn far_starts_cost_a_few_iterations() {
    let model = RIGHT.model();
    let frame_first = FrameFirst::new(&model, FOCAL_LENGTH_PX).unwrap();
    let fixed_point = FixedPoint::new(&model, FOCAL_LENGTH_PX).unwrap();
    let point = point_m(0);
    for start in [-1e5, -1e4, 1e4, 1e5] {
        let a = frame_first
            .solve_from(start, &point, &PAPER, |_| {})
            .unwrap();
        let b = fixed_point
            .solve_from(start, &point, &PAPER, |_| {})
            .unwrap();
        // The fixed point gains a digit a step: 6 or 7 from 1e4 lines, one more from 1e5.
        assert!(
            (6..=8).contains(&b.evaluations),
            "B {} from {start}",
            b.evaluations
        );
        assert!(
            (10..=13).contains(&a.evaluations),
            "A {} from {start}",
            a.evaluations
        );
    }
}
