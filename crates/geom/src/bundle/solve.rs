//! Gauss–Newton steps with learnt curvature, damped only where a step increases the sum.

use std::collections::BTreeSet;

use nalgebra::{DVector, Vector3};
use rayon::prelude::*;

use super::{
    Adjustment, BundleError, BundleOptions, HeightControl, Network, PointRejection,
    check::check,
    compared_heights::compared,
    factor::Factor,
    groups::PointGroups,
    heights::Heights,
    layout::{Layout, Linearised, OF_A_TASK},
    point_rows::PointRows,
    quality,
    quasi_newton::QuasiNewton,
    reduce::{Reduced, Settled, reduce},
    unknowns::State,
};
use crate::pushbroom::ExteriorOrientation;
use areograph_base::units::METRES_PER_KM;

/// A step below this ends the iteration, kilometres and radians.
const STEP: f64 = 1e-8;
/// A relative change of the weighted sum of squares below this ends it too.
const CHANGE: f64 = 1e-8;
/// The relative change with robust weights: the division of a blunder between the two rays of a tie hardly changes the
/// sum, so that the point creeps long after everything else has converged.
const CHANGE_ROBUST: f64 = 1e-6;
/// The relative change before robust weights are applied: where blunders dominate the sum, it need not reach its
/// minimum.
const CHANGE_ROUGH: f64 = 0.1;
/// A relative increase of the sum below this is rounding, mainly of positions of 4e6 m.
const ROUNDING: f64 = 1e-10;
/// Damping after a first step that increased the sum, as a share of each unknown's own information. Unknowns held only
/// by their initial values have little of it.
const DAMPING: f64 = 1e-10;
/// Factor of the damping after each further such step, and its inverse after each good one.
const RAISED: f64 = 10.0;
const EASED: f64 = 0.1;
/// A step is good when the sum decreases by this share of the expected decrease.
const GOOD_SHARE: f64 = 0.5;

/// Adjusts a network.
///
/// # Errors
/// Invalid values, indices without a target, too few observations, a singular network, an iteration that does not
/// converge.
pub fn solve<M: ExteriorOrientation>(
    network: &Network<M>,
    options: &BundleOptions,
) -> Result<Adjustment, BundleError> {
    solve_comparing(network, options, |_| true)
}

/// Adjusts a network, and compares heights with the surface only if `compares` returns true of the adjustment without
/// them: the surface at a hundred thousand points takes many times as long as their adjustment.
///
/// # Errors
/// As [`solve`].
pub fn solve_comparing<M: ExteriorOrientation>(
    network: &Network<M>,
    options: &BundleOptions,
    compares: impl FnOnce(&Adjustment) -> bool,
) -> Result<Adjustment, BundleError> {
    check(network)?;
    let mut layout = Layout::of(network);
    let initial_m = network.points.iter().map(|point| point.ground_m).collect();
    let corrections = DVector::zeros(layout.columns.len());
    let start = layout.linearise(State::new(network, &layout.columns, corrections, initial_m));
    let fitness: Vec<Result<(), PointRejection>> = (0..network.points.len())
        .into_par_iter()
        .with_min_len(OF_A_TASK)
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
    let groups = PointGroups::of(&layout, active);
    let mut history = Vec::new();
    let mut stop = Stop {
        steps_max: options.steps_max,
        change: CHANGE,
    };
    if options.robust.is_some() {
        stop.change = CHANGE_ROUGH;
    }
    let mut settled = settle(&layout, start, &groups, stop, &mut history)?;
    if options.robust.is_some() {
        layout.robust = options.robust;
        stop.change = CHANGE_ROBUST;
        settled = settle(&layout, settled.at, &groups, stop, &mut history)?;
    }
    let control = network.heights.as_ref();
    let mut heights_settled = true;
    if let Some(control) = control.filter(|of| !of.observed.is_empty()) {
        let mut iteration = (stop, &mut history);
        let rounds_max = options.height_rounds_max;
        (settled, heights_settled) = with_heights(
            &mut layout,
            (control, rounds_max),
            settled,
            &groups,
            &mut iteration,
        )?;
    }
    let factor = factorise(&layout, &settled.reduced, 0.0)?;
    let mut adjustment = quality::judge(&layout, &settled, &groups, &fitness, &factor);
    adjustment.observations = observations + adjustment.heights.len();
    adjustment.unknowns = unknowns;
    adjustment.heights_settled = heights_settled;
    adjustment.history = history;
    if let Some(control) = control
        && compares(&adjustment)
    {
        adjustment.compared = compared(&layout, &settled.at, control, |point| {
            fitness[point].is_ok()
        });
    }
    Ok(adjustment)
}

/// Observations, weighted initial values included, and unknowns.
fn count<M: ExteriorOrientation>(layout: &Layout<'_, M>, active: &[usize]) -> (usize, usize) {
    let of_points: usize = active
        .iter()
        .map(|point| {
            2 * (layout.views.of_key(*point).len() + layout.spots.of_key(*point).len())
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

/// Standard deviations that change by less than this leave the weights of heights unchanged, metres.
const HEIGHT_CHANGE_M: f64 = 0.01;

/// Convergence criterion of an iteration.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stop {
    pub(super) steps_max: u32,
    /// Relative change of the weighted sum of squares.
    pub(super) change: f64,
}

/// Continues with heights as observations; returns whether they converged.
fn with_heights<M: ExteriorOrientation>(
    layout: &mut Layout<'_, M>,
    (control, rounds_max): (&HeightControl, u32),
    mut settled: Settled,
    groups: &PointGroups,
    (stop, history): &mut (Stop, &mut Vec<f64>),
) -> Result<(Settled, bool), BundleError> {
    let active_points: BTreeSet<usize> = groups.points.iter().copied().collect();
    let points = control.observed.iter().copied();
    let points = points
        .filter(|point| active_points.contains(point))
        .collect();
    let bus = layout.network.common_bus.as_ref();
    let shared = bus.map_or_else(Vec::new, |bus| layout.columns.shifts_on_surface(bus));
    let heights = Heights::at(&control.surface, points, shared, &settled.at.state);
    layout.heights = Some(heights);
    let mut is_settled = false;
    for _ in 0..rounds_max {
        settled = settle(layout, settled.at, groups, *stop, history)?;
        let reduced = settled.reduced.heights.as_ref();
        let (Some(reduced), Some(heights)) = (reduced, layout.heights.as_mut()) else {
            break;
        };
        let changed_m = heights.reweigh(&reduced.misclosures_m, &reduced.ray_variances_m2);
        if !heights.follow(&control.surface, &settled.at.state) && changed_m < HEIGHT_CHANGE_M {
            is_settled = true;
            break;
        }
    }
    settled.reduced = reduce(layout, &settled.at, groups).map_err(|_| not_converged(history))?;
    Ok((settled, is_settled))
}

pub(super) fn settle<M: ExteriorOrientation>(
    layout: &Layout<'_, M>,
    start: Linearised,
    groups: &PointGroups,
    stop: Stop,
    history: &mut Vec<f64>,
) -> Result<Settled, BundleError> {
    let reduced = reduce(layout, &start, groups).map_err(|_| not_converged(history))?;
    // The second of two iterations begins where the first ended.
    if history.is_empty() {
        history.push(reduced.cost);
    }
    let mut now = Settled { at: start, reduced };
    let mut damping = 0.0;
    let mut curvature = QuasiNewton::default();
    for _ in 0..stop.steps_max {
        let factor = factorise(layout, &now.reduced, damping)?;
        let (shared, is_corrected) = curvature.step(&now, &factor);
        let (next, step) =
            advance(layout, &now, groups, &shared).ok_or_else(|| not_converged(history))?;
        let before = now.reduced.cost;
        let next = layout.linearise(next);
        match reduce(layout, &next, groups) {
            Ok(reduced) if reduced.cost <= before * (1.0 + ROUNDING) || step < STEP => {
                let fall = before - reduced.cost;
                history.push(reduced.cost);
                let expected = shared.dot(&now.reduced.right);
                now = Settled { at: next, reduced };
                if step < STEP || fall.abs() <= stop.change * before {
                    return Ok(now);
                }
                if fall > GOOD_SHARE * expected {
                    damping *= EASED;
                }
                if damping < DAMPING {
                    damping = 0.0;
                }
            }
            _ => {
                curvature.forget();
                // A step with learnt curvature may overshoot.
                if !is_corrected {
                    damping = DAMPING.max(RAISED * damping);
                }
            }
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
) -> Result<Factor, BundleError> {
    let damped = (damping > 0.0).then(|| {
        let mut matrix = reduced.matrix.clone();
        for (column, information) in reduced.matrix.diagonal().into_iter().enumerate() {
            matrix.add_to_element(column, column, damping * information);
        }
        matrix
    });
    let matrix = damped.as_ref().unwrap_or(&reduced.matrix);
    Factor::new(matrix, reduced.heights.as_ref()).map_err(|singular| BundleError::Singular {
        unknowns: singular
            .unknowns
            .into_iter()
            .map(|column| layout.columns.unknowns[column])
            .collect(),
    })
}

/// The state after a step of the shared unknowns, and the length of the complete step.
fn advance<M: ExteriorOrientation>(
    layout: &Layout<'_, M>,
    Settled { at, reduced }: &Settled,
    groups: &PointGroups,
    shared: &DVector<f64>,
) -> Option<(State, f64)> {
    let steps_m: Vec<Vector3<f64>> = groups
        .points
        .par_iter()
        .with_min_len(OF_A_TASK)
        .map_init(PointRows::default, |rows, point| {
            layout.fill(rows, at, *point).ok()?;
            rows.point_step_m(shared)
        })
        .collect::<Option<_>>()?;
    let state = &at.state;
    let mut points_m = state.points_m.clone();
    for (point, step_m) in groups.points.iter().zip(&steps_m) {
        points_m[*point] += step_m;
    }
    if let (Some(heights), Some(reduced)) = (&layout.heights, &reduced.heights) {
        for (point, move_m) in heights.points.iter().zip(reduced.moves_m(shared)) {
            points_m[*point] += move_m;
        }
    }
    let mut longest = 0.0_f64;
    for point in &groups.points {
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
