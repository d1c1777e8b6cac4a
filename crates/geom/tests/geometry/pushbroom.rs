//! Pushbroom geometry: derivatives, the published iterations and their counts, the table of Shan 2002.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly"
)]

use areograph_testing::eos_2002;
use areograph_testing::scene;

mod distortion;
mod edges;
mod misregistration;
mod published;

use areograph_geom::pushbroom::{ExteriorOrientation, Projector, SampledOrientation};
use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;
use scene::{EOS_NADIR, EOS_OBLIQUE, GUSEV, Scene};

/// `dC/dx` and `dM/dx` of the model against central differences of its poses, `step` lines wide.
fn derivatives_agree(model: &impl ExteriorOrientation, x: f64, step: f64) {
    let (pose, motion) = model.pose_and_rate(x);
    assert_eq!(pose, model.pose(x)); // one formula
    let (before, after) = (model.pose(x - step), model.pose(x + step));
    let advance_m = (after.position_m - before.position_m) / (2.0 * step);
    let error = (advance_m - motion.advance_m).norm() / motion.advance_m.norm();
    // Relative: positions of 4e6 m rounded to 1e-9 m over 20 lines of 5 m, and the cubic term.
    assert!(error < 1e-6, "advance {error} at {x}");
    let turned = (after.mars_to_camera - before.mars_to_camera) / (2.0 * step);
    let ours = motion.turn_rad.cross_matrix() * pose.mars_to_camera;
    // Matrix elements rounded to 1e-16 over 20 lines against turns of 1e-6 per line; inertially held
    // cameras turn by 1e-7 per line: 1e-12 absolute is 4e-7 m on the ground.
    let error = (turned - ours).norm();
    assert!(error < 1e-6 * ours.norm() + 1e-12, "turn {error} at {x}");
}

#[test]
fn derivatives_are_those_of_the_poses() {
    for scene in [GUSEV, EOS_NADIR, EOS_OBLIQUE] {
        let (first, second) = (scene.euler(1), scene.euler(2));
        let vector = scene.rotation_vector();
        let sampled = SampledOrientation::new(&scene.samples()).unwrap();
        let half = 0.5 * f64::from(scene.lines);
        for share in [-1.3, -0.97, -0.41, 0.013, 0.38, 0.99, 1.2] {
            let x = share * half;
            derivatives_agree(&first, x, 10.0);
            derivatives_agree(&second, x, 10.0);
            derivatives_agree(&vector, x, 10.0);
            derivatives_agree(&sampled, x, 10.0);
        }
    }
}

proptest! {
    /// Rotation vectors of any size, where the series and the closed form of the Jacobian meet too.
    #[test]
    fn any_rotation_vector_turns_as_it_says(
        r in prop::array::uniform3(-1.5..1.5_f64),
        rate in prop::array::uniform3(-1.0..1.0_f64),
        size in prop::sample::select(vec![1e-6, 1e-3, 0.99e-2, 1.01e-2, 1.0]),
    ) {
        use areograph_geom::pushbroom::{RotationVectorPolynomial, VectorPolynomial};
        let model = RotationVectorPolynomial {
            path_m: VectorPolynomial { coefficients: [Vector3::zeros(); 3] },
            vector_rad: VectorPolynomial {
                coefficients: [Vector3::from(r) * size, Vector3::from(rate), Vector3::zeros()],
            },
            reference: Matrix3::identity(),
        };
        let step = 1e-5;
        let (pose, motion) = model.pose_and_rate(0.0);
        let turned = (model.pose(step).mars_to_camera - model.pose(-step).mars_to_camera) / (2.0 * step);
        let ours = motion.turn_rad.cross_matrix() * pose.mars_to_camera;
        // The cubic term of the difference is 1e-10 × 1.7³; rounding 1e-16 / 1e-5.
        prop_assert!((turned - ours).norm() < 1e-8);
    }
}

#[test]
fn samples_are_met_and_quadratic_motion_is_exact_between_them() {
    let scene = GUSEV;
    let sampled = SampledOrientation::new(&scene.samples()).unwrap();
    for (x, pose) in scene.samples() {
        let ours = sampled.pose(x);
        assert!((ours.position_m - pose.position_m).norm() < 2e-9); // metres: rounding of 4e6 m
        assert!((ours.mars_to_camera - pose.mars_to_camera).norm() < 1e-14); // rounding
    }
    let spacing = f64::from(scene.lines) / 30.0;
    for k in 0..30 {
        let x = (f64::from(k) + 0.37) * spacing - 0.5 * f64::from(scene.lines);
        let exact = scene.pose(x * scene.line_period_s());
        let ours = sampled.pose(x);
        // Third derivative of the orbit 3e-3 m/s³, half a second: a few micrometres inside, 20 µm in the first
        // and last interval where the parabola is one-sided.
        assert!((ours.position_m - exact.position_m).norm() < 5e-5);
        // The same of an orbit's turn: 1e-11 rad are 4 µm on the ground.
        assert!((ours.mars_to_camera - exact.mars_to_camera).norm() < 1e-10);
    }
}

/// Newton's line sees the point: `q1` vanishes there, and the camera vector is that of the pose.
fn newton_sees(scene: &Scene, model: &impl ExteriorOrientation) {
    let projector = Projector::new(model, f64::from(scene.lines)).unwrap();
    for point in scene.profile_m(400, 500.0) {
        let solution = projector.project(&point).unwrap();
        let camera_m = model.pose(solution.x).camera_vector_m(&point);
        // 1e-5 m are 2e-6 lines; the points lie up to two images beyond the ends.
        assert!(camera_m.x.abs() < 1e-5, "{} m", camera_m.x);
        assert!((camera_m - solution.camera_m).norm() < 1e-4); // metres: second order of a last step of 0.01 line
        assert!(solution.evaluations <= 4);
    }
}

#[test]
fn newton_finds_the_line_in_every_model() {
    for scene in [GUSEV, EOS_NADIR, EOS_OBLIQUE] {
        newton_sees(&scene, &scene.euler(1));
        newton_sees(&scene, &scene.euler(2));
        newton_sees(&scene, &scene.rotation_vector());
        newton_sees(&scene, &SampledOrientation::new(&scene.samples()).unwrap());
    }
}

#[test]
fn a_boresight_point_comes_back_to_its_line() {
    for scene in [GUSEV, EOS_OBLIQUE] {
        let model = scene.rotation_vector();
        let projector = Projector::new(&model, f64::from(scene.lines)).unwrap();
        for share in [-0.48, -0.2, 0.0, 0.31, 0.47] {
            let point = scene.boresight_ground_m(share * scene.duration_s);
            let solution = projector.project(&point).unwrap();
            let x = share * f64::from(scene.lines);
            // Lines: what the second-order fit leaves of 15 s of orbit, 3 cm in position.
            assert!((solution.x - x).abs() < 0.02, "{} for {x}", solution.x);
        }
    }
}
