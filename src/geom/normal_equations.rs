//! Normal equations scaled to unit diagonal and solved by Cholesky.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, SymmetricEigen};

/// Smallest pivot of the scaled matrix: what is left of an unknown once all others are known, as a
/// share of its own information. Rounding of a few hundred unknowns leaves about 1e-14.
const PIVOT_MIN: f64 = 1e-12;
/// Unknowns that a message names.
const NAMED_MAX: usize = 4;

/// Unknowns that the observations do not separate, or do not touch.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Singular {
    /// Indices of the unknowns in the weakest combination, the strongest first, four at most.
    pub unknowns: Vec<usize>,
}

/// A factorised symmetric positive definite matrix.
#[derive(Debug, Clone)]
pub struct ScaledCholesky {
    factor: Cholesky<f64, Dyn>,
    /// `1/√diagonal` of the matrix.
    scale: DVector<f64>,
}

impl ScaledCholesky {
    /// Factorises `matrix`, of which the lower triangle is read.
    ///
    /// # Errors
    /// The matrix is not positive definite to working precision.
    pub fn new(mut matrix: DMatrix<f64>) -> Result<Self, Singular> {
        let scale = matrix.diagonal().map(|diagonal| 1.0 / diagonal.sqrt());
        let untouched: Vec<usize> = (0..scale.len())
            .filter(|index| !scale[*index].is_finite())
            .take(NAMED_MAX)
            .collect();
        if !untouched.is_empty() {
            return Err(Singular {
                unknowns: untouched,
            });
        }
        for column in 0..matrix.ncols() {
            for row in column..matrix.nrows() {
                matrix[(row, column)] *= scale[row] * scale[column];
                matrix[(column, row)] = matrix[(row, column)];
            }
        }
        match Cholesky::new(matrix.clone()) {
            Some(factor)
                if factor
                    .l_dirty()
                    .diagonal()
                    .iter()
                    .all(|pivot| pivot * pivot > PIVOT_MIN) =>
            {
                Ok(Self { factor, scale })
            }
            _ => Err(weakest_combination(matrix)),
        }
    }

    /// The solution of `matrix · x = right`.
    #[must_use]
    pub fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        let scaled = right.component_mul(&self.scale);
        self.factor.solve(&scaled).component_mul(&self.scale)
    }

    /// The inverse of the matrix.
    #[must_use]
    pub fn inverse(&self) -> DMatrix<f64> {
        let mut inverse = self.factor.inverse();
        for column in 0..inverse.ncols() {
            for row in 0..inverse.nrows() {
                inverse[(row, column)] *= self.scale[row] * self.scale[column];
            }
        }
        inverse
    }
}

fn weakest_combination(matrix: DMatrix<f64>) -> Singular {
    if matrix.iter().any(|value| !value.is_finite()) {
        return Singular {
            unknowns: Vec::new(),
        };
    }
    let eigen = SymmetricEigen::new(matrix);
    let vector = eigen.eigenvectors.column(eigen.eigenvalues.imin());
    let mut unknowns: Vec<usize> = (0..vector.len())
        .filter(|index| vector[*index].abs() > 0.1)
        .collect();
    unknowns.sort_by(|a, b| vector[*b].abs().total_cmp(&vector[*a].abs()));
    unknowns.truncate(NAMED_MAX);
    Singular { unknowns }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn badly_scaled_equations_are_solved() {
        // Two unknowns in units twelve powers of ten apart.
        let matrix = DMatrix::from_row_slice(2, 2, &[4e12, 1.0, 1.0, 1e-12]);
        let truth = DVector::from_column_slice(&[3e-6, 2e6]);
        let factor = ScaledCholesky::new(matrix.clone()).unwrap();
        let solution = factor.solve(&(&matrix * &truth));
        for index in 0..2 {
            assert!((solution[index] / truth[index] - 1.0).abs() < 1e-14); // rounding
        }
        let identity = &matrix * factor.inverse();
        assert!((identity[(0, 0)] - 1.0).abs() < 1e-14 && (identity[(1, 1)] - 1.0).abs() < 1e-14);
    }

    #[test]
    fn the_unknowns_of_a_singular_system_are_named() {
        // The first and the third unknown occur only as their sum.
        let matrix = DMatrix::from_row_slice(3, 3, &[2.0, 0.0, 2.0, 0.0, 1.0, 0.0, 2.0, 0.0, 2.0]);
        let mut unknowns = ScaledCholesky::new(matrix).unwrap_err().unknowns;
        unknowns.sort_unstable();
        assert_eq!(unknowns, [0, 2]);
        let untouched = DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 0.0, 0.0]);
        assert_eq!(ScaledCholesky::new(untouched).unwrap_err().unknowns, [1]);
        let broken = DMatrix::from_row_slice(2, 2, &[1.0, f64::NAN, f64::NAN, 1.0]);
        assert!(ScaledCholesky::new(broken).is_err());
    }
}
