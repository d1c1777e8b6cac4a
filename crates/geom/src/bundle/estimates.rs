//! Single unknowns of the converged adjustment: their values, cofactors and expected values.

use nalgebra::Matrix2;

use super::{AdjustedBus, Estimate, Residual, layout::Layout, unknowns::State};
use crate::block_equations::BlockMatrix;

/// Correction and square root of the cofactor of a column.
pub(super) fn estimate(state: &State, cofactors: &BlockMatrix, column: usize) -> (f64, f64) {
    (
        state.corrections[column],
        variance(cofactors, column).sqrt(),
    )
}

fn variance(cofactors: &BlockMatrix, column: usize) -> f64 {
    cofactors.element(column, column).unwrap_or_default()
}

/// Residual of the expected value of an unknown, where that has a weight.
pub(super) fn prior<M>(
    layout: &Layout<'_, M>,
    state: &State,
    cofactors: &BlockMatrix,
    column: usize,
) -> Option<Residual> {
    let sigma = layout.columns.sigmas[column];
    let terms = layout.columns.prior_terms(column);
    let products = terms.clone().flat_map(|(row, factor)| {
        terms.clone().map(move |(other, of_other)| {
            factor * of_other * cofactors.element(row, other).unwrap_or_default()
        })
    });
    let share = products.sum::<f64>() / sigma.powi(2);
    sigma.is_finite().then(|| Residual {
        value: -layout.columns.off_prior(&state.corrections, column),
        sigma,
        redundancy: (1.0 - share).clamp(0.0, 1.0),
        weight_factor: 1.0,
    })
}

/// Estimates of laser and profiles; residuals of spots are added later.
pub(super) fn of_bus<M>(
    layout: &Layout<'_, M>,
    state: &State,
    cofactors: &BlockMatrix,
) -> Option<AdjustedBus> {
    let bus = layout.network.common_bus.as_ref()?;
    let columns = &layout.columns;
    let found = |column: usize| {
        let (value, root_cofactor) = estimate(state, cofactors, column);
        let prior = prior(layout, state, cofactors, column);
        Estimate {
            value,
            root_cofactor,
            prior,
        }
    };
    let or_held = |column: Option<usize>| column.map(found).unwrap_or_default();
    let times = columns.line_time_of_image.iter();
    let shifts = columns.shift_of_profile.iter();
    let boresight = columns.boresight;
    let boresight_cofactors = Matrix2::from_fn(|row, column| {
        let both = boresight[row].zip(boresight[column]);
        let element = both.and_then(|(row, column)| cofactors.element(row, column));
        element.unwrap_or_default()
    });
    let angle = |axis: usize| {
        let held = Estimate {
            value: bus.boresight.angles_rad[axis],
            ..Estimate::default()
        };
        boresight[axis].map_or(held, found)
    };
    Some(AdjustedBus {
        boresight_rad: [0, 1].map(angle),
        boresight_cofactors,
        line_times_s: times.map(|column| column.map(found)).collect(),
        profile_shifts_m: shifts.map(|shift| shift.map(or_held)).collect(),
        spots: vec![None; bus.spots.len()],
    })
}
