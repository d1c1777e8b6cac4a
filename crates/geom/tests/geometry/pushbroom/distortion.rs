//! Distorted detector lines: the wide-angle cameras against their instrument kernel, and the way to the ground
//! and back.

use areograph_base::instruments::{DistortionModel, Instrument};
use areograph_config::built_in_instruments;
use areograph_geom::pushbroom::{
    Detector, Distortion, ExteriorOrientation, FixedPoint, FrameFirst, Limits, Projector,
};
use nalgebra::Vector3;

use super::scene::{EOS_OBLIQUE, GUSEV};

fn camera(id: &str) -> Instrument {
    let cameras = built_in_instruments().iter();
    cameras
        .into_iter()
        .find(|camera| camera.id == id)
        .unwrap()
        .clone()
}

/// The whole detector with `summing` pixels in a sample.
fn detector(camera: &Instrument, summing: u32) -> Detector {
    Detector::new(camera, summing, 0, camera.detector.pixels / summing)
}

#[test]
fn look_directions_are_those_of_the_instrument_kernel() {
    // INS-9403x_FOV_BOUNDARY_CORNERS of moc20.ti, corners of the first and the last pixel (their centres across the
    // track, their edges along it) on the side of +X, then on the other; and INS-9403x_BORESIGHT, the middle of the detector.
    let kernel = [
        (
            "moc_wa_red",
            [
                [
                    0.004_011_243_500_160_5,
                    0.922_362_806_078_673_3,
                    0.386_303_978_607_855,
                ],
                [
                    0.003_912_545_671_105_8,
                    -0.957_561_754_650_581_6,
                    0.288_201_627_366_798_3,
                ],
                [
                    0.003_460_137_968_268_4,
                    0.922_363_607_643_934_8,
                    0.386_307_394_103_848_2,
                ],
                [
                    0.003_375_000_533_211_1,
                    -0.957_562_666_215_756_6,
                    0.288_205_394_885_615_3,
                ],
            ],
            [
                0.004_234_210_899_862_3,
                -0.033_637_568_334_821_4,
                0.999_425_127_488_085_4,
            ],
        ),
        (
            "moc_wa_blue",
            [
                [
                    -0.000_194_439_709_793_3,
                    -0.941_712_224_247_275_7,
                    0.336_419_453_802_017_7,
                ],
                [
                    -0.000_190_385_605_123_1,
                    0.965_701_148_267_654,
                    0.259_656_033_990_847_2,
                ],
                [
                    -0.000_752_212_740_069_1,
                    -0.941_712_111_340_111_5,
                    0.336_418_985_093_503_7,
                ],
                [
                    -0.000_736_528_947_749_3,
                    0.965_701_013_302_503_7,
                    0.259_655_561_141_345,
                ],
            ],
            [
                -0.000_528_944_586_935_9,
                0.024_893_957_225_993,
                0.999_689_957_492_449_2,
            ],
        ),
    ];
    for (id, corners, middle) in kernel {
        let camera = camera(id);
        let apart = |aside_px: f64, sample: f64, expected: [f64; 3]| {
            let mut aside = camera.clone();
            aside.detector.along_track_px += aside_px;
            (detector(&aside, 1).look(sample).normalize() - Vector3::from(expected)).norm()
        };
        let last = f64::from(camera.detector.pixels);
        let [first_plus, last_plus, first_minus, last_minus] = corners;
        for distance in [
            apart(0.5, 0.5, first_plus),
            apart(0.5, last - 0.5, last_plus),
            apart(-0.5, 0.5, first_minus),
            apart(-0.5, last - 0.5, last_minus),
            apart(0.0, 0.5 * last, middle),
        ] {
            // Rounding: the kernel prints 16 digits.
            assert!(distance < 1e-12, "{id}: {distance} rad");
        }
    }
}

/// An image of the ground at a depth of `depth_m` comes back to every sample and line.
fn comes_back(camera: &Instrument, summing: u32, model: &impl ExteriorOrientation, lines: f64) {
    let detector = detector(camera, summing);
    let projector = Projector::new(model, lines)
        .unwrap()
        .through(detector.distortion);
    let steps = 173;
    for line in [-0.5, -0.31, 0.0, 0.27, 0.5].map(|share| share * lines) {
        let pose = model.pose(line);
        for step in 0..=steps {
            let sample = detector.samples * f64::from(step) / f64::from(steps);
            let ground_m =
                pose.position_m + pose.mars_to_camera.tr_mul(&detector.look(sample)) * 380e3;
            let seen = projector.project(&ground_m).unwrap();
            let focal_px = detector.focal_px(&seen.camera_m).unwrap();
            let missed = [
                seen.x - line,
                detector.sample(focal_px.y) - sample,
                detector.missed_px(&focal_px),
            ];
            assert!(
                missed.iter().all(|px| px.abs() < 1e-6),
                "{}: {missed:?} px at line {line}, sample {sample}",
                camera.id
            );
        }
    }
}

#[test]
fn the_whole_detector_comes_back_through_the_ground() {
    let mut mapping = camera("moc_na");
    mapping.distortion = DistortionModel::RadialPolynomial {
        coefficients: vec![1e-3, 2e-6, -1e-10],
    };
    mapping.detector.along_track_px = 12.0;
    for scene in [GUSEV, EOS_OBLIQUE] {
        let (model, lines) = (scene.rotation_vector(), f64::from(scene.lines));
        for camera in ["moc_na", "moc_wa_red", "moc_wa_blue"].map(camera) {
            comes_back(&camera, 1, &model, lines);
            comes_back(&camera, 4, &model, lines);
        }
        comes_back(&mapping, 2, &model, lines);
        comes_back(&transverse(), 2, &model, lines);
    }
}

/// A camera whose distorted coordinates, millimetres, are `x − 0.01 − 1e-4 y² + 1e-6 y³ + 1e-3 x y` and
/// `y + 0.02 + 1e-3 y + 2e-5 y² − 3e-6 y³ + 1e-3 x²` of the ideal ones.
fn transverse() -> Instrument {
    let mut camera = camera("moc_na");
    let mut coefficients = [[0.0; 10]; 2];
    let [x, y] = &mut coefficients;
    (x[0], x[1], x[4], x[5], x[9]) = (-0.01, 1.0, 1e-3, -1e-4, 1e-6);
    (y[0], y[2], y[3], y[5], y[9]) = (0.02, 1.001, 1e-3, 2e-5, -3e-6);
    camera.distortion = DistortionModel::Transverse { coefficients };
    camera.detector.along_track_px = 12.0;
    camera
}

#[test]
fn samples_look_where_the_polynomials_put_them() {
    let instrument = transverse();
    let detector = detector(&instrument, 1);
    let (focal_mm, pitch_mm) = (
        instrument.optics.focal_length_mm,
        instrument.optics.pixel_pitch_mm,
    );
    for sample in [0.0, 300.0, 1_024.0, 2_048.0] {
        let look = detector.look(sample);
        let [x, y] = [look.x * focal_mm, look.y * focal_mm];
        let along_mm = x - 0.01 - 1e-4 * y * y + 1e-6 * y.powi(3) + 1e-3 * x * y;
        let across_mm = 1.001 * y + 0.02 + 2e-5 * y * y - 3e-6 * y.powi(3) + 1e-3 * x * x;
        let sense = instrument.detector.samples_along.sign();
        let expected_mm = sense * (sample - instrument.detector.boresight_px) * pitch_mm;
        // Pixels: rounding.
        assert!(
            (along_mm / pitch_mm - 12.0).abs() < 1e-8,
            "{along_mm} mm at {sample}"
        );
        assert!(
            (across_mm - expected_mm).abs() / pitch_mm < 1e-8,
            "{across_mm} mm at {sample}"
        );
    }
}

#[test]
fn the_published_iterations_find_the_line_of_a_distorted_camera() {
    let detector = detector(&camera("moc_wa_red"), 1);
    let (model, lines) = (GUSEV.euler(2), f64::from(GUSEV.lines));
    let limits = Limits {
        tolerance_lines: 1e-8,
        steps_max: 1_000,
    };
    // A focal length for which the frame-first iteration converges at these line periods.
    let frame_first = FrameFirst::new(&model, GUSEV.focal_length_px()).unwrap();
    let fixed_point = FixedPoint::new(&model, GUSEV.focal_length_px()).unwrap();
    for sample in [1_200.0, 1_674.15, 2_300.0] {
        let (x, look) = (0.2 * lines, detector.look(sample));
        let pose = model.pose(x);
        let ground_m = pose.position_m + pose.mars_to_camera.tr_mul(&look) * 380e3;
        let by_frame = frame_first
            .through(detector.distortion)
            .solve(&ground_m, &limits, drop);
        let by_line = fixed_point
            .through(detector.distortion)
            .solve(&ground_m, &limits, drop);
        for solution in [by_frame, by_line] {
            let off_lines = solution.unwrap().x - x;
            assert!(
                off_lines.abs() < 1e-6,
                "{off_lines} lines at sample {sample}"
            );
        }
    }
}

#[test]
fn beyond_the_detector_the_line_goes_straight_on() {
    let detector = detector(&camera("moc_wa_blue"), 1);
    for sample in [
        -300.0,
        -1.0,
        detector.samples + 1.0,
        detector.samples + 300.0,
    ] {
        let place_px = detector.place_px(sample);
        assert!((detector.sample(place_px.y) - sample).abs() < 1e-6);
    }
    // Every direction in front of the camera has a sample.
    for angle_rad in [-1.57, -1.4, 0.0, 1.4, 1.57_f64] {
        let camera_m = Vector3::new(0.0, angle_rad.sin(), angle_rad.cos());
        let y_px = detector.focal_px(&camera_m).unwrap().y;
        assert!(detector.sample(y_px).is_finite());
    }
}

#[test]
fn radial_coefficients_are_found_again() {
    let mut radial = camera("moc_na");
    let coefficients = [1e-3, 2e-6, -1e-10];
    radial.distortion = DistortionModel::RadialPolynomial {
        coefficients: coefficients.to_vec(),
    };
    let fit = detector(&radial, 2).radial_fit(&radial);
    for (found, expected) in fit.coefficients.iter().zip(coefficients) {
        assert!(
            (found / expected - 1.0).abs() < 1e-6,
            "{found} for {expected}"
        ); // rounding over 1024 pixels
    }
    assert!(fit.error_max_px < 1e-6, "{} px", fit.error_max_px);
    // Without distortion all is zero, exactly.
    let none = camera("moc_na");
    let fit = detector(&none, 1).radial_fit(&none);
    assert!(fit.coefficients.iter().all(|k| k.abs() <= 0.0));
}

#[test]
fn a_polynomial_that_turns_back_is_refused() {
    for camera in built_in_instruments() {
        assert_eq!(Distortion::check(camera), Ok(()));
    }
    let mut folded = camera("moc_wa_red");
    folded.distortion = DistortionModel::AnglePolynomial {
        coefficients_rad: vec![0.6, -0.5],
        scale: 1.0,
    };
    // 0.6 r − 0.5 r³ has its largest value at r = 0.632: 632 pixels from the boresight at 1674.15.
    let fault = Distortion::check(&folded).unwrap_err();
    assert!(fault.pixel < 1_674.15 - 632.0, "{fault}");
}
