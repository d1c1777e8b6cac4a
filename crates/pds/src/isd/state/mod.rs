//! The state of a line scanner of usgscsm, as `csminit` of ISIS keeps it in a cube: read as the support data that it was made of.
//!
//! A state has positions and attitudes in the frame of the body, metres and quaternions (x, y, z, w) of camera to body,
//! at uniform epochs from `m_centerEphemerisTime`. The rotation of the body is not in it; the products' rotation takes
//! its place, so that the ground positions of the state are unchanged. The bus is not in it either: its code is 0, and
//! the beam of the laser, which needs the bus, is not tested. Every value then goes through the reader of support data.
//!
//! A state with corrections of its parameters (`m_currentParameterValue`, by `jigsaw`) is refused.
//!
//! # Source
//! `UsgsAstroLsSensorModel` of usgscsm: `constructStateFromIsd`, `getModelState` (newer versions write a line with the
//! name of the model before it), `losToEcf` and `getImageTime`. Its Sun has as many intervals as epochs, hence a step
//! different from its support data; here the Sun's epochs are spread over the positions, as in ALE's files.

mod body_fixed;

use serde_json::{Value, json};

use self::body_fixed::{BodyFixed, as_many, radii_m};
use super::{
    ET_S, ImageSupport, LINE_SCANNER,
    document::{IsdError, Object},
    support_of,
};
use areograph_base::error::{Cause, Error, Result};

/// Most numbers of a list: beyond the largest accepted file.
const NUMBERS_MAX: usize = 1 << 25;
/// Numbers of usgscsm for the distortions that are read.
const RADIAL: u32 = 0;
const LROLROCNAC: u32 = 4;
const DISTORTIONS_MAX: u32 = 1_000;
/// Keys of support data, and keys of a state with the same meaning; the longer of two alike first.
const NAMES: [(&str, &str); 24] = [
    (
        "line_scan_rate",
        "m_intTimeLines, m_intTimeStartTimes, m_intTimes",
    ),
    (
        "instrument_position.ephemeris_times",
        "m_t0Ephem, m_dtEphem",
    ),
    ("instrument_position.positions", "m_positions"),
    ("instrument_position.velocities", "m_velocities"),
    ("instrument_pointing.ephemeris_times", "m_t0Quat, m_dtQuat"),
    ("instrument_pointing.quaternions", "m_quaternions"),
    ("sun_position.positions", "m_sunPosition"),
    ("sun_position.velocities", "m_sunVelocity"),
    (
        "optical_distortion.radial.coefficients",
        "m_opticalDistCoeffs",
    ),
    (
        "optical_distortion.lrolrocnac.coefficients",
        "m_opticalDistCoeffs",
    ),
    ("optical_distortion", "m_opticalDistCoeffs"),
    ("focal_length_model.focal_length", "m_focalLength"),
    ("detector_center.line", "m_detectorLineOrigin"),
    ("detector_center.sample", "m_detectorSampleOrigin"),
    ("focal2pixel_lines", "m_iTransL"),
    ("focal2pixel_samples", "m_iTransS"),
    ("starting_detector_line", "m_startingDetectorLine"),
    ("starting_detector_sample", "m_startingDetectorSample"),
    ("detector_line_summing", "m_detectorLineSumming"),
    ("detector_sample_summing", "m_detectorSampleSumming"),
    ("center_ephemeris_time", "m_centerEphemerisTime"),
    ("starting_ephemeris_time", "m_startingEphemerisTime"),
    ("image_lines", "m_nLines"),
    ("image_samples", "m_nSamples"),
];

/// A state that cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, Cause)]
#[cause(Input: "run csminit on the cube again, or configure the image by its support data (isd) or by label and \
 kernels")]
pub(crate) enum StateError {
    #[error("state of the camera model: {0}")]
    Content(IsdError),
    #[error(
        "the state belongs to the camera model {model}; expected {LINE_SCANNER}: frame, push-frame, radar and \
         projected models are not supported"
    )]
    #[cause("configure the image by label and kernels, or omit the image")]
    Model { model: String },
}

impl StateError {
    /// Requires a model name of line scanners.
    pub(crate) fn unless_line_scanner(model: &str) -> std::result::Result<(), Self> {
        if model == LINE_SCANNER {
            return Ok(());
        }
        let model = model.chars().take(80).collect();
        Err(Self::Model { model })
    }
}

/// Support data from the text of a state; `camera` – the NAIF code of the camera, in place of the state's code, usually
/// 0.
///
/// # Errors
/// Invalid JSON; another model; a state with corrections; a key that is missing or has an invalid value; lists whose
/// lengths differ from the state's declaration; any fault for which support data are refused.
pub(crate) fn support_of_state(text: &[u8], camera: Option<i32>) -> Result<ImageSupport> {
    let state = json_of(text)?;
    let isd = Object::document(&state)
        .and_then(|document| isd_of(&document, &state, camera))
        .map_err(StateError::Content)?;
    let document = Object::document(&isd).map_err(StateError::Content)?;
    support_of(&document).map_err(in_keys_of_the_state)
}

/// The JSON of a state, whose model is named before it and in it.
fn json_of(text: &[u8]) -> std::result::Result<Value, StateError> {
    let not_json = |complaint: String| StateError::Content(IsdError::NotJson(complaint));
    let Some(start) = text.iter().position(|byte| *byte == b'{') else {
        return Err(not_json(format!("no object in {} bytes", text.len())));
    };
    let (name, object) = text.split_at(start);
    let name = String::from_utf8_lossy(name);
    // Older versions write no name before it.
    if !name.trim().is_empty() {
        StateError::unless_line_scanner(name.trim())?;
    }
    let state: Value =
        serde_json::from_slice(object).map_err(|error| not_json(error.to_string()))?;
    let document = Object::document(&state).map_err(StateError::Content)?;
    let model = document.text("m_modelName").map_err(StateError::Content)?;
    StateError::unless_line_scanner(model)?;
    Ok(state)
}

/// An error of the support data in the words of the state.
fn in_keys_of_the_state(error: Error) -> Error {
    let renamed = |text: &str| {
        let names = NAMES.iter();
        names.fold(text.to_owned(), |text, (isd, state)| {
            text.replace(isd, state)
        })
    };
    let cause: &(dyn std::error::Error + 'static) = &*error.cause;
    let of_state = match cause.downcast_ref::<IsdError>() {
        Some(IsdError::Missing { key, expected }) => IsdError::Missing {
            key: renamed(key),
            expected: renamed(expected),
        },
        Some(IsdError::Value {
            key,
            value,
            expected,
        }) => IsdError::Value {
            key: renamed(key),
            value: value.clone(),
            expected: renamed(expected),
        },
        _ => return error,
    };
    StateError::Content(of_state).into()
}

/// The support data that a state was made of.
fn isd_of(
    document: &Object<'_>,
    state: &Value,
    camera: Option<i32>,
) -> std::result::Result<Value, IsdError> {
    unadjusted(document)?;
    let centre_s = document.number("m_centerEphemerisTime", ET_S)?;
    let fixed = BodyFixed::of(document, centre_s)?;
    let camera = match camera {
        Some(camera) => i64::from(camera),
        None => document.code("m_ikCode")?,
    };
    let [equatorial_m, polar_m] = radii_m(document)?;
    let identifier = state["m_imageIdentifier"].as_str();
    let identifier = identifier.filter(|name| !matches!(*name, "" | "UNKNOWN"));
    Ok(json!({
        "name_model": LINE_SCANNER,
        "name_platform": document.text("m_platformIdentifier")?,
        "name_sensor": document.text("m_sensorIdentifier")?,
        "image_identifier": identifier,
        "image_lines": state["m_nLines"],
        "image_samples": state["m_nSamples"],
        "detector_sample_summing": whole(&state["m_detectorSampleSumming"]),
        "detector_line_summing": whole(&state["m_detectorLineSumming"]),
        "starting_detector_sample": whole(&state["m_startingDetectorSample"]),
        "starting_detector_line": state["m_startingDetectorLine"],
        "focal_length_model": { "focal_length": state["m_focalLength"] },
        "focal2pixel_lines": state["m_iTransL"],
        "focal2pixel_samples": state["m_iTransS"],
        "detector_center": {
            "line": state["m_detectorLineOrigin"],
            "sample": state["m_detectorSampleOrigin"],
        },
        "optical_distortion": distortion(document, state)?,
        "center_ephemeris_time": centre_s,
        "starting_ephemeris_time": state["m_startingEphemerisTime"],
        "line_scan_rate": line_scan_rate(document)?,
        "radii": { "semimajor": equatorial_m, "semiminor": polar_m, "unit": "m" },
        "instrument_position": fixed.instrument_position(),
        "instrument_pointing": fixed.instrument_pointing(camera),
        "body_rotation": fixed.body_rotation(),
        "sun_position": fixed.sun(document, centre_s)?,
    }))
}

/// Refuses corrections, and a camera that looks away from the ground.
fn unadjusted(document: &Object<'_>) -> std::result::Result<(), IsdError> {
    const KEY: &str = "m_currentParameterValue";
    let corrections = document.list(KEY, NUMBERS_MAX)?;
    if corrections.iter().any(|value| value.abs() > 0.0) {
        let expected = "zeros: the corrections of an adjusted state (jigsaw) are not supported";
        return Err(document.refused(KEY, expected));
    }
    let direction = document.number("m_zDirection", [-1.0, 1.0])?;
    if (direction - 1.0).abs() > 0.0 {
        return Err(document.refused("m_zDirection", "1, the boresight along +z of the camera"));
    }
    Ok(())
}

/// Rows `[line, time, period]` of the three lists of line times.
fn line_scan_rate(document: &Object<'_>) -> std::result::Result<Vec<[f64; 3]>, IsdError> {
    const LINES: &str = "m_intTimeLines";
    let lines = document.list(LINES, NUMBERS_MAX)?;
    let [starts_s, periods_s] = ["m_intTimeStartTimes", "m_intTimes"].map(|key| {
        let list = document.list(key, NUMBERS_MAX)?;
        as_many(document, key, list.len(), (LINES, lines.len()))?;
        Ok(list)
    });
    let rows = lines.iter().zip(starts_s?).zip(periods_s?);
    Ok(rows
        .map(|((line, start_s), period_s)| [*line, start_s, period_s])
        .collect())
}

/// The distortion by its number in usgscsm.
fn distortion(document: &Object<'_>, state: &Value) -> std::result::Result<Value, IsdError> {
    const KEY: &str = "m_distortionType";
    let coefficients = &state["m_opticalDistCoeffs"];
    match document.whole(KEY, [0, DISTORTIONS_MAX])? {
        RADIAL => Ok(json!({ "radial": { "coefficients": coefficients } })),
        LROLROCNAC => Ok(json!({ "lrolrocnac": { "coefficients": coefficients } })),
        _ => {
            let expected = format!(
                "one of the supported distortions {RADIAL} (radial) and {LROLROCNAC} (lrolrocnac)"
            );
            Err(document.refused(KEY, expected))
        }
    }
}

/// A whole number that usgscsm wrote with a decimal point; any other value unchanged, so that it is refused separately.
fn whole(value: &Value) -> Value {
    let number = value.as_f64();
    let number = number.filter(|number| number.fract().abs() <= 0.0 && (0.0..1e9).contains(number));
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a whole number within the limits checked above"
    )]
    number.map_or_else(|| value.clone(), |number| json!(number as u64))
}
