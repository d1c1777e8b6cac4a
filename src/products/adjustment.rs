//! What tie points, intersection and adjustment say of a site, as JSON.

use std::collections::BTreeMap;

use serde::Serialize;

use super::{GeometricProducts, SiteProducts, Writer, files::write_json};
use crate::{
    config::{AdjustmentConfig, CameraModel, IntersectionConfig},
    error::Result,
    stages::{
        adjust::{AdjustmentSummary, CorrectedImage, PointKind},
        compare_pairs::PairComparison,
        intersect::{ImageResiduals, IntersectedTies},
    },
};

/// What the numbers are, for readers of the file.
const DEFINITIONS: [(&str, &str); 9] = [
    (
        "before, after",
        "with the orientation of the kernels, and with the adjusted one; ground points are intersected anew",
    ),
    (
        "focal",
        "what an intersection leaves in the focal plane, along and across the track, pixels of the image",
    ),
    (
        "reprojection",
        "measured minus projected place of the intersected point: lines along the track, pixels of the image \
         across it; residuals of the pairs too (Table 5 of Shan et al. 2005)",
    ),
    (
        "disagreement_m",
        "how far apart along the flight the two images place a tie point, mean, metres",
    ),
    (
        "footprints",
        "where tie points say that a footprint of the first image lies in the second, minus where it is projected: \
         lines and samples of the second image, metres on the ground, and distances of successive footprints",
    ),
    (
        "budget",
        "eq. 5 to 9 of Shan et al. 2005; pixels are the mean line spacing of the pair. paper_average takes the average of \
         the images' across-track residuals as the paper computes, equation_7 their sum of squares as its eq. 7 says",
    ),
    (
        "correction, sigmas",
        "X, Y and Z position in IAU 2000, metres, then rotations about the camera's x, y and z axis, radians; of each \
         the coefficients of 1, t and t², t = 0 in the middle of the image and 1 at its end. M = exp([rotation]x) M before",
    ),
    (
        "sigmas",
        "a posteriori. They take footprints in images as measured independently, which they are not: they hold for \
         positions of points to each other, not for absolute ones",
    ),
    (
        "configured",
        "a standard deviation that is null leaves the unknown free",
    ),
];

#[derive(Serialize)]
struct Document<'a> {
    format: &'static str,
    site: &'a str,
    definitions: Vec<Definition>,
    configured: Configured<'a>,
    ties: TiesDocument<'a>,
    before: StateDocument<'a>,
    after: StateDocument<'a>,
    adjustment: AdjustmentDocument<'a>,
}

#[derive(Serialize)]
struct Definition {
    of: &'static str,
    is: &'static str,
}

#[derive(Serialize)]
struct Configured<'a> {
    model: CameraModel,
    intersection: &'a IntersectionConfig,
    adjustment: &'a AdjustmentConfig,
}

#[derive(Serialize)]
struct TiesDocument<'a> {
    points: usize,
    joining_images: usize,
    measured_elsewhere: &'a BTreeMap<String, u64>,
    ignored: u64,
    complaints: u64,
}

#[derive(Serialize)]
struct StateDocument<'a> {
    intersected: usize,
    outliers: usize,
    sigma0: f64,
    rejected: Vec<LeftOutDocument<'a>>,
    images: &'a [ImageResiduals],
    pairs: &'a [PairComparison],
}

#[derive(Serialize)]
struct LeftOutDocument<'a> {
    kind: PointKind,
    id: &'a str,
    reason: String,
}

#[derive(Serialize)]
struct AdjustmentDocument<'a> {
    summary: &'a AdjustmentSummary,
    /// Weighted sum of squared residuals before each step and after the last.
    weighted_squares: &'a [f64],
    images: &'a [CorrectedImage],
    left_out: Vec<LeftOutDocument<'a>>,
}

/// Writes `adjustment.json` of a site with tie points.
pub(super) fn write(
    written: &mut Writer,
    site: &SiteProducts,
    geometric: &GeometricProducts,
) -> Result<()> {
    written.add("adjustment.json", |path| {
        write_json(path, &document(site, geometric))?;
        Ok(geometric.adjusted.points.len() as u64)
    })
}

fn document<'a>(site: &SiteProducts<'a>, geometric: &GeometricProducts<'a>) -> Document<'a> {
    let ties = geometric.ties;
    let adjusted = geometric.adjusted;
    let left_out = adjusted.left_out.iter().map(|point| LeftOutDocument {
        kind: point.kind,
        id: &point.id,
        reason: point.reason.to_string(),
    });
    Document {
        format: "areograph adjustment 1",
        site: &site.config.site,
        definitions: DEFINITIONS
            .iter()
            .map(|(of, is)| Definition { of, is })
            .collect(),
        configured: Configured {
            model: site.config.registration.model,
            intersection: &site.config.intersection,
            adjustment: &site.config.adjustment,
        },
        ties: TiesDocument {
            points: ties.points.len(),
            joining_images: ties.joining(),
            measured_elsewhere: &ties.elsewhere,
            ignored: ties.ignored,
            complaints: ties.complaint_count,
        },
        before: state(geometric.intersected, geometric.pairs),
        after: state(geometric.adjusted_intersected, geometric.adjusted_pairs),
        adjustment: AdjustmentDocument {
            summary: &adjusted.summary,
            weighted_squares: &adjusted.weighted_squares,
            images: &adjusted.images,
            left_out: left_out.collect(),
        },
    }
}

fn state<'a>(ties: &'a IntersectedTies, pairs: &'a [PairComparison]) -> StateDocument<'a> {
    let rejected = ties.rejected.iter().map(|tie| LeftOutDocument {
        kind: PointKind::Tie,
        id: &tie.id,
        reason: tie.reason.to_string(),
    });
    StateDocument {
        intersected: ties.points.len(),
        outliers: ties.points.iter().filter(|point| point.outlier).count(),
        sigma0: ties.sigma0,
        rejected: rejected.collect(),
        images: &ties.images,
        pairs,
    }
}
