//! Covariances, residuals, redundancy numbers and correlations of the settled adjustment.

use nalgebra::{DMatrix, DVector, Matrix3};
use rayon::prelude::*;

use super::{
    AdjustedImage, AdjustedPoint, Adjustment, Dropped, ORIENTATION_UNKNOWNS, Residual,
    eliminate::{Layout, PointRows},
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

/// The adjustment at `state`; observations, unknowns and history are left to the caller.
pub(super) fn judge<M: ExteriorOrientation>(
    layout: &Layout<'_, M>,
    state: &State,
    fitness: &[Result<(), Dropped>],
    cofactors: &DMatrix<f64>,
) -> Adjustment {
    let judged: Vec<Result<Judged, Dropped>> = (0..fitness.len())
        .into_par_iter()
        .map(|point| {
            fitness[point]?;
            judge_point(layout, state, point, cofactors).ok_or(Dropped::Undetermined)
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
            for view in &layout.by_point.views[index] {
                adjustment.views[*view] =
                    residuals.next().zip(residuals.next()).map(<[_; 2]>::from);
            }
            for range in &layout.by_point.ranges[index] {
                adjustment.ranges[*range] = residuals.next();
            }
            judged.point
        }));
    }
    for (column, sigma) in layout.columns.sigmas.iter().enumerate() {
        adjustment.weighted_squares += (state.corrections[column] / sigma).powi(2);
    }
    adjustment
}

fn judge_point<M: ExteriorOrientation>(
    layout: &Layout<'_, M>,
    state: &State,
    point: usize,
    cofactors: &DMatrix<f64>,
) -> Option<Judged> {
    let rows = layout.rows(state, point).ok()?;
    let (eliminated, _) = layout.eliminate(state, point).ok()?;
    let inverse = eliminated.triangle.try_inverse()?;
    let local = DMatrix::from_fn(rows.columns.len(), rows.columns.len(), |row, column| {
        cofactors[(rows.columns[row], rows.columns[column])]
    });
    let coupling = eliminated.by_shared.rows(0, 3);
    let through_shared =
        Matrix3::from((coupling * &local * coupling.transpose()).fixed_view::<3, 3>(0, 0));
    let cofactor_m2 = inverse * (Matrix3::identity() + through_shared) * inverse.transpose();
    // Each row without its point: what the shared unknowns alone do to it.
    let points_part = &rows.by_point * inverse;
    let shared_part = &rows.by_shared - &points_part * coupling;
    let spread = &shared_part * local;
    let residuals: Vec<Residual> = (0..rows.weights.len())
        .map(|row| {
            let leverage =
                points_part.row(row).norm_squared() + spread.row(row).dot(&shared_part.row(row));
            residual_of(&rows, row, leverage)
        })
        .collect();
    let priors = layout.network.points[point]
        .sigma_m
        .and_then(|_| residuals.last_chunk::<3>().copied());
    Some(Judged {
        point: AdjustedPoint {
            ground_m: state.points_m[point],
            cofactor_m2,
            priors,
        },
        residuals,
    })
}

fn residual_of(rows: &PointRows, row: usize, leverage: f64) -> Residual {
    let (sigma, weight_factor) = rows.weights[row];
    Residual {
        value: rows.misclosures[row] * sigma / weight_factor.sqrt(),
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

fn judge_image<M>(
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

fn correlated<M>(layout: &Layout<'_, M>, cofactors: &DMatrix<f64>) -> Vec<(Unknown, Unknown, f64)> {
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
