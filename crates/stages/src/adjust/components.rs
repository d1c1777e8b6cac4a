//! Agreement of tie points with their standard deviations.

use super::{network::Assembled, points::PointKind};
use areograph_geom::bundle::{Adjustment, Residual};

/// `sqrt(weighted squares / redundancy)`, 0 without redundancy.
pub(super) fn component(weighted_squares: f64, redundancy: f64) -> f64 {
    if redundancy > 0.0 {
        (weighted_squares / redundancy).sqrt()
    } else {
        0.0
    }
}

/// Weighted squares and redundancy of tie points along and across the track.
fn tie_sums<M>(assembled: &Assembled<M>, adjustment: &Adjustment) -> [(f64, f64); 2] {
    let views = assembled.network.views.iter().zip(&adjustment.views);
    let ties = views.filter(|(view, _)| assembled.kind(view.point) == PointKind::Tie);
    let residuals: Vec<[Residual; 2]> = ties.filter_map(|(_, residuals)| *residuals).collect();
    [0, 1].map(|axis| {
        let of_axis = || residuals.iter().map(|pair| &pair[axis]);
        let squares = of_axis().map(Residual::weighted_square).sum();
        (squares, of_axis().map(|residual| residual.redundancy).sum())
    })
}

/// Standard deviation of unit weight of tie points along and across the track.
pub(super) fn tie_components<M>(assembled: &Assembled<M>, adjustment: &Adjustment) -> [f64; 2] {
    tie_sums(assembled, adjustment).map(|(squares, redundancy)| component(squares, redundancy))
}

/// Largest standard deviation of unit weight that chance explains for some hundred tie points.
pub const WORSE_THAN_CONFIGURED: f64 = 1.12;
/// Number of its own standard deviations, `1/√(2r)`, by which a standard deviation of unit weight may exceed 1 by
/// chance.
const BY_CHANCE: f64 = 2.0;

/// Factor by which covariances scale the a priori variances.
pub(super) fn variance_factor<M>(assembled: &Assembled<M>, adjustment: &Adjustment) -> f64 {
    let factors = tie_sums(assembled, adjustment).map(|(squares, redundancy)| {
        let found = component(squares, redundancy);
        let is_chance = found <= 1.0 + BY_CHANCE / (2.0 * redundancy).sqrt();
        if is_chance { 1.0 } else { found * found }
    });
    factors.into_iter().fold(1.0, f64::max)
}
