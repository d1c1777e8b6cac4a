//! Contents of `ranges.json` and `orientation.json`.

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use serde_json::Value;

use super::ReadError;
use crate::files::read_bytes;
use areograph_base::error::{Locate, Result};
use areograph_geom::statistics::Summary;

/// `ranges.json`: the result of the range check per profile.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct RangesDocument {
    /// Profiles in order.
    pub profiles: Vec<ProfileDocument>,
}

/// One profile of `ranges.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ProfileDocument {
    /// Window, orbit and crossing.
    pub id: String,
    /// Whether the profile is within the limits.
    pub valid: bool,
    /// Measured range minus distance to the spacecraft in the kernels, metres.
    pub range_minus_distance_m: Summary,
    /// Number of outliers.
    pub outliers: u32,
}

/// `orientation.json`: times and polynomial models of one image.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct ImageDocument {
    /// Whether the model is within the limits.
    pub valid: bool,
    /// Times and camera of the image, by key.
    pub times: Value,
    /// Model of first order.
    pub first_order: OrientationModel,
    /// Model of second order.
    pub second_order: OrientationModel,
    /// Whether ω and κ are poorly determined.
    pub near_gimbal_lock: bool,
}

/// Fit of the polynomials of one order to the samples.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OrientationModel {
    /// RMSE of the position (norm of x, y, z), metres.
    pub position_rmse_m: f64,
    /// X.
    pub x_m: LengthModel,
    /// Y.
    pub y_m: LengthModel,
    /// Z.
    pub z_m: LengthModel,
    /// ω.
    pub omega_rad: AngleModel,
    /// φ.
    pub phi_rad: AngleModel,
    /// κ.
    pub kappa_rad: AngleModel,
}

/// A polynomial of a length.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LengthModel {
    /// RMSE, metres.
    #[serde(rename(deserialize = "rmse"))]
    pub rmse_m: f64,
}

/// A polynomial of an angle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AngleModel {
    /// RMSE, arcseconds.
    pub rmse_arcsec: f64,
}

impl ImageDocument {
    /// The models of both orders, to be compared key by key.
    #[must_use]
    pub fn models(&self) -> impl Serialize {
        serde_json::json!({
            "first_order": self.first_order,
            "second_order": self.second_order,
            "near_gimbal_lock": self.near_gimbal_lock,
        })
    }
}

/// Reads `ranges.json`.
///
/// # Errors
/// An error of the disk; a document that is not JSON or lacks a member.
pub fn read_ranges(path: &Path) -> Result<RangesDocument> {
    document(path, "range statistics")
}

/// Reads `orientation.json` of an image.
///
/// # Errors
/// As [`read_ranges`].
pub fn read_image(path: &Path) -> Result<ImageDocument> {
    document(path, "orientation models")
}

fn document<T: DeserializeOwned>(path: &Path, what: &'static str) -> Result<T> {
    serde_json::from_slice(&read_bytes(path)?)
        .map_err(ReadError::unreadable(what))
        .in_file(path)
}
