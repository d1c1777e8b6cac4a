//! Gauss–Newton over the free combinations of parameters, with their a priori values.

use nalgebra::{DMatrix, DVector, Vector3};

use super::{
    camera::CalibrationState,
    elimination::{Triangle, reduced_rows},
    freedom::Freedom,
    shared::with_shared_errors,
    sight::{GroundPoint, SightError},
};

/// Maximum number of steps. Large residuals, as before the look angles are free, slow the convergence.
const STEPS_MAX: u32 = 200;
/// A step below this ends the iteration, in standard deviations of the estimates; these are multiplied by the root mean square of the residuals if
/// it exceeds one.
const STEP: f64 = 1e-3;
/// Relative rounding errors of a sum of squares are smaller.
const ROUNDING: f64 = 1e-9;

/// Reasons why the calibration failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum CalibrationError {
    /// A point has no position.
    #[error("point {point}: {why}")]
    Point {
        /// Its index.
        point: usize,
        /// The reason.
        why: SightError,
    },
    /// The iteration did not converge.
    #[error("the adjustment did not converge after {STEPS_MAX} steps")]
    NotConverged,
    /// A free combination has no a priori standard deviation and is not observed.
    #[error("the points do not determine the free parameters")]
    Singular,
}

/// Start of an adjustment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Start<'a> {
    /// The a priori values: the laboratory geometry.
    pub known: &'a CalibrationState,
    /// The first state of the iteration.
    pub from: &'a CalibrationState,
}

/// An adjusted calibration.
#[derive(Debug, Clone, PartialEq)]
pub struct Solved {
    /// The parameters.
    pub state: CalibrationState,
    /// Their covariance, in order; zero for fixed ones.
    pub covariance: DMatrix<f64>,
    /// Positions of the points.
    pub places_m: Vec<Vector3<f64>>,
    /// Steps.
    pub steps: u32,
}

/// Adjusts the free combinations to `points` and to their a priori values.
///
/// # Errors
/// [`CalibrationError`].
pub fn solve(
    points: &[GroundPoint],
    start: Start<'_>,
    freedom: &Freedom,
) -> Result<Solved, CalibrationError> {
    let mut state = start.from.clone();
    let mut last: Option<Step> = None;
    for steps in 1..=STEPS_MAX {
        let here = linearised(points, &state, start.known, freedom);
        // With residuals of many standard deviations, a whole step may lead away, also to where points have no position.
        let squares = here.as_ref().map_or(f64::INFINITY, |here| here.squares);
        let is_away = |last: &Step| squares.is_nan() || squares > (1.0 + ROUNDING) * last.squares;
        if let Some(last) = last.as_mut().filter(|last| is_away(last)) {
            last.step *= 0.5;
            state = last.from.moved(&freedom.change(&last.step));
            continue;
        }
        let Linearised {
            triangle,
            right,
            places_m,
            redundancy,
            ..
        } = here?;
        let step = triangle
            .solve_upper_triangular(&right)
            .filter(|step| step.iter().all(|component| component.is_finite()))
            .ok_or(CalibrationError::Singular)?;
        let next = state.moved(&freedom.change(&step));
        let length = (&triangle * &step).norm();
        last = Some(Step {
            from: std::mem::replace(&mut state, next),
            step,
            squares,
        });
        if length > STEP * (squares / redundancy.max(1) as f64).sqrt().max(1.0) {
            continue;
        }
        let unit = DMatrix::identity(freedom.len(), freedom.len());
        let inverse = triangle
            .solve_upper_triangular(&unit)
            .ok_or(CalibrationError::Singular)?;
        let independent = &inverse * inverse.transpose();
        let covariance = with_shared_errors(&independent, points, &state, freedom, &places_m)
            .map_err(|(point, why)| CalibrationError::Point { point, why })?;
        return Ok(Solved {
            covariance: freedom.covariance(&covariance),
            state,
            places_m,
            steps,
        });
    }
    Err(CalibrationError::NotConverged)
}

/// A step of the iteration.
struct Step {
    from: CalibrationState,
    /// Over the free combinations.
    step: DVector<f64>,
    /// Weighted squares of the residuals at its beginning.
    squares: f64,
}

/// Normal equations over the free combinations at a state.
struct Linearised {
    triangle: DMatrix<f64>,
    right: DVector<f64>,
    /// Positions of the points at the state.
    places_m: Vec<Vector3<f64>>,
    /// Weighted squares of all residuals at the state.
    squares: f64,
    redundancy: usize,
}

fn linearised(
    points: &[GroundPoint],
    state: &CalibrationState,
    known: &CalibrationState,
    freedom: &Freedom,
) -> Result<Linearised, CalibrationError> {
    let unknowns = freedom.len();
    let mut triangle = Triangle::new(unknowns);
    // The a priori value of every free combination is an observation with a standard deviation of one.
    let off = freedom.components(&(known.vector() - state.vector()));
    let mut beforehand = DMatrix::identity(unknowns, unknowns + 1);
    beforehand.column_mut(unknowns).copy_from(&off);
    triangle.add(beforehand);
    let mut places_m = Vec::with_capacity(points.len());
    for (index, point) in points.iter().enumerate() {
        let at = |why| CalibrationError::Point { point: index, why };
        let place_m = point.place(state).map_err(at)?;
        triangle.add(reduced_rows(point, state, freedom, &place_m).map_err(at)?);
        places_m.push(place_m);
    }
    let redundancy = triangle.count.saturating_sub(unknowns);
    let (triangle, right, left) = triangle.finish();
    Ok(Linearised {
        places_m,
        squares: left + right.norm_squared(),
        redundancy,
        triangle,
        right,
    })
}
