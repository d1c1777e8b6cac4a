//! Support data with another camera and other positions; everything else is unchanged.

use nalgebra::{Matrix3, Vector3};
use serde_json::{Value, json};

use super::{
    APPLIED, CALIBRATED_BY, SupportSource,
    document::{IsdError, Object},
};
use areograph_base::{error::Result, instruments::TRANSVERSE_TERMS, units::METRES_PER_KM};

/// A line of samples as support data represent it: equal samples on a straight line, and a distortion if the line is
/// curved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LineOptics {
    /// From the bus to the camera: z along the boresight, y along the samples.
    pub bus_to_camera: Matrix3<f64>,
    /// Sample of the boresight, 0 at the outer edge of the first.
    pub boresight_sample: f64,
    /// Tangent of the angle between two samples on the straight line.
    pub tangent_per_sample: f64,
    /// The curve, if the line is not straight.
    pub curve: Option<LineCurve>,
}

/// A curved line: coefficients of the powers 0 to 3 of the tangent `y` across the track.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LineCurve {
    /// Tangent along the track.
    pub along: [f64; 4],
    /// Tangent on the straight line of the sample that looks at `y`.
    pub straight: [f64; 4],
}

impl LineCurve {
    /// The distortion `transverse` of usgscsm that represents it in front of a focal length.
    fn transverse(&self, focal_mm: f64) -> Value {
        // Terms 1, y, y² and y³ among those of third degree; the second term is x.
        let terms = |powers: [f64; 4], by_x: f64| {
            let mut terms = [0.0; TRANSVERSE_TERMS];
            terms[1] = by_x;
            for (at, (power, coefficient)) in [0, 2, 5, 9].into_iter().zip((0..).zip(powers)) {
                terms[at] = coefficient * focal_mm.powi(1 - power);
            }
            terms
        };
        json!({"transverse": {
            "x": terms(self.along.map(|of| -of), 1.0),
            "y": terms(self.straight, 0.0),
        }})
    }
}

/// Keys of the camera: its mounting, which is one of the keys of `instrument_pointing`, is separate.
const CAMERA_KEYS: [&str; 7] = [
    "focal_length_model",
    "focal2pixel_lines",
    "focal2pixel_samples",
    "detector_center",
    "starting_detector_line",
    "optical_distortion",
    CALIBRATED_BY,
];
/// Beginnings of notes on the camera.
const CAMERA_NOTES: [&str; 2] = ["optical_distortion", "detector coordinates"];
const POINTING: &str = "instrument_pointing";
/// The mounting, and the frames that it leads from and to, which support data may omit.
const MOUNTING: &str = "constant_rotation";
const FRAMES: &str = "constant_frames";

impl SupportSource<'_> {
    /// The support data with the camera of others, which are of the same line: mounting, optics, detector line, distortion and
    /// the name of its calibration, which is then of another orbit.
    ///
    /// # Errors
    /// A file cannot be read; JSON that is not support data; support data that lack a key of the camera.
    pub fn with_camera_of(self, other: Self) -> Result<String> {
        let value = |source: Self| -> Result<Value> {
            let text = source.text();
            source
                .located(text.and_then(|text| Ok(serde_json::from_slice(&text).map_err(not_json)?)))
        };
        let (mut support, camera) = (value(self)?, value(other)?);
        let document = other.located(Object::document(&camera))?;
        let pointing = other.located(document.object(POINTING))?;
        self.located(Object::document(&support).and_then(|of| of.object(POINTING)))?;
        for key in CAMERA_KEYS {
            support[key] = other.located(document.any(key))?.clone();
        }
        // Notes of areograph on the camera that is replaced.
        if let Some(notes) = support["areograph"]["notes"].as_array_mut() {
            let is_of_camera = |note: &Value| {
                let note = note.as_str().unwrap_or_default();
                CAMERA_NOTES.iter().any(|start| note.starts_with(start))
            };
            notes.retain(|note| !is_of_camera(note));
        }
        support[CALIBRATED_BY][APPLIED] = json!(true);
        support[POINTING][MOUNTING] = other.located(pointing.any(MOUNTING))?.clone();
        if pointing.has(FRAMES) {
            support[POINTING][FRAMES] = other.located(pointing.any(FRAMES))?.clone();
        }
        self.located(pretty(&support))
    }

    /// The support data with another camera, and with `shift_m` added to positions: J2000 metres at an ET.
    ///
    /// # Errors
    /// The file cannot be read; JSON that is not support data.
    pub fn rewritten(
        self,
        camera: &LineOptics,
        shift_m: impl Fn(f64) -> Vector3<f64>,
    ) -> Result<String> {
        let text = self.text();
        self.located(text.and_then(|text| Ok(rewritten(&text, camera, shift_m)?)))
    }
}

fn rewritten(
    text: &[u8],
    camera: &LineOptics,
    shift_m: impl Fn(f64) -> Vector3<f64>,
) -> std::result::Result<String, IsdError> {
    let mut value: Value = serde_json::from_slice(text).map_err(not_json)?;
    let document = Object::document(&value)?;
    let [first, summing] = [
        document.number("starting_detector_sample", [0.0, 1e9])?,
        document.number("detector_sample_summing", [1.0, 1e9])?,
    ];
    let focal_mm = document
        .object("focal_length_model")?
        .number("focal_length", [f64::MIN_POSITIVE, 1e9])?;
    let (positions, velocities) = states(&document, shift_m)?;
    // Of an earlier calibration.
    if let Some(keys) = value.as_object_mut() {
        keys.remove(CALIBRATED_BY);
    }
    let pixels_per_mm = summing / (camera.tangent_per_sample * focal_mm);
    let boresight_px = first + camera.boresight_sample * summing;
    // Row by row, which are the columns of the transpose.
    let mounting = camera.bus_to_camera.transpose();
    value["instrument_pointing"]["constant_rotation"] = json!(mounting.as_slice());
    value["focal2pixel_lines"] = json!([0.0, pixels_per_mm, 0.0]);
    value["focal2pixel_samples"] = json!([0.0, 0.0, pixels_per_mm]);
    value["detector_center"] = json!({"line": 0.0, "sample": boresight_px});
    value["starting_detector_line"] = json!(0);
    value["optical_distortion"] = match &camera.curve {
        Some(curve) => curve.transverse(focal_mm),
        None => json!({"radial": {"coefficients": [0.0, 0.0, 0.0]}}),
    };
    value["instrument_position"]["positions"] = positions;
    value["instrument_position"]["velocities"] = velocities;
    pretty(&value)
}

#[allow(clippy::needless_pass_by_value, reason = "called by map_err")]
fn not_json(error: serde_json::Error) -> IsdError {
    IsdError::NotJson(error.to_string())
}

fn pretty(value: &Value) -> std::result::Result<String, IsdError> {
    let text = serde_json::to_string_pretty(value).map_err(not_json)?;
    Ok(text + "\n")
}

/// Positions and velocities of the spacecraft plus a shift.
fn states(
    document: &Object<'_>,
    shift_m: impl Fn(f64) -> Vector3<f64>,
) -> std::result::Result<(Value, Value), IsdError> {
    let table = document.object("instrument_position")?;
    let et_s = table.epochs("ephemeris_times")?;
    let moved = |key: &str, by: &dyn Fn(f64) -> Vector3<f64>| {
        let rows = table.rows::<3>(key)?.into_iter().zip(&et_s);
        let rows: Vec<[f64; 3]> = rows
            .map(|(row, et_s)| (Vector3::from(row) + by(*et_s) / METRES_PER_KM).into())
            .collect();
        Ok(json!(rows))
    };
    let rate_m_s = |et_s: f64| shift_m(et_s + 0.5) - shift_m(et_s - 0.5);
    Ok((
        moved("positions", &shift_m)?,
        moved("velocities", &rate_m_s)?,
    ))
}
