//! Planimetry from relief: heights of points on slopes fit the surface in one position only.

use nalgebra::{DMatrix, DVector, MatrixXx2};

use super::{
    factor::Factor, heights::Heights, layout::Layout, reduce::Settled,
    reduced_heights::ReducedHeights,
};
use crate::{pushbroom::ExteriorOrientation, surface::ProfileOnRelief};

/// Planimetric information from the relief of a site.
#[derive(Debug, Clone, PartialEq)]
pub struct ReliefOfSite {
    /// Standard deviations in east and north of the position of the images against the surface from heights only,
    /// metres, whether they are used for it or not.
    pub sigma_m: [f64; 2],
    /// Shifts of the profiles, when heights are used for it, without profiles whose shift is a separate unknown.
    pub profiles: Vec<ProfileShift>,
}

/// Offset between the recorded and the true position of a profile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProfileShift {
    /// Index of the profile.
    pub profile: usize,
    /// Offset in east, north and height, metres.
    pub shift_m: [f64; 3],
    /// Square roots of the cofactors of these, metres.
    pub root_cofactors_m: [f64; 3],
}

/// The relief under `heights`; `left` is the inverse of the covariance of their differences, given all other
/// information.
pub(super) fn of_site<M: ExteriorOrientation>(
    layout: &Layout<'_, M>,
    settled: &Settled,
    heights: &Heights,
    left: Option<&DMatrix<f64>>,
) -> Option<ReliefOfSite> {
    let reduced = settled.reduced.heights.as_ref()?;
    Some(ReliefOfSite {
        sigma_m: sigma_m(layout, settled, heights)?,
        profiles: left.map_or_else(Vec::new, |left| {
            shifts(heights, &reduced.weighted_differences(), left)
        }),
    })
}

/// Shifts of the profiles of the surface whose shift is not a separate unknown.
///
/// * `weighted` – differences times the inverse of their covariance
/// * `left` – as in [`of_site`]
fn shifts(heights: &Heights, weighted: &DVector<f64>, left: &DMatrix<f64>) -> Vec<ProfileShift> {
    let Some(relief) = &heights.surface.relief else {
        return Vec::new();
    };
    let is_shared = |profile: usize| heights.shared.iter().any(|(of, _)| *of == profile);
    let profiles = relief.profiles.iter().enumerate();
    let profiles: Vec<(usize, &ProfileOnRelief)> =
        profiles.filter(|(_, of)| !is_shared(of.profile)).collect();
    let rows = profiles
        .iter()
        .flat_map(|(at, _)| [0, 1, 2].map(|axis| 3 * at + axis));
    let rows: Vec<usize> = rows.collect();
    let before_m2 = relief
        .covariance_m2
        .select_rows(&rows)
        .select_columns(&rows);
    let mut by_shift = DMatrix::zeros(rows.len(), weighted.len());
    for (row, (_, of)) in profiles.iter().enumerate() {
        by_shift.rows_mut(3 * row, 3).copy_from(&of.by_shift);
    }
    let by_covariance = &before_m2 * &by_shift;
    let shifts_m = &by_covariance * weighted;
    let known = left * by_covariance.transpose();
    let of_profile = |(row, (_, of)): (usize, &(usize, &ProfileOnRelief))| ProfileShift {
        profile: of.profile,
        shift_m: [0, 1, 2].map(|axis| {
            let removed_m = if axis < 2 { of.removed_m[axis] } else { 0.0 };
            removed_m + shifts_m[3 * row + axis]
        }),
        root_cofactors_m: [0, 1, 2].map(|axis| {
            let at = 3 * row + axis;
            let known_m2 = by_covariance.row(at).transpose().dot(&known.column(at));
            // Rounding may leave the variance of a shift that is known exactly a little below 0.
            (before_m2[(at, at)] - known_m2).max(0.0).sqrt()
        }),
    };
    profiles.iter().enumerate().map(of_profile).collect()
}

/// Standard deviation of a shift common to all points from heights only: their differences are uncertain by rays,
/// surface and a priori orientations.
fn sigma_m<M: ExteriorOrientation>(
    layout: &Layout<'_, M>,
    settled: &Settled,
    heights: &Heights,
) -> Option<[f64; 2]> {
    let plain = ReducedHeights::of(layout, &heights.without_plan(), &settled.at, true).ok()?;
    let factor = Factor::new(&settled.reduced.matrix, Some(&plain)).ok()?;
    let (_, weights) = factor.through_heights()?;
    let slopes = &heights.surface.slopes;
    let by_shift = MatrixXx2::from_fn(slopes.len(), |place, axis| slopes[place][axis]);
    let information = by_shift.tr_mul(&(weights * &by_shift));
    let cofactors_m2 = information.try_inverse()?;
    let sigma_m = [0, 1].map(|axis| cofactors_m2[(axis, axis)].sqrt());
    sigma_m
        .iter()
        .all(|sigma_m| sigma_m.is_finite())
        .then_some(sigma_m)
}
