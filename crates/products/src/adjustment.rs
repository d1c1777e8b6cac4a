//! Results of tie points, intersection and adjustment of a site, as JSON.

mod boresight;
mod configured;
mod readings;

use std::{borrow::Cow, collections::BTreeMap};

use schemars::JsonSchema;
use serde::Serialize;

use super::{
    AdjustmentProducts, GeometricProducts, SiteProducts,
    files::write_json,
    product::{Content, Declaration, Role, Write},
};
use areograph_base::schema::{DocumentSchema, all_positive, at, none_negative};
use areograph_config::IntersectionConfig;
use areograph_geom::{
    bundle::ORIENTATION_UNKNOWNS,
    light_time::LightTime,
    pushbroom::CameraModel,
    statistics::Summary,
    uncertainty::{ResidualMoments, UncertaintyBudget},
};
use areograph_stages::{
    adjust::{AdjustmentSummary, CorrectedImage, HeightSummary, PointKind, ReliefSummary},
    check_heights::{HeightCheck, ProfilesApart, SurfaceFigures},
    compare_pairs::{PairComparison, ProfileByTies},
    intersect::{ImageResiduals, IntersectedTies},
};
use boresight::BoresightDocument;
use configured::AdjustmentKeys;
use readings::OtherReadingDocument;

/// Definitions of the numbers, for readers of the file.
const DEFINITIONS: [(&str, &str); 12] = [
    (
        "before, after",
        "with the orientation of the kernels, and with the adjusted one; ground points are intersected anew",
    ),
    (
        "focal",
        "residual of the intersection in the focal plane, along and across the track, pixels of the image",
    ),
    (
        "reprojection",
        "measured minus projected place of the intersected point: lines along the track, pixels of the image \
         across it; residuals of the pairs too (Table 5 of Shan et al. 2005)",
    ),
    (
        "heights",
        "tie points above the MOLA surface, metres: before the adjustment a test of the orientation, after it the fit of the \
         adjustment to its control",
    ),
    (
        "along_track_parallax_m",
        "mean distance along the flight between the two images' positions of a tie point, metres",
    ),
    (
        "footprints",
        "position of a footprint of the first image in the second by the tie points, minus its projected position: \
         lines and samples of the second image, metres on the ground, and distances of successive footprints. Only \
         footprints count that both images show, on a line between those of the tie points; outside are those within the \
         lines of both images that lie outside one of them. above_mola_m: heights at which the rays of these places meet, minus \
         those of the footprints",
    ),
    (
        "budget",
        "eq. 5 to 9 of Shan et al. 2005; pixels are the mean line spacing of the pair. paper_average takes the average of \
         the images' across-track residuals as the paper computes, equation_7 their sum of squares as its eq. 7 states; \
         both add the means of the images in quadrature. equation_5 has the differences of the images tie point by tie \
         point, where means of opposite sign add up, and the mean misregistration that they leave unexplained",
    ),
    (
        "correction, sigmas",
        "X, Y and Z position in IAU 2000, metres, then rotations about the camera's x, y and z axis, radians; of each \
         the coefficients of 1, t and t², t = 0 in the middle of the image and 1 at its end. M = exp([rotation]x) M before",
    ),
    (
        "sigmas",
        "a priori variances times the variance factor. The published model treats footprints in images as measured \
         independently, which they are not: there they describe how well images agree, not the accuracy of heights and positions",
    ),
    (
        "other_reading",
        "where a pair disagrees by more than 100 m along the flight: the mean of the tie points by the other of two readings, \
         all images equally likely to be wrong or one offset of the attitude's clock (attitude_clock_s), minus that of the \
         adjustment. Which is true is not measured: standard deviations hold for their own reading",
    ),
    (
        "boresight",
        "where adjustment.common_bus is yes: angles of the laser from the direction by mounting and altimeter file \
         (towards X of the bus, and at right angles to that and the beam), the offset of each recorded profile from its adjusted position, \
         and the unknown farthest from its a priori value, in standard deviations of the contradiction",
    ),
    (
        "configured",
        "a standard deviation above 1e300 leaves the unknown free; without blunder_limit and height_blunder_limit all tie \
         points are kept",
    ),
];

#[derive(Serialize, JsonSchema)]
#[schemars(
    title = "Adjustment of a site",
    description = "adjustment.json of areograph: tie points intersected with the orientation of the kernels and with the adjusted one, every pair of images compared, and the combined adjustment. Metres, radians, seconds, pixels of the image; unknown values are omitted."
)]
struct Document<'a> {
    #[schemars(extend("const" = "areograph adjustment 1"))]
    format: &'static str,
    site: &'a str,
    #[schemars(length(min = 1))]
    definitions: Vec<Definition>,
    configured: Configured<'a>,
    ties: TiesDocument<'a>,
    before: StateDocument<'a>,
    after: StateDocument<'a>,
    adjustment: AdjustmentDocument<'a>,
}

#[derive(Serialize, JsonSchema)]
struct Definition {
    of: &'static str,
    is: Cow<'static, str>,
}

#[derive(Serialize, JsonSchema)]
struct Configured<'a> {
    model: CameraModel,
    light_time: LightTime,
    intersection: &'a IntersectionConfig,
    adjustment: AdjustmentKeys<'a>,
}

#[derive(Serialize, JsonSchema)]
struct TiesDocument<'a> {
    points: usize,
    multi_image: usize,
    measured_elsewhere: &'a BTreeMap<String, u64>,
    ignored: u64,
    complaints: u64,
}

#[derive(Serialize, JsonSchema)]
struct StateDocument<'a> {
    intersected: usize,
    outliers: usize,
    #[schemars(range(min = 0.0))]
    sigma0: f64,
    rejected: Vec<RejectedPointDocument<'a>>,
    images: &'a [ImageResiduals],
    pairs: Vec<PairDocument<'a>>,
    heights: HeightDocument<'a>,
}

/// Heights of tie points against the MOLA surface.
#[derive(Serialize, JsonSchema)]
struct HeightDocument<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    surface: Option<&'a SurfaceFigures>,
    #[serde(skip_serializing_if = "Option::is_none")]
    no_surface_because: Option<&'a str>,
    above_surface_m: &'a Summary,
    #[schemars(range(min = 0.0))]
    mean_sigma_m: f64,
    near_shots: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    profiles_apart: Option<&'a ProfilesApart>,
}

impl<'a> HeightDocument<'a> {
    fn of(check: &'a HeightCheck) -> Self {
        Self {
            surface: check.surface.as_ref().ok(),
            no_surface_because: check.surface.as_ref().err().map(String::as_str),
            above_surface_m: &check.above_m,
            mean_sigma_m: check.mean_sigma_m,
            near_shots: check.near_shots,
            profiles_apart: check.apart.as_ref(),
        }
    }
}

#[derive(Serialize, JsonSchema)]
struct PairDocument<'a> {
    images: &'a [String; 2],
    ties: u32,
    #[schemars(range(min = 0.0))]
    convergence_rad: f64,
    #[schemars(extend("exclusiveMinimum" = 0))]
    height_over_base: f64,
    #[schemars(transform = all_positive)]
    line_spacing_m: [f64; 2],
    #[schemars(transform = all_positive)]
    pixel_size_m: [f64; 2],
    residuals: &'a [ResidualMoments; 2],
    #[schemars(range(min = 0.0))]
    along_track_parallax_m: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    mola_spacing_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    footprints: Option<FootprintsDocument<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    budget: Option<&'a UncertaintyBudget>,
    #[serde(skip_serializing_if = "Option::is_none")]
    no_budget_because: Option<&'a str>,
}

#[derive(Serialize, JsonSchema)]
struct FootprintsDocument<'a> {
    #[schemars(range(min = 1, max = 2))]
    order: u8,
    ties: u32,
    ties_rejected: u32,
    tie_lines: &'a Summary,
    tie_samples: &'a Summary,
    #[serde(skip_serializing_if = "Option::is_none")]
    apart_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    apart_sigma_m: Option<f64>,
    profiles: Vec<ProfileDocument<'a>>,
    outside: u32,
}

#[derive(Serialize, JsonSchema)]
struct ProfileDocument<'a> {
    profile: &'a str,
    lines: &'a Summary,
    samples: &'a Summary,
    along_m: f64,
    along_sigma_m: f64,
    above_mola_m: &'a Summary,
    #[serde(skip_serializing_if = "Option::is_none")]
    along_spacings: Option<f64>,
    beyond_ties: u32,
}

#[derive(Serialize, JsonSchema)]
struct RejectedPointDocument<'a> {
    kind: PointKind,
    id: &'a str,
    reason: String,
}

#[derive(Serialize, JsonSchema)]
struct AdjustmentDocument<'a> {
    summary: &'a AdjustmentSummary,
    #[serde(skip_serializing_if = "Option::is_none")]
    heights: Option<&'a HeightSummary>,
    #[serde(skip_serializing_if = "Option::is_none")]
    relief: Option<&'a ReliefSummary>,
    /// Pointing of the laser in simultaneous images.
    #[serde(skip_serializing_if = "Option::is_none")]
    boresight: Option<BoresightDocument<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    no_boresight_because: Option<&'a str>,
    /// With its standard deviation.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = at("/prefixItems/1", "minimum", 0))]
    attitude_clock_s: Option<(f64, f64)>,
    #[serde(skip_serializing_if = "Option::is_none")]
    other_reading: Option<OtherReadingDocument>,
    #[serde(skip_serializing_if = "Option::is_none")]
    no_other_reading_because: Option<&'a str>,
    /// Weighted sum of squared residuals before each step and after the last.
    #[schemars(length(min = 1), transform = none_negative)]
    weighted_squares: &'a [f64],
    images: Vec<ImageDocument<'a>>,
    rejected: Vec<RejectedPointDocument<'a>>,
}

#[derive(Serialize, JsonSchema)]
struct ImageDocument<'a> {
    image: &'a str,
    #[schemars(extend("exclusiveMinimum" = 0))]
    half_lines: f64,
    #[schemars(extend("exclusiveMinimum" = 0))]
    line_period_s: f64,
    correction: &'a [f64; ORIENTATION_UNKNOWNS],
    /// Position of the spacecraft in the PEDR file, X, Y and Z, metres, where that was the expected position.
    #[serde(skip_serializing_if = "Option::is_none")]
    pedr_orbit_m: Option<[f64; 3]>,
    #[schemars(transform = none_negative)]
    sigmas: &'a [f64; ORIENTATION_UNKNOWNS],
    /// With its standard deviation.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = at("/prefixItems/1", "minimum", 0))]
    time_bias_s: Option<(f64, f64)>,
}

/// Path of the document below the products of a site.
pub const ADJUSTMENT: &str = "adjustment.json";

pub(super) static DOCUMENT: Declaration = Declaration {
    path: ADJUSTMENT,
    what: "tie points intersected before and after the adjustment, every pair of images compared, the adjustment itself",
    readers: "scripts",
    rows: "adjusted points",
    role: Role::Data,
    content: Content::Document(schema),
    write: Write::Adjustment(|path, of, geometric, adjustment| {
        write_json(path, &document(of.site, geometric, adjustment))?;
        Ok(Some(adjustment.adjusted.points.len() as u64))
    }),
    uses: &[],
};

/// Schema of the document.
pub(super) fn schema() -> DocumentSchema {
    let keys = "/$defs/IntersectionConfig/properties";
    DocumentSchema::of::<Document>("adjustment").with(
        &format!("{keys}/convergence_min_rad"),
        "exclusiveMinimum",
        0,
    )
}

fn document<'a>(
    site: &SiteProducts<'a>,
    geometric: &GeometricProducts<'a>,
    adjustment: &AdjustmentProducts<'a>,
) -> Document<'a> {
    let ties = geometric.ties;
    let adjusted = adjustment.adjusted;
    let other = adjusted.other_reading.as_ref();
    let boresight = adjusted.boresight.as_ref();
    let rejected = adjusted.rejected.iter().map(|point| RejectedPointDocument {
        kind: point.kind,
        id: &point.id,
        reason: point.reason.to_string(),
    });
    Document {
        format: "areograph adjustment 1",
        site: &site.config.site,
        definitions: DEFINITIONS
            .iter()
            .map(|(of, is)| Definition {
                of,
                is: site.config.wording().of(*is),
            })
            .collect(),
        configured: Configured {
            model: site.config.registration.model,
            light_time: site.config.orientation.light_time,
            intersection: &site.config.intersection,
            adjustment: AdjustmentKeys::of(&site.config.adjustment),
        },
        ties: TiesDocument {
            points: ties.points.len(),
            multi_image: ties.multi_image(),
            measured_elsewhere: &ties.elsewhere,
            ignored: ties.ignored,
            complaints: ties.complaint_count,
        },
        before: state(geometric.intersected, geometric.pairs, geometric.heights),
        after: state(adjustment.intersected, adjustment.pairs, adjustment.heights),
        adjustment: AdjustmentDocument {
            summary: &adjusted.summary,
            heights: adjusted.heights.as_ref(),
            relief: adjusted.relief.as_ref(),
            boresight: boresight.and_then(|of| Some(BoresightDocument::of(of.as_ref().ok()?))),
            no_boresight_because: boresight.and_then(|of| Some(of.as_ref().err()?.as_str())),
            attitude_clock_s: adjusted.attitude_clock_s,
            other_reading: other.and_then(|other| Some(other.as_ref().ok()?.into())),
            no_other_reading_because: other.and_then(|other| Some(other.as_ref().err()?.as_str())),
            weighted_squares: &adjusted.weighted_squares,
            images: adjusted.images.iter().map(image).collect(),
            rejected: rejected.collect(),
        },
    }
}

fn state<'a>(
    ties: &'a IntersectedTies,
    pairs: &'a [PairComparison],
    heights: &'a HeightCheck,
) -> StateDocument<'a> {
    let rejected = ties.rejected.iter().map(|tie| RejectedPointDocument {
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
        pairs: pairs.iter().map(pair).collect(),
        heights: HeightDocument::of(heights),
    }
}

fn image(image: &CorrectedImage) -> ImageDocument<'_> {
    ImageDocument {
        image: &image.id,
        half_lines: image.half_lines,
        line_period_s: image.line_period_s,
        correction: &image.correction,
        pedr_orbit_m: image.pedr_orbit_m(),
        sigmas: &image.sigmas,
        time_bias_s: image.time_bias_s,
    }
}

fn pair(pair: &PairComparison) -> PairDocument<'_> {
    fn profile(profile: &ProfileByTies) -> ProfileDocument<'_> {
        ProfileDocument {
            profile: &profile.profile,
            lines: &profile.lines,
            samples: &profile.samples,
            along_m: profile.along_m,
            along_sigma_m: profile.along_sigma_m,
            above_mola_m: &profile.above_m,
            along_spacings: profile.along_spacings,
            beyond_ties: profile.beyond_ties,
        }
    }
    PairDocument {
        images: &pair.images,
        ties: pair.ties,
        convergence_rad: pair.convergence_rad,
        height_over_base: pair.height_over_base,
        line_spacing_m: pair.line_spacing_m,
        pixel_size_m: pair.pixel_size_m,
        residuals: &pair.residuals,
        along_track_parallax_m: pair.along_track_parallax_m,
        mola_spacing_m: pair.mola_spacing_m,
        footprints: pair.footprints.as_ref().map(|by_ties| FootprintsDocument {
            order: by_ties.order,
            ties: by_ties.ties,
            ties_rejected: by_ties.ties_rejected,
            tie_lines: &by_ties.tie_lines,
            tie_samples: &by_ties.tie_samples,
            apart_m: by_ties.apart_m,
            apart_sigma_m: by_ties.apart_sigma_m,
            profiles: by_ties.profiles.iter().map(profile).collect(),
            outside: by_ties.outside,
        }),
        budget: pair.budget.as_ref().ok(),
        no_budget_because: pair.budget.as_ref().err().map(String::as_str),
    }
}
