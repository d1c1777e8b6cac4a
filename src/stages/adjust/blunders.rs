//! Tie points that are no ties: found by their standardised residuals, left out, and adjusted again.

use super::{
    network::Assembled,
    points::{PointKind, RejectedPoint, RejectionReason},
};
use crate::geom::{
    bundle::{Adjustment, BundleError, BundleOptions, Network, Residual, solve},
    pushbroom::ExteriorOrientation,
};

/// Rounds after which no more tie points are rejected.
const ROUNDS_MAX: u32 = 20;
/// In each round only points whose residual reaches this share of the largest are left out: a blunder
/// pulls at its neighbours, and they come right when it is gone.
const SHARE_OF_LARGEST: f64 = 0.5;

/// Adjusts, leaves out the worst tie points and repeats until no standardised residual exceeds `limit`; without one
/// all stay.
pub(super) fn solve_without_blunders<M: ExteriorOrientation>(
    assembled: &mut Assembled<M>,
    bundle_options: &BundleOptions,
    limit: Option<f64>,
) -> Result<Adjustment, BundleError> {
    let mut adjustment = solve(&assembled.network, bundle_options)?;
    let Some(limit) = limit else {
        return Ok(adjustment);
    };
    for _ in 0..ROUNDS_MAX {
        let worst = worst_standardised(&assembled.network, &adjustment, assembled.shots);
        let largest = worst.iter().copied().fold(0.0, f64::max);
        if largest <= limit {
            break;
        }
        let threshold = limit.max(SHARE_OF_LARGEST * largest);
        let rejected: Vec<bool> = worst.iter().map(|value| *value >= threshold).collect();
        for (point, standardised) in worst
            .iter()
            .enumerate()
            .filter(|(point, _)| rejected[*point])
        {
            assembled.rejected.push(RejectedPoint {
                kind: PointKind::Tie,
                index: assembled.points[point].index,
                id: assembled.points[point].name.clone(),
                reason: RejectionReason::Blunder {
                    standardised: *standardised,
                },
            });
        }
        assembled.network.views.retain(|view| !rejected[view.point]);
        adjustment = solve(&assembled.network, bundle_options)?;
    }
    Ok(adjustment)
}

/// The largest standardised residual of each tie point, without sign; 0 for shots and dropped points.
fn worst_standardised<M>(network: &Network<M>, adjustment: &Adjustment, shots: usize) -> Vec<f64> {
    let mut worst = vec![0.0_f64; network.points.len()];
    for (view, residuals) in network.views.iter().zip(&adjustment.views) {
        if view.point < shots {
            continue;
        }
        for standardised in residuals
            .iter()
            .flatten()
            .filter_map(Residual::standardised)
        {
            worst[view.point] = worst[view.point].max(standardised.abs());
        }
    }
    worst
}
