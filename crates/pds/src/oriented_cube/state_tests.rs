//! Cubes with the state of a camera model against the support data that it was made of, and states that are refused.

#![allow(
    clippy::disallowed_methods,
    reason = "tests write into temporary folders"
)]

use super::*;
use crate::isd::read_isd;
use areograph_config::built_in_instruments;
use areograph_geom::{
    attitude::{matrix_of_rotation_vector, rotation_vector, spice_quaternion},
    body_rotation::{body_rotation, spin_rad_s},
};
use areograph_testing::{
    csm_state::{state_of_isd, state_text},
    cube::{CubeString, cube_with},
};
use nalgebra::{Matrix3, Vector3};
use serde_json::{Value, json};

const SIZE: [u32; 2] = [1_000, 1_024];
const CENTRE_S: f64 = 38_134_456.9;
const PERIOD_S: f64 = 0.9642e-3;
/// Rows of the tables, 0.05 s apart, over the image and beyond.
const ROWS: i32 = 25;

/// Seconds from the middle of the image to the rows.
fn rows_s() -> impl Iterator<Item = f64> {
    (0..ROWS).map(|row| 0.05 * f64::from(row - ROWS / 2))
}

/// Kilometres, and kilometres per second, of a circle around Mars.
fn flight(after_s: f64) -> [Vector3<f64>; 2] {
    let (sin, cos) = (9e-4 * after_s).sin_cos();
    let rate_rad_s = 9e-4;
    [
        3_800.0 * Vector3::new(cos, 0.3 * sin, 0.954 * sin),
        3_800.0 * rate_rad_s * Vector3::new(-sin, 0.3 * cos, 0.954 * cos),
    ]
}

/// J2000 to the bus.
fn bus(after_s: f64) -> Matrix3<f64> {
    let turn = Vector3::new(1e-3 + 2e-5 * after_s, 2.0 - 9e-4 * after_s, 0.4);
    matrix_of_rotation_vector(&turn)
}

/// Support data of an image of MOC in the rotation of the products.
fn isd() -> Value {
    let et_s: Vec<f64> = rows_s().map(|after_s| CENTRE_S + after_s).collect();
    let rows = |row: &dyn Fn(f64) -> Vec<f64>| rows_s().map(row).collect::<Vec<_>>();
    let to_mars =
        |after_s: f64| *body_rotation(Body::Mars, Et::from_seconds(CENTRE_S + after_s)).matrix();
    let spin = spin_rad_s(Body::Mars.model());
    let ends = [rows_s().next().unwrap(), rows_s().last().unwrap()];
    let sun_km = |after_s: f64| vec![1.9e8 + 20.0 * after_s, 1.2e8, -3.0e7];
    let half_s = 0.5 * PERIOD_S * f64::from(SIZE[0]);
    let mounting = matrix_of_rotation_vector(&Vector3::new(0.002, -0.001, 0.003));
    json!({
        "name_model": "USGS_ASTRO_LINE_SCANNER_SENSOR_MODEL",
        "name_platform": "MARS GLOBAL SURVEYOR",
        "name_sensor": "MGS_MOC_NA",
        "image_identifier": "E02/01461",
        "image_lines": SIZE[0],
        "image_samples": SIZE[1],
        "detector_sample_summing": 2,
        "detector_line_summing": 2,
        "starting_detector_sample": 0,
        "starting_detector_line": 0.0,
        "focal_length_model": { "focal_length": 3_500.0 },
        "focal2pixel_lines": [0.0, 76.923, 0.0],
        "focal2pixel_samples": [0.0, 0.0, 76.923],
        "detector_center": { "line": 0.0, "sample": 1_023.6 },
        "optical_distortion": { "radial": { "coefficients": [0.0, 1e-7, 0.0] } },
        "center_ephemeris_time": CENTRE_S,
        "starting_ephemeris_time": CENTRE_S - half_s,
        "line_scan_rate": [[0.5, -half_s - 0.5 * PERIOD_S, PERIOD_S]],
        "radii": { "semimajor": 3_396.19, "semiminor": 3_376.2, "unit": "km" },
        "instrument_position": {
            "reference_frame": 1,
            "ephemeris_times": et_s,
            "positions": rows(&|after_s| flight(after_s)[0].as_slice().to_vec()),
            "velocities": rows(&|after_s| flight(after_s)[1].as_slice().to_vec()),
        },
        "instrument_pointing": {
            "reference_frame": 1,
            "time_dependent_frames": [-94_000, 1],
            "constant_frames": [-94_031, -94_000],
            "constant_rotation": mounting.transpose().as_slice(),
            "ephemeris_times": et_s,
            "quaternions": rows(&|after_s| spice_quaternion(&bus(after_s)).to_vec()),
            "angular_velocities": rows(&|_| vec![0.0; 3]),
        },
        "body_rotation": {
            "reference_frame": 1,
            "ephemeris_times": ends.map(|after_s| CENTRE_S + after_s),
            "quaternions": ends.map(|after_s| spice_quaternion(&to_mars(after_s))),
            "angular_velocities": ends.map(|after_s| to_mars(after_s).tr_mul(&spin).as_slice().to_vec()),
        },
        "sun_position": {
            "reference_frame": 1,
            "ephemeris_times": ends.map(|after_s| CENTRE_S + after_s),
            "positions": ends.map(sun_km),
            "velocities": ends.map(|_| vec![20.0, 0.0, 0.0]),
        },
    })
}

/// Groups of the label of that image.
fn groups(more: &str) -> String {
    format!(
        "  Group = Instrument\n    SpacecraftName = \"MARS GLOBAL SURVEYOR\"\n    InstrumentId = MOC-NA\n    TargetName = Mars\n    \
         StartTime = 2001-03-17T20:53:12.26\n    CrosstrackSumming = 2\n    DowntrackSumming = 2\n    \
         LineExposureDuration = 0.482100 <milliseconds>\n    SpacecraftClockCount = 669329623:36\n    FirstLineSample = 1\n  End_Group\n  \
         Group = Archive\n    ProductId = E02/01461\n  End_Group\n  Group = BandBin\n    FilterName = BROAD_BAND\n  End_Group\n{more}"
    )
}

fn written<T>(name: &str, bytes: &[u8], read: impl FnOnce(&Path) -> T) -> T {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    read(&path)
}

fn read_bytes(bytes: &[u8]) -> Result<OrientedCube> {
    written("e0201461.cub", bytes, |path| {
        read_oriented_cube(path, built_in_instruments())
    })
}

/// A cube of these groups with a state of this text.
fn cube_of(groups: &str, text: &str) -> Vec<u8> {
    cube_with(groups, SIZE, (&[], &[CubeString::state(text)]), false)
}

fn state() -> Value {
    state_of_isd(&isd())
}

/// J2000 to the camera.
fn attitude(support: &ImageSupport, et_s: f64) -> Matrix3<f64> {
    let pointing = &support.tables.pointing;
    pointing.constant * pointing.at(et_s).0
}

#[test]
fn a_state_orients_as_the_support_data_that_it_was_made_of() {
    let expected = written("isd.json", isd().to_string().as_bytes(), read_isd).unwrap();
    // With the name of the model before the JSON, as newer versions of usgscsm write it, and without.
    for text in [state_text(&state()), state().to_string()] {
        let cube = read_bytes(&cube_of(&groups(""), &text)).unwrap();
        let found = &cube.support;
        assert_eq!(found.line_times, expected.line_times);
        assert_eq!(
            (found.samples, found.first_detector, found.radii_m),
            (expected.samples, expected.first_detector, expected.radii_m)
        );
        assert_eq!([found.crosstrack_summing, found.downtrack_summing], [2, 2]);
        let [camera, other] = [&found.instrument, &expected.instrument];
        assert_eq!(camera.optics, other.optics);
        assert_eq!(camera.detector, other.detector);
        assert_eq!(camera.distortion, other.distortion);
        assert_eq!(camera.naif.instrument, other.naif.instrument);
        // A state does not have the attitude of the bus.
        assert_eq!(camera.naif.bus, 0);
        assert_eq!(found.identifier, expected.identifier);
        for after_s in [-0.6, -0.4821, -0.2, 0.0137, 0.31, 0.4821, 0.6] {
            let et_s = CENTRE_S + after_s;
            let [one, two] = [found, &expected].map(|support| {
                let tables = &support.tables;
                let (position_m, velocity_m_s) = tables.position.at(et_s);
                (
                    position_m,
                    velocity_m_s,
                    tables.sun.at(et_s).0,
                    tables.body_rotation.at(et_s).0,
                )
            });
            // Metres and metres per second: the rounding of an ET times 3.4 km/s, and its change over a step.
            assert!(
                (one.0 - two.0).norm() < 1e-4,
                "{after_s}: {}",
                one.0 - two.0
            );
            assert!(
                (one.1 - two.1).norm() < 2e-3,
                "{after_s}: {}",
                one.1 - two.1
            );
            // Metres of 2e11: that rounding times the rotation of Mars.
            assert!((one.2 - two.2).norm() < 2.0, "{after_s}: {}", one.2 - two.2);
            // Radians: rounding of quaternions; that of an ET times 9e-4 rad/s.
            assert!(rotation_vector(&(one.3 * two.3.transpose())).norm() < 1e-12);
            let turn = attitude(found, et_s) * attitude(&expected, et_s).transpose();
            assert!(rotation_vector(&turn).norm() < 1e-10, "{after_s}");
        }
    }
}

#[test]
fn what_orients_a_cube_is_stated() {
    let cube = read_bytes(&cube_of(&groups(""), &state_text(&state()))).unwrap();
    assert_eq!(
        cube.orientation,
        Orientation::State {
            model: "USGS_ASTRO_LINE_SCANNER_SENSOR_MODEL".to_owned(),
            plugin: "UsgsAstroPluginCSM".to_owned(),
        }
    );
    assert_eq!(cube.label.unwrap().fields.crosstrack_summing, Some(2));
    // Other cameras have no label that is read.
    let groups =
        "  Group = Instrument\n    SpacecraftName = MARS_RECONNAISSANCE_ORBITER\n  End_Group\n";
    let other = read_bytes(&cube_of(groups, &state_text(&state()))).unwrap();
    assert_eq!(other.label, None);
    assert_eq!(other.support.identifier.as_deref(), Some("E02/01461"));
    assert!(
        other
            .support
            .tables
            .frame_remark(Body::Mars, "e0201461.cub", Et::from_seconds(CENTRE_S))
            .is_none()
    );
    let mut of_moon = state();
    of_moon["m_majorAxis"] = json!(1_737_400.0);
    of_moon["m_minorAxis"] = json!(1_737_400.0);
    let moon = read_bytes(&cube_of(groups, &state_text(&of_moon))).unwrap();
    assert!(moon.support.sees(Body::Moon, "image").is_ok());
    assert!(
        moon.support
            .tables
            .frame_remark(Body::Moon, "e0201461.cub", Et::from_seconds(CENTRE_S))
            .is_none()
    );
}

#[test]
fn a_projected_cube_has_the_size_of_its_state_before_the_projection() {
    let mapping = "  Group = Mapping\n    ProjectionName = Sinusoidal\n  End_Group\n";
    let text = state_text(&state());
    let projected = cube_with(
        &groups(mapping),
        [300, 200],
        (&[], &[CubeString::state(&text)]),
        false,
    );
    let cube = read_bytes(&projected).unwrap();
    assert_eq!(cube.projection.as_deref(), Some("Sinusoidal"));
    assert_eq!(cube.notes().len(), 2, "{:?}", cube.notes());
    let cropped = cube_with(
        &groups(""),
        [300, 200],
        (&[], &[CubeString::state(&text)]),
        false,
    );
    refused(
        &cropped,
        "has 1000 lines and 1024 samples; expected 300 and 200",
    );
}

/// Asserts that these bytes are refused with `expected` and advice.
fn refused(bytes: &[u8], expected: &str) {
    let refused = read_bytes(bytes).unwrap_err();
    assert!(
        refused.to_string().contains(expected),
        "{refused}; expected {expected}"
    );
    assert!(!refused.cause.advice().is_empty());
}

/// A change of a state, and what the message must contain.
type Change = (fn(&mut Value), &'static str);

const CHANGES: [Change; 19] = [
    (
        |state| state["m_modelName"] = json!("USGS_ASTRO_SAR_SENSOR_MODEL"),
        "the camera model USGS_ASTRO_SAR_SENSOR_MODEL; expected USGS_ASTRO_LINE_SCANNER_SENSOR_MODEL",
    ),
    (
        |state| state["m_currentParameterValue"][3] = json!(0.5),
        "expected zeros: the corrections of an adjusted state (jigsaw) are not supported",
    ),
    (
        |state| state["m_zDirection"] = json!(-1.0),
        "m_zDirection is -1.0; expected 1",
    ),
    (
        |state| state["m_distortionType"] = json!(1),
        "m_distortionType is 1; expected one of the supported distortions 0 (radial) and 4 (lrolrocnac)",
    ),
    (
        |state| state["m_focalLength"] = json!("long"),
        "m_focalLength is \"long\"; expected a finite number",
    ),
    (
        |state| state["m_detectorSampleSumming"] = json!(1.5),
        "m_detectorSampleSumming is 1.5; expected a whole number from 1 to 1000",
    ),
    (
        |state| state["m_iTransS"] = json!([0.0, 0.0]),
        "m_iTransS is [0.0,0.0]; expected 3 finite numbers",
    ),
    (
        |state| state["m_iTransS"] = json!([0.0, 76.923, 0.0]),
        "independent of m_iTransL",
    ),
    (
        |state| {
            state["m_positions"].as_array_mut().unwrap().pop();
        },
        "expected 3 numbers per epoch, not 74 in total",
    ),
    (
        |state| state["m_numPositions"] = json!(78),
        "m_numPositions is 78; expected 75, the count of numbers in m_positions",
    ),
    (
        |state| {
            let numbers = state["m_velocities"].as_array_mut().unwrap();
            numbers.truncate(72);
        },
        "expected 72, the count of numbers in m_velocities",
    ),
    (
        |state| state["m_numQuaternions"] = json!(99),
        "m_numQuaternions is 99; expected 100",
    ),
    (
        |state| state["m_quaternions"][7] = json!(2.0),
        "expected unit quaternions (x, y, z, w); the quaternion of epoch 1 has length",
    ),
    (
        |state| state["m_positions"] = json!(vec![1.0; 75]),
        "expected positions at least 3376200 m from the centre of the target",
    ),
    (
        |state| state["m_intTimes"] = json!([1e-3, 1e-3]),
        "expected 1 entries, one per entry of m_intTimeLines, not 2",
    ),
    (
        |state| state["m_t0Quat"] = json!(-0.1),
        "m_t0Quat, m_dtQuat is [38134456.8",
    ),
    (
        |state| state["m_dtEphem"] = json!(0.0),
        "m_dtEphem is 0.0; expected a number from 0.000001",
    ),
    (
        |state| state["m_majorAxis"] = json!(3_397_000.0),
        "m_majorAxis is 3397000.0; expected together with m_minorAxis, the radii of Mars (3396190 and 3376200 m)",
    ),
    (
        |state| state["m_imageIdentifier"] = json!("E02-02016"),
        "the state of the camera model belongs to product E0202016; expected E0201461, the product in the label",
    ),
];

#[test]
fn states_that_cannot_be_used_are_refused_in_their_own_keys() {
    for (change, expected) in CHANGES {
        let mut changed = state();
        change(&mut changed);
        let text = format!("USGS_ASTRO_LINE_SCANNER_SENSOR_MODEL\n{changed}");
        refused(&cube_of(&groups(""), &text), expected);
    }
    // Keys that the camera model of areograph does without.
    let unused = [
        "m_sensorName",
        "m_platformFlag",
        "m_ikCode",
        "m_imageIdentifier",
    ];
    let whole = state();
    for key in whole.as_object().unwrap().keys() {
        let mut lacking = whole.clone();
        lacking.as_object_mut().unwrap().remove(key);
        let text = format!("USGS_ASTRO_LINE_SCANNER_SENSOR_MODEL\n{lacking}");
        let bytes = cube_of(&groups(""), &text);
        if unused.contains(&&**key) {
            assert!(read_bytes(&bytes).is_ok(), "{key}");
        } else {
            refused(&bytes, key);
        }
    }
}

#[test]
fn other_models_are_refused_by_name_wherever_they_are_named() {
    let text = state_text(&state());
    for model in [
        "USGS_ASTRO_FRAME_SENSOR_MODEL",
        "USGS_ASTRO_PUSH_FRAME_SENSOR_MODEL",
        "USGS_ASTRO_PROJECTED_LINE_SCANNER_SENSOR_MODEL",
    ] {
        let expected = format!("the camera model {model}; expected");
        let mut string = CubeString::state(&text);
        string.keywords = format!("  ModelName = {model}\n");
        refused(
            &cube_with(&groups(""), SIZE, (&[], &[string]), false),
            &expected,
        );
        let line = "USGS_ASTRO_LINE_SCANNER_SENSOR_MODEL\n";
        let other = text.replacen(line, &format!("{model}\n"), 1);
        refused(&cube_of(&groups(""), &other), &expected);
    }
}

#[test]
fn a_damaged_state_is_refused_or_is_still_one_of_numbers() {
    let text = state_text(&state());
    let bytes = cube_of(&groups(""), &text);
    for cut in [1, text.len() / 2, text.len() - 40] {
        refused(
            &cube_of(&groups(""), &text[..text.len() - cut]),
            "not image support data",
        );
    }
    refused(
        &bytes[..bytes.len() - 1],
        "string CSMState of the cube ends at byte",
    );
    // Every bit of the length.
    let label = String::from_utf8_lossy(&bytes[..65_536]).into_owned();
    let length = format!("Bytes = {}", text.len());
    let at = label.find(&length).unwrap() + "Bytes = ".len();
    for digit in at..at + length.len() - "Bytes = ".len() {
        for bit in 0..8 {
            let mut damaged = bytes.clone();
            damaged[digit] ^= 1 << bit;
            assert!(read_bytes(&damaged).is_err(), "byte {digit}, bit {bit}");
        }
    }
    for at in (bytes.len() - text.len()..bytes.len()).step_by(53) {
        for flip in [0x01, 0x10, 0x80] {
            let mut damaged = bytes.clone();
            damaged[at] ^= flip;
            if let Ok(cube) = read_bytes(&damaged) {
                assert!(cube.support.line_times.start().seconds().is_finite());
                assert!(
                    attitude(&cube.support, CENTRE_S)
                        .iter()
                        .all(|part| part.is_finite())
                );
            }
        }
    }
}
