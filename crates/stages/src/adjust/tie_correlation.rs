//! Errors that neighbouring tie points have in common, as residuals along the track show them.
//!
//! Errors of matching are alike where patches overlap or texture repeats, and jitter displaces neighbours together. Precise heights of many
//! neighbours would otherwise determine the position by errors that do not average out. Across the track nothing shows
//! the correlation, because heights absorb errors there: the one along the track is assumed.

use nalgebra::Vector3;

use super::network::Assembled;
use areograph_geom::bundle::{Adjustment, CommonNoise};

/// Tie points within this distance are neighbours, metres.
const NEIGHBOUR_M: f64 = 500.0;
/// Distance over which the correlation falls to 1/e, metres: a choice, as jitter of a second covers 3 km and patches 50 m.
const REACH_M: f64 = 1_000.0;
/// Fewest pairs of neighbours that show a correlation.
const PAIRS_MIN: usize = 40;
/// Residuals with less redundancy hardly show an error.
const REDUNDANCY_MIN: f64 = 0.05;
/// Standardised residuals count by at most this much: blunders are not noise.
const RESIDUAL_MAX: f64 = 3.0;
/// A correlation of 1 has no independent part.
const SHARE_MAX: f64 = 0.9;

/// Noise that neighbouring tie points have in common; `None` where their residuals show none.
pub(super) fn common_noise<M>(
    assembled: &Assembled<M>,
    adjustment: &Adjustment,
) -> Option<CommonNoise> {
    let views = assembled.network.views.iter().zip(&adjustment.views);
    let ties = views.filter(|(view, _)| view.point >= assembled.shots);
    let along: Vec<(usize, Vector3<f64>, f64)> = ties
        .filter_map(|(view, residuals)| {
            let [along, _] = (*residuals)?;
            let ground_m = adjustment.points[view.point].ok()?.ground_m;
            let standardised = along.value / (along.sigma * along.redundancy.sqrt());
            (along.redundancy > REDUNDANCY_MIN).then(|| {
                let standardised = standardised.clamp(-RESIDUAL_MAX, RESIDUAL_MAX);
                (view.image, ground_m, standardised)
            })
        })
        .collect();
    let share = correlation(&along)?;
    (share > 0.0).then_some(CommonNoise {
        share: share.min(SHARE_MAX),
        reach_m: REACH_M,
    })
}

/// Correlation at the same place that residuals of neighbours in the same image show, each with image and ground position.
fn correlation(residuals: &[(usize, Vector3<f64>, f64)]) -> Option<f64> {
    let (mut products, mut expected, mut pairs) = (0.0, 0.0, 0_usize);
    for (index, (image, ground_m, first)) in residuals.iter().enumerate() {
        for (other, place_m, second) in &residuals[index + 1..] {
            let apart_m = (place_m - ground_m).norm();
            if image == other && apart_m < NEIGHBOUR_M {
                products += first * second;
                expected += (-apart_m / REACH_M).exp();
                pairs += 1;
            }
        }
    }
    let squares: f64 = residuals.iter().map(|(_, _, value)| value * value).sum();
    let mean_square = squares / residuals.len() as f64;
    (pairs >= PAIRS_MIN && mean_square > 0.0).then(|| products / expected / mean_square)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Residuals of a row of points, 100 m apart.
    fn row(value: impl Fn(usize) -> f64) -> Vec<(usize, Vector3<f64>, f64)> {
        let at = |index: usize| Vector3::new(3.39e6, 0.0, 100.0 * index as f64);
        (0..100).map(|index| (0, at(index), value(index))).collect()
    }

    #[test]
    fn waves_are_shared_by_neighbours_and_alternating_errors_are_not() {
        // A wave of 6 km: neighbours up to 400 m apart differ by at most 24 degrees.
        let wave = correlation(&row(|index| {
            (index as f64 / 60.0 * std::f64::consts::TAU).sin()
        }));
        assert!(wave.unwrap() > 0.9, "{wave:?}");
        let alternating = correlation(&row(|index| if index % 2 == 0 { 1.0 } else { -1.0 }));
        assert!(alternating.unwrap().abs() < 0.05, "{alternating:?}");
        assert_eq!(correlation(&row(|_| 1.0)[..5]), None);
    }
}
