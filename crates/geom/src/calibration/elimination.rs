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

    /// The triangle of the unknowns and its right side; missing rows are zero.
    pub(super) fn finish(mut self) -> (DMatrix<f64>, DVector<f64>) {
        self.fold();
        let mut square = DMatrix::zeros(self.unknowns, self.unknowns + 1);
        let held = self.rows.nrows().min(self.unknowns);
        square.rows_mut(0, held).copy_from(&self.rows.rows(0, held));
        let right = square.column(self.unknowns).into_owned();
        (square.remove_column(self.unknowns), right)
    }
}

/// Rows `[A | −V]` of a point over the free combinations, its coordinates eliminated at its position under `state`.
pub(super) fn reduced_rows(
    point: &GroundPoint,
    state: &CalibrationState,
    freedom: &Freedom,
    place_m: &Vector3<f64>,
) -> Result<DMatrix<f64>, SightError> {
    let known = if point.known.is_some() { 3 } else { 0 };
    let count = 2 * point.sights.len() + known;
    let unknowns = freedom.len();
    let mut by_place = DMatrix::zeros(count, 3);
    let mut rest = DMatrix::zeros(count, unknowns + 1);
    for (index, sight) in point.sights.iter().enumerate() {
        let rows = sight.rows(state, place_m)?;
        by_place.rows_mut(2 * index, 2).copy_from(&rows.by_place);
        let mut into = rest.rows_mut(2 * index, 2);
        into.columns_mut(0, unknowns)
            .copy_from(&freedom.rows(rows.by_parameters));
        into.column_mut(unknowns).copy_from(&-rows.residual);
    }
    if let Some(known) = &point.known {
        let first = count - 3;
        by_place.rows_mut(first, 3).copy_from(&known.whitening);
        let off = known.whitening * (known.place_m - place_m);
        rest.rows_mut(first, 3).column_mut(unknowns).copy_from(&off);
    }
    if count < 3 {
        return Err(SightError::Parallel);
    }
    by_place.qr().q_tr_mul(&mut rest);
    Ok(rest.rows(3, count - 3).into_owned())
}
