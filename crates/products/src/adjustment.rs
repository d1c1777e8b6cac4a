//! Results of tie points, intersection and adjustment of a site, as JSON.

mod boresight;
mod configured;
mod definitions;
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
    readings::AlongTrack,
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
use definitions::DEFINITIONS;
use readings::OtherReadingDocument;

#[derive(Serialize, JsonSchema)]
#[schemars(
    title = "Adjustment of a site",
    description = "adjustment.json of areograph: tie points intersected with the orientation from the \
                   kernels and with the adjusted orientation, comparisons of every pair of images, and the combined \
                   adjustment. Units: metres, radians, seconds, image pixels; unknown values are omitted."
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
    /// Form of orientation, if the configuration requires one; otherwise `registration.json` states the form of each
    /// image.
    #[serde(skip_serializing_if = "Option::is_none")]
    model: Option<CameraModel>,
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

/// Heights of tie points above the MOLA surface.
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
    along_track: Option<&'a AlongTrack>,
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
    /// Boresight of the laser from simultaneous images.
    #[serde(skip_serializing_if = "Option::is_none")]
    boresight: Option<BoresightDocument<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    no_boresight_because: Option<&'a str>,
    /// Offset of the attitude clock, seconds, with its standard deviation.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = at("/prefixItems/1", "minimum", 0))]
    attitude_clock_s: Option<(f64, f64)>,
    #[serde(skip_serializing_if = "Option::is_none")]
    other_reading: Option<OtherReadingDocument>,
    #[serde(skip_serializing_if = "Option::is_none")]
    no_other_reading_because: Option<&'a str>,
    /// Weighted sum of squared residuals before each step and after the last step.
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
    /// Position of the spacecraft in the PEDR file minus its position in the kernels, X, Y and Z, metres, if the former
    /// is the a priori position.
    #[serde(skip_serializing_if = "Option::is_none")]
    pedr_orbit_m: Option<[f64; 3]>,
    #[schemars(transform = none_negative)]
    sigmas: &'a [f64; ORIENTATION_UNKNOWNS],
    /// Standard deviation of the delay of all lines, as contained in `sigmas`; 0 if `sigmas` do not contain it.
    #[schemars(range(min = 0.0))]
    line_time_sigma_s: f64,
    /// Time bias of the image, seconds, with its standard deviation.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = at("/prefixItems/1", "minimum", 0))]
    time_bias_s: Option<(f64, f64)>,
}

/// Path of the document below the products of a site.
pub const ADJUSTMENT: &str = "adjustment.json";

pub(super) static DOCUMENT: Declaration = Declaration {
    path: ADJUSTMENT,
    what: "tie points intersected with the orientations before and after the adjustment, comparisons of image pairs, \
           and the adjustment",
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
                is: site.config.terms().fill(is),
            })
            .collect(),
        configured: Configured {
            model: site.config.registration.model,
            light_time: site.config.orientation.light_time,
            intersection: &site.config.intersection,
            adjustment: AdjustmentKeys::of(&site.config.adjustment, site.images),
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
            boresight: boresight
                .and_then(|boresight| Some(BoresightDocument::of(boresight.as_ref().ok()?))),
            no_boresight_because: boresight
                .and_then(|boresight| Some(boresight.as_ref().err()?.as_str())),
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
        line_time_sigma_s: image.line_time_sigma_s,
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
        along_track: pair.along_track.as_ref(),
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
