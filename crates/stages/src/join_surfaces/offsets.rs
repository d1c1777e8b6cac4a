//! Offsets of terrain models of pairs against each other, by their overlap and by the altimeter.

use nalgebra::{DMatrix, DVector};

use areograph_geom::statistics::Summary;

/// Bands of an overlap whose scatter shows the uncertainty of its offset: at most, and at least.
const BANDS_MAX: usize = 16;
const BANDS_MIN: usize = 4;
/// Fewer cells determine no offset.
pub(super) const CELLS_MIN: usize = 100;
/// Standard deviation of the mean of all offsets about 0, metres: the level of the site remains that of the adjustment.
const LEVEL_SIGMA_M: f64 = 1e-3;
/// Standard deviation of an offset for which nothing else is stated, metres: as images before an adjustment have.
const UNKNOWN_M: f64 = 100.0;

/// An offset with its standard deviation, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Offset {
    pub(super) offset_m: f64,
    pub(super) sigma_m: f64,
}

/// A difference between the heights of two models in a cell.
#[derive(Debug, Clone, Copy)]
pub(super) struct Difference {
    pub(super) row: usize,
    pub(super) above_m: f64,
    /// Its stated standard deviation.
    pub(super) sigma_m: f64,
}

impl Offset {
    /// The offset of an overlap, from its cells row by row; `None` for too few of them. Neighbouring differences have common
    /// errors, of the compared square and of jitter along the lines, so that the scatter of wide bands shows the
    /// uncertainty of their mean. `rows` is the number of rows of the compared square.
    pub(super) fn of_overlap(cells: &[Difference], rows: usize) -> Option<Self> {
        if cells.len() < CELLS_MIN {
            return None;
        }
        let [first, last] = [cells.first()?.row, cells.last()?.row];
        let bands = ((last - first + 1) / (2 * rows).max(1)).clamp(1, BANDS_MAX);
        let band = |cell: &Difference| (cell.row - first) * bands / (last - first + 1);
        let medians: Vec<(f64, f64)> = cells
            .chunk_by(|one, other| band(one) == band(other))
            .map(|cells| {
                let above_m: Vec<f64> = cells.iter().map(|cell| cell.above_m).collect();
                (Summary::of(&above_m).median, cells.len() as f64)
            })
            .collect();
        let count = cells.len() as f64;
        let offset_m = medians.iter().map(|(of, n)| of * n).sum::<f64>() / count;
        let square_m2 = cells.iter().map(|cell| cell.sigma_m.powi(2)).sum::<f64>() / count;
        if medians.len() < BANDS_MIN {
            let sigma_m = square_m2.sqrt();
            return Some(Self { offset_m, sigma_m });
        }
        let scatter = medians.iter().map(|(of, n)| (n * (of - offset_m)).powi(2));
        let n = medians.len() as f64;
        let scatter_m2 = scatter.sum::<f64>() / (count * count) * n / (n - 1.0);
        // Each band is compared at least as well as one of its cells would be in an average of bands.
        let least_m2 = square_m2 / count;
        let sigma_m = scatter_m2.max(least_m2).sqrt();
        Some(Self { offset_m, sigma_m })
    }
}

/// What is known of a model.
#[derive(Debug, Clone, Copy)]
pub(super) struct Known {
    /// Number of its heights.
    pub(super) cells: u32,
    /// Standard deviation of its level by the adjustment, metres.
    pub(super) level_sigma_m: Option<f64>,
    /// The altimeter above it.
    pub(super) shots: Option<Offset>,
}

/// Offsets of all models above their common level, and their covariance, square metres.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Levels {
    pub(super) offsets_m: Vec<f64>,
    pub(super) covariance_m2: DMatrix<f64>,
}

impl Levels {
    /// By least squares, from `seams`: indices of two models, and the first above the second. The altimeter has one offset
    /// from all models, so that it determines differences between models only.
    ///
    /// `None` for numbers that are not finite.
    pub(super) fn of(models: &[Known], seams: &[([usize; 2], Offset)]) -> Option<Self> {
        let count = models.len();
        let mut equations = Equations::new(count + 1);
        let total: f64 = models.iter().map(|model| f64::from(model.cells)).sum();
        let mut level = vec![0.0; count + 1];
        for (index, model) in models.iter().enumerate() {
            let mut own = vec![0.0; count + 1];
            own[index] = 1.0;
            let sigma_m = model.level_sigma_m.unwrap_or(UNKNOWN_M);
            equations.observe(
                &own,
                Offset {
                    offset_m: 0.0,
                    sigma_m,
                },
            );
            if let Some(shots) = model.shots {
                // The altimeter above the model is its common offset minus that of the model.
                own[index] = -1.0;
                own[count] = 1.0;
                equations.observe(&own, shots);
            }
            level[index] = f64::from(model.cells) / total.max(1.0);
        }
        for ([one, other], offset) in seams {
            let mut seam = vec![0.0; count + 1];
            (seam[*one], seam[*other]) = (1.0, -1.0);
            equations.observe(&seam, *offset);
        }
        let sigma_m = LEVEL_SIGMA_M;
        equations.observe(
            &level,
            Offset {
                offset_m: 0.0,
                sigma_m,
            },
        );
        // Without shots, nothing else determines the offset of the altimeter.
        let mut of_shots = vec![0.0; count + 1];
        of_shots[count] = 1.0;
        let sigma_m = 1e3 * UNKNOWN_M;
        equations.observe(
            &of_shots,
            Offset {
                offset_m: 0.0,
                sigma_m,
            },
        );
        let (offsets_m, covariance_m2) = equations.solved()?;
        Some(Self {
            offsets_m: offsets_m.iter().take(count).copied().collect(),
            covariance_m2: covariance_m2.view((0, 0), (count, count)).into_owned(),
        })
    }
}

struct Equations {
    normals: DMatrix<f64>,
    right: DVector<f64>,
}

impl Equations {
    fn new(unknowns: usize) -> Self {
        Self {
            normals: DMatrix::zeros(unknowns, unknowns),
            right: DVector::zeros(unknowns),
        }
    }

    fn observe(&mut self, of: &[f64], Offset { offset_m, sigma_m }: Offset) {
        let of = DVector::from_column_slice(of);
        // No offset is known better than the level, which keeps the weights finite.
        let weight = sigma_m.max(LEVEL_SIGMA_M).powi(-2);
        self.normals += weight * &of * of.transpose();
        self.right += weight * offset_m * of;
    }

    /// Every unknown has an observation of its own, so that the matrix of finite numbers is positive definite.
    fn solved(self) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let factor = self.normals.cholesky()?;
        Some((factor.solve(&self.right), factor.inverse()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known(shots: Option<Offset>) -> Known {
        Known {
            cells: 1_000,
            level_sigma_m: Some(5.0),
            shots,
        }
    }

    fn offset(offset_m: f64, sigma_m: f64) -> Offset {
        Offset { offset_m, sigma_m }
    }

    #[test]
    fn overlaps_and_shots_determine_differences_and_not_the_level() {
        // Two models that overlap, and a third that only the altimeter connects; all shots lie 30 m above the site.
        let models = [
            known(Some(offset(26.0, 0.5))),
            known(Some(offset(34.0, 0.5))),
            known(Some(offset(30.0, 0.5))),
        ];
        let seams = [([0, 1], offset(8.0, 0.1))];
        let levels = Levels::of(&models, &seams).expect("finite numbers");
        // Between observation and the a priori level, metres.
        for (found_m, expected_m) in levels.offsets_m.iter().zip([4.0, -4.0, 0.0]) {
            assert!((found_m - expected_m).abs() < 0.1, "{:?}", levels.offsets_m);
        }
        let of_difference_m2 = |one: usize, other: usize| {
            let c = &levels.covariance_m2;
            c[(one, one)] + c[(other, other)] - 2.0 * c[(one, other)]
        };
        // The overlap, and the shots of two models, of which one is the mean of two.
        assert!((of_difference_m2(0, 1).sqrt() - 0.1).abs() < 0.01);
        assert!((0.5..0.72).contains(&of_difference_m2(0, 2).sqrt()));
    }

    #[test]
    fn the_scatter_of_bands_is_the_uncertainty_of_an_overlap() {
        // Waves along the rows, as jitter makes them, of 40 rows and an amplitude of 2 m, and a step of 12 m.
        let difference = |at: usize| Difference {
            row: at / 20,
            above_m: 12.0 + 2.0 * (std::f64::consts::TAU * (at / 20) as f64 / 37.0).sin(),
            sigma_m: 1.5,
        };
        let cells: Vec<Difference> = (0..800 * 20).map(difference).collect();
        let found = Offset::of_overlap(&cells, 5).expect("there are enough cells");
        assert!((found.offset_m - 12.0).abs() < 3.0 * found.sigma_m);
        // Independent cells would give 0.01 m, and one cell 1.5 m.
        assert!((0.02..0.5).contains(&found.sigma_m), "{found:?}");
        assert_eq!(Offset::of_overlap(&cells[..50], 5), None);
        let few = Offset::of_overlap(&cells[..200], 5).expect("as above");
        assert!((few.sigma_m - 1.5).abs() < 1e-9);
    }
}
