//! Planimetry from relief: heights of points on slopes fit the surface in one position only.

use nalgebra::{DMatrix, Matrix3, MatrixXx2};

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
    let weighted = reduced.weighted_differences();
    let is_shared = |profile: usize| heights.shared.iter().any(|(of, _)| *of == profile);
    let profiles = heights
        .surface
        .relief
        .iter()
        .flat_map(|relief| &relief.profiles);
    let profiles = profiles.filter(|of| !is_shared(of.profile));
    let shift = |of: &ProfileOnRelief| {
        let variances_m2 = Matrix3::from_diagonal(&of.sigma_m.map(|sigma_m| sigma_m.powi(2)));
        let shift_m = variances_m2 * &of.by_shift * &weighted;
        let known = &of.by_shift * left? * of.by_shift.transpose();
        let cofactors_m2 = variances_m2 - variances_m2 * known * variances_m2;
        Some(ProfileShift {
            profile: of.profile,
            shift_m: shift_m.into(),
            root_cofactors_m: cofactors_m2.diagonal().map(f64::sqrt).into(),
        })
    };
    Some(ReliefOfSite {
        sigma_m: sigma_m(layout, settled, heights)?,
        profiles: profiles.filter_map(shift).collect(),
    })
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
