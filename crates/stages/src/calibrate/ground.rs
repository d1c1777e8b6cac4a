//! Tie points against the ground between laser points.
//!
//! Two lines of a camera determine the place of a tie point and one residual, across the flight. A measurement that is
//! wrong along the flight leaves no residual: it moves the point and changes its height. Only the ground around it can
//! contradict that. Laser points give a first ground; tie points that agree with it make it denser.

use nalgebra::{DMatrix, Vector3};

use super::{
    read::OrbitPoint,
    result::{PointKind, TieGround},
};
use areograph_geom::{
    calibration::CalibrationState,
    ellipsoid::local_axes,
    scattered_heights::{POINTS_MIN, PredictedHeight, ScatteredHeights},
    statistics::Summary,
};

/// A tie point is left out when it is farther from the ground than this many standard deviations: of 100,000 good points
/// on ground without surprises one is.
const OFF_SIGMAS: f64 = 4.5;
/// Factor from the error that one in a hundred of the laser points exceeds to the largest that ground explains.
const TAILS: f64 = 1.5;
/// Maximum number of grounds with tie points.
const ROUNDS: usize = 10;

/// A tie point off the ground.
#[derive(Clone, Copy)]
pub(super) struct Off {
    /// Index of the point.
    pub(super) index: usize,
    /// Its height above the ground, metres.
    pub(super) above_m: f64,
    /// This height in standard deviations.
    pub(super) sigmas: f64,
}

/// A tie point as the cameras locate it.
#[derive(Clone, Copy)]
struct Tie {
    index: usize,
    place_m: Vector3<f64>,
    sigma_m: f64,
}

impl Tie {
    /// The tie point `of`, which has this index; `None` where its rays determine no place.
    fn of(
        index: usize,
        of: &OrbitPoint,
        state: &CalibrationState,
        covariance: &DMatrix<f64>,
    ) -> Option<Self> {
        let point = of.point.unaided();
        let place_m = point.place(state).ok()?;
        let of_place = point.covariance_m2(state, covariance, &place_m).ok()?;
        let axes = local_axes(&place_m);
        let up_m2 = (axes * of_place * axes.transpose())[(2, 2)];
        Some(Self {
            index,
            place_m,
            sigma_m: up_m2.max(0.0).sqrt(),
        })
    }

    fn above(&self, beneath: &PredictedHeight) -> Off {
        let above_m = self.place_m.norm() - beneath.radius_m;
        Off {
            index: self.index,
            above_m,
            sigmas: above_m / beneath.sigma_m.hypot(self.sigma_m),
        }
    }
}

/// Result of the test.
pub(super) struct Tested {
    /// Tie points off the ground.
    pub(super) off: Vec<Off>,
    /// Index of each other tie point in use, and its smallest detectable height error, metres.
    pub(super) shown_m: Vec<(usize, f64)>,
    pub(super) summary: TieGround,
}

/// Tests tie points in use against the ground. `None` where laser points in use are too few or nearly on a line.
pub(super) fn off_ground(
    points: &[OrbitPoint],
    state: &CalibrationState,
    covariance: &DMatrix<f64>,
) -> Option<Tested> {
    let lasers = points.iter().filter(|point| point.is(PointKind::Control));
    let lasers_m: Vec<Vector3<f64>> = lasers
        .filter_map(|point| Some(point.point.known?.place_m))
        .collect();
    let laser_ground = ScatteredHeights::new(&lasers_m)?;
    let limit = OFF_SIGMAS.max(TAILS * laser_ground.tail);
    // Written so that NaN counts.
    let is_off = |of: &Off| !(of.sigmas.abs() <= limit);
    let ties = points.iter().enumerate();
    let ties = ties.filter(|(_, of)| of.is(PointKind::Tie));
    let mut kept: Vec<Tie> = ties
        .filter_map(|(index, of)| Tie::of(index, of, state, covariance))
        .collect();
    let mut off = Vec::new();
    kept.retain(|tie| {
        let Some(above) = laser_ground.at(&tie.place_m).map(|of| tie.above(&of)) else {
            return true;
        };
        let is_kept = !is_off(&above);
        off.extend((!is_kept).then_some(above));
        is_kept
    });
    let mut sigmas_m: Vec<Option<f64>> = vec![None; kept.len()];
    for _ in 0..ROUNDS {
        let places_m: Vec<Vector3<f64>> = kept.iter().map(|tie| tie.place_m).collect();
        let Some(ground) = laser_ground.with(&places_m) else {
            break;
        };
        let found = on_ground(&kept, &ground, lasers_m.len());
        sigmas_m = found.iter().map(|of| Some(of.as_ref()?.sigma_m)).collect();
        let worst = worst_of_neighbours(&found, is_off);
        if worst.is_empty() {
            break;
        }
        for at in worst.into_iter().rev() {
            kept.remove(at);
            sigmas_m.remove(at);
            off.extend(found[at].as_ref().map(|of| of.off));
        }
    }
    off.sort_by_key(|of| of.index);
    let known_m: Vec<f64> = sigmas_m.iter().flatten().copied().collect();
    let shown_m = kept.iter().zip(&sigmas_m);
    Some(Tested {
        summary: TieGround {
            tested: (known_m.len() + off.len()) as u64,
            limit_sigmas: limit,
            limit_m: (!known_m.is_empty()).then(|| limit * Summary::of(&known_m).median),
        },
        shown_m: shown_m
            .map(|(tie, sigma_m)| (tie.index, limit * sigma_m.unwrap_or(f64::INFINITY)))
            .collect(),
        off,
    })
}

/// A tie point on a ground that contains it.
struct OnGround {
    off: Off,
    sigma_m: f64,
    /// Indices of the tie points near it.
    near: Vec<usize>,
}

/// Tie points against the ground of the others; its first `lasers` points are laser points.
fn on_ground(ties: &[Tie], ground: &ScatteredHeights, lasers: usize) -> Vec<Option<OnGround>> {
    let at = |(at, tie): (usize, &Tie)| {
        let (beneath, near) = ground.at_point(lasers + at)?;
        Some(OnGround {
            off: tie.above(&beneath),
            sigma_m: beneath.sigma_m.hypot(tie.sigma_m),
            near: near
                .into_iter()
                .filter_map(|of| of.checked_sub(lasers))
                .collect(),
        })
    };
    ties.iter().enumerate().map(at).collect()
}

/// Points off the ground, and farther off than all near them, in order: a wrong point moves the ground at its
/// neighbours.
fn worst_of_neighbours(found: &[Option<OnGround>], is_off: impl Fn(&Off) -> bool) -> Vec<usize> {
    let sigmas = |at: usize| found[at].as_ref().map_or(0.0, |of| of.off.sigmas.abs());
    let is_worst =
        |of: &OnGround, at: usize| of.near.iter().all(|near| !(sigmas(*near) > sigmas(at)));
    let of = found.iter().enumerate();
    let of = of.filter(|(at, of)| {
        of.as_ref()
            .is_some_and(|of| is_off(&of.off) && is_worst(of, *at))
    });
    of.map(|(at, _)| at).collect()
}

/// Reason why tie points are not tested against the ground.
pub(super) fn untested(points: &[OrbitPoint]) -> String {
    let lasers = points
        .iter()
        .filter(|point| point.is(PointKind::Control))
        .count();
    format!(
        "{lasers} laser points are used, fewer than {POINTS_MIN} or nearly on a line: heights of tie points are not \
         tested, and measurement errors along the flight are not identified"
    )
}
