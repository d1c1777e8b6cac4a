//! Tie points, their intersection and the combined adjustment.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// Tie points between the images.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct TiesConfig {
    /// The files, globs resolved, sorted, without repeats; none when there are no tie points. They enter
    /// fingerprints by content.
    #[serde(skip)]
    pub files: Vec<PathBuf>,
}

/// How tie points are intersected.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct IntersectionConfig {
    /// Weights of the measurements.
    pub weighting: Weighting,
    /// Smallest angle between the two rays of a point that differ most, radians.
    pub convergence_min_rad: f64,
}

impl Default for IntersectionConfig {
    fn default() -> Self {
        Self {
            weighting: Weighting::Focal { sigma_px: 1.0 },
            convergence_min_rad: 0.5_f64.to_radians(),
        }
    }
}

/// What a measuring error is the same for in all images.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Weighting {
    /// Standard deviation of both focal coordinates.
    Focal {
        /// Pixels.
        sigma_px: f64,
    },
    /// Standard deviations along the track in lines and across it in pixels.
    Line {
        /// Lines.
        along_lines: f64,
        /// Pixels.
        across_px: f64,
    },
}

/// Critical value of the test of standardised residuals: one good observation in a thousand fails it.
///
/// # Source
/// Baarda 1968, A testing procedure for use in geodetic networks.
pub const BAARDA_LIMIT: f64 = 3.29;

/// Standard deviations and options of the combined adjustment.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AdjustmentConfig {
    /// Tie points, along and across the track, focal pixels.
    pub tie_sigma_px: [f64; 2],
    /// What image coordinates of footprints are.
    pub mola_image: MolaImage,
    /// Their standard deviations, along and across the track, focal pixels.
    pub mola_sigma_px: [f64; 2],
    /// How far outside an image a footprint still counts as seen by it, pixels.
    pub mola_margin_px: f64,
    /// Footprint coordinates, metres.
    pub ground_sigma_m: f64,
    /// Ranges, metres.
    pub range_sigma_m: f64,
    /// Range bias of each profile, metres; 0 for no such unknown.
    pub range_bias_sigma_m: f64,
    /// Time bias of each image, seconds; 0 for no such unknown.
    pub time_bias_sigma_s: f64,
    /// Position unknowns of images that look to nadir, metres; angles get the same at the ground.
    pub nadir_sigma_m: f64,
    /// Position unknowns of images that look elsewhere, metres; angles get the same at the ground.
    pub off_nadir_sigma_m: f64,
    /// Weights of image coordinates that fall with their residual.
    pub robust: Option<Robust>,
    /// Standardised residual above which a tie point is a blunder and left out; `None` keeps all.
    pub blunder_limit: Option<f64>,
    /// Images whose unknowns have their own standard deviations.
    pub images: Vec<OrientationPrior>,
}

impl Default for AdjustmentConfig {
    /// The standard deviations of Yoon & Shan 2004, one MOLA spacing for footprints in images, and Baarda's
    /// test with one good observation in a thousand beyond it.
    fn default() -> Self {
        Self {
            tie_sigma_px: [1.0, 1.0],
            mola_image: MolaImage::Weighted,
            mola_sigma_px: [74.0, 4.0],
            mola_margin_px: 200.0,
            ground_sigma_m: 10.0,
            range_sigma_m: 10.0,
            range_bias_sigma_m: 0.0,
            time_bias_sigma_s: 0.0,
            nadir_sigma_m: 100.0,
            off_nadir_sigma_m: 200.0,
            robust: None,
            blunder_limit: Some(BAARDA_LIMIT),
            images: Vec::new(),
        }
    }
}

/// Standard deviations of one image's orientation unknowns.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OrientationPrior {
    /// Identifier of the image.
    pub id: String,
    /// X, Y, Z, each with the powers 0, 1, 2 of `t`, metres; infinite leaves free, 0 holds fixed.
    pub position_m: Option<[f64; 9]>,
    /// Rotations about the camera's axes, likewise, radians.
    pub rotation_rad: Option<[f64; 9]>,
}

/// What image coordinates of footprints are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MolaImage {
    /// Observations with their own standard deviations, as in the paper.
    Weighted,
    /// Nothing.
    Off,
    /// No observations, but projected with the adjusted orientation afterwards: a coordinate that
    /// follows the orientation has no residual and carries no weight, no freedom and no covariance.
    Reproject,
}

impl MolaImage {
    /// Every mode, with its word in the configuration.
    pub const WORDS: [(&'static str, Self); 3] = [
        ("weighted", Self::Weighted),
        ("off", Self::Off),
        ("reproject", Self::Reproject),
    ];
}

/// Weights that fall with the normalised residual.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Robust {
    /// The function.
    pub function: RobustFunction,
    /// Normalised residual from which the weight falls (Huber) or at which it is half (Cauchy).
    pub limit: f64,
}

/// Weight functions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RobustFunction {
    /// `1` up to the limit, then `limit/|z|`.
    Huber,
    /// `1 / (1 + (z/limit)²)`.
    Cauchy,
}

impl RobustFunction {
    /// The limit that keeps 95 % efficiency for normal errors.
    #[must_use]
    pub const fn usual_limit(self) -> f64 {
        match self {
            Self::Huber => 1.345,
            Self::Cauchy => 2.385,
        }
    }
}
