//! Variation of heights with distance.

use std::{collections::BTreeMap, sync::LazyLock};

use nalgebra::Vector2;

use super::{Placed, SurfaceOptions, fractional_power::FractionalPower};

/// Distance at which roughness is stated, metres: about one spacing of MOLA's shots.
const REFERENCE_M: f64 = 300.0;
/// Spacings over which roughness is estimated.
const LAGS: usize = 10;
/// Shots farther apart than this multiple of the usual distance have missing shots between them.
pub(super) const GAP: f64 = 1.5;
/// Edge of a cell in which pairs of shots are summed, metres.
const CELL_M: f64 = 2_000.0;
/// Pairs farther from a place than this have no weight in its roughness, metres.
const REACH_M: f64 = 10_000.0;
/// Weight of the roughness of all shots in the roughness of a place, in pairs of shots.
const PRIOR_PAIRS: f64 = 20.0;

/// The power of squared distances.
static POWER: LazyLock<FractionalPower> = LazyLock::new(|| FractionalPower::new(Variogram::HURST));

/// Half the mean square difference of heights at a distance: `½ ν² (d / 300 m)^(2H)`, `H = 0.7`.
///
/// The exponent is not estimated. On six windows of real MOLA shots exponents fitted along the profiles (0.35 to 0.95)
/// predict withheld profiles worse than this one does: the ground between the profiles, craters above all, does not
/// follow the exponent along them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Variogram {
    /// Root mean square difference of heights 300 m apart, metres.
    pub roughness_m: f64,
}

impl Variogram {
    /// Hurst exponent of the ground.
    pub const HURST: f64 = 0.7;

    /// Half the mean square difference of heights between two points, m².
    pub(super) fn between(self, one: &Vector2<f64>, other: &Vector2<f64>) -> f64 {
        let distances = (one - other).norm_squared() / (REFERENCE_M * REFERENCE_M);
        0.5 * self.roughness_m.powi(2) * POWER.of(distances)
    }

    /// The variogram at a distance.
    pub(super) fn at(self, distance_m: f64) -> f64 {
        self.between(&Vector2::zeros(), &Vector2::new(distance_m, 0.0))
    }
}

/// Pairs of shots of a profile, some spacings apart, by their number of spacings.
type Sums = [Sum; LAGS];

/// Sums over pairs of shots that are equally many spacings apart.
#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    pairs: f64,
    distances_m: f64,
    /// Squares of height differences, without the noise of the shots.
    squares_m2: f64,
}

impl Sum {
    fn add(&mut self, other: &Self, weight: f64) {
        self.pairs += weight * other.pairs;
        self.distances_m += weight * other.distances_m;
        self.squares_m2 += weight * other.squares_m2;
    }

    /// Mean square difference at 300 m, m²; negative where noise exceeds it.
    fn at_reference_m2(&self) -> Option<f64> {
        let distance_m = self.distances_m / self.pairs;
        let scale = (distance_m / REFERENCE_M).powf(2.0 * Variogram::HURST);
        (self.pairs > 0.0 && distance_m > 0.0).then(|| self.squares_m2 / self.pairs / scale)
    }
}

/// Roughness of the ground of a surface, and its change from place to place.
#[derive(Debug, Clone)]
pub(super) struct Roughness {
    /// Variogram of all shots.
    pub(super) all: Variogram,
    sums: Sums,
    cells: BTreeMap<[i64; 2], Sums>,
    least_m: f64,
}

impl Roughness {
    /// Roughness from heights of shots of every profile up to ten spacings apart, their noise removed.
    pub(super) fn learn(shots: &[Placed], options: &SurfaceOptions) -> Self {
        let noise_m2 = 2.0 * options.shot_sigma_m.powi(2);
        let longest_m = GAP * usual_step_m(shots.iter().map(|of| (of.profile, of.plan_m)));
        let mut sums = Sums::default();
        let mut cells: BTreeMap<[i64; 2], Sums> = BTreeMap::new();
        for profile in shots.chunk_by(|one, next| one.profile == next.profile) {
            for (index, one) in profile.iter().enumerate() {
                let cell = cells.entry(cell(&one.plan_m)).or_default();
                let others = profile[index + 1..].iter().take(LAGS);
                for (lag, other) in others.enumerate() {
                    let distance_m = (one.plan_m - other.plan_m).norm();
                    // Written so that NaN counts; kriging refuses it.
                    if distance_m > longest_m * (lag + 1) as f64 {
                        continue;
                    }
                    let pair = Sum {
                        pairs: 1.0,
                        distances_m: distance_m,
                        squares_m2: (one.height_m - other.height_m).powi(2) - noise_m2,
                    };
                    sums[lag].add(&pair, 1.0);
                    cell[lag].add(&pair, 1.0);
                }
            }
        }
        let least_m = options.roughness_min_m;
        Self {
            all: of(&sums, least_m),
            sums,
            cells,
            least_m,
        }
    }

    /// Standard deviations of heights at a place over those by the roughness of all shots: from the pairs of shots
    /// within 10 km, near ones more than far ones.
    pub(super) fn share(&self, place: &Vector2<f64>) -> f64 {
        let mut sums = self.sums;
        let of_all = PRIOR_PAIRS / sums[0].pairs.max(PRIOR_PAIRS);
        for sum in &mut sums {
            *sum = Sum {
                pairs: of_all * sum.pairs,
                distances_m: of_all * sum.distances_m,
                squares_m2: of_all * sum.squares_m2,
            };
        }
        let [west, south] = cell(&place.add_scalar(-REACH_M));
        let [east, north] = cell(&place.add_scalar(REACH_M));
        for row in west..=east {
            for (index, of_cell) in self.cells.range([row, south]..=[row, north]) {
                let middle_m = Vector2::new(index[0] as f64 + 0.5, index[1] as f64 + 0.5) * CELL_M;
                let distance = (middle_m - place).norm() / REACH_M;
                let weight = (1.0 - distance * distance).max(0.0).powi(2);
                for (sum, of_cell) in sums.iter_mut().zip(of_cell) {
                    sum.add(of_cell, weight);
                }
            }
        }
        of(&sums, self.least_m).roughness_m / self.all.roughness_m
    }
}

/// Roughness from pairs of shots, short distances weighing more: their differences are less alike.
fn of(sums: &Sums, least_m: f64) -> Variogram {
    let (mut squares_m2, mut weights) = (0.0, 0.0);
    for (lag, sum) in sums.iter().enumerate() {
        if let Some(of_lag_m2) = sum.at_reference_m2() {
            let weight = 1.0 / (lag + 1) as f64;
            squares_m2 += weight * of_lag_m2;
            weights += weight;
        }
    }
    let mean_m2 = if weights > 0.0 {
        squares_m2 / weights
    } else {
        0.0
    };
    Variogram {
        roughness_m: mean_m2.max(0.0).sqrt().max(least_m),
    }
}

#[allow(
    clippy::cast_possible_truncation,
    reason = "a site is a few hundred cells across"
)]
fn cell(place_m: &Vector2<f64>) -> [i64; 2] {
    [place_m.x, place_m.y].map(|component_m| (component_m / CELL_M).floor() as i64)
}

/// Median distance of successive shots of a profile, metres; infinite without any.
///
/// * `places` – the profile of every shot, and its place in plan
pub(super) fn usual_step_m(places: impl Iterator<Item = (usize, Vector2<f64>)> + Clone) -> f64 {
    let pairs = places.clone().zip(places.skip(1));
    let mut steps_m: Vec<f64> = pairs
        .filter(|((profile, _), (next, _))| profile == next)
        .map(|((_, place_m), (_, next_m))| (place_m - next_m).norm())
        .collect();
    steps_m.sort_unstable_by(f64::total_cmp);
    steps_m
        .get(steps_m.len() / 2)
        .copied()
        .unwrap_or(f64::INFINITY)
}
