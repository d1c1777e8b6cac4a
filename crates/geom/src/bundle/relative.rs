//! Points against the error that they share: the shift of their profile, or the error of the mean of the points with an
//! observed height.
//!
//! Positions have common errors that averaging does not reduce. The variance of a difference from the mean is
//! `var(P) + var(mean) − 2 cov(P, mean)`; it is not the variance of the point less the variance of the mean, since the
//! orientation moves points at the two ends of an image differently.

use nalgebra::{DMatrix, Matrix3, Matrix3xX, MatrixXx3, Vector3};
use rayon::prelude::*;

use super::{
    AdjustedPoint, PointRejection,
    factor::Factor,
    layout::{Layout, Linearised},
    point_rows::PointRows,
    reduced_heights::ReducedHeights,
};
use crate::pushbroom::ExteriorOrientation;

/// The mean of the points with an observed height.
pub(super) struct Mean {
    /// Its cofactors, m²: the part that rays leave undetermined averages out, the common part does not.
    pub(super) cofactor_m2: Matrix3<f64>,
    count: f64,
    /// Index among the heights of each point that has one.
    of_point: Vec<Option<usize>>,
    /// Motion of each of these points with its height, one column each.
    moves: Matrix3xX<f64>,
    /// `Σ⁻¹` times these, one row per height, and `Σ⁻¹G`.
    weighted_moves: MatrixXx3<f64>,
    weighted: DMatrix<f64>,
    /// Cofactors between the shared unknowns and the sum of the points.
    through: MatrixXx3<f64>,
}

impl Mean {
    pub(super) fn of<M: ExteriorOrientation>(
        layout: &Layout<'_, M>,
        at: &Linearised,
        points: &[usize],
        factor: &Factor,
        heights: &ReducedHeights,
    ) -> Option<Self> {
        if points.is_empty() {
            return None;
        }
        let columns = layout.columns.len();
        let mut own_m2 = Matrix3::zeros();
        let mut by_shared = Matrix3xX::zeros(columns);
        let mut moves = Matrix3xX::zeros(points.len());
        let mut of_point = vec![None; layout.network.points.len()];
        let mut rows = PointRows::default();
        for (index, point) in points.iter().enumerate() {
            layout.fill(&mut rows, at, *point).ok()?;
            let inverse = rows.eliminate().try_inverse()?;
            own_m2 += inverse * inverse.transpose();
            for (place, column) in rows.columns().enumerate() {
                let mut shared = by_shared.column_mut(column);
                shared -= inverse * coupling(&rows, place);
            }
            moves.set_column(index, &(inverse * heights.turned[index]));
            of_point[*point] = Some(index);
        }
        let weighted_moves = heights.weights() * moves.transpose();
        let weighted = heights.weighted();
        own_m2 -= &moves * &weighted_moves;
        by_shared -= &moves * &weighted;
        let mut through = MatrixXx3::zeros(columns);
        for axis in 0..3 {
            through.set_column(axis, &factor.solve(&by_shared.row(axis).transpose()));
        }
        let count = points.len() as f64;
        Some(Self {
            cofactor_m2: (own_m2 + by_shared * &through) / (count * count),
            count,
            of_point,
            moves,
            weighted_moves,
            weighted,
            through,
        })
    }

    /// Cofactors between the mean and a shared unknown, by its column.
    pub(super) fn with_unknown(&self, column: usize) -> Vector3<f64> {
        self.through.row(column).transpose() / self.count
    }

    /// Change of the mean with an error of each observed height, of either sign: one column per height.
    pub(super) fn by_height(&self) -> Matrix3xX<f64> {
        let moves = &self.weighted_moves + &self.weighted * &self.through;
        moves.transpose() / self.count
    }

    /// States the accuracy of all points that no profile records, relative to the mean.
    pub(super) fn compare<M: ExteriorOrientation>(
        &self,
        layout: &Layout<'_, M>,
        at: &Linearised,
        points: &mut [Result<AdjustedPoint, PointRejection>],
    ) {
        let compared = |rows: &mut PointRows, (index, point): (usize, &mut Result<_, _>)| {
            let point: Option<&mut AdjustedPoint> = point.as_mut().ok();
            if let Some(point) = point.filter(|point| point.relative_m2.is_none()) {
                let between_m2 = self.between_m2(layout, at, index, rows);
                point.relative_m2 = between_m2.map(|between_m2| {
                    point.cofactor_m2 + self.cofactor_m2 - between_m2 - between_m2.transpose()
                });
            }
        };
        points
            .par_iter_mut()
            .enumerate()
            .for_each_init(PointRows::default, compared);
    }

    /// Cofactors between a point and the mean.
    fn between_m2<M: ExteriorOrientation>(
        &self,
        layout: &Layout<'_, M>,
        at: &Linearised,
        point: usize,
        rows: &mut PointRows,
    ) -> Option<Matrix3<f64>> {
        layout.fill(rows, at, point).ok()?;
        let inverse = rows.eliminate().try_inverse()?;
        let mut sum_m2 = Matrix3::zeros();
        for (place, column) in rows.columns().enumerate() {
            sum_m2 -= inverse * coupling(rows, place) * self.through.row(column);
        }
        if let Some(height) = self.of_point[point] {
            let moves = self.moves.column(height);
            let pull = self.weighted_moves.row(height) + self.weighted.row(height) * &self.through;
            sum_m2 += inverse * inverse.transpose() - moves * pull;
        }
        Some(sum_m2 / self.count)
    }
}

/// The transformed rows of a point in one of their shared unknowns.
fn coupling(rows: &PointRows, place: usize) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| rows.row(axis)[place])
}

/// Change of the cofactors of a point when they refer to the shift of its profile, m²; `None` for a point that no
/// profile with an unknown shift records.
///
/// * `cofactors` – of the shared unknowns in `rows`, whose order they have
/// * `between` – cofactors of the point and one of these
pub(super) fn against_profile<M: ExteriorOrientation>(
    layout: &Layout<'_, M>,
    point: usize,
    rows: &PointRows,
    cofactors: &DMatrix<f64>,
    between: impl Fn(usize) -> Vector3<f64>,
) -> Option<Matrix3<f64>> {
    let (axes, columns) = layout.shift_of(point)?;
    let places = columns.map(|column| rows.columns().position(|of| Some(of) == column));
    let solved = (0..3).filter_map(|axis| Some((axes.row(axis).transpose(), places[axis]?)));
    let solved: Vec<(Vector3<f64>, usize)> = solved.collect();
    let mut added_m2 = Matrix3::zeros();
    for (towards, place) in &solved {
        // The record is the point plus the shift.
        let mixed = between(*place) * towards.transpose();
        added_m2 += mixed + mixed.transpose();
        for (other, column) in &solved {
            added_m2 += towards * other.transpose() * cofactors[(*place, *column)];
        }
    }
    (!solved.is_empty()).then_some(added_m2)
}
