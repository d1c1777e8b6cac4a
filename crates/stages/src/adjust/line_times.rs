//! Errors of the line times in the stated accuracy of a camera.
//!
//! Tie points do not separate a delay of all lines of an image from a rotation about the axis across the flight, so
//! line times are no unknown: the a priori standard deviation of rotations allows for them. The adjusted orientation
//! then shows the ground where it is, but its position belongs to the tag of a line, and its rotation contains the
//! flight of the camera until the exposure. The delay is an error of the position at the exposure; together with the
//! rotation it shows the same ground.
//!
//! With the a priori covariance `Σ₀ = P⁻¹` of the adjustment and the cofactors `Q`, the error of an estimate is
//! `−Q P x` plus the error from the observations. If a delay moves the camera by `D` and the ground in its lines as the
//! rotation `g` does, the true a priori covariance is `Σ₀ + σ²(D Dᵀ − g gᵀ)`, and the covariance of the estimate, as
//! observations do not distinguish `D` from `g`, `Q + σ²(D Dᵀ − g gᵀ − (D − g)uᵀ − u(D − g)ᵀ)`, `u = g − Q P g`. No
//! function of image and ground changes its variance by it.
//!
//! # Source
//! The error of a least-squares estimate whose a priori covariance is not the true one; derived here.

use nalgebra::{DMatrix, DVector, Vector3};

use areograph_base::footprints::AdjustmentModel;
use areograph_config::AdjustmentConfig;
use areograph_geom::{bundle::ORIENTATION_UNKNOWNS, pushbroom::ExteriorOrientation};

/// First rotation of the unknowns of an image.
const ROTATIONS: usize = ORIENTATION_UNKNOWNS / 2;
/// A smaller share of a rotation about an axis that is held is curvature, not the effect of a delay.
const HELD_SHARE: f64 = 1e-3;

/// Effect of a delay of all lines of an image on the unknowns of its orientation, per second.
#[derive(Debug, Clone, PartialEq)]
pub struct LineDelay {
    /// Difference of the camera at the exposure of a line from the camera at its tag: metres and radians.
    moved: [f64; ORIENTATION_UNKNOWNS],
    /// The rotation that moves the ground in the image as much: radians.
    seen_as: [f64; ORIENTATION_UNKNOWNS],
}

impl LineDelay {
    /// The delay of an image of `2 half_lines` lines, one every `line_period_s`, of ground at a distance of `range_m`.
    pub(super) fn of(
        orientation: &impl ExteriorOrientation,
        half_lines: f64,
        line_period_s: f64,
        range_m: f64,
    ) -> Self {
        let advance_m = |x: f64| orientation.pose_and_rate(x).1.advance_m;
        let (pose, rate) = orientation.pose_and_rate(0.0);
        let velocity_m_s = rate.advance_m / line_period_s;
        let change_m_s = (advance_m(half_lines) - advance_m(-half_lines)) / (2.0 * line_period_s);
        let turn_rad_s = rate.turn_rad / line_period_s;
        let by_motion_rad_s = (pose.mars_to_camera * velocity_m_s).cross(&Vector3::z()) / range_m;
        let (mut moved, mut seen_as) = ([0.0; ORIENTATION_UNKNOWNS], [0.0; ORIENTATION_UNKNOWNS]);
        for axis in 0..3 {
            moved[3 * axis] = velocity_m_s[axis];
            moved[3 * axis + 1] = change_m_s[axis];
            moved[ROTATIONS + 3 * axis] = turn_rad_s[axis];
            seen_as[ROTATIONS + 3 * axis] = turn_rad_s[axis] + by_motion_rad_s[axis];
        }
        Self { moved, seen_as }
    }

    /// The standard deviation of the delay that `prior_sigmas` allow for, at most `sigma_s`, seconds.
    fn allowed_s(&self, sigma_s: f64, prior_sigmas: &[f64; ORIENTATION_UNKNOWNS]) -> f64 {
        let whole = self.seen_as.iter().map(|of| of.powi(2)).sum::<f64>().sqrt();
        let shares = self.seen_as.iter().zip(prior_sigmas);
        let squares = shares.map(|(by_delay, prior_sigma)| {
            if *prior_sigma > 0.0 {
                (by_delay / prior_sigma).powi(2)
            } else if by_delay.abs() > HELD_SHARE * whole {
                f64::INFINITY
            } else {
                0.0
            }
        });
        sigma_s.min(squares.sum::<f64>().sqrt().recip())
    }

    /// Constant rotation that the delay which `prior_sigmas` allow for is seen as, of one standard deviation, radians.
    pub(super) fn constant_turn_rad(
        &self,
        sigma_s: f64,
        prior_sigmas: &[f64; ORIENTATION_UNKNOWNS],
    ) -> Vector3<f64> {
        let allowed_s = self.allowed_s(sigma_s, prior_sigmas);
        Vector3::from_fn(|axis, _| self.seen_as[ROTATIONS + 3 * axis] * allowed_s)
    }

    /// Covariance that a delay adds to an image whose unknowns have these cofactors and a priori standard deviations,
    /// and the standard deviation of the delay, seconds.
    pub(super) fn added(
        &self,
        sigma_s: f64,
        cofactors: &DMatrix<f64>,
        prior_sigmas: &[f64; ORIENTATION_UNKNOWNS],
    ) -> (DMatrix<f64>, f64) {
        let allowed_s = self.allowed_s(sigma_s, prior_sigmas);
        // Unknowns that are held stay so.
        let of_unknowns = |by_delay: &[f64; ORIENTATION_UNKNOWNS]| {
            let solved = by_delay.iter().zip(prior_sigmas);
            let solved = solved.map(|(by_delay, sigma)| if *sigma > 0.0 { *by_delay } else { 0.0 });
            DVector::from_iterator(ORIENTATION_UNKNOWNS, solved) * allowed_s
        };
        let (moved, seen_as) = (of_unknowns(&self.moved), of_unknowns(&self.seen_as));
        let weighted = seen_as.iter().zip(prior_sigmas);
        let weighted = weighted.map(|(of, sigma)| {
            if *sigma > 0.0 {
                of / (sigma * sigma)
            } else {
                0.0
            }
        });
        let weighted = DVector::from_iterator(ORIENTATION_UNKNOWNS, weighted);
        let taken = &seen_as - cofactors * weighted;
        let apart = &moved - &seen_as;
        let mixed = &apart * taken.transpose();
        let added = &moved * moved.transpose()
            - &seen_as * seen_as.transpose()
            - &mixed
            - mixed.transpose();
        (added, allowed_s)
    }
}

/// Standard deviation of the delay of all lines of an image that is not an unknown of the adjustment, seconds.
pub(super) fn delay_sigma_s(config: &AdjustmentConfig) -> f64 {
    let is_unknown = config.time_bias_sigma_s > 0.0;
    // By the attitude clock, line times are right; the published model knows positions to 100 m and no line times.
    if is_unknown || config.attitude_clock || config.model == AdjustmentModel::Published {
        return 0.0;
    }
    let of_shots_s = config.boresight_line_time_sigma_s;
    let of_shots_s = of_shots_s.filter(|_| config.common_bus);
    of_shots_s.unwrap_or(config.line_time_sigma_s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use areograph_geom::pushbroom::{EulerPolynomial, VectorPolynomial};

    const PERIOD_S: f64 = 1.5e-3;
    const RANGE_M: f64 = 380e3;
    const SIGMA_S: f64 = 0.045;

    /// Flies north over the equator, 5 m a line, and looks straight down without turning.
    fn delay() -> LineDelay {
        let still = [Vector3::zeros(); 2];
        let camera = EulerPolynomial {
            path_m: VectorPolynomial {
                coefficients: [
                    Vector3::new(3_776e3, 0.0, 0.0),
                    Vector3::new(0.0, 0.0, 5.0),
                    still[0],
                ],
            },
            angles_rad: VectorPolynomial {
                coefficients: [
                    Vector3::new(0.0, std::f64::consts::FRAC_PI_2, 0.0),
                    still[0],
                    still[1],
                ],
            },
        };
        LineDelay::of(&camera, 4_000.0, PERIOD_S, RANGE_M)
    }

    fn priors() -> [f64; ORIENTATION_UNKNOWNS] {
        std::array::from_fn(|unknown| match (unknown < ROTATIONS, unknown % 3) {
            (true, 0) => 25.0,
            (true, 1) => 0.2,
            (true, _) => 0.0,
            (false, 0) => 4e-4,
            (false, _) => 1e-5,
        })
    }

    /// Without observations, cofactors are the a priori variances: the delay adds the path of the camera to its
    /// position, takes its part from the rotation, and does not change the uncertainty of the ground.
    #[test]
    fn a_delay_moves_the_camera_and_not_the_ground() {
        let (delay, priors) = (delay(), priors());
        let cofactors =
            DMatrix::from_fn(ORIENTATION_UNKNOWNS, ORIENTATION_UNKNOWNS, |row, column| {
                if row == column {
                    priors[row].powi(2)
                } else {
                    0.0
                }
            });
        let (added, allowed_s) = delay.added(SIGMA_S, &cofactors, &priors);
        assert!((allowed_s - SIGMA_S).abs() < 1e-15); // seconds; 0.4 mrad allow for 46 ms
        let way_m = 5.0 / PERIOD_S * SIGMA_S;
        assert!((added[(6, 6)].sqrt() - way_m).abs() < 1e-9); // metres
        let total = &cofactors + &added;
        let turns = (ROTATIONS..ORIENTATION_UNKNOWNS).step_by(3);
        let largest = turns.max_by(|a, b| added[(*a, *a)].abs().total_cmp(&added[(*b, *b)].abs()));
        let about = largest.unwrap();
        assert!((-added[(about, about)]).sqrt() * RANGE_M - way_m < 1e-9);
        assert!(total[(about, about)] > 0.0);
        // Place of the boresight on the ground along the flight: the observable combination of both.
        let sense = delay.seen_as[about].signum();
        let ground_m2 = |of: &DMatrix<f64>| {
            of[(6, 6)]
                + of[(about, about)] * RANGE_M.powi(2)
                + 2.0 * sense * of[(6, about)] * RANGE_M
        };
        // m²: rounding of 2e4.
        assert!((ground_m2(&total) - ground_m2(&cofactors)).abs() < 1e-6);
    }

    #[test]
    fn a_delay_is_no_larger_than_the_rotation_allows_and_held_unknowns_stay_held() {
        let delay = delay();
        let cofactors = DMatrix::zeros(ORIENTATION_UNKNOWNS, ORIENTATION_UNKNOWNS);
        let mut priors = priors();
        for constant in (ROTATIONS..ORIENTATION_UNKNOWNS).step_by(3) {
            priors[constant] = 1e-4;
        }
        let (added, allowed_s) = delay.added(SIGMA_S, &cofactors, &priors);
        // 38 m on the ground are 11.4 ms.
        assert!((allowed_s - 1e-4 * RANGE_M * PERIOD_S / 5.0).abs() < 1e-12);
        assert!(added[(8, 8)].abs() < 1e-30, "{}", added[(8, 8)]);
        priors[ROTATIONS..].fill(0.0);
        let (added, allowed_s) = delay.added(SIGMA_S, &cofactors, &priors);
        assert!(allowed_s.abs() < 1e-30 && added.amax() < 1e-30);
    }
}
