//! Units: their search, and its validation by held-out shots.

use super::{
    result::{HeldOut, MatchOptions, MatchSigma, MatchedPoint, UnitMatch, UnitResult},
    search::{Best, find, is_one_relief, moments, rms_m, shifted_m, surface},
    settle::{Settled, settled},
    shots::Shot,
    similarity::Similarity,
    surface::SimilaritySurface,
};
use areograph_geom::{height_grid::HeightGrid, statistics::Summary};

/// Every *n*-th shot of a unit is held out.
const HELD_OUT_EVERY: usize = 4;
/// A unit has more points than this, of at least this many passes.
const POINTS_MIN: usize = 15;
const STRIPS_MIN: usize = 2;
/// A shift below a cell cannot improve held-out shots; they may be worse by this factor at least.
const NO_SHIFT_SHARE: f64 = 1.1;
/// With *n* used shots and *n*/3 held-out ones, noise alone makes the square of this factor less than 1 + 12/*n* (two standard
/// deviations); shots of a pass share errors, and half of them count.
const NO_SHIFT_NOISE: f64 = 24.0;
/// Largest difference of a unit's shift from the median, cells: an orbit drifts by 7 over an image (Li et al. 2023:
/// 0.01 m a line over 24,000 lines, cells of 35.8 m). In narrow searches the limit is this share of the reach: a tenth
/// of chance shifts agree so closely.
const AGREE_CELLS: f64 = 10.0;
const AGREE_SHARE: f64 = 1.0 / 3.0;

/// Shots that lie together.
pub(super) struct Unit<'a> {
    used: Vec<&'a Shot>,
    held_out: Vec<&'a Shot>,
    result: UnitResult,
}

impl<'a> Unit<'a> {
    /// The unit of number `unit` with these shots, which are in the order of time; at least one.
    pub(super) fn of(grid: &HeightGrid, unit: usize, judges: bool, shots: &[&'a Shot]) -> Self {
        let (mut used, mut held_out) = (Vec::new(), Vec::new());
        for (index, shot) in shots.iter().enumerate() {
            if index % HELD_OUT_EVERY == HELD_OUT_EVERY - 1 {
                held_out.push(*shot);
            } else {
                used.push(*shot);
            }
        }
        let mut tracks: Vec<usize> = shots.iter().map(|shot| shot.track).collect();
        tracks.dedup();
        let mean = |of: fn(&Shot) -> f64| {
            shots.iter().map(|shot| of(shot)).sum::<f64>() / shots.len() as f64
        };
        let centre_m = [mean(|shot| shot.plan_m[0]), mean(|shot| shot.plan_m[1])];
        let middle = [mean(|shot| shot.cell[0]), mean(|shot| shot.cell[1])];
        let mean_m = mean(|shot| shot.height_m);
        let far = shots
            .iter()
            .map(|shot| (shot.plan_m[0] - centre_m[0]).hypot(shot.plan_m[1] - centre_m[1]));
        let squares = shots.iter().map(|shot| (shot.height_m - mean_m).powi(2));
        let result = UnitResult {
            unit,
            place_rad: grid.place_rad(middle),
            judges,
            shots: shots.len(),
            strips: tracks.len(),
            radius_m: far.fold(0.0, f64::max),
            relief_m: (squares.sum::<f64>() / shots.len() as f64).sqrt(),
            found: None,
            held_out: None,
            concordance: [None; 2],
            similarity: None,
            refused_because: String::new(),
        };
        Self {
            used,
            held_out,
            result,
        }
    }

    /// Whether its ground is withheld.
    pub(super) const fn judges(&self) -> bool {
        self.result.judges
    }

    /// Its shots, and whether each is held out.
    pub(super) fn members(&self) -> impl Iterator<Item = (&'a Shot, bool)> {
        let used = self.used.iter().map(|shot| (*shot, false));
        used.chain(self.held_out.iter().map(|shot| (*shot, true)))
    }

    /// Names of its shots.
    pub(super) fn names(&self) -> Vec<String> {
        let shots = self.used.iter().chain(&self.held_out);
        shots.map(|shot| shot.name.clone()).collect()
    }

    /// Searches the unit and validates the result with its own shots.
    pub(super) fn matched(
        &self,
        grid: &HeightGrid,
        measure: Similarity,
        options: &MatchOptions,
    ) -> UnitResult {
        let mut result = self.result.clone();
        result.refused_because = self.judged(grid, measure, options, &mut result);
        result
    }

    /// Similarity of its heights at all shifts of the search.
    pub(super) fn surface(
        &self,
        grid: &HeightGrid,
        measure: Similarity,
        reach: u32,
    ) -> SimilaritySurface {
        surface(grid, &self.used, measure, reach)
    }

    /// Enters the result; returns why the unit is rejected, empty if it is kept.
    fn judged(
        &self,
        grid: &HeightGrid,
        measure: Similarity,
        options: &MatchOptions,
        result: &mut UnitResult,
    ) -> String {
        if result.shots <= POINTS_MIN {
            return format!("{} shots; expected more than {POINTS_MIN}", result.shots);
        }
        if result.strips < STRIPS_MIN {
            return format!("shots of only one pass; expected {STRIPS_MIN} passes or more");
        }
        let Some(mut best) = find(grid, &self.used, measure, options.search_cells) else {
            return "the model has no heights, or no relief, around its shots".to_owned();
        };
        let settled = settled(grid, &self.used, best.shift);
        if let Ok(settled) = &settled {
            best.shift = settled.shift;
        }
        let Some(at_best) = moments(grid, &self.used, best.shift) else {
            return "the model has too few heights at its best shift".to_owned();
        };
        let bias_m = at_best.bias();
        result.found = Some(found(grid, &best, bias_m, settled.ok()));
        result.held_out = self.held_out(grid, best.shift, bias_m);
        result.concordance = [[0.0; 2], best.shift].map(|shift| {
            let heights = moments(grid, &self.held_out, shift)?;
            heights.similarity(Similarity::Ccc)
        });
        let [model_m, laser_m] = at_best.variances().map(f64::sqrt);
        let wrong = [
            (
                best.at_border,
                "its best shift is at the edge of the search area or of the model".to_owned(),
            ),
            (
                !(best.score > options.least_score),
                format!(
                    "similarity {:.3}; expected more than {}",
                    best.score, options.least_score
                ),
            ),
            (
                !(best.contrast > options.least_contrast),
                format!(
                    "contrast {:.2}; expected more than {}",
                    best.contrast, options.least_contrast
                ),
            ),
            (
                !is_one_relief(&at_best),
                format!(
                    "heights vary by {model_m:.3} m in the model and by {laser_m:.1} m according to the laser; \
                     expected heights in metres"
                ),
            ),
        ];
        let wrong = wrong
            .into_iter()
            .find_map(|(is_so, why)| is_so.then_some(why));
        wrong
            .or_else(|| settled.err().map(|why| why.to_string()))
            .or_else(|| not_better(result.held_out.as_ref(), best.shift, self.used.len()))
            .unwrap_or_default()
    }

    /// Held-out shots with and without a shift.
    fn held_out(&self, grid: &HeightGrid, shift: [f64; 2], bias_m: f64) -> Option<HeldOut> {
        let bias_before_m = moments(grid, &self.used, [0.0; 2])?.bias();
        Some(HeldOut {
            shots: self.held_out.len(),
            before_m: rms_m(grid, &self.held_out, [0.0; 2], bias_before_m)?,
            after_m: rms_m(grid, &self.held_out, shift, bias_m)?,
        })
    }

    /// The control point of a kept unit: the used shot whose height residual is closest to the unit's bias, so that it
    /// is not an outlier.
    pub(super) fn point(&self, grid: &HeightGrid, result: &UnitResult) -> Option<MatchedPoint> {
        let found = result.found.as_ref()?;
        let sigma = found.sigma?;
        let [east, north] = found.shift_cells;
        let shift = [-north, east];
        let off_m = |shot: &Shot| {
            let height_m = shifted_m(grid, shot, shift)?;
            Some((height_m - shot.height_m - found.bias_m).abs())
        };
        let shots = self
            .used
            .iter()
            .filter_map(|shot| Some((*shot, off_m(shot)?)));
        let (shot, _) = shots.min_by(|a, b| a.1.total_cmp(&b.1))?;
        let height_m = shifted_m(grid, shot, shift)?;
        let [longitude_rad, latitude_rad] =
            grid.place_rad([shot.cell[0] + shift[0], shot.cell[1] + shift[1]]);
        Some(MatchedPoint {
            unit: result.unit,
            judges: result.judges,
            name: shot.name.clone(),
            laser: [shot.longitude_rad, shot.latitude_rad, shot.radius_m],
            model: [longitude_rad, latitude_rad, grid.radius_m + height_m],
            sigma_m: [sigma.shift_m[0], sigma.shift_m[1], sigma.bias_m],
            in_images: Vec::new(),
        })
    }
}

fn found(grid: &HeightGrid, best: &Best, bias_m: f64, settled: Option<Settled>) -> UnitMatch {
    let [south, east] = best.shift;
    // Not −south: a zero shift has no sign.
    let shift_cells = [east, 0.0 - south];
    let of = |size: [f64; 2]| [shift_cells[0] * size[0], shift_cells[1] * size[1]];
    UnitMatch {
        shift_cells,
        shift_m: of(grid.cell_m()),
        shift_rad: of(grid.cell_rad),
        score: best.score,
        contrast: best.contrast,
        bias_m,
        sigma: settled.map(|settled| {
            let [south, east] = settled.sigma_cells;
            let [east_m, north_m] = grid.cell_m();
            MatchSigma {
                shift_m: [east * east_m, south * north_m],
                bias_m: settled.sigma_bias_m,
            }
        }),
    }
}

/// Why held-out shots do not confirm a shift, if they do not.
fn not_better(held_out: Option<&HeldOut>, [south, east]: [f64; 2], used: usize) -> Option<String> {
    let Some(of) = held_out else {
        return Some("the model has too few heights at the held-out shots".to_owned());
    };
    let is_shifted = south.hypot(east) >= 1.0;
    let by_noise = (1.0 + NO_SHIFT_NOISE / used.max(1) as f64).sqrt();
    let most_m = of.before_m
        * if is_shifted {
            1.0
        } else {
            NO_SHIFT_SHARE.max(by_noise)
        };
    // Written so that NaN is rejected too.
    (!(of.after_m < most_m)).then(|| {
        format!(
            "the shift does not improve the held-out shots: {:.1} m without it, {:.1} m with it",
            of.before_m, of.after_m
        )
    })
}

/// Rejects units whose shift is far from the median of all kept units that are not withheld, for a search within
/// `search_cells`; returns the number of these before.
pub(super) fn refuse_lonely(units: &mut [UnitResult], search_cells: u32) -> usize {
    let most = AGREE_CELLS.min(AGREE_SHARE * f64::from(search_cells));
    let kept = units.iter().filter(|unit| unit.is_kept() && !unit.judges);
    let shifts: Vec<[f64; 2]> = kept
        .filter_map(|unit| Some(unit.found?.shift_cells))
        .collect();
    let median = |axis: usize| {
        let of: Vec<f64> = shifts.iter().map(|shift| shift[axis]).collect();
        Summary::of(&of).median
    };
    if shifts.is_empty() {
        return 0;
    }
    let median = [median(0), median(1)];
    for unit in units.iter_mut().filter(|unit| unit.is_kept()) {
        let Some(found) = &unit.found else { continue };
        let [east, north] = [0, 1].map(|axis| found.shift_cells[axis] - median[axis]);
        if !(east.hypot(north) < most) {
            unit.refused_because = format!(
                "its shift differs by {:.0} cells from the median of the kept units; expected less than {most:.1}",
                east.hypot(north)
            );
        }
    }
    shifts.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shifts_below_a_cell_may_be_worse_by_noise_and_others_must_be_better() {
        let held_out = |after_m: f64| HeldOut {
            shots: 4,
            before_m: 10.0,
            after_m,
        };
        let is_kept = |after_m: f64, east: f64, used: usize| {
            not_better(Some(&held_out(after_m)), [0.0, east], used).is_none()
        };
        // √(1 + 24/12) = 1.73, and √(1 + 24/400) = 1.03, where the factor is 1.1.
        assert!(is_kept(17.0, 0.8, 12) && !is_kept(17.6, 0.8, 12));
        assert!(is_kept(10.9, 0.8, 400) && !is_kept(11.1, 0.8, 400));
        assert!(is_kept(9.9, 1.2, 12) && !is_kept(10.1, 1.2, 12));
        assert!(!is_kept(f64::NAN, 0.8, 12));
    }
}
