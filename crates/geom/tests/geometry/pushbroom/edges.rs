//! Points that cannot be projected are reported with their reason.

use areograph_config::usual_instrument;
use areograph_geom::pushbroom::{
    Detector, EulerPolynomial, ExteriorOrientation, FixedPoint, FrameFirst, Limits, Pose,
    Projector, SampledOrientation, SamplesError, Unseen, VectorPolynomial,
};
use nalgebra::{Matrix3, Vector3};

use super::scene::GUSEV;

const LIMITS: Limits = Limits {
    tolerance_lines: 0.1,
    steps_max: 100,
};

/// A camera rotated by half a turn about its boresight: it flies along +X.
struct TurnedAround<M>(M);

impl<M: ExteriorOrientation> ExteriorOrientation for TurnedAround<M> {
    fn pose(&self, x: f64) -> Pose {
        self.pose_and_rate(x).0
    }

    fn pose_and_rate(&self, x: f64) -> (Pose, areograph_geom::pushbroom::PoseRate) {
        let half_turn = Matrix3::from_diagonal(&Vector3::new(-1.0, -1.0, 1.0));
        let (mut pose, mut motion) = self.0.pose_and_rate(x);
        pose.mars_to_camera = half_turn * pose.mars_to_camera;
        motion.turn_rad = half_turn * motion.turn_rad;
        (pose, motion)
    }
}

impl areograph_geom::pushbroom::PolynomialPath for TurnedAround<EulerPolynomial> {
    fn path_m(&self) -> &VectorPolynomial {
        &self.0.path_m
    }
}

#[test]
fn a_camera_mounted_the_other_way_round_finds_the_same_line() {
    let model = GUSEV.euler(2);
    let turned = TurnedAround(model);
    let frame_first = FrameFirst::new(&turned, GUSEV.focal_length_px()).unwrap();
    let fixed_point = FixedPoint::new(&turned, GUSEV.focal_length_px()).unwrap();
    let straight = FixedPoint::new(&model, GUSEV.focal_length_px()).unwrap();
    let projector = Projector::new(&turned, f64::from(GUSEV.lines)).unwrap();
    for point in GUSEV.profile_m(10, 3_000.0) {
        let expected = straight.solve(&point, &LIMITS, |_| {}).unwrap();
        let by_a = frame_first.solve(&point, &LIMITS, |_| {}).unwrap();
        let by_b = fixed_point.solve(&point, &LIMITS, |_| {}).unwrap();
        assert!((by_b.x - expected.x).abs() < 1e-9); // lines: the same numbers with other signs
        assert_eq!(by_b.evaluations, expected.evaluations);
        assert!((by_a.x - expected.x).abs() < 0.2); // lines: two tolerances
        assert!((projector.project(&point).unwrap().x - expected.x).abs() < 0.12);
    }
}

#[test]
fn points_behind_the_camera_are_no_numbers() {
    let model = GUSEV.euler(2);
    let above = model.pose(0.0).position_m * 1.1;
    let frame_first = FrameFirst::new(&model, GUSEV.focal_length_px()).unwrap();
    let fixed_point = FixedPoint::new(&model, GUSEV.focal_length_px()).unwrap();
    let projector = Projector::new(&model, f64::from(GUSEV.lines)).unwrap();
    let behind = Err(Unseen::BehindCamera);
    assert_eq!(frame_first.solve(&above, &LIMITS, |_| {}), behind);
    assert_eq!(fixed_point.solve(&above, &LIMITS, |_| {}), behind);
    assert_eq!(projector.project(&above), behind);
}

#[test]
fn values_that_are_not_finite_are_refused() {
    let model = GUSEV.euler(2);
    let nowhere = Vector3::new(f64::NAN, 0.0, 0.0);
    let projector = Projector::new(&model, f64::from(GUSEV.lines)).unwrap();
    assert_eq!(projector.project(&nowhere), Err(Unseen::NotFinite));
    let frame_first = FrameFirst::new(&model, GUSEV.focal_length_px()).unwrap();
    let by_a = frame_first.solve(&nowhere, &LIMITS, |_| {});
    assert_eq!(by_a, Err(Unseen::NotFinite));
    let mut broken = model;
    broken.path_m.coefficients[1].x = f64::INFINITY;
    assert_eq!(Projector::new(&broken, 1e4).err(), Some(Unseen::NotFinite));
    assert_eq!(
        Projector::new(&model, f64::NAN).err(),
        Some(Unseen::NotFinite)
    );
    assert_eq!(Projector::new(&model, 0.0).err(), Some(Unseen::NotFinite));
}

#[test]
fn a_camera_that_flies_across_its_lines_is_refused() {
    let mut model = GUSEV.rotation_vector();
    let quarter = Matrix3::new(0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
    model.reference = quarter * model.reference;
    // Mars rotates under the orbit: the flight is 4° off the orbit's plane, so the camera is rotated accordingly.
    let (pose, motion) = model.pose_and_rate(0.0);
    let flight = pose.mars_to_camera * motion.advance_m;
    let rest =
        nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), (flight.x / flight.y).atan());
    model.reference = rest.matrix() * model.reference;
    let refused = Some(Unseen::AcrossFlight);
    assert_eq!(Projector::new(&model, 1e4).err(), refused);
    assert_eq!(FixedPoint::new(&model, 1e5).err(), refused);
    assert_eq!(FrameFirst::new(&model, 1e5).err(), refused);
}

#[test]
fn points_far_outside_are_still_found() {
    let model = GUSEV.rotation_vector();
    let projector = Projector::new(&model, f64::from(GUSEV.lines)).unwrap();
    let far = GUSEV.boresight_ground_m(6.0 * GUSEV.duration_s);
    let solution = projector.project(&far).unwrap();
    assert!(solution.x > 5.0 * f64::from(GUSEV.lines));
}

#[test]
fn samples_that_are_no_orientation_are_refused() {
    let samples = GUSEV.samples();
    let fault = |samples: &[(f64, Pose)]| SampledOrientation::new(samples).unwrap_err();
    assert_eq!(fault(&samples[..2]), SamplesError::TooFew(2));
    let mut swapped = samples.clone();
    swapped[7].0 = swapped[6].0;
    assert!(matches!(
        fault(&swapped),
        SamplesError::NotIncreasing { row: 7, .. }
    ));
    let mut stretched = samples.clone();
    stretched[3].1.mars_to_camera *= 1.001;
    assert!(matches!(
        fault(&stretched),
        SamplesError::NotAPose { row: 3, .. }
    ));
    let mut lost = samples;
    lost[4].1.position_m.y = f64::NAN;
    assert!(matches!(
        fault(&lost),
        SamplesError::NotAPose { row: 4, .. }
    ));
}

#[test]
fn samples_run_from_edge_to_edge_of_the_detector() {
    // Summed by three from detector 40: 600 samples.
    let detector = Detector::new(usual_instrument(), 3, 40, 600);
    let at = |y_mm: f64| {
        // A camera vector whose ray meets the detector y_mm from the boresight, along the camera's +Y.
        let camera_m = Vector3::new(0.0, y_mm / 3_500.0 * 4e5, 4e5);
        detector.sample(detector.focal_px(&camera_m).unwrap().y)
    };
    let pitch_mm = 0.013_124_057_852_294_9;
    let edge_mm = |detector: f64| (detector - 1_024.0) * pitch_mm;
    assert!(at(edge_mm(40.0)).abs() < 1e-9); // pixels
    assert!((at(edge_mm(40.0 + 1_800.0)) - 600.0).abs() < 1e-9);
    assert!((detector.sample(detector.place_px(17.25).y) - 17.25).abs() < 1e-12);
    let ahead = detector.focal_px(&Vector3::new(-1.0, 0.0, 4e5)).unwrap();
    assert!(ahead.x > 0.0); // the camera flies along its −X
    assert!(detector.focal_px(&Vector3::new(0.0, 0.0, -1.0)).is_err());
}
