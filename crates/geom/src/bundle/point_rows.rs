//! The weighted rows of one point in the shared unknowns and in its coordinates, and the elimination of the latter.

use std::ops::Range;

use nalgebra::{DVector, Matrix3, Vector3};

use super::rows::{ImagePartials, Row};

/// Shared unknowns with adjacent columns, in the equations and in a point's rows.
#[derive(Debug, Clone)]
pub(super) struct Run {
    /// Columns in the equations.
    pub(super) columns: Range<usize>,
    /// Position of the first one in the rows.
    pub(super) first: usize,
}

/// The weighted rows of one point: views by twos, then ranges, then its own coordinates if observed.
///
/// It is reused for one point after another, so that its memory is allocated only once.
#[derive(Debug, Clone, Default)]
pub(super) struct PointRows {
    /// Shared unknowns that the rows contain.
    pub(super) runs: Vec<Run>,
    /// Numbers in a row of `beside`: partial derivatives by these unknowns, then the misclosure.
    pub(super) width: usize,
    /// Rows, one after the other.
    pub(super) beside: Vec<f64>,
    /// Partial derivatives by the point.
    pub(super) by_point: Vec<Vector3<f64>>,
    /// Standard deviation and weight factor of each row.
    pub(super) weights: Vec<(f64, f64)>,
    /// Their part of the minimised sum.
    pub(super) cost: f64,
    /// Workspace of [`PointRows::eliminate`].
    sums: Vec<f64>,
}

impl PointRows {
    /// Empties the rows and lays out the unknowns of `columns`.
    pub(super) fn begin(&mut self, columns: impl Iterator<Item = Range<usize>>) {
        self.beside.clear();
        self.by_point.clear();
        self.weights.clear();
        self.cost = 0.0;
        self.runs.clear();
        let columns = columns.filter(|columns| !columns.is_empty());
        self.runs
            .extend(columns.map(|columns| Run { columns, first: 0 }));
        self.runs.sort_unstable_by_key(|run| run.columns.start);
        self.runs.dedup_by_key(|run| run.columns.start);
        let mut first = 0;
        for run in &mut self.runs {
            run.first = first;
            first += run.columns.len();
        }
        self.width = first + 1;
    }

    /// Appends an empty row.
    pub(super) fn push(&mut self, by_point: Vector3<f64>, misclosure: f64, weight: (f64, f64)) {
        self.beside.resize(self.beside.len() + self.width - 1, 0.0);
        self.beside.push(misclosure);
        self.by_point.push(by_point);
        self.weights.push(weight);
    }

    /// Appends a row of an image, divided by its standard deviation.
    pub(super) fn push_observed(&mut self, row: &Row, of_image: &[Option<usize>], factor: f64) {
        let root_weight = factor.sqrt() / row.sigma;
        self.push(
            row.by_point * root_weight,
            row.misclosure * root_weight,
            (row.sigma, factor),
        );
        let partials: ImagePartials = row.by_image();
        for (column, partial) in of_image.iter().zip(&partials) {
            if let Some(column) = column {
                self.set_last(*column, partial * root_weight);
            }
        }
    }

    /// Sets the derivative by the unknown in `column` in the last row.
    pub(super) fn set_last(&mut self, column: usize, value: f64) {
        let last = self.beside.len() - self.width;
        let run = self.runs.iter().find(|run| run.columns.contains(&column));
        if let Some(run) = run {
            self.beside[last + run.first + column - run.columns.start] = value;
        }
    }

    /// Derivatives by the shared unknowns in a row, and its misclosure last.
    pub(super) fn row(&self, row: usize) -> &[f64] {
        &self.beside[row * self.width..(row + 1) * self.width]
    }

    /// Column of each shared unknown in the rows.
    pub(super) fn columns(&self) -> impl Iterator<Item = usize> + '_ {
        self.runs.iter().flat_map(|run| run.columns.clone())
    }

    /// Transforms at least three rows so that the coordinates of the point remain in the first three only, and returns
    /// their triangle `R`.
    ///
    /// `by_point` is consumed; everything else is transformed in place.
    ///
    /// # Source
    /// Householder 1958, Unitary triangularization of a nonsymmetric matrix.
    pub(super) fn eliminate(&mut self) -> Matrix3<f64> {
        let Self {
            by_point,
            beside,
            width,
            sums,
            ..
        } = self;
        let mut triangle = Matrix3::zeros();
        for axis in 0..3 {
            let (above, below) = by_point.split_at_mut(axis);
            let length = below
                .iter()
                .map(|row| row[axis].powi(2))
                .sum::<f64>()
                .sqrt();
            for (row, entry) in above.iter().enumerate() {
                triangle[(row, axis)] = entry[axis];
            }
            if length == 0.0 {
                continue;
            }
            // The mirror's normal replaces the column; its first entry is made large, not small.
            let pivot = below[0][axis];
            let image = -length.copysign(pivot);
            below[0][axis] = pivot - image;
            triangle[(axis, axis)] = image;
            let share = 1.0 / (length * (length + pivot.abs()));
            for later in axis + 1..3 {
                let along: f64 = below.iter().map(|row| row[axis] * row[later]).sum();
                for row in &mut *below {
                    row[later] -= share * along * row[axis];
                }
            }
            sums.clear();
            sums.resize(*width, 0.0);
            let beside = &mut beside[axis * *width..];
            for (normal, row) in below.iter().zip(beside.chunks_exact(*width)) {
                add_multiple(sums, normal[axis], row);
            }
            for (normal, row) in below.iter().zip(beside.chunks_exact_mut(*width)) {
                add_multiple(row, -share * normal[axis], sums);
            }
        }
        triangle
    }

    /// Step of the point that goes with a step of the shared unknowns.
    pub(super) fn point_step_m(&mut self, shared: &DVector<f64>) -> Option<Vector3<f64>> {
        // Misclosures reduced by the shared unknowns; from here on a row is that value only.
        for row in 0..self.weights.len() {
            let at = row * self.width;
            let known: f64 = self
                .runs
                .iter()
                .map(|run| {
                    let partials = &self.beside[at + run.first..][..run.columns.len()];
                    let steps = &shared.as_slice()[run.columns.clone()];
                    partials.iter().zip(steps).map(|(a, b)| a * b).sum::<f64>()
                })
                .sum();
            self.beside[row] = self.beside[at + self.width - 1] - known;
        }
        self.width = 1;
        let triangle = self.eliminate();
        triangle.solve_upper_triangular(&Vector3::from_column_slice(&self.beside[..3]))
    }
}

/// Adds `factor · from` to `to`.
fn add_multiple(to: &mut [f64], factor: f64, from: &[f64]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to += factor * from;
    }
}
