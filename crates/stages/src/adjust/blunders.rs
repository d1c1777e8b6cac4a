//! Mismatched tie points: identified by their residuals and heights, and rejected before the adjustment is repeated.

use super::{
    heights::height_blunders,
    network::Assembled,
    points::{PointKind, RejectedPoint, RejectionReason},
    tie_correlation::common_noise,
    tie_scatter::{SCATTER_MAX_PX, tie_scatter_px},
};
use areograph_base::watch::Watch;
use areograph_config::AdjustmentConfig;
use areograph_geom::{
    bundle::{Adjustment, BundleError, BundleOptions, Network, Residual, solve, solve_comparing},
    pushbroom::ExteriorOrientation,
    robust::RobustWeight,
};

/// Rounds after which no more tie points are rejected.
const ROUNDS_MAX: u32 = 20;
/// Each round rejects only points whose residual reaches this share of the largest: a blunder distorts its neighbours,
/// which recover once it is removed.
const SHARE_OF_LARGEST: f64 = 0.5;
/// Solutions that show a scatter: where standard deviations are far too small, low weights hide a part of it at first.
const SCATTER_ROUNDS: u32 = 4;
/// Weights for networks with very many blunders.
const WHERE_MANY: RobustWeight = RobustWeight::Cauchy {
    limit: RobustWeight::CAUCHY_LIMIT,
};

/// Adjusts without mismatched tie points.
///
/// Rejects first by image residuals, with heights only compared; then, where a surface exists, by heights; then with
/// heights as observations.
pub(super) fn solve_without_blunders<M: ExteriorOrientation>(
    assembled: &mut Assembled<M>,
    bundle_options: &BundleOptions,
    config: &AdjustmentConfig,
    watch: Watch<'_>,
) -> Result<Adjustment, BundleError> {
    let limit = config.blunder_limit;
    let adjustment = by_residuals(assembled, bundle_options, limit, watch)?;
    if assembled.network.heights.is_none() {
        return Ok(adjustment);
    }
    let adjustment = by_heights(assembled, bundle_options, config, adjustment, watch)?;
    let common_noise = common_noise(assembled, &adjustment);
    if let Some(control) = &mut assembled.network.heights {
        control.common_noise = common_noise;
    }
    assembled.observe_heights();
    let adjustment = solved(assembled, bundle_options, watch)?;
    // Once the heights bend as the ground does, other blunders stand out.
    by_heights(assembled, bundle_options, config, adjustment, watch)
}

/// Solves the network once and counts the solution.
fn solved<M: ExteriorOrientation>(
    assembled: &Assembled<M>,
    bundle_options: &BundleOptions,
    watch: Watch<'_>,
) -> Result<Adjustment, BundleError> {
    let adjustment = solve(&assembled.network, bundle_options);
    watch.step(1, "solutions");
    adjustment
}

/// Solves the network once and counts the solution; its heights are compared with the surface only where no standardised
/// residual exceeds `limit`, because a solution with blunders is followed by another.
fn solved_within<M: ExteriorOrientation>(
    assembled: &Assembled<M>,
    bundle_options: &BundleOptions,
    limit: f64,
    watch: Watch<'_>,
) -> Result<Adjustment, BundleError> {
    let (network, shots) = (&assembled.network, assembled.shots);
    let adjustment = solve_comparing(network, bundle_options, |adjustment| {
        largest(&worst_standardised(network, adjustment, shots)) <= limit
    });
    watch.step(1, "solutions");
    adjustment
}

/// Adjusts, rejects the worst tie points and repeats until no standardised residual exceeds `limit`; without a limit
/// all stay.
fn by_residuals<M: ExteriorOrientation>(
    assembled: &mut Assembled<M>,
    bundle_options: &BundleOptions,
    limit: Option<f64>,
    watch: Watch<'_>,
) -> Result<Adjustment, BundleError> {
    let Some(limit) = limit else {
        return solved(assembled, bundle_options, watch);
    };
    let mut first = solved_within(assembled, bundle_options, limit, watch);
    let is_within = |assembled: &Assembled<M>, adjustment: &Adjustment| {
        let worst = worst_standardised(&assembled.network, adjustment, assembled.shots);
        largest(&worst) <= limit
    };
    let is_doubtful = match &first {
        Ok(adjustment) => !is_within(assembled, adjustment),
        Err(BundleError::NotConverged { .. }) => true,
        Err(_) => false,
    };
    if is_doubtful {
        // Low weights of blunders keep these from bending the solution that shows the scatter.
        let low_weights = BundleOptions {
            robust: bundle_options.robust.or(Some(WHERE_MANY)),
            ..*bundle_options
        };
        if add_scatter(assembled, first.as_ref().ok(), &low_weights, watch) {
            first = solved_within(assembled, bundle_options, limit, watch);
        }
        let is_lost = matches!(first, Err(BundleError::NotConverged { .. }));
        if is_lost && bundle_options.robust.is_none() {
            // Too many or too large blunders leave no common solution; low weights reveal them.
            let adjustment = solved_within(assembled, &low_weights, limit, watch)?;
            reject_worst(assembled, &low_weights, limit, adjustment, watch)?;
            first = solved_within(assembled, bundle_options, limit, watch);
        }
    }
    reject_worst(assembled, bundle_options, limit, first?, watch)
}

/// Adds the scatter of the tie points to their standard deviations before any is rejected, because scatter is no
/// blunder; returns whether there is any.
///
/// * `first` – the solution so far, where there is one
/// * `low_weights` – options of a solution that shows the scatter better
fn add_scatter<M: ExteriorOrientation>(
    assembled: &mut Assembled<M>,
    first: Option<&Adjustment>,
    low_weights: &BundleOptions,
    watch: Watch<'_>,
) -> bool {
    let mut is_added = false;
    for _ in 0..SCATTER_ROUNDS {
        // Low weights may alternate between solutions. The median of the residuals resists blunders as well.
        let shown = solved(assembled, low_weights, watch).ok();
        let shown = shown.as_ref().or(first.filter(|_| !is_added));
        let scatter_px = shown.map_or(0.0, |shown| tie_scatter_px(assembled, shown));
        if scatter_px <= 0.0 {
            break;
        }
        assembled.scatter_ties(scatter_px);
        is_added = true;
        if assembled.tie_scatter_px >= SCATTER_MAX_PX {
            break;
        }
    }
    is_added
}

/// Rejects the worst tie points of `adjustment`, adjusts again and repeats until none is beyond `limit`.
fn reject_worst<M: ExteriorOrientation>(
    assembled: &mut Assembled<M>,
    bundle_options: &BundleOptions,
    limit: f64,
    mut adjustment: Adjustment,
    watch: Watch<'_>,
) -> Result<Adjustment, BundleError> {
    for round in 1..=ROUNDS_MAX {
        let worst = worst_standardised(&assembled.network, &adjustment, assembled.shots);
        let largest = largest(&worst);
        if largest <= limit {
            break;
        }
        let threshold = limit.max(SHARE_OF_LARGEST * largest);
        let rejected = worst.iter().enumerate();
        let rejected = rejected.filter(|(_, standardised)| **standardised >= threshold);
        let rejected = rejected.map(|(point, standardised)| {
            let standardised = *standardised;
            (point, RejectionReason::Blunder { standardised })
        });
        assembled.reject(rejected.collect());
        adjustment = if round < ROUNDS_MAX {
            solved_within(assembled, bundle_options, limit, watch)?
        } else {
            solved(assembled, bundle_options, watch)?
        };
    }
    Ok(adjustment)
}

/// Rejects tie points with implausible heights until none is left; returns the adjustment without them.
fn by_heights<M: ExteriorOrientation>(
    assembled: &mut Assembled<M>,
    bundle_options: &BundleOptions,
    config: &AdjustmentConfig,
    mut adjustment: Adjustment,
    watch: Watch<'_>,
) -> Result<Adjustment, BundleError> {
    let Some(limit) = config.height_blunder_limit else {
        return Ok(adjustment);
    };
    for _ in 0..ROUNDS_MAX {
        let blunders = height_blunders(assembled, &adjustment, limit);
        if blunders.is_empty() {
            break;
        }
        let rejected = blunders.iter().map(|blunder| {
            let reason = RejectionReason::Height {
                above_m: blunder.above_m,
                standardised: blunder.standardised,
            };
            (blunder.point, reason)
        });
        assembled.reject(rejected.collect());
        adjustment = solved(assembled, bundle_options, watch)?;
    }
    Ok(adjustment)
}

impl<M> Assembled<M> {
    /// Removes tie points from the network, by index.
    fn reject(&mut self, rejected: Vec<(usize, RejectionReason)>) {
        let mut is_rejected = vec![false; self.points.len()];
        for (point, reason) in rejected {
            is_rejected[point] = true;
            self.network.points[point].known = None;
            self.rejected.push(RejectedPoint {
                kind: PointKind::Tie,
                index: self.points[point].index,
                id: self.points[point].name.clone(),
                reason,
            });
        }
        self.network.views.retain(|view| !is_rejected[view.point]);
    }
}

fn largest(standardised: &[f64]) -> f64 {
    standardised.iter().copied().fold(0.0, f64::max)
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
