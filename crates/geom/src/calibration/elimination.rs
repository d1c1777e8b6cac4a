//! Rows of points over the parameters, the points' own coordinates eliminated by reflections.

use nalgebra::{DMatrix, DVector, Vector3};

use super::{
    camera::CalibrationState,
    freedom::Freedom,
    sight::{GroundPoint, SightError},
};

/// Rows collected before they are folded into a triangle.
const ROWS_MAX: usize = 2_048;

/// Rows `[A | l]` with the squares of all rows that were added: an upper triangle.
#[derive(Debug, Clone)]
pub(super) struct Triangle {
    unknowns: usize,
    rows: DMatrix<f64>,
    waiting: Vec<DMatrix<f64>>,
    waiting_rows: usize,
    /// Number of rows added, and the accumulated squares of their remaining right sides.
    pub(super) count: usize,
}

impl Triangle {
    pub(super) fn new(unknowns: usize) -> Self {
        Self {
            unknowns,
            rows: DMatrix::zeros(0, unknowns + 1),
            waiting: Vec::new(),
            waiting_rows: 0,
            count: 0,
        }
    }

    /// Adds rows `[A | l]`.
    pub(super) fn add(&mut self, rows: DMatrix<f64>) {
        self.count += rows.nrows();
        self.waiting_rows += rows.nrows();
        self.waiting.push(rows);
        if self.waiting_rows >= ROWS_MAX {
            self.fold();
        }
    }

    fn fold(&mut self) {
        let mut all = DMatrix::zeros(self.rows.nrows() + self.waiting_rows, self.unknowns + 1);
        let mut at = 0;
        for rows in std::iter::once(&self.rows).chain(&self.waiting) {
            all.rows_mut(at, rows.nrows()).copy_from(rows);
            at += rows.nrows();
        }
        self.rows = all.qr().r();
        self.waiting.clear();
        self.waiting_rows = 0;
    }

    /// The triangle of the unknowns, its right side, and the sum of the squares that no unknown reduces; missing rows are zero.
    pub(super) fn finish(mut self) -> (DMatrix<f64>, DVector<f64>, f64) {
        self.fold();
        let mut square = DMatrix::zeros(self.unknowns, self.unknowns + 1);
        let held = self.rows.nrows().min(self.unknowns);
        square.rows_mut(0, held).copy_from(&self.rows.rows(0, held));
        let right = square.column(self.unknowns).into_owned();
        let left = self.rows.column(self.unknowns);
        let left = left.rows_range(held..).norm_squared();
        (square.remove_column(self.unknowns), right, left)
    }
}

/// Rows `[A | −V]` of a point over the free combinations, its coordinates eliminated at its position under `state`.
pub(super) fn reduced_rows(
    point: &GroundPoint,
    state: &CalibrationState,
    freedom: &Freedom,
    place_m: &Vector3<f64>,
) -> Result<DMatrix<f64>, SightError> {
    let unknowns = freedom.len();
    let Rows {
        by_place,
        by_parameters,
        residuals,
    } = Rows::of(point, state, freedom, place_m)?;
    let mut rest = by_parameters.insert_column(unknowns, 0.0);
    rest.column_mut(unknowns).copy_from(&-residuals);
    let count = rest.nrows();
    by_place.qr().q_tr_mul(&mut rest);
    Ok(rest.rows(3, count - 3).into_owned())
}

/// Changes of the right sides of the normal equations of a control point by shifts of its known position, columns.
pub(super) fn response(
    point: &GroundPoint,
    state: &CalibrationState,
    freedom: &Freedom,
    place_m: &Vector3<f64>,
    shifts_m: &[Vector3<f64>; 3],
) -> Result<DMatrix<f64>, SightError> {
    let rows = Rows::of(point, state, freedom, place_m)?;
    let count = rows.by_place.nrows();
    let mut shifted = DMatrix::zeros(count, shifts_m.len());
    if let Some(known) = &point.known {
        for (column, shift_m) in shifts_m.iter().enumerate() {
            let mut into = shifted.column_mut(column);
            into.rows_mut(count - 3, 3)
                .copy_from(&(known.whitening * shift_m));
        }
    }
    let mut by_parameters = rows.by_parameters;
    let reflections = rows.by_place.qr();
    reflections.q_tr_mul(&mut by_parameters);
    reflections.q_tr_mul(&mut shifted);
    let below = |of: &DMatrix<f64>| of.rows(3, count - 3).into_owned();
    Ok(below(&by_parameters).tr_mul(&below(&shifted)))
}

/// All rows of a point, over their standard deviations; those of its known position are last.
struct Rows {
    by_place: DMatrix<f64>,
    by_parameters: DMatrix<f64>,
    residuals: DVector<f64>,
}

impl Rows {
    fn of(
        point: &GroundPoint,
        state: &CalibrationState,
        freedom: &Freedom,
        place_m: &Vector3<f64>,
    ) -> Result<Self, SightError> {
        let known = if point.known.is_some() { 3 } else { 0 };
        let count = 2 * point.sights.len() + known;
        if count < 3 {
            return Err(SightError::Parallel);
        }
        let mut of = Self {
            by_place: DMatrix::zeros(count, 3),
            by_parameters: DMatrix::zeros(count, freedom.len()),
            residuals: DVector::zeros(count),
        };
        for (index, sight) in point.sights.iter().enumerate() {
            let rows = sight.rows(state, place_m)?;
            of.by_place.rows_mut(2 * index, 2).copy_from(&rows.by_place);
            of.by_parameters
                .rows_mut(2 * index, 2)
                .copy_from(&freedom.rows(rows.by_parameters));
            of.residuals
                .rows_mut(2 * index, 2)
                .copy_from(&rows.residual);
        }
        if let Some(known) = &point.known {
            let first = count - 3;
            of.by_place.rows_mut(first, 3).copy_from(&known.whitening);
            let off = known.whitening * (place_m - known.place_m);
            of.residuals.rows_mut(first, 3).copy_from(&off);
        }
        Ok(of)
    }
}
