//! What cameras miss the known place of a point by, in the plane and in height, and what is to be expected of that.

use nalgebra::{DMatrix, Matrix3, Vector3};

use super::{
    camera::CalibrationState,
    sight::{GroundPoint, KnownPlace, SightError, SightRows},
};
use crate::ellipsoid::local_axes;

/// Sum of squares over the variances of measurement and known place, and the sum that is to be expected.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Missed {
    /// Of the coordinates.
    pub square: f64,
    /// What that is on average when standard deviations are true: the number of coordinates, more by the parameters' own errors for a point
    /// that was not used to find them, less for one that was.
    pub expected: f64,
    /// How many coordinates are free to differ: all of a point that was not used, and as many as are expected of one that was.
    pub free: f64,
}

/// What a point of known place misses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Misfit {
    /// East and north.
    pub plane: Missed,
    /// Up; none of a point that one camera sees, which tells no height.
    pub height: Option<Missed>,
}

/// Whether a point took part in finding the parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TookPart {
    /// It did, and drew them towards it.
    Yes,
    /// It was held back.
    No,
}

impl GroundPoint {
    /// The middle of where its sights meet the sphere of a radius.
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

    /// What the cameras miss a known place by; `None` for a point of unknown place.
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
        // By one sight, or by parallel ones, a place is seen in the plane alone.
        let (place_m, axes) = match self.unaided().place(state) {
            Ok(place_m) => (place_m, 3),
            Err(_) => (self.at_radius(state, known.place_m.norm())?, 2),
        };
        // Where it is seen: control may lie kilometres off, where angles that cancel in the solution would not.
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

/// Rows of all sights of a point where they see it, over their standard deviations.
struct Stacked {
    by_place: DMatrix<f64>,
    by_parameters: DMatrix<f64>,
    /// Covariance of the residuals by measurement and known place.
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
