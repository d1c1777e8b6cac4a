//! Tie points, their intersection and the combined adjustment.

use std::path::PathBuf;

use serde::Serialize;

use crate::{
    footprints::FootprintImageCoordinates,
    geom::{intersection::Weighting, robust::RobustWeight, statistics::BAARDA_LIMIT},
};

/// Tie points between the images.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct TiesConfig {
    /// The files, globs resolved, sorted, without repeats; none when there are no tie points.
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

/// Standard deviations and options of the combined adjustment.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AdjustmentConfig {
    /// Tie points, along and across the track, focal pixels.
    pub tie_sigma_px: [f64; 2],
    /// What image coordinates of footprints are.
    pub mola_image: FootprintImageCoordinates,
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
    pub robust: Option<RobustWeight>,
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
            mola_image: FootprintImageCoordinates::Weighted,
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
