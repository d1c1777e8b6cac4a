//! What is asked of a match, and what it gives.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::{similarity::Similarity, surface::SimilaritySurface};
use crate::{
    altimetry::ShotFilter,
    body::Body,
    geom::height_grid::HeightGrid,
    stages::{judge::Verdict, line_camera::LineCamera},
};

/// How laser profiles are matched with a terrain model. Li et al. 2023 and its published program have 15 points, 1000 m², 70 cells,
/// similarities above 0.9 and contrasts above 1.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MatchOptions {
    /// Most points of a segment.
    pub segment_points: usize,
    /// Population variance of laser heights that a segment must exceed, m².
    pub least_variance_m2: f64,
    /// The measure; none takes `pearson` while the median bias exceeds a tenth of the relief, or 100 m, else `ccc`.
    pub similarity: Option<Similarity>,
    /// Shifts are tried within so many cells.
    pub search_cells: u32,
    /// Similarity that a unit must exceed.
    pub least_score: f64,
    /// What the best similarity over the mean of those above 0 must exceed.
    pub least_contrast: f64,
    /// Largest root mean square of model minus laser, bias removed, over all shots that were held out, metres.
    pub limit_m: f64,
    /// Of the clusters.
    pub seed: u64,
    /// Shots that are taken.
    pub filter: ShotFilter,
}

/// Which ground is held back: every so manieth rectangle of a lattice, shifted by a seed. They do not depend on the model, so that
/// a shot stays on its side whatever model it is matched with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct HeldBackGround {
    /// Every so manieth rectangle.
    pub every: u32,
    /// Which of them.
    pub seed: u64,
}

/// A terrain model in memory, to be matched.
#[derive(Debug, Clone, Copy)]
pub struct ModelRequest<'a> {
    /// Its heights.
    pub model: &'a HeightGrid,
    /// PEDR files.
    pub pedr: &'a [PathBuf],
    /// Images that it was made from.
    pub images: &'a [LineCamera],
    /// How.
    pub options: &'a MatchOptions,
    /// Ground that judges.
    pub held_back: HeldBackGround,
}

/// What to match.
#[derive(Debug, Clone, Serialize)]
pub struct MatchRequest {
    /// How.
    pub options: MatchOptions,
    /// The body.
    pub body: Body,
    /// Radius of the sphere that heights of the model count from, metres, where it is stated.
    pub radius_m: Option<f64>,
    /// Whether that is meant to be another sphere than that of the model's map.
    pub heights_apart: bool,
    /// The terrain model.
    #[serde(skip)]
    pub model: PathBuf,
    /// PEDR files.
    #[serde(skip)]
    pub pedr: Vec<PathBuf>,
    /// Images that the model was made from.
    pub images: Vec<MatchImage>,
}

/// An image by its support data.
#[derive(Debug, Clone, Serialize)]
pub struct MatchImage {
    /// Name in the table of control: that of a camera of `areograph calibrate`.
    pub name: String,
    /// The support data.
    #[serde(skip)]
    pub isd: PathBuf,
}

/// What a match gives.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LaserMatch {
    /// Radius of the sphere that heights of the model count from, metres.
    pub radius_m: f64,
    /// Size of a cell towards the east and the north, metres.
    pub cell_m: [f64; 2],
    /// Shots on the model, passes that they are of, and segments.
    pub shots: usize,
    /// Passes.
    pub tracks: usize,
    /// Segments.
    pub segments: usize,
    /// Segments with relief.
    pub segments_kept: usize,
    /// The measure that ran.
    pub similarity: Similarity,
    /// Median of model minus laser over the units that correlation keeps, metres, which decides on the measure.
    pub located_bias_m: Option<f64>,
    /// Median of model minus laser over the units that are kept, metres.
    pub bias_m: Option<f64>,
    /// Of the kept units all shots that were held out.
    pub held_out: Option<HeldOut>,
    /// By how much their standard deviations were widened; none of too few units.
    pub widened: Option<Widened>,
    /// Every unit, kept or not.
    pub units: Vec<UnitResult>,
    /// A control point of every kept unit.
    pub points: Vec<MatchedPoint>,
    /// Names of the images.
    pub images: Vec<String>,
    /// The verdict.
    pub verdict: Verdict,
    /// What was left out.
    pub complaints: Vec<String>,
    /// How much that is.
    pub complaint_count: u64,
}

/// Model minus laser at shots that were held out: root mean squares about the bias of the shots that were used, metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HeldOut {
    /// Shots.
    pub shots: usize,
    /// Without the shift.
    pub before_m: f64,
    /// With it.
    pub after_m: f64,
}

/// A unit of segments that lie together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct UnitResult {
    /// Its number, from 1.
    pub unit: usize,
    /// East longitude and latitude of its middle, radians.
    pub place_rad: [f64; 2],
    /// Whether its ground is held back: it judges, and no other unit shares a shot with it.
    pub judges: bool,
    /// Shots.
    pub shots: usize,
    /// Passes that they are of.
    pub strips: usize,
    /// Largest distance of a shot from the middle, metres.
    pub radius_m: f64,
    /// Standard deviation of its laser heights, metres.
    pub relief_m: f64,
    /// What the search found; absent where there was none.
    pub found: Option<UnitMatch>,
    /// Shots that were held out, where the model has heights with and without the shift.
    pub held_out: Option<HeldOut>,
    /// Similarity over the shifts of that search; absent in matches of models that are made round by round.
    pub similarity: Option<SimilaritySurface>,
    /// Why it is not kept; empty for one that is.
    pub refused_because: String,
}

impl UnitResult {
    /// Whether it is kept.
    #[must_use]
    pub const fn is_kept(&self) -> bool {
        self.refused_because.is_empty()
    }
}

/// What the search of a unit found: where the model has the ground, seen from where the laser has it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct UnitMatch {
    /// Shift to the east and the north, cells.
    pub shift_cells: [f64; 2],
    /// The same, metres.
    pub shift_m: [f64; 2],
    /// The same in longitude and latitude, radians.
    pub shift_rad: [f64; 2],
    /// Similarity.
    pub score: f64,
    /// That over the mean of similarities above 0.
    pub contrast: f64,
    /// Mean of model minus laser over the shots that were used, metres.
    pub bias_m: f64,
    /// Standard deviations; none where least squares have no place.
    pub sigma: Option<MatchSigma>,
}

/// Standard deviations of a unit: those of leaving out single shots, widened as all units ask for ([`Widened`]). Errors of the laser
/// that its shots share are not in them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MatchSigma {
    /// Of the shift to the east and the north, metres.
    pub shift_m: [f64; 2],
    /// Of model minus laser, metres.
    pub bias_m: f64,
}

impl MatchSigma {
    /// The same, so many times as wide.
    pub(super) fn wider(self, by: Widened) -> Self {
        Self {
            shift_m: self.shift_m.map(|sigma_m| by.shift * sigma_m),
            bias_m: by.bias * self.bias_m,
        }
    }
}

/// By how much standard deviations of units were widened, 1 and more: by as much units scatter about a plane over the ground beyond
/// what leaving out their shots says. A model errs in common over the shots of a unit, which these cannot tell.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Widened {
    /// Of shifts.
    pub shift: f64,
    /// Of biases.
    pub bias: f64,
}

/// A laser control point: the shot of a unit that lies nearest to its bias.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MatchedPoint {
    /// Number of its unit.
    pub unit: usize,
    /// Whether that is held back.
    pub judges: bool,
    /// File, record and shot.
    pub name: String,
    /// East longitude, latitude, radians, and radius, metres, by the laser.
    pub laser: [f64; 3],
    /// The same where the model has it.
    pub model: [f64; 3],
    /// Standard deviations of what the two differ by towards the east, the north and up, metres, by the matching alone.
    pub sigma_m: [f64; 3],
    /// Line and sample in each image, where the image shows it.
    pub in_images: Vec<Option<[f64; 2]>>,
}

impl MatchedPoint {
    /// Standard deviation of a horizontal coordinate, metres: root mean square of east and north.
    #[must_use]
    pub fn sigma_horizontal_m(&self) -> f64 {
        let [east_m, north_m, _] = self.sigma_m;
        std::f64::consts::FRAC_1_SQRT_2 * east_m.hypot(north_m)
    }
}
