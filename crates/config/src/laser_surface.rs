//! `[laser_surface]`.

use serde::Deserialize;

use areograph_base::body::Body;
use areograph_geom::surface::SurfaceOptions;

use super::{
    declare::{declare_table, key},
    forms::{from_to, zero_or},
};

declare_table! {
    /// Laser surface: the ground between the shots of all profiles. It is compared with the heights of tie points and,
    /// in the default adjustment, controls them.
    pub struct MolaSurfaceConfig: Deserialize {
        /// Standard deviation of the height of a shot.
        shot_sigma_m: f64 = key(from_to(0.01, 1e4)).or(SurfaceOptions::default().shot_sigma_m),
        /// Standard deviation of the radial error shared by all shots of a profile (1 m after crossover correction,
        /// Neumann et al. 2001).
        profile_sigma_m: f64 = key(zero_or(1e-3, 1e4)).or(SurfaceOptions::default().profile_sigma_m),
        /// Standard deviation of the plan error between images and shots, shared by all tie points; on slopes, this
        /// error becomes a height error. The default combines 110 m for the images and 70 m for MOLA.
        plan_sigma_m: f64 = key(zero_or(1e-3, 1e5)).or(SurfaceOptions::default().plan_sigma_m),
        /// Standard deviation of the plan position of a profile, per axis (100 m horizontally for MOLA, Neumann et al.
        /// 2001). The stated accuracies of footprints include this value. It is also used in the test for misplaced
        /// profiles and, where relief or the common bus determines the position (`adjustment.relief_for_plan`,
        /// `adjustment.common_bus`), as the a priori standard deviation of the shift of a profile.
        profile_plan_sigma_m: f64 = key(from_to(1e-3, 1e5)).or(70.0),
        /// Lower limit of the roughness estimated from the shots: root mean square difference of heights 300 m apart.
        roughness_min_m: f64 = key(from_to(0.01, 1e4)).or(SurfaceOptions::default().roughness_min_m),
    }
}

impl MolaSurfaceConfig {
    /// Uncertainties of the surface of `body`.
    #[must_use]
    pub const fn options(&self, body: Body) -> SurfaceOptions {
        SurfaceOptions {
            shot_sigma_m: self.shot_sigma_m,
            profile_sigma_m: self.profile_sigma_m,
            plan_sigma_m: self.plan_sigma_m,
            roughness_min_m: self.roughness_min_m,
            profile_plan_sigma_m: self.profile_plan_sigma_m,
            uses_relief: false,
            body,
        }
    }
}
