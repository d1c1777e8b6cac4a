//! Support data with another camera and other positions; everything else is unchanged.

use nalgebra::{Matrix3, Vector3};
use serde_json::{Value, json};

use super::{
    CALIBRATED_BY, SupportSource,
    document::{IsdError, Object},
};
use areograph_base::{error::Result, units::METRES_PER_KM};

/// A camera that support data represent exactly: a straight line of equal samples, without distortion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StraightCamera {
    /// From the bus to the camera: z along the boresight, y along the samples.
    pub bus_to_camera: Matrix3<f64>,
    /// Sample of the boresight, 0 at the outer edge of the first.
    pub boresight_sample: f64,
    /// Tangent of the angle between two samples.
    pub tangent_per_sample: f64,
}

impl SupportSource<'_> {
    /// The support data with another camera, and with `shift_m` added to positions: J2000 metres at an ET.
    ///
    /// # Errors
    /// The file cannot be read; JSON that is not support data.
    pub fn rewritten(
        self,
        camera: &StraightCamera,
        shift_m: impl Fn(f64) -> Vector3<f64>,
    ) -> Result<String> {
        let text = self.text();
        self.located(text.and_then(|text| Ok(rewritten(&text, camera, shift_m)?)))
    }
}

fn rewritten(
    text: &[u8],
    camera: &StraightCamera,
    shift_m: impl Fn(f64) -> Vector3<f64>,
) -> std::result::Result<String, IsdError> {
    let not_json = |error: serde_json::Error| IsdError::NotJson(error.to_string());
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
    value["optical_distortion"] = json!({"radial": {"coefficients": [0.0, 0.0, 0.0]}});
    value["instrument_position"]["positions"] = positions;
    value["instrument_position"]["velocities"] = velocities;
    let text = serde_json::to_string_pretty(&value).map_err(not_json)?;
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
