//! The ground between laser shots: its height by ordinary kriging, with the covariance of its errors.
//!
//! Profiles of a laser altimeter sample the ground every 300 m along the track and every few kilometres across it. The
//! deviation of the ground from its interpolation is estimated from the profiles themselves ([`Variogram`]), anew for every
//! place from the shots around it; errors at neighbouring points are correlated, so their covariance is full
//! ([`SurfaceHeights::covariance_m2`]), and their tails are long ([`tails`]).
//!
//! # Source
//! Ordinary kriging: Cressie 1993, Statistics for spatial data, section 3.2.
//!
//! ```
//! use areograph_base::body::Body;
//! use areograph_geom::{
//!     ellipsoid::on_ellipsoid_m,
//!     surface::{LaserSurface, SurfaceOptions, SurfaceShot},
//! };
//! use nalgebra::Vector3;
//!
//! // A profile along a meridian, 300 m from shot to shot, 50 m above the ellipsoid.
//! let shots: Vec<SurfaceShot> = (0..40)
//!     .map(|shot| {
//!         let north_rad = f64::from(shot) * 300.0 / 3_396_190.0;
//!         let up = Vector3::new(north_rad.cos(), 0.0, north_rad.sin());
//!         let ground_m = on_ellipsoid_m(Body::Mars.model(), &up) + 50.0 * up;
//!         SurfaceShot { ground_m, profile: 0, attitude_known: true, off_nadir_rad: 0.0 }
//!     })
//!     .collect();
//! let surface = LaserSurface::new(&shots, &[], &SurfaceOptions::default())?;
//! let beside = surface.predict(&[shots[20].ground_m + Vector3::new(0.0, 300.0, 0.0)]);
//! assert!((beside.heights_m[0] - 50.0).abs() < 1e-6); // metres; a constant is reproduced
//! // Beside the profile the ground may vary as it does along the profile.
//! assert!((2.0..3.0).contains(&beside.sigma_m(0)));
//! # Ok::<(), areograph_geom::surface::SurfaceError>(())
//! ```

mod crossovers;
mod fractional_power;
#[cfg(test)]
mod invented_profiles;
mod kriging;
mod left_out;
mod plan;
mod plan_shifts;
mod prediction;
mod profiles;
mod shot;
pub mod tails;
mod variogram;
mod withheld;

use nalgebra::{Vector2, Vector3};

use self::{
    kriging::Kriging, plan::Plan, prediction::OfProfiles, shot::PROFILE_PLAN_M,
    variogram::Roughness,
};
use crate::ellipsoid::height_m;
use areograph_base::body::{Body, BodyModel};

pub use crossovers::{Crossover, crossovers};
pub use left_out::{LeftOut, ProfilePriors};
pub use plan_shifts::PlanShifts;
pub use prediction::{MeanHeight, PlaceHeight, ProfileOnRelief, Relief, SurfaceHeights};
pub use profiles::{ProfileNet, ProfileShift};
pub use shot::{
    NADIR_MAX_RAD, SharedErrors, SurfaceShot, attitude_sigma_m, turned_sigmas_m, with_across_track,
};
pub use variogram::Variogram;
pub use withheld::{Withheld, WithheldScore, withheld};

/// Maximum number of shots for kriging: the cost of the equations grows with their cube.
const SHOTS_MAX: usize = 1500;
/// With more shots, those within this distance of a requested point are used, metres.
const NEAR_M: f64 = 3_000.0;
/// Minimum number of shots of a surface.
const SHOTS_MIN: usize = 10;
/// Half the baseline of gradients, metres: less than a footprint of the laser.
const GRADIENT_STEP_M: f64 = 30.0;

/// Uncertainties of a surface of laser shots.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceOptions {
    /// Noise of the height of a shot, metres.
    pub shot_sigma_m: f64,
    /// Radial error that all shots of a profile share, metres.
    pub profile_sigma_m: f64,
    /// Planimetric error between the requested points and the shots on each axis, common to all of them, metres; on a
    /// slope it becomes a height error.
    pub plan_sigma_m: f64,
    /// Minimum roughness, metres at 300 m, see [`Variogram`].
    pub roughness_min_m: f64,
    /// Planimetric error that all shots of a profile share, on each axis, metres.
    pub profile_plan_sigma_m: f64,
    /// Whether relief determines planimetry: the planimetric error between images and shots is then estimated from heights, and is
    /// not part of their own errors.
    pub uses_relief: bool,
    /// The body whose ellipsoid heights refer to.
    pub body: Body,
}

impl Default for SurfaceOptions {
    /// Shots of MOLA to 1 m and their profiles to 1 m radially after crossovers (Neumann et al. 2001); 130 m in
    /// planimetry: 110 m of the images and 70 m of MOLA on an axis.
    fn default() -> Self {
        Self {
            shot_sigma_m: 1.0,
            profile_sigma_m: 1.0,
            plan_sigma_m: 130.0,
            roughness_min_m: 2.0,
            profile_plan_sigma_m: PROFILE_PLAN_M,
            uses_relief: false,
            body: Body::Mars,
        }
    }
}

/// Reasons why a surface cannot be computed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SurfaceError {
    /// Too few shots.
    #[error("{shots} laser shots are too few for a surface; expected at least {SHOTS_MIN}")]
    TooFew {
        /// Shots.
        shots: usize,
    },
    /// Shots or options without a positive definite covariance.
    #[error(
        "laser shots do not determine a surface: a coordinate or a standard deviation is not a number"
    )]
    NotANumber,
}

/// The ground from laser shots.
#[derive(Debug, Clone)]
pub struct LaserSurface {
    plan: Plan,
    kriging: Kriging,
    of_profiles: OfProfiles,
    roughness: Roughness,
    options: SurfaceOptions,
}

impl LaserSurface {
    /// The surface of `shots` for heights near the points `around`, Mars-fixed, metres: with very many shots, the ones
    /// near these points are used.
    ///
    /// # Errors
    /// Too few shots, a coordinate or standard deviation that is not finite.
    pub fn new(
        shots: &[SurfaceShot],
        around: &[Vector3<f64>],
        options: &SurfaceOptions,
    ) -> Result<Self, SurfaceError> {
        Self::of(shots, around, options, None)
    }

    /// The same where shifts of profiles in plan are known from their crossovers: they are removed from the shots, and
    /// where relief determines planimetry, their covariance replaces `profile_plan_sigma_m`.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with_plan_shifts(
        shots: &[SurfaceShot],
        around: &[Vector3<f64>],
        options: &SurfaceOptions,
        shifts: &PlanShifts,
    ) -> Result<Self, SurfaceError> {
        Self::of(&shifts.removed_from(shots), around, options, Some(shifts))
    }

    fn of(
        shots: &[SurfaceShot],
        around: &[Vector3<f64>],
        options: &SurfaceOptions,
        shifts: Option<&PlanShifts>,
    ) -> Result<Self, SurfaceError> {
        if shots.len() < SHOTS_MIN {
            return Err(SurfaceError::TooFew { shots: shots.len() });
        }
        let model = options.body.model();
        let plan = Plan::around(model, shots.iter().map(|shot| shot.ground_m));
        let placed: Vec<Placed> = shots
            .iter()
            .map(|shot| Placed::new(model, &plan, shot, options.profile_sigma_m))
            .collect();
        let roughness = Roughness::learn(&placed, options);
        let around: Vec<Vector2<f64>> = around.iter().map(|place| plan.of(place)).collect();
        let taken = thinned(near(placed, &around));
        if taken.len() < SHOTS_MIN {
            return Err(SurfaceError::TooFew { shots: taken.len() });
        }
        let (shot_m, profile_m) = (options.shot_sigma_m, options.profile_sigma_m);
        let kriging = Kriging::new(taken, roughness.all, shot_m, profile_m)
            .ok_or(SurfaceError::NotANumber)?;
        Ok(Self {
            plan,
            of_profiles: OfProfiles::new(&kriging, options, shifts),
            kriging,
            roughness,
            options: *options,
        })
    }

    /// Roughness of the ground, of all shots.
    #[must_use]
    pub const fn variogram(&self) -> Variogram {
        self.kriging.variogram
    }

    /// Profiles that shots of the surface belong to, by their indices, ascending.
    #[must_use]
    pub fn profiles(&self) -> Vec<usize> {
        self.kriging.profiles()
    }

    /// Whether heights above it determine planimetry.
    #[must_use]
    pub const fn uses_relief(&self) -> bool {
        self.options.uses_relief
    }

    /// A priori standard deviation of the shift of a profile in plan on an axis, metres.
    #[must_use]
    pub const fn profile_plan_sigma_m(&self) -> f64 {
        self.options.profile_plan_sigma_m
    }

    /// Number of shots of the surface.
    #[must_use]
    pub fn shots(&self) -> usize {
        self.kriging.shots.len()
    }

    /// Height of a point above the ellipsoid of the surface's body along the radius, metres, and its change with the
    /// point.
    #[must_use]
    pub fn height_m(&self, place_m: &Vector3<f64>) -> (f64, Vector3<f64>) {
        height_m(self.options.body.model(), place_m)
    }
}

/// A shot in planimetry.
#[derive(Debug, Clone, Copy)]
struct Placed {
    plan_m: Vector2<f64>,
    height_m: f64,
    profile: usize,
    /// Factors of the errors that its profile shares.
    shared: SharedErrors,
}

impl Placed {
    fn new(model: &BodyModel, plan: &Plan, shot: &SurfaceShot, profile_sigma_m: f64) -> Self {
        Self {
            plan_m: plan.of(&shot.ground_m),
            height_m: height_m(model, &shot.ground_m).0,
            profile: shot.profile,
            shared: shot.shared(profile_sigma_m),
        }
    }
}

/// From too many shots, those near the points `around`.
fn near(shots: Vec<Placed>, around: &[Vector2<f64>]) -> Vec<Placed> {
    if shots.len() <= SHOTS_MAX || around.is_empty() {
        return shots;
    }
    let is_near = |shot: &Placed| {
        let mut distances_m = around.iter().map(|place| (place - shot.plan_m).norm());
        distances_m.any(|distance_m| distance_m < NEAR_M)
    };
    shots.into_iter().filter(is_near).collect()
}

/// From too many shots, every second, third …
fn thinned(shots: Vec<Placed>) -> Vec<Placed> {
    let step = shots.len().div_ceil(SHOTS_MAX).max(1);
    shots.into_iter().step_by(step).collect()
}

#[cfg(test)]
mod tests;
