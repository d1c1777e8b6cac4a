//! Similarity of the heights of a unit at all shifts.

use serde::{Deserialize, Serialize};

/// Maximum number of values from side to side: every shift of a search within 70 cells.
const SIDE_MAX: i64 = 141;
/// Number of levels above the level of similarity 0.
const STEPS: f64 = 254.0;

/// Similarity over the shifts of a search, in levels of a byte.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SimilaritySurface {
    /// Edge of the square of shifts of which a value is the best; odd, so that one value is centred on the zero shift.
    pub step_cells: u32,
    /// Number of values from the central one to each side.
    pub reach: u32,
    /// Row by row from the north-west, as many columns as rows: 1 for similarity 0 and below, 255 for 1, between them evenly by
    /// `1 − √(1 − similarity)`, as a good match and a chance one both lie near 1; 0 where the model covers too few shots, or is flat.
    pub levels: Vec<u8>,
}

impl SimilaritySurface {
    /// The surface of similarities `at` shifts within `reach` rows (southwards) and columns (eastwards); none beyond.
    pub(super) fn of(reach: i64, at: impl Fn([i64; 2]) -> Option<f64>) -> Self {
        let width = 2 * reach + 1;
        let step = ((width + SIDE_MAX - 1) / SIDE_MAX) | 1;
        let half = step / 2;
        let values = (reach + half) / step;
        let best = |row: i64, column: i64| {
            let around = |value: i64| value * step - half..=value * step + half;
            let shifts =
                around(row).flat_map(|row| around(column).map(move |column| [row, column]));
            shifts.filter_map(&at).max_by(f64::total_cmp)
        };
        let levels = (-values..=values)
            .flat_map(|row| (-values..=values).map(move |column| (row, column)))
            .map(|(row, column)| level(best(row, column)));
        Self {
            step_cells: natural(step),
            reach: natural(values),
            levels: levels.collect(),
        }
    }

    /// Place of a level between similarity 0 and 1; `None` where the similarity is not known.
    #[must_use]
    pub fn share(level: u8) -> Option<f64> {
        let above = level.checked_sub(1)?;
        Some(f64::from(above) / STEPS)
    }

    /// Place of a similarity between 0 and 1: `1 − √(1 − similarity)`.
    #[must_use]
    pub fn share_of(similarity: f64) -> f64 {
        1.0 - (1.0 - similarity.clamp(0.0, 1.0)).sqrt()
    }

    /// Values from side to side.
    #[must_use]
    pub const fn side(&self) -> u32 {
        2 * self.reach + 1
    }
}

fn natural(of: i64) -> u32 {
    u32::try_from(of).unwrap_or_default()
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "between 0 and 254"
)]
fn level(similarity: Option<f64>) -> u8 {
    let of = |similarity: f64| 1 + (STEPS * SimilaritySurface::share_of(similarity)).round() as u8;
    similarity.map_or(0, of)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A peak of 0.9 at row 3, column −5, and no value in column 7.
    fn peak([row, column]: [i64; 2]) -> Option<f64> {
        let far = ((row - 3) as f64).hypot((column + 5) as f64);
        (column != 7).then_some(0.9 - 0.1 * far)
    }

    fn brightest(of: &SimilaritySurface) -> [i64; 2] {
        let side = i64::from(of.side());
        let levels = of.levels.iter().zip(0_i64..);
        let (_, at) = levels.max_by_key(|(level, _)| **level).unwrap();
        [at / side, at % side].map(|of_side| of_side - i64::from(of.reach))
    }

    #[test]
    fn a_search_within_seventy_cells_keeps_every_shift() {
        let of = SimilaritySurface::of(70, peak);
        assert_eq!(
            (of.step_cells, of.side(), of.levels.len()),
            (1, 141, 141 * 141)
        );
        assert_eq!(brightest(&of), [3, -5]);
        let mut levels = of.levels.iter().zip(0..);
        assert!(levels.all(|(level, at)| (*level == 0) == (at % 141 - 70 == 7)));
        // 1 − √0.1 of 254 levels above the first; similarities below 0 are that.
        assert_eq!(of.levels.iter().max(), Some(&175));
        let share = SimilaritySurface::share(175).unwrap();
        assert!((share - (1.0 - 0.1_f64.sqrt())).abs() <= 0.5 / STEPS); // half a level
        assert_eq!(SimilaritySurface::share(of.levels[0]), Some(0.0));
        assert_eq!(SimilaritySurface::share(0), None);
    }

    #[test]
    fn wide_searches_keep_the_best_of_shifts_side_by_side() {
        for reach in [71, 200, 500] {
            let of = SimilaritySurface::of(reach, peak);
            let step = i64::from(of.step_cells);
            assert!(of.side() <= 141 && step % 2 == 1);
            // It holds all shifts, and no row is entirely beyond the search.
            let edge = i64::from(of.reach) * step;
            assert!(edge + step / 2 >= reach && edge - step / 2 <= reach);
            assert_eq!(of.levels.iter().max(), Some(&175));
            let nearest = [3, -5].map(|of: i64| (of + step / 2).div_euclid(step));
            assert_eq!(brightest(&of), nearest);
        }
    }
}
