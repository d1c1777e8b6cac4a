//! Residuals by image, and points whose residuals are outliers.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{IntersectedPoint, MeasureResidual};
use areograph_geom::statistics::Summary;

/// Robust standard deviations beyond the median distance at which a point is marked: residuals lie nearly on a line;
/// for normal ones there, this is 3.6 standard deviations, one point in three thousand.
const OUTLIER_SIGMA: f64 = 5.0;

/// Residual statistics along and across the track.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Residuals2 {
    /// Along the track, focal-plane pixels or lines.
    pub along: Summary,
    /// Across the track, pixels.
    pub across: Summary,
}

/// Residuals of one image over all points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ImageResiduals {
    /// Identifier of the image.
    pub image: String,
    /// Residuals in the focal plane, pixels on both axes.
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

/// Marks points with a reprojection residual whose distance from the median of its image exceeds the median distance by
/// five robust standard deviations. With identical residuals nothing is marked.
///
/// The criterion is the distance from the median, not the length: a clock error shifts all residuals of an image in one
/// direction, and a blunder at right angles to it hardly lengthens them.
pub(super) fn mark_outliers(points: &mut [IntersectedPoint], images: usize) {
    let limits: Vec<Limit> = (0..images).map(|image| Limit::of(points, image)).collect();
    for point in points {
        point.outlier = point
            .measures
            .iter()
            .any(|measure| limits[measure.image].is_beyond(measure));
    }
}

/// The median of the residuals of an image, and the largest accepted distance from it.
struct Limit {
    median: [f64; 2],
    distance: f64,
}

impl Limit {
    fn of(points: &[IntersectedPoint], image: usize) -> Self {
        let own = || {
            let measures = points.iter().flat_map(|point| &point.measures);
            measures.filter(|measure| measure.image == image)
        };
        let along: Vec<f64> = own().map(|measure| measure.reprojection_lines).collect();
        let across: Vec<f64> = own().map(|measure| measure.reprojection_px).collect();
        let median = [Summary::of(&along).median, Summary::of(&across).median];
        let distances: Vec<f64> = own().map(|measure| distance(measure, median)).collect();
        let summary = Summary::of(&distances);
        Self {
            median,
            // Rounding of exact measurements is no spread.
            distance: summary.median + OUTLIER_SIGMA * summary.nmad.max(1e-6),
        }
    }

    fn is_beyond(&self, measure: &MeasureResidual) -> bool {
        distance(measure, self.median) > self.distance
    }
}

fn distance(measure: &MeasureResidual, [along, across]: [f64; 2]) -> f64 {
    (measure.reprojection_lines - along).hypot(measure.reprojection_px - across)
}
