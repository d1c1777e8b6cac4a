//! Request and result of a match.

use std::{collections::BTreeMap, path::PathBuf};

use serde::{Deserialize, Serialize};

use super::{
    pass::Pass,
    similarity::{Moments, Similarity},
    surface::SimilaritySurface,
};
use crate::{judge::Verdict, line_camera::LineCamera};
use areograph_base::{
    altimetry::{GroundRadius, ShotFilter},
    body::Body,
};
use areograph_geom::height_grid::HeightGrid;

/// Options of the match of laser profiles with a terrain model. Li et al. 2023 and its published program have 15
/// points, 1000 m², 70 cells, similarities above 0.9 and contrasts above 1.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MatchOptions {
    /// Maximum number of points of a segment.
    pub segment_points: usize,
    /// Drift of the images against the laser, metres per metre of ground; with it, segments are as long as a drift of one cell
    /// permits, regardless of `segment_points`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub segment_drift: Option<f64>,
    /// Population variance of laser heights that a segment must exceed, m².
    pub least_variance_m2: f64,
    /// The measure; `None` selects `pearson` where the median bias exceeds a tenth of the relief, or 100 m, otherwise
    /// `ccc`.
    pub similarity: Option<Similarity>,
    /// Shifts are searched within this many cells.
    pub search_cells: u32,
    /// Similarity to the terrain model that a unit of shots must exceed.
    pub least_score: f64,
    /// Ratio of the best similarity to the mean of those above 0 that a unit must exceed.
    pub least_contrast: f64,
    /// Largest root mean square of model minus laser, bias removed, over all held-out shots, metres.
    pub limit_m: f64,
    /// Seed of the clusters.
    pub seed: u64,
    /// Radius of a shot that represents the ground.
    pub ground: GroundRadius,
    /// Shots that are taken.
    pub filter: ShotFilter,
}

/// Withheld ground: every *n*-th rectangle of a lattice, shifted by a seed. The rectangles do not depend on the model,
/// so that a shot stays on its side with every model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct HeldBackGround {
    /// Every *n*-th rectangle is withheld.
    pub(super) every: u32,
    /// Seed of the shift.
    pub(super) seed: u64,
}

/// A terrain model in memory, to be matched.
#[derive(Debug, Clone, Copy)]
pub(super) struct ModelRequest<'a> {
    /// Its heights.
    pub(super) model: &'a HeightGrid,
    /// PEDR files.
    pub(super) pedr: &'a [PathBuf],
    /// Images that it was made from.
    pub(super) images: &'a [LineCamera],
    /// Options.
    pub(super) options: &'a MatchOptions,
    /// Withheld ground.
    pub(super) held_back: HeldBackGround,
}

/// Request of a match.
#[derive(Debug, Clone, Serialize)]
pub struct MatchRequest {
    /// Options.
    pub options: MatchOptions,
    /// The body.
    pub body: Body,
    /// Radius of the reference sphere of the model's heights, metres, where it is stated.
    pub radius_m: Option<f64>,
    /// Whether that sphere is meant to differ from the sphere of the model's map.
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

/// An image with its support data.
#[derive(Debug, Clone, Serialize)]
pub struct MatchImage {
    /// Name in the control table: the name of a camera of `areograph calibrate`.
    pub name: String,
    /// The support data.
    #[serde(skip)]
    pub isd: PathBuf,
}

/// The result of a match.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LaserMatch {
    /// Radius of the reference sphere of the model's heights, metres.
    pub radius_m: f64,
    /// Size of a cell towards the east and the north, metres.
    pub cell_m: [f64; 2],
    /// Shots on the model.
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
    /// All held-out shots of the kept units.
    pub held_out: Option<HeldOut>,
    /// Widening of their standard deviations; `None` with too few units.
    pub widened: Option<Widened>,
    /// Every unit, kept or not.
    pub units: Vec<UnitResult>,
    /// Heights along every pass.
    pub passes: Vec<Pass>,
    /// A control point of every kept unit.
    pub points: Vec<MatchedPoint>,
    /// Names of the images.
    pub images: Vec<String>,
    /// The verdict.
    pub verdict: Verdict,
    /// Records and points that were excluded.
    pub complaints: Vec<String>,
    /// Their number.
    pub complaint_count: u64,
}

/// Shots of a concordance.
const SHOTS_MIN: usize = 4;

impl LaserMatch {
    /// Concordance of heights of an earlier model and of this model with the laser, without any shift, at the held-out shots of every kept unit at which both
    /// have heights: its number and both values. Units with fewer than four such shots are left out.
    ///
    /// # Source
    /// Li et al. 2023, eq. 18 and Table 4.
    #[must_use]
    pub fn concordances_after(&self, earlier: &Self) -> Vec<(usize, [f64; 2])> {
        let shots = earlier.passes.iter().flat_map(|pass| &pass.shots);
        let earlier_m: BTreeMap<&str, f64> = shots
            .filter_map(|shot| Some((&*shot.name, shot.model_m?)))
            .collect();
        let mut heights_m: BTreeMap<usize, Vec<[f64; 3]>> = BTreeMap::new();
        let shots = self.passes.iter().flat_map(|pass| &pass.shots);
        for shot in shots.filter(|shot| shot.is_held_out) {
            let earlier_m = earlier_m.get(&*shot.name);
            if let (Some(unit), Some(earlier_m), Some(model_m)) =
                (shot.unit, earlier_m, shot.model_m)
            {
                let of_unit = heights_m.entry(unit).or_default();
                of_unit.push([*earlier_m, model_m, shot.laser_m]);
            }
        }
        let kept = self.units.iter().filter(|unit| unit.is_kept());
        let concordances = kept.filter_map(|unit| {
            let heights_m = heights_m.get(&unit.unit)?;
            let [.., middle_m] = *heights_m.first()?;
            if heights_m.len() < SHOTS_MIN {
                return None;
            }
            let of = |model: usize| {
                let mut moments = Moments::default();
                for of_shot in heights_m {
                    moments.add(of_shot[model] - middle_m, of_shot[2] - middle_m);
                }
                moments.similarity(Similarity::Ccc)
            };
            Some((unit.unit, [of(0)?, of(1)?]))
        });
        concordances.collect()
    }

    /// Kept units with the lowest, the median and the highest similarity, in this order; fewer where fewer are kept.
    #[must_use]
    pub fn examples(&self) -> Vec<&UnitResult> {
        let shown = examples(&self.units);
        shown.into_iter().map(|at| &self.units[at]).collect()
    }

    /// The pass with the shifted model at the most shots, and at least at two.
    #[must_use]
    pub fn longest_pass(&self) -> Option<&Pass> {
        let passes = self.passes.iter().rev();
        passes
            .max_by_key(|pass| pass.shifted())
            .filter(|pass| pass.shifted() >= 2)
    }
}

/// Model minus laser at held-out shots: root mean squares about the bias of the used shots, metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HeldOut {
    /// Shots.
    pub shots: usize,
    /// Without the shift.
    pub before_m: f64,
    /// With the shift.
    pub after_m: f64,
}

/// A unit of segments that lie together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct UnitResult {
    /// Its number, from 1.
    pub unit: usize,
    /// East longitude and latitude of its middle, radians.
    pub place_rad: [f64; 2],
    /// Whether its ground is withheld: it validates, and no other unit shares a shot with it.
    pub judges: bool,
    /// Shots.
    pub shots: usize,
    /// Passes of these shots.
    pub strips: usize,
    /// Largest distance of a shot from the middle, metres.
    pub radius_m: f64,
    /// Standard deviation of its laser heights, metres.
    pub relief_m: f64,
    /// Result of the search; absent where it found no shift.
    pub found: Option<UnitMatch>,
    /// Held-out shots, where the model has heights with and without the shift.
    pub held_out: Option<HeldOut>,
    /// Concordance of model and laser heights at held-out shots, without and with the shift (Li et al. 2023, eq. 18 and
    /// Table 4); `None` where the model has too few heights.
    pub concordance: [Option<f64>; 2],
    /// Similarity over the shifts of that search.
    pub similarity: Option<SimilaritySurface>,
    /// Reason why it is rejected; empty if it is kept.
    pub refused_because: String,
}

impl UnitResult {
    /// Whether it is kept.
    #[must_use]
    pub const fn is_kept(&self) -> bool {
        self.refused_because.is_empty()
    }
}

/// Result of the search of a unit: position of the ground in the model relative to its position from the laser.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct UnitMatch {
    /// Shift to the east and the north, cells.
    pub shift_cells: [f64; 2],
    /// Shift to the east and the north, metres.
    pub shift_m: [f64; 2],
    /// Shift in longitude and latitude, radians.
    pub shift_rad: [f64; 2],
    /// Similarity.
    pub score: f64,
    /// Similarity over the mean of similarities above 0.
    pub contrast: f64,
    /// Mean of model minus laser over the shots that were used, metres.
    pub bias_m: f64,
    /// Standard deviations; `None` where least squares give no position.
    pub sigma: Option<MatchSigma>,
}

/// Standard deviations of a unit: from leaving out single shots, widened by the scatter of all units ([`Widened`]).
/// Errors of the laser that its shots share are not included.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MatchSigma {
    /// Standard deviations of the shift to the east and the north, metres.
    pub shift_m: [f64; 2],
    /// Standard deviation of model minus laser, metres.
    pub bias_m: f64,
}

impl MatchSigma {
    /// The standard deviations, widened by these factors.
    pub(super) fn wider(self, by: Widened) -> Self {
        Self {
            shift_m: self.shift_m.map(|sigma_m| by.shift * sigma_m),
            bias_m: by.bias * self.bias_m,
        }
    }
}

/// Factors by which standard deviations of units were widened, at least 1: scatter of units about a plane over the
/// ground relative to the scatter predicted by leaving out their shots. The shots of a unit share an error of the
/// model, which they cannot show.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Widened {
    /// Factor of shifts.
    pub shift: f64,
    /// Factor of biases.
    pub bias: f64,
}

/// A laser control point: the shot of a unit whose height residual is closest to the unit's bias.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MatchedPoint {
    /// Number of its unit.
    pub unit: usize,
    /// Whether that unit is withheld.
    pub judges: bool,
    /// File, record and shot.
    pub name: String,
    /// East longitude, latitude, radians, and radius, metres, by the laser.
    pub laser: [f64; 3],
    /// East longitude, latitude, radians, and radius, metres, by the model.
    pub model: [f64; 3],
    /// Standard deviations of their difference in east, north and height, metres, from the matching only.
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

/// Kept units with the lowest, the median and the highest similarity, by index; fewer where fewer are kept.
fn examples(units: &[UnitResult]) -> Vec<usize> {
    let mut scores: Vec<(usize, f64)> = units
        .iter()
        .enumerate()
        .filter(|(_, unit)| unit.is_kept())
        .filter_map(|(at, unit)| Some((at, unit.found?.score)))
        .collect();
    scores.sort_by(|a, b| a.1.total_cmp(&b.1));
    let Some(last) = scores.len().checked_sub(1) else {
        return Vec::new();
    };
    let mut shown = vec![0, last / 2, last];
    shown.dedup();
    shown.into_iter().map(|at| scores[at].0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit(score: Option<f64>, refused_because: &str) -> UnitResult {
        UnitResult {
            unit: 1,
            place_rad: [0.0; 2],
            judges: false,
            shots: 60,
            strips: 2,
            radius_m: 5_000.0,
            relief_m: 80.0,
            found: score.map(|score| UnitMatch {
                shift_cells: [0.0; 2],
                shift_m: [0.0; 2],
                shift_rad: [0.0; 2],
                score,
                contrast: 2.0,
                bias_m: 0.0,
                sigma: None,
            }),
            held_out: None,
            concordance: [None; 2],
            similarity: None,
            refused_because: refused_because.to_owned(),
        }
    }

    #[test]
    fn examples_are_the_lowest_the_median_and_the_highest_of_kept_units() {
        let kept = |scores: &[f64]| -> Vec<UnitResult> {
            let refused = [unit(Some(0.1), "far"), unit(None, "flat")];
            let kept = scores.iter().map(|score| unit(Some(*score), ""));
            refused.into_iter().chain(kept).collect()
        };
        assert_eq!(examples(&kept(&[])), [0; 0]);
        assert_eq!(examples(&kept(&[0.95])), [2]);
        assert_eq!(examples(&kept(&[0.95, 0.92])), [3, 2]);
        assert_eq!(examples(&kept(&[0.95, 0.99, 0.91, 0.97, 0.93])), [4, 2, 3]);
    }
}
