//! Expected values of unknowns in dense form, for comparison.

use nalgebra::DVector;

use super::{layout::Layout, unknowns::Unknown};
use crate::{block_equations::BlockMatrix, pushbroom::EulerPolynomial};

/// The row of an unknown minus its expected value, of `width` columns: the shift of a profile follows an image.
pub(super) fn prior_row(
    layout: &Layout<'_, EulerPolynomial>,
    column: usize,
    width: usize,
) -> DVector<f64> {
    let mut row = DVector::zeros(width);
    row[column] = 1.0;
    if let Unknown::ProfileShift { profile, axis } = layout.columns.unknowns[column] {
        let bus = layout.network.common_bus.as_ref().unwrap();
        if let Some(shared) = bus.profiles[profile].shared {
            let roll = Unknown::Orientation {
                image: shared.image,
                coefficient: 9,
            };
            let roll = layout.columns.unknowns.iter().position(|of| *of == roll);
            row[roll.unwrap()] = -shared.by_rotation_m[axis];
        }
    }
    if layout.columns.unknowns[column] == (Unknown::Boresight { axis: 1 }) {
        let bus = layout.network.common_bus.as_ref().unwrap();
        let first = Unknown::Boresight { axis: 0 };
        let first = layout.columns.unknowns.iter().position(|of| *of == first);
        let covariance = &bus.boresight.covariance_rad2;
        row[first.unwrap()] = -covariance[(0, 1)] / covariance[(0, 0)];
    }
    row
}

/// Expected value of that difference.
pub(super) fn expected(layout: &Layout<'_, EulerPolynomial>, column: usize) -> f64 {
    let Unknown::Boresight { axis } = layout.columns.unknowns[column] else {
        return 0.0;
    };
    let bus = layout.network.common_bus.as_ref().unwrap();
    let row = prior_row(layout, column, layout.columns.len());
    let of = |axis| Unknown::Boresight { axis };
    (0..=axis)
        .map(|axis| {
            let unknowns = &layout.columns.unknowns;
            let place = unknowns.iter().position(|unknown| *unknown == of(axis));
            row[place.unwrap()] * bus.boresight.angles_rad[axis]
        })
        .sum()
}

/// Variance of an unknown minus its expected value, of the cofactors of all shared unknowns.
pub(super) fn prior_variance(
    layout: &Layout<'_, EulerPolynomial>,
    cofactors: &BlockMatrix,
    column: usize,
) -> f64 {
    let row = prior_row(layout, column, layout.columns.len());
    let products = row.iter().enumerate().flat_map(|(of, factor)| {
        row.iter().enumerate().map(move |(other, of_other)| {
            factor * of_other * cofactors.element(of, other).unwrap_or_default()
        })
    });
    products.sum()
}
