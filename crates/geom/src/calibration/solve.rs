//! Gauss–Newton over the free combinations of parameters, with their a priori values.

use nalgebra::{DMatrix, DVector, Vector3};

use super::{
    camera::CalibrationState,
    elimination::{Triangle, reduced_rows},
    freedom::Freedom,
    shared::with_shared_errors,
    sight::{GroundPoint, SightError},
};

/// Maximum number of steps.
const STEPS_MAX: u32 = 40;
/// A step below this ends the iteration, in standard deviations of the estimates.
const STEP: f64 = 1e-3;

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
    for steps in 1..=STEPS_MAX {
        let (triangle, right, places_m) = linearised(points, &state, start.known, freedom)?;
        let step = triangle
            .solve_upper_triangular(&right)
            .filter(|step| step.iter().all(|component| component.is_finite()))
            .ok_or(CalibrationError::Singular)?;
        state = state.moved(&freedom.change(&step));
        if (&triangle * &step).norm() > STEP {
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

/// Triangle and right side over the free combinations at a state, and the positions of the points there.
type Linearised = (DMatrix<f64>, DVector<f64>, Vec<Vector3<f64>>);

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
    let (triangle, right) = triangle.finish();
    Ok((triangle, right, places_m))
}
