//! Gauss–Newton steps, with damping only where a step makes matters worse.

use nalgebra::{DVector, Vector3};
use rayon::prelude::*;

use super::{
    Adjustment, BundleFault, BundleOptions, Dropped, Network,
    eliminate::{ByPoint, Layout, Reduced, reduce},
    quality,
    unknowns::{Columns, State},
};
use crate::{geom::normal_equations::ScaledCholesky, units::METRES_PER_KM};

/// A step below this ends the iteration, kilometres and radians.
const STEP: f64 = 1e-8;
/// So does a relative change of the weighted sum of squares below this.
const CHANGE: f64 = 1e-8;
/// The same with robust weights: how a blunder is shared between the two rays of a tie hardly changes the
/// sum, so that the point creeps long after everything else is at rest.
const CHANGE_ROBUST: f64 = 1e-6;
/// Damping after a step that made matters worse, as a share of each unknown's own information.
const DAMPING: f64 = 1e-6;

/// Adjusts a network.
///
/// # Errors
/// Values that are none, indices without a target, too few observations, a singular network, an
/// iteration that does not settle.
pub fn solve(network: &Network, options: &BundleOptions) -> Result<Adjustment, BundleFault> {
    check(network)?;
    let mut layout = Layout {
        network,
        columns: Columns::of(network),
        by_point: ByPoint::of(network),
        robust: None,
    };
    let initial_m = network.points.iter().map(|point| point.ground_m).collect();
    let corrections = DVector::zeros(layout.columns.len());
    let start = State::new(network, &layout.columns, corrections, initial_m);
    let fitness: Vec<Result<(), Dropped>> = (0..network.points.len())
        .into_par_iter()
        .map(|point| layout.fitness(&start, point))
        .collect();
    let active: Vec<usize> = (0..fitness.len())
        .filter(|point| fitness[*point].is_ok())
        .collect();
    let (observations, unknowns) = count(&layout, &active);
    if observations < unknowns || unknowns == 0 {
        return Err(BundleFault::Underdetermined {
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
    let factor = factorise(&layout, &settled.reduced, 0.0)?;
    let mut adjustment = quality::judge(&layout, &settled.state, &fitness, &factor.inverse());
    adjustment.observations = observations;
    adjustment.unknowns = unknowns;
    adjustment.history = history;
    Ok(adjustment)
}

/// Observations, weighted initial values included, and unknowns.
fn count(layout: &Layout<'_>, active: &[usize]) -> (usize, usize) {
    let of_points: usize = active
        .iter()
        .map(|point| {
            2 * layout.by_point.views[*point].len()
                + layout.by_point.ranges[*point].len()
                + 3 * usize::from(layout.network.points[*point].sigma_m.is_some())
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

struct Settled {
    state: State,
    reduced: Reduced,
}

fn settle(
    layout: &Layout<'_>,
    start: State,
    active: &[usize],
    steps_max: u32,
    history: &mut Vec<f64>,
) -> Result<Settled, BundleFault> {
    let reduced = reduce(layout, &start, active).map_err(|_| unsettled(history))?;
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
        let (next, step) =
            advance(layout, &now.state, active, &shared).ok_or_else(|| unsettled(history))?;
        let before = now.reduced.cost;
        match reduce(layout, &next, active) {
            Ok(reduced) if reduced.cost <= before || step < STEP => {
                let change = (before - reduced.cost).abs();
                history.push(reduced.cost);
                now = Settled {
                    state: next,
                    reduced,
                };
                if step < STEP || change <= least_change * before {
                    return Ok(now);
                }
                damping = 0.0;
            }
            _ => damping = DAMPING.max(10.0 * damping),
        }
    }
    Err(unsettled(history))
}

fn unsettled(history: &[f64]) -> BundleFault {
    BundleFault::Unsettled {
        steps: history.len().saturating_sub(1),
        weighted_squares: history.last().copied().unwrap_or_default(),
    }
}

fn factorise(
    layout: &Layout<'_>,
    reduced: &Reduced,
    damping: f64,
) -> Result<ScaledCholesky, BundleFault> {
    let mut matrix = reduced.matrix.clone();
    for index in 0..matrix.nrows() {
        matrix[(index, index)] *= 1.0 + damping;
    }
    ScaledCholesky::new(matrix).map_err(|singular| BundleFault::Singular {
        unknowns: singular
            .unknowns
            .into_iter()
            .map(|column| layout.columns.unknowns[column])
            .collect(),
    })
}

/// The state after a step of the shared unknowns, and the length of the whole step.
fn advance(
    layout: &Layout<'_>,
    state: &State,
    active: &[usize],
    shared: &DVector<f64>,
) -> Option<(State, f64)> {
    let steps_m: Vec<Vector3<f64>> = active
        .par_iter()
        .map(|point| layout.eliminate(state, *point).ok()?.0.point_step_m(shared))
        .collect::<Option<_>>()?;
    let mut points_m = state.points_m.clone();
    let mut longest = 0.0_f64;
    for (point, step_m) in active.iter().zip(&steps_m) {
        points_m[*point] += step_m;
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

fn check(network: &Network) -> Result<(), BundleFault> {
    let value = |what, index, value: f64, valid: bool, expected| {
        if valid {
            Ok(())
        } else {
            Err(BundleFault::Value {
                what,
                index,
                value,
                expected,
            })
        }
    };
    let positive = |what, index, number: f64| {
        let valid = number > 0.0 && number.is_finite();
        value(what, index, number, valid, "a positive number")
    };
    let finite = |what, index, number: f64| {
        value(what, index, number, number.is_finite(), "a finite number")
    };
    let deviation = |what, index, sigma: f64| {
        value(
            what,
            index,
            sigma,
            sigma >= 0.0,
            "a standard deviation of 0 or more",
        )
    };
    for (index, image) in network.images.iter().enumerate() {
        positive("half the lines of image", index, image.half_lines)?;
        positive("line period of image", index, image.line_period_s)?;
        positive("focal length of image", index, image.focal_length_px)?;
        deviation("time bias of image", index, image.time_bias_sigma_s)?;
        for sigma in image.sigmas {
            deviation("orientation of image", index, sigma)?;
        }
        for polynomial in [&image.orientation.path_m, &image.orientation.angles_rad] {
            for coefficient in polynomial.coefficients.iter().flatten() {
                finite("orientation of image", index, *coefficient)?;
            }
        }
    }
    for (index, sigma_m) in network.range_bias_sigmas_m.iter().enumerate() {
        deviation("range bias of profile", index, *sigma_m)?;
    }
    for (index, point) in network.points.iter().enumerate() {
        for axis in 0..3 {
            finite("point", index, point.ground_m[axis])?;
            if let Some(sigma_m) = point.sigma_m {
                positive("standard deviation of point", index, sigma_m[axis])?;
            }
        }
    }
    for (index, view) in network.views.iter().enumerate() {
        matched(network, "view", index, view.point, view.image)?;
        finite("line of view", index, view.x_lines)?;
        finite("sample of view", index, view.y_px)?;
        positive("standard deviation of view", index, view.sigma_px.x)?;
        positive("standard deviation of view", index, view.sigma_px.y)?;
    }
    for (index, range) in network.ranges.iter().enumerate() {
        matched(network, "range", index, range.point, range.image)?;
        if range.profile >= network.range_bias_sigmas_m.len() {
            return Err(unmatched("range", index, "profile", range.profile));
        }
        finite("line of range", index, range.x_lines)?;
        positive("range", index, range.range_m)?;
        positive("standard deviation of range", index, range.sigma_m)?;
    }
    Ok(())
}

fn matched(
    network: &Network,
    what: &'static str,
    index: usize,
    point: usize,
    image: usize,
) -> Result<(), BundleFault> {
    if point >= network.points.len() {
        return Err(unmatched(what, index, "point", point));
    }
    if image >= network.images.len() {
        return Err(unmatched(what, index, "image", image));
    }
    Ok(())
}

fn unmatched(what: &'static str, index: usize, kind: &str, named: usize) -> BundleFault {
    BundleFault::Unmatched {
        what,
        index,
        named: format!("{kind} {named}"),
    }
}
