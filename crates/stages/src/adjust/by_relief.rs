//! Adjustment without and with relief, and the choice between them.

use super::{
    adjusted::Adjusted,
    relief::{ProfileOffset, ReliefChoice, ReliefComparison},
};
use areograph_base::error::{Kind, Result};
use areograph_config::ReliefForPlan;

/// Relief is used if it reduces a standard deviation of the mean position to at most this share: the position then depends on
/// further assumptions.
const SHARE_OF_USE: f64 = 0.75;
/// Weight of the configured standard deviation of shifts of profiles in the estimated one, in profiles.
const PRIOR_PROFILES: f64 = 3.0;
/// A shift counts in the estimate by at most this many standard deviations.
const SHIFT_MAX_SIGMAS: f64 = 3.0;
/// An estimate above the configured value by less than this share leaves the result.
const LARGER_BY: f64 = 0.05;

/// Adjusts by `with`, whose argument is the standard deviation of shifts of profiles in plan where relief determines the position.
///
/// * `plan_sigma_m` – the configured standard deviation, metres
///
/// # Errors
/// Those of `with`, except failures of the adjustment with relief where relief is optional.
pub(super) fn adjusted_by(
    relief: ReliefForPlan,
    plan_sigma_m: f64,
    with: impl Fn(Option<f64>) -> Result<Adjusted>,
) -> Result<Adjusted> {
    match relief {
        ReliefForPlan::No => with(None),
        ReliefForPlan::Yes => by_relief(plan_sigma_m, with),
        ReliefForPlan::Auto => {
            let without = with(None)?;
            if !could_improve(&without) {
                return Ok(with_choice(without, ReliefChoice::Imprecise));
            }
            match by_relief(plan_sigma_m, with) {
                Ok(by_relief) => Ok(chosen(without, by_relief)),
                Err(error) if error.cause.kind() == Kind::Input => {
                    let reason = error.cause.to_string();
                    Ok(with_choice(without, ReliefChoice::Failed(reason)))
                }
                Err(error) => Err(error),
            }
        }
    }
}

/// Adjusts with relief; where the shifts of profiles are larger than `plan_sigma_m` states, once more with what they show.
fn by_relief(
    plan_sigma_m: f64,
    with: impl Fn(Option<f64>) -> Result<Adjusted>,
) -> Result<Adjusted> {
    let first = with(Some(plan_sigma_m))?;
    let shifts = first.relief.as_ref().map(|relief| &*relief.profile_shifts);
    let shown_m = scatter_m(shifts.unwrap_or_default(), plan_sigma_m);
    if shown_m <= (1.0 + LARGER_BY) * plan_sigma_m {
        return Ok(first);
    }
    match with(Some(shown_m)) {
        Err(error) if error.cause.kind() == Kind::Input => Ok(first),
        again => again,
    }
}

/// Standard deviation of shifts of profiles in plan on an axis, from the shifts and a priori, metres.
///
/// An estimated shift is the share `f = 1 − σ²/σ₀²` of the true shift and of its noise, whose variance is `σ₀² (1/f − 1)`: its
/// expected square is `f² σ_true² + f (1 − f) σ₀²`. Shifts that nothing determines do not count.
fn scatter_m(shifts: &[ProfileOffset], prior_m: f64) -> f64 {
    let prior_m2 = prior_m.powi(2);
    let limit_m2 = SHIFT_MAX_SIGMAS.powi(2) * prior_m2;
    let axes = shifts
        .iter()
        .flat_map(|of| [0, 1].map(|axis| (of.shift_m[axis], of.sigma_m[axis])));
    let axes = axes.map(|(shift_m, sigma_m)| {
        // Profiles off nadir may have larger standard deviations than the a priori one: nothing is known of these.
        let share = 1.0 - sigma_m.powi(2) / prior_m2;
        if share <= 0.0 {
            return (0.0, 0.0);
        }
        let of_true_m2 = (shift_m * shift_m).min(limit_m2) - share * (1.0 - share) * prior_m2;
        (share * share, of_true_m2)
    });
    let weight = 2.0 * PRIOR_PROFILES;
    let (weights, sum_m2) = axes.fold(
        (weight, weight * prior_m2),
        |(weights, sum_m2), (weight, of_true_m2)| (weights + weight, sum_m2 + of_true_m2),
    );
    (sum_m2 / weights).max(0.0).sqrt()
}

/// Standard deviations of the mean position, east and north, metres.
fn position_sigma_m(adjusted: &Adjusted) -> Option<[f64; 2]> {
    let [east_m, north_m, _] = adjusted.heights.as_ref()?.mean_sigma_m;
    Some([east_m, north_m])
}

/// Whether relief alone is more precise than the position without it on an axis.
fn could_improve(without: &Adjusted) -> bool {
    let known_m = position_sigma_m(without);
    let relief_m = without.relief.as_ref().map(|relief| relief.sigma_m);
    let axes = known_m
        .into_iter()
        .flatten()
        .zip(relief_m.into_iter().flatten());
    axes.into_iter()
        .any(|(known_m, relief_m)| relief_m < known_m)
}

/// The adjustment with relief, if it is more precise.
fn chosen(without: Adjusted, by_relief: Adjusted) -> Adjusted {
    let (Some(without_sigma_m), Some(with_sigma_m)) =
        (position_sigma_m(&without), position_sigma_m(&by_relief))
    else {
        return without;
    };
    let shares = [0, 1].map(|axis| with_sigma_m[axis] / without_sigma_m[axis]);
    let is_settled = |of: &Adjusted| of.heights.as_ref().is_some_and(|of| of.settled);
    let is_better = shares.iter().any(|share| *share <= SHARE_OF_USE)
        && shares.iter().all(|share| *share <= 1.0)
        && (is_settled(&by_relief) || !is_settled(&without));
    let compared = ReliefChoice::Compared(ReliefComparison {
        without_sigma_m,
        with_sigma_m,
    });
    with_choice(if is_better { by_relief } else { without }, compared)
}

fn with_choice(mut adjusted: Adjusted, choice: ReliefChoice) -> Adjusted {
    if let Some(relief) = &mut adjusted.relief {
        relief.choice = choice;
    }
    adjusted
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shifts(sizes_m: &[f64], sigma_m: f64) -> Vec<ProfileOffset> {
        let offset = |shift_m: &f64| ProfileOffset {
            profile: String::new(),
            shift_m: [*shift_m, -shift_m, 0.0],
            sigma_m: [sigma_m, sigma_m, 1.0],
        };
        sizes_m.iter().map(offset).collect()
    }

    #[test]
    fn larger_shifts_state_a_larger_scatter_and_unknown_ones_none() {
        // Metres. The share of the true shift is 1 − 20²/70² = 0.918: √((20·(100² − 369) + 6·70²) / (20·0.843 + 6)) = 98.6.
        let large_m = scatter_m(&shifts(&[100.0; 10], 20.0), 70.0);
        assert!((large_m - 98.6).abs() < 0.1, "{large_m}");
        // Shifts that nothing determines keep the value.
        let unknown_m = scatter_m(&shifts(&[0.0; 10], 70.0), 70.0);
        assert!((unknown_m - 70.0).abs() < 1e-9, "{unknown_m}");
        assert!((scatter_m(&[], 70.0) - 70.0).abs() < 1e-9);
        // A misplaced profile counts as three standard deviations: √((2·210² + 6·70²) / 14) = 91.7.
        let one_m = scatter_m(&shifts(&[5_000.0, 0.0, 0.0, 0.0], 0.0), 70.0);
        assert!((one_m - 91.7).abs() < 0.1, "{one_m}");
    }
}
