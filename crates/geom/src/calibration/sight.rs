//! Ground points and their sights: positions under a calibration, with covariances and residuals.

use nalgebra::{DMatrix, Matrix2x3, Matrix3, Vector2, Vector3};

use super::camera::{CalibrationState, LinePose};

/// Maximum number of steps of an intersection.
const STEPS_MAX: u32 = 20;
/// A step below this ends the iteration, metres.
const STEP_M: f64 = 1e-4;
/// Smallest sine of the angle between the rays of a point without control.
const CONVERGENCE_MIN: f64 = 0.01;

/// A line of a camera that sees a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sight {
    /// The camera.
    pub camera: usize,
    /// Its pose when the line was exposed.
    pub pose: LinePose,
    /// The sample, −1 to 1.
    pub s: f64,
    /// Standard deviations across and along the flight, tangents.
    pub sigma: [f64; 2],
}

/// A control point, known independently of the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KnownPlace {
    /// Position, body-fixed, metres.
    pub place_m: Vector3<f64>,
    /// Rows along axes in which its errors are independent, over their standard deviations, 1/m.
    pub whitening: Matrix3<f64>,
    /// The part of these errors that it shares with other points.
    pub shared: Option<SharedError>,
}

/// An error that all points of a group share, such as those of one laser profile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SharedError {
    /// The group.
    pub group: usize,
    /// Standard deviations along a horizontal axis and of the radius, metres; part of the errors by which a point is weighted.
    pub sigma_m: [f64; 2],
}

/// A point on the ground.
#[derive(Debug, Clone, PartialEq)]
pub struct GroundPoint {
    /// Its sights.
    pub sights: Vec<Sight>,
    /// Its control, if any.
    pub known: Option<KnownPlace>,
}

/// Reasons why a point has no position.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum SightError {
    /// Its rays are parallel, or it has only one.
    #[error("its rays do not intersect")]
    Parallel,
    /// It lies behind a camera, or its numbers are not finite.
    #[error("its rays intersect behind a camera")]
    Behind,
    /// The iteration did not converge.
    #[error("its rays do not determine a position")]
    NotConverged,
}

/// A sight's rows over its standard deviations.
pub(super) struct SightRows {
    pub(super) residual: Vector2<f64>,
    pub(super) by_place: Matrix2x3<f64>,
    pub(super) by_parameters: DMatrix<f64>,
}

impl Sight {
    /// Residual and its change with position over the standard deviations.
    fn weighted(
        &self,
        state: &CalibrationState,
        place_m: &Vector3<f64>,
    ) -> Result<(Vector2<f64>, Matrix2x3<f64>), SightError> {
        let linear = state.linear(self.camera, &self.pose, self.s, place_m);
        let linear = linear.ok_or(SightError::Behind)?;
        let (mut residual, mut by_place) = (linear.residual, linear.by_place);
        for (row, sigma) in self.sigma.iter().enumerate() {
            residual[row] /= sigma;
            let mut of_row = by_place.row_mut(row);
            of_row /= *sigma;
        }
        Ok((residual, by_place))
    }

    /// All of the sight's rows.
    pub(super) fn rows(
        &self,
        state: &CalibrationState,
        place_m: &Vector3<f64>,
    ) -> Result<SightRows, SightError> {
        let layout = state.layout();
        let linear = state.linear(self.camera, &self.pose, self.s, place_m);
        let linear = linear.ok_or(SightError::Behind)?;
        let (residual, by_place) = self.weighted(state, place_m)?;
        let mut by_parameters = DMatrix::zeros(2, layout.len());
        let first = self.camera * layout.of_camera();
        for (row, sigma) in self.sigma.iter().enumerate() {
            for axis in 0..3 {
                by_parameters[(row, first + axis)] = linear.by_offset[(row, axis)] / sigma;
                // The spacecraft moves in the opposite sense to the point.
                let by_position = -by_place[(row, axis)];
                by_parameters[(row, layout.orbit() + axis)] = by_position * self.pose.after_lines;
            }
            let mut power = 1.0;
            for index in 0..=layout.order {
                by_parameters[(row, first + 3 + row * (layout.order + 1) + index)] = -power / sigma;
                power *= self.s;
            }
        }
        Ok(SightRows {
            residual,
            by_place,
            by_parameters,
        })
    }

    /// Position and direction of its ray, body-fixed.
    fn ray(&self, state: &CalibrationState) -> (Vector3<f64>, Vector3<f64>) {
        let look = state.cameras[self.camera].look(self.s);
        let direction = self.pose.body_to_axes.tr_mul(&look).normalize();
        let position_m = state.position_m(&self.pose);
        (position_m, direction)
    }

    /// First intersection of its ray with the sphere of a radius, body-fixed metres.
    #[must_use]
    pub fn at_radius(&self, state: &CalibrationState, radius_m: f64) -> Option<Vector3<f64>> {
        let (position_m, direction) = self.ray(state);
        let towards = -position_m.dot(&direction);
        let square = towards * towards - position_m.norm_squared() + radius_m * radius_m;
        (square >= 0.0 && towards > 0.0).then(|| position_m + direction * (towards - square.sqrt()))
    }
}

impl GroundPoint {
    /// The point from its sights only.
    #[must_use]
    pub fn unaided(&self) -> Self {
        Self {
            sights: self.sights.clone(),
            known: None,
        }
    }

    /// The point nearest to its rays.
    fn start(&self, state: &CalibrationState) -> Result<Vector3<f64>, SightError> {
        if let Some(known) = &self.known {
            return Ok(known.place_m);
        }
        let rays: Vec<_> = self.sights.iter().map(|sight| sight.ray(state)).collect();
        let mut widest: f64 = 0.0;
        let (mut sum, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for (index, (position_m, direction)) in rays.iter().enumerate() {
            for (_, other) in &rays[..index] {
                widest = widest.max(direction.cross(other).norm());
            }
            let across = Matrix3::identity() - direction * direction.transpose();
            sum += across;
            right += across * position_m;
        }
        if !(widest > CONVERGENCE_MIN) {
            return Err(SightError::Parallel);
        }
        let inverse = sum.try_inverse().ok_or(SightError::Parallel)?;
        Ok(inverse * right)
    }

    /// Normal equations of its position over the standard deviations, and the step that they give.
    fn step(
        &self,
        state: &CalibrationState,
        place_m: &Vector3<f64>,
    ) -> Result<(Matrix3<f64>, Vector3<f64>), SightError> {
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for sight in &self.sights {
            let (residual, by_place) = sight.weighted(state, place_m)?;
            normal += by_place.transpose() * by_place;
            right -= by_place.transpose() * residual;
        }
        if let Some(known) = &self.known {
            normal += known.whitening.transpose() * known.whitening;
            right += known.whitening.transpose() * (known.whitening * (known.place_m - place_m));
        }
        Ok((normal, right))
    }

    /// Its position under a calibration, with its control if it has any.
    ///
    /// # Errors
    /// [`SightError`].
    pub fn place(&self, state: &CalibrationState) -> Result<Vector3<f64>, SightError> {
        let mut place_m = self.start(state)?;
        for _ in 0..STEPS_MAX {
            let (normal, right) = self.step(state, &place_m)?;
            let inverse = normal.try_inverse().ok_or(SightError::Parallel)?;
            let step_m = inverse * right;
            place_m += step_m;
            if step_m.norm() < STEP_M {
                return Ok(place_m);
            }
        }
        Err(SightError::NotConverged)
    }

    /// Residuals of its sights at a position, tangents across and along.
    ///
    /// # Errors
    /// [`SightError::Behind`].
    pub fn residuals(
        &self,
        state: &CalibrationState,
        place_m: &Vector3<f64>,
    ) -> Result<Vec<Vector2<f64>>, SightError> {
        let residual = |sight: &Sight| {
            let linear = state.linear(sight.camera, &sight.pose, sight.s, place_m);
            linear
                .map(|linear| linear.residual)
                .ok_or(SightError::Behind)
        };
        self.sights.iter().map(residual).collect()
    }

    /// Covariance of its position from its measurements and the parameters, m².
    ///
    /// # Errors
    /// [`SightError`].
    pub fn covariance_m2(
        &self,
        state: &CalibrationState,
        covariance: &DMatrix<f64>,
        place_m: &Vector3<f64>,
    ) -> Result<Matrix3<f64>, SightError> {
        let (normal, _) = self.step(state, place_m)?;
        let inverse = normal.try_inverse().ok_or(SightError::Parallel)?;
        let mut gain = DMatrix::zeros(3, covariance.nrows());
        for sight in &self.sights {
            let rows = sight.rows(state, place_m)?;
            gain -= inverse * rows.by_place.transpose() * rows.by_parameters;
        }
        let of_parameters = &gain * covariance * gain.transpose();
        Ok(inverse + of_parameters.fixed_view::<3, 3>(0, 0))
    }
}
