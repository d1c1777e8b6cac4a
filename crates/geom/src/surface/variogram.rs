//! Variation of heights with distance.

use nalgebra::Vector2;

use super::{Placed, SurfaceOptions};

/// Distance at which roughness is stated, metres: about one spacing of MOLA's shots.
const REFERENCE_M: f64 = 300.0;
/// Spacings over which roughness is estimated.
const LAGS: usize = 5;
/// Shots farther apart than this multiple of the usual distance have missing shots between them.
const GAP: f64 = 1.5;

/// Half the mean square difference of heights at a distance: `½ ν² (d / 300 m)^(2H)`, `H = 0.7`.
///
/// The exponent is not estimated: on smooth plains it comes out near 1, and craters between the profiles then deviate
/// from the surface by more than its standard deviation allows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Variogram {
    /// Root mean square difference of heights 300 m apart, metres.
    pub roughness_m: f64,
}

impl Variogram {
    /// Hurst exponent of the ground.
    pub const HURST: f64 = 0.7;

    /// Roughness from heights of successive shots of every profile, their noise removed.
    pub(super) fn learn(shots: &[Placed], options: &SurfaceOptions) -> Self {
        let mut squares: Vec<f64> = (1..=LAGS)
            .filter_map(|lag| {
                let (distance_m, difference_m2) = structure(shots, lag)?;
                let of_ground_m2 = difference_m2 - 2.0 * options.shot_sigma_m.powi(2);
                Some(of_ground_m2 / (distance_m / REFERENCE_M).powf(2.0 * Self::HURST))
            })
            .collect();
        squares.sort_unstable_by(f64::total_cmp);
        let median_m2 = squares.get(squares.len() / 2).copied().unwrap_or_default();
        Self {
            roughness_m: median_m2.max(0.0).sqrt().max(options.roughness_min_m),
        }
    }

    /// Half the mean square difference of heights between two points, m².
    pub(super) fn between(self, one: &Vector2<f64>, other: &Vector2<f64>) -> f64 {
        let distance_m = (one - other).norm();
        0.5 * self.roughness_m.powi(2) * (distance_m / REFERENCE_M).powf(2.0 * Self::HURST)
    }

    /// The same at a distance.
    pub(super) fn at(self, distance_m: f64) -> f64 {
        self.between(&Vector2::zeros(), &Vector2::new(distance_m, 0.0))
    }
}

/// Mean distance and mean square height difference of shots `lag` apart in a profile; `None` without any.
fn structure(shots: &[Placed], lag: usize) -> Option<(f64, f64)> {
    let pairs = |lag: usize| {
        let pairs = shots.iter().zip(shots.get(lag..).unwrap_or_default());
        pairs.filter(|(one, other)| one.profile == other.profile)
    };
    let distance_m = |(one, other): (&Placed, &Placed)| (one.plan_m - other.plan_m).norm();
    let mut steps_m: Vec<f64> = pairs(1).map(distance_m).collect();
    steps_m.sort_unstable_by(f64::total_cmp);
    let usual_m = lag as f64 * steps_m.get(steps_m.len() / 2)?;
    let (mut count, mut distances_m, mut squares_m2) = (0.0, 0.0, 0.0);
    for pair in pairs(lag) {
        let apart_m = distance_m(pair);
        if apart_m < GAP * usual_m {
            count += 1.0;
            distances_m += apart_m;
            squares_m2 += (pair.0.height_m - pair.1.height_m).powi(2);
        }
    }
    (count > 0.0 && distances_m > 0.0).then(|| (distances_m / count, squares_m2 / count))
}
