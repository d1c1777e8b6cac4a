//! Residuals by image, and points whose residuals are out of line.

use serde::{Deserialize, Serialize};

use super::{IntersectedPoint, MeasureResidual};
use crate::geom::statistics::Summary;

/// Robust standard deviations from the median at which a point is marked.
const OUTLIER_SIGMA: f64 = 3.0;

/// Statistics along and across the track.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Residuals2 {
    /// Along the track: focal pixels, or lines.
    pub along: Summary,
    /// Across the track, pixels.
    pub across: Summary,
}

/// Residuals of one image over all points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ImageResiduals {
    /// Identifier of the image.
    pub image: String,
    /// Focal residuals, pixels in both axes.
    pub focal: Residuals2,
    /// Reprojection residuals, lines along the track and pixels across it.
    pub reprojection: Residuals2,
}

impl ImageResiduals {
    /// Statistics of the image at `index`.
    pub(super) fn of(id: &str, index: usize, points: &[IntersectedPoint]) -> Self {
        let summary = |pick: fn(&MeasureResidual) -> f64| {
            let values: Vec<f64> = points
                .iter()
                .flat_map(|point| &point.measures)
                .filter(|measure| measure.image == index)
                .map(pick)
                .collect();
            Summary::of(&values)
        };
        Self {
            image: id.to_owned(),
            focal: Residuals2 {
                along: summary(|measure| measure.focal_along_px),
                across: summary(|measure| measure.focal_across_px),
            },
            reprojection: Residuals2 {
                along: summary(|measure| measure.reprojection_lines),
                across: summary(|measure| measure.reprojection_px),
            },
        }
    }
}

fn length(measure: &MeasureResidual) -> f64 {
    measure.reprojection_lines.hypot(measure.reprojection_px)
}

/// Marks points with a reprojection residual longer than its image's median by three robust standard
/// deviations. With identical residuals nothing is marked.
pub(super) fn mark_outliers(points: &mut [IntersectedPoint], images: usize) {
    let limits: Vec<f64> = (0..images)
        .map(|image| {
            let lengths: Vec<f64> = points
                .iter()
                .flat_map(|point| &point.measures)
                .filter(|measure| measure.image == image)
                .map(length)
                .collect();
            let summary = Summary::of(&lengths);
            // Rounding of exact measurements is no spread.
            summary.median + OUTLIER_SIGMA * summary.nmad.max(1e-6)
        })
        .collect();
    for point in points {
        point.outlier = point
            .measures
            .iter()
            .any(|measure| length(measure) > limits[measure.image]);
    }
}
