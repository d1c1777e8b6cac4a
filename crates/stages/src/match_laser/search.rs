//! The shift at which the heights of a unit fit the model best: all shifts by whole cells, then between them.

use super::{
    shots::Shot,
    similarity::{Moments, Similarity},
    surface::SimilaritySurface,
};
use areograph_geom::height_grid::HeightGrid;

/// Share of a unit's points that must have a height in the model, at every shift that counts.
const COVERED: f64 = 0.9;
/// Largest ratio of the relief of model and laser, either way: heights in kilometres have a thousandth of the relief.
const RELIEF: f64 = 2.0;

/// The best shift of a unit, of all within some cells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Best {
    /// Shift of the model against the laser, rows (southwards) and columns (eastwards), between whole cells.
    pub(super) shift: [f64; 2],
    /// Similarity at the nearest whole cells.
    pub(super) score: f64,
    /// Similarity over the mean of all similarities above 0.
    pub(super) contrast: f64,
    /// Whether the best whole cells are at the border of all shifts, or of the shifts for which the model has heights.
    pub(super) at_border: bool,
}

/// Similarities at all shifts within `reach` cells.
struct Surface {
    reach: i64,
    scores: Vec<Option<f64>>,
}

impl Surface {
    fn of(grid: &HeightGrid, shots: &[&Shot], measure: Similarity, reach: i64) -> Self {
        let shifts =
            (-reach..=reach).flat_map(|row| (-reach..=reach).map(move |column| [row, column]));
        let moved = Moved::of(shots);
        let scores = shifts.map(|shift| moved.moments(grid, shift)?.similarity(measure));
        Self {
            reach,
            scores: scores.collect(),
        }
    }

    fn at(&self, [row, column]: [i64; 2]) -> Option<f64> {
        let width = 2 * self.reach + 1;
        let within = |of: i64| (-self.reach..=self.reach).contains(&of);
        if !(within(row) && within(column)) {
            return None;
        }
        let index = (row + self.reach) * width + column + self.reach;
        self.scores.get(usize::try_from(index).ok()?).copied()?
    }

    /// The best of all; of equal ones the first.
    fn best(&self) -> Option<Best> {
        let mut best: Option<([i64; 2], f64)> = None;
        let (mut sum, mut count) = (0.0, 0.0);
        for row in -self.reach..=self.reach {
            for column in -self.reach..=self.reach {
                let Some(score) = self.at([row, column]) else {
                    continue;
                };
                if score > 0.0 {
                    (sum, count) = (sum + score, count + 1.0);
                }
                if best.is_none_or(|(_, so_far)| score > so_far) {
                    best = Some(([row, column], score));
                }
            }
        }
        let (at, score) = best?;
        let around =
            [-1, 0, 1].map(|row| [-1, 0, 1].map(|column| self.at([at[0] + row, at[1] + column])));
        let between = vertex(&around);
        let [row, column] = between.unwrap_or_default();
        Some(Best {
            shift: [at[0] as f64 + row, at[1] as f64 + column],
            score,
            contrast: if sum > 0.0 { score * count / sum } else { 0.0 },
            at_border: between.is_none(),
        })
    }
}

/// Maximum of the quadratic through a value and its neighbours, rows and columns from the middle, at most 1; the middle
/// itself where it has no maximum. Where shots lie on parallel passes, peaks are ridges: rows and columns are
/// correlated.
fn vertex(around: &[[Option<f64>; 3]; 3]) -> Option<[f64; 2]> {
    let [
        [north_west, north, north_east],
        [west, middle, east],
        [south_west, south, south_east],
    ] = *around;
    let ([north, south], [west, east]) = ([north?, south?], [west?, east?]);
    let middle = middle?;
    let slope = [0.5 * (south - north), 0.5 * (east - west)];
    let bend = [south - 2.0 * middle + north, east - 2.0 * middle + west];
    let twist = 0.25 * (south_east? - south_west? - north_east? + north_west?);
    let determinant = bend[0] * bend[1] - twist * twist;
    if !(bend[0] < 0.0 && determinant > 0.0) {
        return Some([0.0; 2]);
    }
    let at = [
        (twist * slope[1] - bend[1] * slope[0]) / determinant,
        (twist * slope[0] - bend[0] * slope[1]) / determinant,
    ];
    Some(if at.iter().all(|of| of.abs() <= 1.0) {
        at
    } else {
        [0.0; 2]
    })
}

/// Shots with heights relative to their mean.
struct Moved<'a> {
    shots: &'a [&'a Shot],
    mean_m: f64,
    needed: f64,
}

impl<'a> Moved<'a> {
    fn of(shots: &'a [&'a Shot]) -> Self {
        let count = shots.len() as f64;
        Self {
            shots,
            mean_m: shots.iter().map(|shot| shot.height_m).sum::<f64>() / count,
            needed: COVERED * count,
        }
    }

    /// Moments at a shift by whole cells, where the model has enough heights.
    fn moments(&self, grid: &HeightGrid, shift: [i64; 2]) -> Option<Moments> {
        self.taken(|shot| grid.probed_m(&shot.probe, shift))
    }

    fn taken(&self, height_m: impl Fn(&Shot) -> Option<f64>) -> Option<Moments> {
        let mut moments = Moments::default();
        for shot in self.shots {
            if let Some(height_m) = height_m(shot) {
                moments.add(height_m - self.mean_m, shot.height_m - self.mean_m);
            }
        }
        (moments.count() >= self.needed.max(1.0)).then_some(moments)
    }
}

/// Finds the best shift of `shots` within `reach` cells; `None` where the model covers no shift.
pub(super) fn find(
    grid: &HeightGrid,
    shots: &[&Shot],
    measure: Similarity,
    reach: u32,
) -> Option<Best> {
    Surface::of(grid, shots, measure, i64::from(reach)).best()
}

/// Similarities of `shots` at all shifts within `reach` cells, for pictures.
pub(super) fn surface(
    grid: &HeightGrid,
    shots: &[&Shot],
    measure: Similarity,
    reach: u32,
) -> SimilaritySurface {
    let surface = Surface::of(grid, shots, measure, i64::from(reach));
    SimilaritySurface::of(surface.reach, |shift| surface.at(shift))
}

/// Moments at a shift between cells; `None` where the model covers too few shots.
pub(super) fn moments(grid: &HeightGrid, shots: &[&Shot], shift: [f64; 2]) -> Option<Moments> {
    Moved::of(shots).taken(|shot| shifted_m(grid, shot, shift))
}

/// Height of the model at a shifted shot.
pub(super) fn shifted_m(grid: &HeightGrid, shot: &Shot, shift: [f64; 2]) -> Option<f64> {
    grid.height_m([shot.cell[0] + shift[0], shot.cell[1] + shift[1]])
}

/// Root mean square of model minus laser at `shots`, with a shift, about `bias_m`.
pub(super) fn rms_m(
    grid: &HeightGrid,
    shots: &[&Shot],
    shift: [f64; 2],
    bias_m: f64,
) -> Option<f64> {
    let off_m = shots
        .iter()
        .filter_map(|shot| Some(shifted_m(grid, shot, shift)? - shot.height_m - bias_m));
    let squares: Vec<f64> = off_m.map(|off_m| off_m * off_m).collect();
    let is_covered = squares.len() as f64 >= (COVERED * shots.len() as f64).max(1.0);
    is_covered.then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}

/// Whether model and laser have relief of similar size.
pub(super) fn is_one_relief(moments: &Moments) -> bool {
    let [model, laser] = moments.variances();
    let ratio = (model / laser).sqrt();
    (RELIEF.recip()..=RELIEF).contains(&ratio)
}

#[cfg(test)]
mod tests {
    use super::*;
    use areograph_geom::height_grid::Probe;

    const SIZE: usize = 120;

    /// Ground without nearby repetition: waves of incommensurable lengths, in cells.
    fn ground_m(row: f64, column: f64) -> f64 {
        let waves = [
            [0.11, 0.05, 300.0],
            [-0.04, 0.13, 250.0],
            [0.21, -0.17, 90.0],
        ];
        waves
            .iter()
            .map(|[down, right, high_m]| high_m * (down * row + right * column).sin())
            .sum()
    }

    #[allow(
        clippy::cast_possible_truncation,
        reason = "heights keep a tenth of a millimetre"
    )]
    fn grid(height_m: impl Fn(f64, f64) -> f64) -> HeightGrid {
        let cells =
            (0..SIZE).flat_map(|row| (0..SIZE).map(move |column| [row as f64, column as f64]));
        HeightGrid {
            size: [SIZE; 2],
            first_rad: [1.0, 0.05],
            cell_rad: [1e-4; 2],
            radius_m: 3_396_190.0,
            heights_m: cells
                .map(|[row, column]| height_m(row, column) as f32)
                .collect(),
        }
    }

    /// Shots on two crossing lines about the middle, with the heights of the ground.
    fn shots() -> Vec<Shot> {
        let places = (0..40_u8).map(|index| {
            let along = f64::from(index % 20) * 1.3;
            if index < 20 {
                [46.2 + along, 52.4 + 0.2 * along]
            } else {
                [46.7 + along, 61.8 - 0.3 * along]
            }
        });
        places
            .map(|cell| Shot {
                name: String::new(),
                tag_s: 0.0,
                longitude_rad: 0.0,
                latitude_rad: 0.0,
                radius_m: 0.0,
                height_m: ground_m(cell[0], cell[1]),
                cell,
                probe: Probe::at(cell),
                plan_m: [0.0; 2],
                track: 0,
            })
            .collect()
    }

    const MEASURES: [Similarity; 3] = [
        Similarity::Ccc,
        Similarity::Pearson,
        Similarity::CccBiasRemoved,
    ];

    #[test]
    fn a_model_shifted_by_whole_cells_gives_exactly_that() {
        // 12 cells to the east and 7 to the south.
        let model = grid(|row, column| ground_m(row - 7.0, column - 12.0));
        let shots = shots();
        let shots: Vec<&Shot> = shots.iter().collect();
        for measure in MEASURES {
            let best = find(&model, &shots, measure, 20);
            assert!(
                best.is_some_and(|best| {
                    // A quadratic approximates the peak, interpolated heights the ground: tenths of a cell.
                    (best.shift[0] - 7.0).hypot(best.shift[1] - 12.0) < 0.25
                        && best.score > 0.99
                        && !best.at_border
                }),
                "{measure:?}: {best:?}"
            );
        }
    }

    #[test]
    fn what_lies_between_cells_is_found() {
        let model = grid(|row, column| ground_m(row + 3.4, column - 5.7));
        let shots = shots();
        let shots: Vec<&Shot> = shots.iter().collect();
        let best = find(&model, &shots, Similarity::Ccc, 20);
        // A quadratic approximates the peak, a ridge as the passes are nearly parallel: tenths of a cell.
        assert!(
            best.is_some_and(|best| (best.shift[0] + 3.4).hypot(best.shift[1] - 5.7) < 0.2),
            "{best:?}"
        );
    }

    #[test]
    fn a_peak_at_the_border_is_reported() {
        let model = grid(|row, column| ground_m(row - 7.0, column - 12.0));
        let shots = shots();
        let shots: Vec<&Shot> = shots.iter().collect();
        let best = find(&model, &shots, Similarity::Pearson, 7);
        assert!(best.is_some_and(|best| best.at_border), "{best:?}");
        // No height beyond column 80: the model ends where the best shift would be.
        let cut = grid(|row, column| {
            if column > 72.0 {
                f64::NAN
            } else {
                ground_m(row - 7.0, column - 12.0)
            }
        });
        let best = find(&cut, &shots, Similarity::Pearson, 20);
        assert!(
            best.is_none_or(|best| best.at_border || best.shift[1] < 11.0),
            "{best:?}"
        );
    }

    #[test]
    fn flat_ground_has_no_best_shift() {
        let shots = shots();
        let shots: Vec<&Shot> = shots.iter().collect();
        let flat = grid(|_, _| 120.0);
        assert_eq!(find(&flat, &shots, Similarity::Pearson, 5), None);
        let none = grid(|_, _| f64::NAN);
        assert_eq!(find(&none, &shots, Similarity::Ccc, 5), None);
    }

    #[test]
    fn relief_in_kilometres_is_another_relief() {
        let shots = shots();
        let shots: Vec<&Shot> = shots.iter().collect();
        let relief = |factor: f64| {
            let model = grid(|row, column| factor * ground_m(row, column));
            moments(&model, &shots, [0.0; 2]).is_some_and(|moments| is_one_relief(&moments))
        };
        assert!(relief(1.0) && relief(0.7) && !relief(0.001));
    }

    #[test]
    fn held_out_shots_fit_at_the_shift_alone() {
        let model = grid(|row, column| 80.0 + ground_m(row - 7.0, column - 12.0));
        let shots = shots();
        let shots: Vec<&Shot> = shots.iter().collect();
        let rms = |shift| rms_m(&model, &shots, shift, 80.0).unwrap_or(f64::NAN);
        // Bilinear heights of waves 30 cells long miss by a few metres; unshifted ones by hundreds.
        assert!(rms([7.0, 12.0]) < 5.0 && rms([0.0, 0.0]) > 200.0);
    }
}
