//! Laser shots, and the errors that the shots of a profile share.

use nalgebra::Vector3;

use crate::ellipsoid::local_axes;

/// Errors that a profile of unknown attitude shares, over the errors of others: robust spread of their crossovers at a
/// real window near the south pole, 2.9 against 0.7 m.
const UNKNOWN_ATTITUDE: f64 = 4.0;
/// Height error of a profile off nadir over the tangent of its angle, metres: five passes of 11 to 28° in three real windows
/// differ by 7 to 153 m from the profiles that they cross after the crossover correction, by 206 m times the tangent (root mean
/// square). An attitude error of 0.5 mrad has this effect.
const OFF_NADIR_M: f64 = 200.0;
/// Profiles at smaller angles point at nadir, radians: errors of their attitude are in the radial error of all profiles.
pub const NADIR_MAX_RAD: f64 = std::f64::consts::PI / 180.0;
/// Shift of a profile at nadir in plan on an axis, metres (Neumann et al. 2001), of which [`SharedErrors::plan`] is a multiple.
pub(super) const PROFILE_PLAN_M: f64 = 70.0;

/// A laser shot on the ground. Shots of a profile are in their order along it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceShot {
    /// Its footprint, Mars-fixed, metres.
    pub ground_m: Vector3<f64>,
    /// Index of its profile.
    pub profile: usize,
    /// Whether the direction of the laser is known, as the attitude flag of its file states it. Where it is not, errors that
    /// its profile shares are larger, in plan and along the radius.
    pub attitude_known: bool,
    /// Angle of the laser off nadir, radians: an attitude error changes the height of such shots.
    pub off_nadir_rad: f64,
}

/// Standard deviations of the shift of a profile off nadir by the attitude, across its track and along the radius, metres; 0 at
/// nadir, where the errors of all profiles contain it.
///
/// * `off_nadir_rad` – angle of its beam off nadir
#[must_use]
pub fn turned_sigmas_m(off_nadir_rad: f64) -> [f64; 2] {
    if off_nadir_rad.abs() > NADIR_MAX_RAD {
        [OFF_NADIR_M, OFF_NADIR_M * off_nadir_rad.abs().tan()]
    } else {
        [0.0; 2]
    }
}

/// Standard deviation of the shift of a profile along the radius due to its attitude, in addition to `profile_sigma_m`, metres; 0
/// at nadir where the attitude is known.
///
/// * `attitude_known`, `off_nadir_rad` – see [`SurfaceShot`]
/// * `profile_sigma_m` – radial error of a profile at nadir of known attitude
#[must_use]
pub fn attitude_sigma_m(attitude_known: bool, off_nadir_rad: f64, profile_sigma_m: f64) -> f64 {
    let [_, up_m] = turned_sigmas_m(off_nadir_rad);
    let unknown_m = if attitude_known {
        0.0
    } else {
        profile_sigma_m * (UNKNOWN_ATTITUDE.powi(2) - 1.0).sqrt()
    };
    up_m.hypot(unknown_m)
}

/// Standard deviations in east, north and height with an additional one across a track, metres.
///
/// * `ends_m` – first and last place of the track, Mars-fixed; of a single place the direction is unknown, and nothing is added
#[must_use]
pub fn with_across_track(
    sigmas_m: Vector3<f64>,
    ends_m: [&Vector3<f64>; 2],
    across_m: f64,
) -> Vector3<f64> {
    let along = local_axes(ends_m[0]) * (ends_m[1] - ends_m[0]);
    let track = along.xy().try_normalize(0.0).unwrap_or_default();
    Vector3::new(
        sigmas_m.x.hypot(across_m * track.y),
        sigmas_m.y.hypot(across_m * track.x),
        sigmas_m.z,
    )
}

/// Errors that the shots of a profile share, relative to a profile at nadir of known attitude.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SharedErrors {
    /// Along the radius.
    pub radial: f64,
    /// In plan.
    pub plan: f64,
}

impl SharedErrors {
    /// Shared errors of a profile at nadir of known attitude.
    pub(super) const LEAST: Self = Self {
        radial: 1.0,
        plan: 1.0,
    };

    /// Standard deviation of the plan shift of a profile in addition to the shift of a profile at nadir of known
    /// attitude, metres: √(σ² − σ₀²).
    pub(super) fn farther_m(&self) -> f64 {
        PROFILE_PLAN_M * (self.plan.powi(2) - 1.0).max(0.0).sqrt()
    }

    /// The larger ones of two.
    pub(super) const fn or_larger(self, other: &Self) -> Self {
        Self {
            radial: self.radial.max(other.radial),
            plan: self.plan.max(other.plan),
        }
    }
}

impl SurfaceShot {
    /// Factors of the errors that its profile shares; `profile_sigma_m` is the radial one of a profile at nadir.
    pub(super) fn shared(&self, profile_sigma_m: f64) -> SharedErrors {
        let attitude = if self.attitude_known {
            1.0
        } else {
            UNKNOWN_ATTITUDE
        };
        let [across_m, up_m] = turned_sigmas_m(self.off_nadir_rad);
        let radial = if profile_sigma_m > 0.0 {
            f64::hypot(attitude, up_m / profile_sigma_m)
        } else {
            attitude
        };
        SharedErrors {
            radial,
            plan: attitude.hypot(across_m / PROFILE_PLAN_M),
        }
    }
}
