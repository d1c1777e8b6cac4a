//! Interval of the contours of a terrain model.

use crate::stages::map_surface::SurfaceAccount;

/// Least interval of contours, standard deviations of heights: 90 % of heights are within half an interval, as the
/// United States National Map Accuracy Standards (1947) require of contours (2 × 1.645).
const INTERVAL_SIGMAS: f64 = 3.29;
/// Largest number of intervals within the relief.
const INTERVALS_MAX: f64 = 25.0;

/// Interval of the contours of a model, metres: 1, 2 or 5 times a power of ten that its standard deviation permits and
/// its relief needs.
pub(super) fn contour_interval_m(account: &SurfaceAccount) -> f64 {
    let heights_m = account.above_reference(&account.look.heights).heights_m;
    let known = heights_m.iter().filter(|height_m| !height_m.is_nan());
    let [low_m, high_m] = known.fold(
        [f64::INFINITY, f64::NEG_INFINITY],
        |[low, high], height_m| {
            let height_m = f64::from(*height_m);
            [low.min(height_m), high.max(height_m)]
        },
    );
    let relief_m = (high_m - low_m).max(0.0);
    rounded_up(f64::max(
        INTERVAL_SIGMAS * account.sigma_m,
        relief_m / INTERVALS_MAX,
    ))
}

/// The least of 1, 2 and 5 times the powers of ten that is not below a number.
fn rounded_up(number: f64) -> f64 {
    /// Least interval, metres: heights have no more digits.
    const LEAST_M: f64 = 0.01;
    let number = number.max(LEAST_M);
    // Written so that 1, 2 and 5 themselves stay in spite of rounding.
    let power = 10_f64.powf((number.log10() + 1e-9).floor());
    let steps = [1.0, 2.0, 5.0].map(|step| step * power);
    let fits = steps
        .into_iter()
        .find(|step| *step >= number * (1.0 - 1e-9));
    fits.unwrap_or(10.0 * power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_are_one_two_or_five() {
        let rounded = [0.0, 0.011, 0.9, 1.0, 1.1, 2.0, 4.2, 5.3, 10.0, 161.0].map(rounded_up);
        let expected = [0.01, 0.02, 1.0, 1.0, 2.0, 2.0, 5.0, 10.0, 10.0, 200.0];
        for (rounded, expected) in rounded.into_iter().zip(expected) {
            // Powers of ten are rounded.
            assert!(
                (rounded - expected).abs() < 1e-9 * expected,
                "{rounded} {expected}"
            );
        }
    }
}
