//! Pairs and seams of a terrain model in `surface.json`.

use schemars::JsonSchema;
use serde::Serialize;

use crate::{products::SiteProducts, stages::map_surface::Joint, units::RADIANS_PER_DEGREE};

/// The pairs and seams of `surface.json`.
#[derive(Serialize, JsonSchema)]
pub(super) struct JointDocument<'a> {
    /// Cells with a height.
    filled: u32,
    /// Number of these with heights of several pairs.
    several: u32,
    pairs: Vec<PairDocument<'a>>,
    seams: Vec<SeamDocument>,
}

#[derive(Serialize, JsonSchema)]
struct PairDocument<'a> {
    /// Identifiers of both images.
    images: [&'a str; 2],
    /// Its bit in `surface_pairs.tif`; omitted for a pair without a terrain model: without common ground or convergence, or
    /// with too few heights.
    #[serde(skip_serializing_if = "Option::is_none")]
    bit: Option<u32>,
    /// Cells that both images show.
    cells: u32,
    /// Number of these with a height.
    filled: u32,
    /// Angle between the rays of both images in the middle of the common ground.
    convergence_deg: f64,
    /// Root mean square of the standard deviations of the heights about their common offset.
    sigma_m: f64,
    /// Level of the pair above the mean level of all pairs, which was subtracted from its heights.
    offset_m: f64,
    /// Standard deviation of this offset.
    offset_sigma_m: f64,
    /// Median of the altimeter above the pair, before the subtraction; omitted with too few shots.
    #[serde(skip_serializing_if = "Option::is_none")]
    mola_minus_surface_m: Option<f64>,
    /// Standard deviation of this median.
    #[serde(skip_serializing_if = "Option::is_none")]
    mola_sigma_m: Option<f64>,
}

#[derive(Serialize, JsonSchema)]
struct SeamDocument {
    /// Places of two pairs in the list of pairs, from 0.
    pairs: [usize; 2],
    /// Cells with heights of both.
    cells: u32,
    /// Heights of the first pair minus heights of the second, before the offsets were subtracted.
    before_m: f64,
    /// The same after the offsets were subtracted.
    after_m: f64,
    /// Standard deviation of the difference, from its scatter along the overlap.
    #[schemars(range(min = 0.0))]
    sigma_m: f64,
    /// Robust spread of the differences of single cells about their mean, in units of their standard deviation.
    #[schemars(range(min = 0.0))]
    spread_sigmas: f64,
}

impl<'a> JointDocument<'a> {
    pub(super) fn of(site: &SiteProducts<'a>, joint: &Joint) -> Self {
        let images = |of: [usize; 2]| of.map(|image| &*site.images[image].times.id);
        let pairs = joint.pairs.iter().map(|of| PairDocument {
            images: images(of.images),
            bit: of.bit,
            cells: of.cells,
            filled: of.filled,
            convergence_deg: of.convergence_rad / RADIANS_PER_DEGREE,
            sigma_m: of.sigma_m,
            offset_m: of.offset_m,
            offset_sigma_m: of.offset_sigma_m,
            mola_minus_surface_m: of.shots_above_m.map(|[above_m, _]| above_m),
            mola_sigma_m: of.shots_above_m.map(|[_, sigma_m]| sigma_m),
        });
        let seams = joint.seams.iter().map(|of| SeamDocument {
            pairs: of.pairs,
            cells: of.cells,
            before_m: of.before_m,
            after_m: of.after_m,
            sigma_m: of.sigma_m,
            spread_sigmas: of.spread_sigmas,
        });
        Self {
            filled: joint.filled,
            several: joint.several,
            pairs: pairs.collect(),
            seams: seams.collect(),
        }
    }
}
