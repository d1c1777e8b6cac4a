//! Gauss–Newton steps, with damping only where a step makes matters worse.

use std::collections::BTreeSet;

use nalgebra::{DVector, Vector3};
use rayon::prelude::*;

use super::{
    Adjustment, BundleError, BundleOptions, HeightControl, Network, PointRejection,
    check::check,
    compared_heights::compared,
    heights::Heights,
    layout::Layout,
    point_rows::PointRows,
    quality,
    reduce::{Reduced, Settled, reduce},
    reduced_heights::ReducedHeights,
    unknowns::State,
};
use crate::{
    geom::{normal_equations::ScaledCholesky, pushbroom::ExteriorOrientation},
    units::METRES_PER_KM,
};

/// A step below this ends the iteration, kilometres and radians.
const STEP: f64 = 1e-8;
/// So does a relative change of the weighted sum of squares below this.
const CHANGE: f64 = 1e-8;
/// The same with robust weights: how a blunder is shared between the two rays of a tie hardly changes the
/// sum, so that the point creeps long after everything else is converged.
const CHANGE_ROBUST: f64 = 1e-6;
/// A relative rise of the sum below this is rounding, of positions of 4e6 m in the main.
const ROUNDING: f64 = 1e-10;
/// Damping after a step that made matters worse, as a share of each unknown's own information.
const DAMPING: f64 = 1e-6;

/// Adjusts a network.
///
/// # Errors
/// Values that are none, indices without a target, too few observations, a singular network, an
/// iteration that does not converge.
pub fn solve<M: ExteriorOrientation>(
    network: &Network<M>,
    options: &BundleOptions,
) -> Result<Adjustment, BundleError> {
    check(network)?;
    let mut layout = Layout::of(network);
    let initial_m = network.points.iter().map(|point| point.ground_m).collect();
    let corrections = DVector::zeros(layout.columns.len());
    let start = State::new(network, &layout.columns, corrections, initial_m);
    let fitness: Vec<Result<(), PointRejection>> = (0..network.points.len())
        .into_par_iter()
        .map_init(PointRows::default, |rows, point| {
            layout.fitness(rows, &start, point)
        })
        .collect();
    let active: Vec<usize> = (0..fitness.len())
        .filter(|point| fitness[*point].is_ok())
        .collect();
    let (observations, unknowns) = count(&layout, &active);
    if observations < unknowns || unknowns == 0 {
        return Err(BundleError::Underdetermined {
            observations,
            unknowns,
        });
    }
    let mut history = Vec::new();
    let mut settled = settle(&layout, start, &active, options.steps_max, &mut history)?;
    if options.robust.is_some() {
        layout.robust = options.robust;
        settled = settle(
            &layout,
            settled.state,
            &active,
            options.steps_max,
            &mut history,
        )?;
    }
    let control = network.heights.as_ref();
    if let Some(control) = control.filter(|of| !of.observed.is_empty()) {
        let mut room = (options.steps_max, &mut history);
        settled = with_heights(&mut layout, control, settled, &active, &mut room)?;
    }
    let factor = factorise(&layout, &settled.reduced, 0.0)?;
    let cofactors = factor.inverse();
    let mut adjustment = quality::judge(&layout, &settled, &fitness, &cofactors);
    adjustment.compared = control.map_or_else(Vec::new, |control| {
        compared(&layout, &settled.state, control, |point| {
            fitness[point].is_ok()
        })
    });
    adjustment.observations = observations + adjustment.heights.len();
    adjustment.unknowns = unknowns;
    adjustment.history = history;
    Ok(adjustment)
}

/// Observations, weighted initial values included, and unknowns.
fn count<M: ExteriorOrientation>(layout: &Layout<'_, M>, active: &[usize]) -> (usize, usize) {
    let of_points: usize = active
        .iter()
        .map(|point| {
            2 * layout.views.of_key(*point).len()
                + layout.ranges.of_key(*point).len()
                + 3 * usize::from(layout.network.points[*point].known.is_some())
        })
        .sum();
    let weighted = layout
        .columns
        .sigmas
        .iter()
        .filter(|sigma| sigma.is_finite());
    (
        of_points + weighted.count(),
        layout.columns.len() + 3 * active.len(),
    )
}

/// Rounds in which heights find their surface and their weights.
const HEIGHT_ROUNDS_MAX: u32 = 15;
/// Standard deviations that change by less than this leave the weights of heights as they are, metres.
const HEIGHT_CHANGE_M: f64 = 0.01;

/// Goes on with heights as observations.
fn with_heights<M: ExteriorOrientation>(
    layout: &mut Layout<'_, M>,
    control: &HeightControl,
    mut settled: Settled,
    active: &[usize],
    (steps_max, history): &mut (u32, &mut Vec<f64>),
) -> Result<Settled, BundleError> {
    let active_points: BTreeSet<usize> = active.iter().copied().collect();
    let points = control.observed.iter().copied();
    let points = points
        .filter(|point| active_points.contains(point))
        .collect();
    let heights = Heights::at(&control.surface, points, &settled.state);
    layout.heights = Some(heights);
    for _ in 0..HEIGHT_ROUNDS_MAX {
        settled = settle(layout, settled.state, active, *steps_max, history)?;
        let reduced = settled.reduced.heights.as_ref();
        let (Some(reduced), Some(heights)) = (reduced, layout.heights.as_mut()) else {
            break;
        };
        let changed_m = heights.reweigh(&reduced.misclosures_m, &reduced.ray_variances_m2);
        if !heights.follow(&control.surface, &settled.state) && changed_m < HEIGHT_CHANGE_M {
            break;
        }
    }
    settled.reduced = reduce(layout, &settled.state, active).map_err(|_| not_converged(history))?;
    Ok(settled)
}

pub(super) fn settle<M: ExteriorOrientation>(
    layout: &Layout<'_, M>,
    start: State,
    active: &[usize],
    steps_max: u32,
    history: &mut Vec<f64>,
) -> Result<Settled, BundleError> {
    let reduced = reduce(layout, &start, active).map_err(|_| not_converged(history))?;
    // The second of two iterations begins where the first ended.
    if history.is_empty() {
        history.push(reduced.cost);
    }
    let mut now = Settled {
        state: start,
        reduced,
    };
    let least_change = if layout.robust.is_some() {
        CHANGE_ROBUST
    } else {
        CHANGE
    };
    let mut damping = 0.0;
    for _ in 0..steps_max {
        let factor = factorise(layout, &now.reduced, damping)?;
        let shared = factor.solve(&now.reduced.right);
        let heights = now.reduced.heights.as_ref();
        let (next, step) = advance(layout, &now.state, active, &shared, heights)
            .ok_or_else(|| not_converged(history))?;
        let before = now.reduced.cost;
        match reduce(layout, &next, active) {
            Ok(reduced) if reduced.cost <= before * (1.0 + ROUNDING) || step < STEP => {
                let change = (before - reduced.cost).abs();
                history.push(reduced.cost);
                now = Settled {
                    state: next,
                    reduced,
                };
                if step < STEP || change <= least_change * before {
                    return Ok(now);
                }
                // What helped once helps again, until it is needed no more.
                damping = if damping > DAMPING {
                    0.1 * damping
                } else {
                    0.0
                };
            }
            _ => damping = DAMPING.max(10.0 * damping),
        }
    }
    Err(not_converged(history))
}

fn not_converged(history: &[f64]) -> BundleError {
    BundleError::NotConverged {
        steps: history.len().saturating_sub(1),
        weighted_squares: history.last().copied().unwrap_or_default(),
    }
}

fn factorise<M>(
    layout: &Layout<'_, M>,
    reduced: &Reduced,
    damping: f64,
) -> Result<ScaledCholesky, BundleError> {
    let mut matrix = reduced.matrix.clone();
    for index in 0..matrix.nrows() {
        matrix[(index, index)] *= 1.0 + damping;
    }
    ScaledCholesky::new(matrix).map_err(|singular| BundleError::Singular {
        unknowns: singular
            .unknowns
            .into_iter()
            .map(|column| layout.columns.unknowns[column])
            .collect(),
    })
}

/// The state after a step of the shared unknowns, and the length of the whole step.
fn advance<M: ExteriorOrientation>(
    layout: &Layout<'_, M>,
    state: &State,
    active: &[usize],
    shared: &DVector<f64>,
    heights: Option<&ReducedHeights>,
) -> Option<(State, f64)> {
    let steps_m: Vec<Vector3<f64>> = active
        .par_iter()
        .map_init(PointRows::default, |rows, point| {
            layout.fill(rows, state, *point).ok()?;
            rows.point_step_m(shared)
        })
        .collect::<Option<_>>()?;
    let mut points_m = state.points_m.clone();
    for (point, step_m) in active.iter().zip(&steps_m) {
        points_m[*point] += step_m;
    }
    if let (Some(heights), Some(reduced)) = (&layout.heights, heights) {
        for (point, move_m) in heights.points.iter().zip(reduced.moves_m(shared)) {
            points_m[*point] += move_m;
        }
    }
    let mut longest = 0.0_f64;
    for point in active {
        let step_m = points_m[*point] - state.points_m[*point];
        longest = longest.max(step_m.norm() / METRES_PER_KM);
    }
    for (unknown, step) in layout.columns.unknowns.iter().zip(shared) {
        longest = longest.max(step.abs() / unknown.step_unit());
    }
    let corrections = &state.corrections + shared;
    longest.is_finite().then(|| {
        let next = State::new(layout.network, &layout.columns, corrections, points_m);
        (next, longest)
    })
}
