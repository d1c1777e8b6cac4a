//! Covariances, residuals, redundancy numbers and correlations of the settled adjustment.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix3xX, Vector3};
use rayon::prelude::*;

use super::{
    AdjustedImage, AdjustedPoint, Adjustment, ORIENTATION_UNKNOWNS, PointRejection, Residual,
    layout::Layout,
    point_rows::PointRows,
    reduce::Settled,
    reduced_heights::ReducedHeights,
    unknowns::{State, Unknown},
};
use crate::geom::pushbroom::ExteriorOrientation;

/// Correlations above this are reported.
const CORRELATION_REPORTED: f64 = 0.95;

/// What one point contributes: its estimate, and a residual for each of its rows.
struct Judged {
    point: AdjustedPoint,
    residuals: Vec<Residual>,
}

/// What observed heights do to the points that carry them.
struct Controls {
    /// Index among the heights of each point that has one.
    of_point: Vec<Option<usize>>,
    /// `u` of each.
    turned: Vec<Vector3<f64>>,
    /// `Σ⁻¹`.
    weights: DMatrix<f64>,
    /// `Q Gᵀ Σ⁻¹`, one column a height, and `Gᵀ Σ⁻¹`.
    through: DMatrix<f64>,
    weighted: DMatrix<f64>,
}

/// What an observed height does to its point.
struct Control<'a> {
    turned: &'a Vector3<f64>,
    weight: f64,
    through: &'a [f64],
    /// `Σ⁻¹ G Q Gᵀ Σ⁻¹` of it.
    fed_back: f64,
}

impl Controls {
    fn of(reduced: &ReducedHeights, points: &[usize], of: usize, cofactors: &DMatrix<f64>) -> Self {
        let mut of_point = vec![None; of];
        for (index, point) in points.iter().enumerate() {
            of_point[*point] = Some(index);
        }
        let weighted = reduced.weighted().transpose();
        Self {
            of_point,
            turned: reduced.turned.clone(),
            weights: reduced.weights(),
            through: cofactors * &weighted,
            weighted,
        }
    }

    fn of_point(&self, point: usize) -> Option<Control<'_>> {
        let index = self.of_point[point]?;
        let through = column_of(&self.through, index);
        Some(Control {
            turned: &self.turned[index],
            weight: self.weights[(index, index)],
            fed_back: dot(through, column_of(&self.weighted, index)),
            through,
        })
    }
}

/// The adjustment where it has settled; observations, unknowns and history are left to the caller.
pub(super) fn judge<M: ExteriorOrientation>(
    layout: &Layout<'_, M>,
    Settled { state, reduced }: &Settled,
    fitness: &[Result<(), PointRejection>],
    cofactors: &DMatrix<f64>,
) -> Adjustment {
    let heights = layout.heights.as_ref().zip(reduced.heights.as_ref());
    let controls =
        heights.map(|(of, reduced)| Controls::of(reduced, &of.points, fitness.len(), cofactors));
    let judged: Vec<Result<Judged, PointRejection>> = (0..fitness.len())
        .into_par_iter()
        .map_init(Default::default, |room, point| {
            fitness[point]?;
            judge_point(layout, state, point, cofactors, controls.as_ref(), room)
                .ok_or(PointRejection::Undetermined)
        })
        .collect();
    let mut adjustment = Adjustment {
        images: (0..layout.network.images.len())
            .map(|image| judge_image(layout, state, image, cofactors))
            .collect(),
        points: Vec::with_capacity(judged.len()),
        views: vec![None; layout.network.views.len()],
        ranges: vec![None; layout.network.ranges.len()],
        range_biases_m: layout
            .columns
            .of_profile
            .iter()
            .map(|column| column.map(|column| estimate(state, cofactors, column)))
            .collect(),
        heights: heights.map_or_else(Vec::new, |(of, reduced)| reduced.residuals(of, cofactors)),
        compared: Vec::new(),
        height_squares: 0.0,
        mean_cofactor_m2: None,
        observations: 0,
        unknowns: 0,
        weighted_squares: 0.0,
        history: Vec::new(),
        correlated: correlated(layout, cofactors),
    };
    for (index, entry) in judged.into_iter().enumerate() {
        adjustment.points.push(entry.map(|judged| {
            let squares = judged.residuals.iter().map(Residual::weighted_square);
            adjustment.weighted_squares += squares.sum::<f64>();
            let mut residuals = judged.residuals.into_iter();
            for view in layout.views.of_key(index) {
                adjustment.views[*view] =
                    residuals.next().zip(residuals.next()).map(<[_; 2]>::from);
            }
            for range in layout.ranges.of_key(index) {
                adjustment.ranges[*range] = residuals.next();
            }
            judged.point
        }));
    }
    for (column, sigma) in layout.columns.sigmas.iter().enumerate() {
        adjustment.weighted_squares += (state.corrections[column] / sigma).powi(2);
    }
    if let Some((of, reduced)) = heights {
        adjustment.height_squares = reduced.weighted_squares();
        adjustment.weighted_squares += adjustment.height_squares;
        adjustment.mean_cofactor_m2 =
            mean_cofactor_m2(layout, state, &of.points, cofactors, controls.as_ref());
    }
    adjustment
}

/// Room for one point, used again for the next.
#[derive(Default)]
struct Room {
    rows: PointRows,
    transformed: PointRows,
    /// Cofactors between the point, transformed by its triangle, and the shared unknowns of its rows.
    between: Vec<Vector3<f64>>,
}

fn judge_point<M: ExteriorOrientation>(
    layout: &Layout<'_, M>,
    state: &State,
    point: usize,
    cofactors: &DMatrix<f64>,
    controls: Option<&Controls>,
    room: &mut Room,
) -> Option<Judged> {
    let Room {
        rows,
        transformed,
        between,
    } = room;
    layout.fill(rows, state, point).ok()?;
    layout.fill(transformed, state, point).ok()?;
    let inverse = transformed.eliminate().try_inverse()?;
    let coupling = [0, 1, 2].map(|row| transformed.row(row));
    between.clear();
    between.extend(rows.columns().map(|column| {
        let cofactors = column_of(cofactors, column);
        Vector3::from(coupling.map(|coupling| {
            let runs = rows.runs.iter();
            runs.map(|run| dot(&cofactors[run.columns.clone()], &coupling[run.first..]))
                .sum()
        }))
    }));
    // Cofactors of the point transformed by its triangle: what its rays leave open, what the shared unknowns add, and
    // what an observed height takes away.
    let mut transformed_cofactor = Matrix3::identity();
    for (place, between) in between.iter().enumerate() {
        transformed_cofactor += between * Vector3::from(coupling.map(|row| row[place])).transpose();
    }
    if let Some(control) = controls.and_then(|of| of.of_point(point)) {
        let through = Vector3::from(coupling.map(|row| {
            let columns = rows.columns().zip(row);
            columns
                .map(|(column, partial)| partial * control.through[column])
                .sum()
        }));
        let mixed = through * control.turned.transpose();
        let own = control.turned * control.turned.transpose();
        transformed_cofactor +=
            mixed + mixed.transpose() + own * (control.fed_back - control.weight);
        for (between, column) in between.iter_mut().zip(rows.columns()) {
            *between += control.turned * control.through[column];
        }
    }
    let residuals: Vec<Residual> = (0..rows.weights.len())
        .map(|row| {
            // What the point does to the row, what the shared unknowns do, and what both do together.
            let own = inverse.tr_mul(&rows.by_point[row]);
            let mut leverage = own.dot(&(transformed_cofactor * own));
            let partials = rows.row(row);
            let of_row = || {
                let places = rows.columns().zip(partials).zip(&*between);
                places.filter(|((_, partial), _)| **partial != 0.0)
            };
            for (index, ((column, partial), between)) in of_row().enumerate() {
                let cofactors = column_of(cofactors, column);
                let before: f64 = of_row()
                    .take(index)
                    .map(|((column, partial), _)| cofactors[column] * partial)
                    .sum();
                leverage += partial
                    * (2.0 * before + cofactors[column] * partial - 2.0 * between.dot(&own));
            }
            residual_of(rows, row, leverage)
        })
        .collect();
    let priors = layout.network.points[point]
        .known
        .and_then(|_| residuals.last_chunk::<3>().copied());
    Some(Judged {
        point: AdjustedPoint {
            ground_m: state.points_m[point],
            cofactor_m2: inverse * transformed_cofactor * inverse.transpose(),
            priors,
        },
        residuals,
    })
}

/// Cofactors of the mean of `points`: what their rays leave open averages out, what they share does not.
fn mean_cofactor_m2<M: ExteriorOrientation>(
    layout: &Layout<'_, M>,
    state: &State,
    points: &[usize],
    cofactors: &DMatrix<f64>,
    controls: Option<&Controls>,
) -> Option<Matrix3<f64>> {
    let columns = layout.columns.len();
    let mut own_m2 = Matrix3::zeros();
    let mut by_shared = Matrix3xX::zeros(columns);
    let mut moves = Matrix3xX::zeros(points.len());
    let mut rows = PointRows::default();
    for (index, point) in points.iter().enumerate() {
        layout.fill(&mut rows, state, *point).ok()?;
        let inverse = rows.eliminate().try_inverse()?;
        own_m2 += inverse * inverse.transpose();
        for (place, column) in rows.columns().enumerate() {
            let coupling = Vector3::new(rows.row(0)[place], rows.row(1)[place], rows.row(2)[place]);
            let mut shared = by_shared.column_mut(column);
            shared -= inverse * coupling;
        }
        if let Some(controls) = controls {
            moves.set_column(index, &(inverse * controls.turned[index]));
        }
    }
    if let Some(controls) = controls {
        own_m2 -= &moves * &controls.weights * moves.transpose();
        by_shared -= &moves * controls.weighted.transpose();
    }
    let count = points.len() as f64;
    let sum_m2 = own_m2 + &by_shared * cofactors * by_shared.transpose();
    (count > 0.0).then(|| sum_m2 / (count * count))
}

/// A column of a matrix.
fn column_of(matrix: &DMatrix<f64>, column: usize) -> &[f64] {
    &matrix.as_slice()[column * matrix.nrows()..(column + 1) * matrix.nrows()]
}

/// Sum of products, as far as the first reaches.
fn dot(first: &[f64], second: &[f64]) -> f64 {
    first.iter().zip(second).map(|(a, b)| a * b).sum()
}

fn residual_of(rows: &PointRows, row: usize, leverage: f64) -> Residual {
    let (sigma, weight_factor) = rows.weights[row];
    let misclosure = rows.row(row)[rows.width - 1];
    Residual {
        value: misclosure * sigma / weight_factor.sqrt(),
        sigma,
        // Rounding may leave it a little outside.
        redundancy: (1.0 - leverage).clamp(0.0, 1.0),
        weight_factor,
    }
}

/// Correction and square root of the cofactor of a column.
fn estimate(state: &State, cofactors: &DMatrix<f64>, column: usize) -> (f64, f64) {
    (
        state.corrections[column],
        cofactors[(column, column)].sqrt(),
    )
}

fn judge_image<M: ExteriorOrientation>(
    layout: &Layout<'_, M>,
    state: &State,
    image: usize,
    cofactors: &DMatrix<f64>,
) -> AdjustedImage {
    let columns = &layout.columns.of_image[image];
    let between = |row: usize, column: usize| match (columns[row], columns[column]) {
        (Some(row), Some(column)) => cofactors[(row, column)],
        _ => 0.0,
    };
    let prior = |column: usize| {
        let sigma = layout.columns.sigmas[column];
        sigma.is_finite().then(|| Residual {
            value: -state.corrections[column],
            sigma,
            redundancy: (1.0 - cofactors[(column, column)] / sigma.powi(2)).clamp(0.0, 1.0),
            weight_factor: 1.0,
        })
    };
    AdjustedImage {
        correction: state.orientations[image],
        cofactors: DMatrix::from_fn(ORIENTATION_UNKNOWNS, ORIENTATION_UNKNOWNS, between),
        priors: std::array::from_fn(|coefficient| columns[coefficient].and_then(prior)),
        time_bias_s: columns[ORIENTATION_UNKNOWNS].map(|column| estimate(state, cofactors, column)),
    }
}

fn correlated<M: ExteriorOrientation>(
    layout: &Layout<'_, M>,
    cofactors: &DMatrix<f64>,
) -> Vec<(Unknown, Unknown, f64)> {
    let deviations: DVector<f64> = cofactors.diagonal().map(f64::sqrt);
    let mut pairs = Vec::new();
    for first in 0..deviations.len() {
        for second in first + 1..deviations.len() {
            let coefficient = cofactors[(second, first)] / (deviations[first] * deviations[second]);
            if coefficient.abs() > CORRELATION_REPORTED {
                let unknowns = &layout.columns.unknowns;
                pairs.push((unknowns[first], unknowns[second], coefficient));
            }
        }
    }
    pairs
}
