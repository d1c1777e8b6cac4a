//! Elimination of each point's coordinates, which leaves equations in the shared unknowns only.
//!
//! An orthogonal transformation of a point's rows leaves its three coordinates in the first three of
//! them. The squares of the other rows sum up to the Schur complement `U − W V⁻¹ Wᵀ`; nothing is
//! subtracted, so nothing is lost to cancellation.

use nalgebra::{DMatrix, DVector, Dyn, Matrix3, OMatrix, U3, Vector3};
use rayon::prelude::*;

use super::{
    Dropped, Network,
    rows::{self, Row},
    unknowns::{Columns, State},
};
use crate::geom::{
    collinearity::BehindCamera, pushbroom::ExteriorOrientation, robust::RobustWeight,
};

/// Parts in which points are summed: fixed, so that the sums do not depend on the number of threads.
const PARTS: usize = 16;
/// A point whose rows determine one direction this much worse than another counts as undetermined.
const DIRECTION_RATIO_MIN: f64 = 1e-6;

/// Which observations belong to each point.
pub(super) struct ByPoint {
    pub(super) views: Vec<Vec<usize>>,
    pub(super) ranges: Vec<Vec<usize>>,
}

impl ByPoint {
    pub(super) fn of<M>(network: &Network<M>) -> Self {
        let mut by_point = Self {
            views: vec![Vec::new(); network.points.len()],
            ranges: vec![Vec::new(); network.points.len()],
        };
        for (index, view) in network.views.iter().enumerate() {
            by_point.views[view.point].push(index);
        }
        for (index, range) in network.ranges.iter().enumerate() {
            by_point.ranges[range.point].push(index);
        }
        by_point
    }
}

/// A network laid out for its adjustment.
pub(super) struct Layout<'a, M> {
    pub(super) network: &'a Network<M>,
    pub(super) columns: Columns,
    pub(super) by_point: ByPoint,
    pub(super) robust: Option<RobustWeight>,
}

/// The weighted rows of one point: views by twos, then ranges, then its own coordinates if observed.
pub(super) struct PointRows {
    /// Shared unknowns that the rows contain, ascending.
    pub(super) columns: Vec<usize>,
    pub(super) by_shared: DMatrix<f64>,
    pub(super) by_point: OMatrix<f64, Dyn, U3>,
    pub(super) misclosures: DVector<f64>,
    /// Standard deviation and weight factor of each row.
    pub(super) weights: Vec<(f64, f64)>,
    /// Their part of the sum that is made small.
    pub(super) cost: f64,
}

/// A point's rows after the transformation.
pub(super) struct Eliminated {
    pub(super) columns: Vec<usize>,
    /// `R` of the coordinates' columns.
    pub(super) triangle: Matrix3<f64>,
    /// Transformed rows of the shared unknowns; the first three go with `triangle`.
    pub(super) by_shared: DMatrix<f64>,
    pub(super) misclosures: DVector<f64>,
}

impl<M: ExteriorOrientation> Layout<'_, M> {
    fn columns_of(&self, point: usize) -> Vec<usize> {
        let views = self.by_point.views[point]
            .iter()
            .map(|view| self.network.views[*view].image);
        let ranges = self.by_point.ranges[point]
            .iter()
            .map(|range| &self.network.ranges[*range]);
        let images = views.chain(ranges.clone().map(|range| range.image));
        let mut columns: Vec<usize> = images
            .flat_map(|image| self.columns.of_image[image])
            .chain(ranges.map(|range| self.columns.of_profile[range.profile]))
            .flatten()
            .collect();
        columns.sort_unstable();
        columns.dedup();
        columns
    }

    /// The rows of `point` at `state`.
    pub(super) fn rows(&self, state: &State, point: usize) -> Result<PointRows, BehindCamera> {
        let (views, ranges) = (&self.by_point.views[point], &self.by_point.ranges[point]);
        let priors = self.network.points[point].sigma_m;
        let count = 2 * views.len() + ranges.len() + 3 * usize::from(priors.is_some());
        let columns = self.columns_of(point);
        let mut rows = PointRows {
            by_shared: DMatrix::zeros(count, columns.len()),
            columns,
            by_point: OMatrix::<f64, Dyn, U3>::zeros(count),
            misclosures: DVector::zeros(count),
            weights: Vec::with_capacity(count),
            cost: 0.0,
        };
        for view in views {
            let view = &self.network.views[*view];
            let pair = rows::of_view(self.network, state, view)?;
            let of_image = &self.columns.of_image[view.image];
            let (factor, cost) = self.robust_factor(&pair);
            rows.cost += cost;
            for row in &pair {
                rows.push(row, of_image, factor);
            }
        }
        for range in ranges {
            let range = &self.network.ranges[*range];
            let row = rows::of_range(self.network, state, range);
            rows.cost += (row.misclosure / row.sigma).powi(2);
            let at = rows.push(&row, &self.columns.of_image[range.image], 1.0);
            if let Some(column) = self.columns.of_profile[range.profile] {
                rows.add(at, column, 1.0 / row.sigma);
            }
        }
        if let Some(sigma_m) = priors {
            let initial_m = self.network.points[point].ground_m;
            for axis in 0..3 {
                let at = rows.weights.len();
                rows.by_point[(at, axis)] = 1.0 / sigma_m[axis];
                rows.misclosures[at] =
                    (initial_m[axis] - state.points_m[point][axis]) / sigma_m[axis];
                rows.cost += rows.misclosures[at].powi(2);
                rows.weights.push((sigma_m[axis], 1.0));
            }
        }
        Ok(rows)
    }

    /// Factor of a view's weights, and its part of the sum that is made small.
    fn robust_factor(&self, pair: &[Row; 2]) -> (f64, f64) {
        let squares: f64 = pair
            .iter()
            .map(|row| (row.misclosure / row.sigma).powi(2))
            .sum();
        match self.robust {
            None => (1.0, squares),
            Some(weight) => {
                let z = (0.5 * squares).sqrt();
                (weight.factor(z), 4.0 * weight.cost(z))
            }
        }
    }

    /// The rows of `point` with its coordinates eliminated, and its part of the sum.
    pub(super) fn eliminate(
        &self,
        state: &State,
        point: usize,
    ) -> Result<(Eliminated, f64), BehindCamera> {
        let mut rows = self.rows(state, point)?;
        let decomposition = rows.by_point.qr();
        decomposition.q_tr_mul(&mut rows.by_shared);
        decomposition.q_tr_mul(&mut rows.misclosures);
        let eliminated = Eliminated {
            columns: rows.columns,
            triangle: Matrix3::from(decomposition.unpack_r().fixed_view::<3, 3>(0, 0)),
            by_shared: rows.by_shared,
            misclosures: rows.misclosures,
        };
        Ok((eliminated, rows.cost))
    }

    /// Why `point` cannot take part, from its rows at the start.
    pub(super) fn fitness(&self, state: &State, point: usize) -> Result<(), Dropped> {
        let rows = self.rows(state, point).map_err(|_| Dropped::BehindCamera)?;
        if rows.weights.len() < 3 {
            return Err(Dropped::Undetermined);
        }
        let singular_values = rows.by_point.singular_values();
        // Written so that NaN is refused.
        if singular_values.min() > DIRECTION_RATIO_MIN * singular_values.max() {
            Ok(())
        } else {
            Err(Dropped::Undetermined)
        }
    }
}

impl PointRows {
    /// Appends a row of an image divided by its standard deviation, and says where.
    fn push(&mut self, row: &Row, of_image: &[Option<usize>], factor: f64) -> usize {
        let at = self.weights.len();
        let root_weight = factor.sqrt() / row.sigma;
        for (column, partial) in of_image.iter().zip(&row.by_image) {
            if let Some(column) = column {
                self.add(at, *column, root_weight * partial);
            }
        }
        self.by_point
            .row_mut(at)
            .copy_from(&(root_weight * row.by_point));
        self.misclosures[at] = root_weight * row.misclosure;
        self.weights.push((row.sigma, factor));
        at
    }

    fn add(&mut self, row: usize, column: usize, value: f64) {
        if let Ok(local) = self.columns.binary_search(&column) {
            self.by_shared[(row, local)] += value;
        }
    }
}

impl Eliminated {
    /// Step of the point that goes with a step of the shared unknowns.
    pub(super) fn point_step_m(&self, shared: &DVector<f64>) -> Option<Vector3<f64>> {
        let mut right = Vector3::from(self.misclosures.fixed_rows::<3>(0));
        for (local, column) in self.columns.iter().enumerate() {
            right -= self.by_shared.fixed_view::<3, 1>(0, local) * shared[*column];
        }
        self.triangle.solve_upper_triangular(&right)
    }
}

/// Reduced normal equations at a state.
#[derive(Clone)]
pub(super) struct Reduced {
    /// Lower triangle.
    pub(super) matrix: DMatrix<f64>,
    pub(super) right: DVector<f64>,
    /// The sum that is made small.
    pub(super) cost: f64,
}

impl Reduced {
    fn zeros(columns: usize) -> Self {
        Self {
            matrix: DMatrix::zeros(columns, columns),
            right: DVector::zeros(columns),
            cost: 0.0,
        }
    }

    fn add(&mut self, point: &Eliminated, cost: f64) {
        self.cost += cost;
        let rows = point.by_shared.nrows() - 3;
        if rows == 0 {
            return;
        }
        let misclosures = point.misclosures.rows(3, rows);
        for (first, first_column) in point.columns.iter().enumerate() {
            let partials = point.by_shared.view((3, first), (rows, 1));
            self.right[*first_column] += partials.dot(&misclosures);
            for (second, second_column) in point.columns.iter().enumerate().skip(first) {
                self.matrix[(*second_column, *first_column)] +=
                    partials.dot(&point.by_shared.view((3, second), (rows, 1)));
            }
        }
    }
}

/// Sums up the points of `active` and the initial values of the shared unknowns.
pub(super) fn reduce<M: ExteriorOrientation>(
    layout: &Layout<'_, M>,
    state: &State,
    active: &[usize],
) -> Result<Reduced, BehindCamera> {
    let columns = layout.columns.len();
    let part_len = active.len().div_ceil(PARTS).max(1);
    let parts: Vec<Reduced> = active
        .par_chunks(part_len)
        .map(|points| {
            let mut part = Reduced::zeros(columns);
            for point in points {
                let (eliminated, cost) = layout.eliminate(state, *point)?;
                part.add(&eliminated, cost);
            }
            Ok(part)
        })
        .collect::<Result<_, BehindCamera>>()?;
    let mut sum = Reduced::zeros(columns);
    for part in parts {
        sum.matrix += part.matrix;
        sum.right += part.right;
        sum.cost += part.cost;
    }
    for (column, sigma) in layout.columns.sigmas.iter().enumerate() {
        // Infinite standard deviations weigh nothing.
        let weight = sigma.powi(-2);
        let correction = state.corrections[column];
        sum.matrix[(column, column)] += weight;
        sum.right[column] -= weight * correction;
        sum.cost += weight * correction * correction;
    }
    Ok(sum)
}
