//! Misfit of cameras at control points, in planimetry and in height, and its expectation.

use nalgebra::{DMatrix, Matrix3, Vector3};

use super::{
    camera::CalibrationState,
    sight::{GroundPoint, KnownPlace, SightError, SightRows},
};
use crate::ellipsoid::local_axes;

/// Sum of squares over the variances of measurement and control, and its expectation.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Missed {
    /// Sum of squares of the coordinates.
    pub square: f64,
    /// Its mean when standard deviations are true: the number of coordinates, plus the effect of the parameters' errors
    /// for a withheld point, minus it for a point that was used.
    pub expected: f64,
    /// Number of degrees of freedom: all coordinates of a withheld point, the expected number for one that was used.
    pub free: f64,
}

/// Misfit at a control point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Misfit {
    /// East and north.
    pub plane: Missed,
    /// Up; `None` for a point seen by one camera, which determines no height.
    pub height: Option<Missed>,
}

/// Whether a point was used to estimate the parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TookPart {
    /// It was used, and drew them towards it.
    Yes,
    /// It was withheld.
    No,
}

impl GroundPoint {
    /// The mean of the intersections of its sights with the sphere of a radius.
    fn at_radius(
        &self,
        state: &CalibrationState,
        radius_m: f64,
    ) -> Result<Vector3<f64>, SightError> {
        let mut sum_m = Vector3::zeros();
        for sight in &self.sights {
            sum_m += (sight.at_radius(state, radius_m)).ok_or(SightError::Behind)?;
        }
        Ok(sum_m / self.sights.len() as f64)
    }

    /// Misfit of the cameras at a control point; `None` for a point without control.
    ///
    /// * `covariance` – of the parameters
    ///
    /// # Errors
    /// [`SightError`].
    pub fn misfit(
        &self,
        state: &CalibrationState,
        covariance: &DMatrix<f64>,
        took_part: TookPart,
    ) -> Result<Option<Misfit>, SightError> {
        let Some(known) = &self.known else {
            return Ok(None);
        };
        // One sight, or parallel ones, determine planimetry only.
        let (place_m, axes) = match self.unaided().place(state) {
            Ok(place_m) => (place_m, 3),
            Err(_) => (self.at_radius(state, known.place_m.norm())?, 2),
        };
        // At the point that the cameras see: control may be kilometres away, where angles that cancel in the solution
        // would not.
        let rows = self.sights.iter().map(|sight| sight.rows(state, &place_m));
        let of = Stacked::of(&rows.collect::<Result<Vec<_>, _>>()?, known)?;
        let by_place = &of.by_place * local_axes(&known.place_m).transpose();
        let moves = by_place.columns(0, axes);
        let normal = moves.transpose() * moves;
        let gain = normal.try_inverse().ok_or(SightError::Parallel)? * moves.transpose();
        let mut off_m = local_axes(&known.place_m) * (place_m - known.place_m);
        off_m[2] = place_m.norm() - known.place_m.norm();
        let noise_m2 = &gain * of.noise * gain.transpose();
        let drawn = gain * of.by_parameters;
        let drawn_m2 = &drawn * covariance * drawn.transpose();
        let missed = |at: usize| {
            let share = drawn_m2[(at, at)] / noise_m2[(at, at)];
            let (expected, free) = match took_part {
                TookPart::Yes => ((1.0 - share).max(0.0), (1.0 - share).max(0.0)),
                TookPart::No => (1.0 + share, 1.0),
            };
            Missed {
                square: off_m[at].powi(2) / noise_m2[(at, at)],
                expected,
                free,
            }
        };
        Ok(Some(Misfit {
            plane: missed(0).and(missed(1)),
            height: (axes == 3).then(|| missed(2)),
        }))
    }
}

impl Missed {
    /// Both together.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            square: self.square + other.square,
            expected: self.expected + other.expected,
            free: self.free + other.free,
        }
    }
}

/// Rows of all sights of a point at the point that they see, over their standard deviations.
struct Stacked {
    by_place: DMatrix<f64>,
    by_parameters: DMatrix<f64>,
    /// Covariance of the residuals from measurement and control.
    noise: DMatrix<f64>,
}

impl Stacked {
    fn of(rows: &[SightRows], known: &KnownPlace) -> Result<Self, SightError> {
        let count = 2 * rows.len();
        let parameters = rows.first().map_or(0, |of| of.by_parameters.ncols());
        let mut by_place = DMatrix::zeros(count, 3);
        let mut by_parameters = DMatrix::zeros(count, parameters);
        for (index, of) in rows.iter().enumerate() {
            by_place.rows_mut(2 * index, 2).copy_from(&of.by_place);
            by_parameters
                .rows_mut(2 * index, 2)
                .copy_from(&of.by_parameters);
        }
        let inverse: Matrix3<f64> = (known.whitening.try_inverse()).ok_or(SightError::Parallel)?;
        let spread = &by_place * inverse;
        Ok(Self {
            noise: DMatrix::identity(count, count) + &spread * spread.transpose(),
            by_place,
            by_parameters,
        })
    }
}
