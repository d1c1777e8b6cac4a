//! `[laser_surface]`.

use serde::Deserialize;

use areograph_base::body::Body;
use areograph_geom::surface::SurfaceOptions;

use super::{
    declare::{declare_table, key},
    forms::{from_to, zero_or},
};

declare_table! {
    /// The ground between the shots of all profiles, with which heights of tie points are compared and, in the
    /// default adjustment, controlled.
    pub struct MolaSurfaceConfig: Deserialize {
        /// Standard deviation of the height of a shot.
        shot_sigma_m: f64 = key(from_to(0.01, 1e4)).or(SurfaceOptions::default().shot_sigma_m),
        /// Radial error that all shots of a profile share (1 m after crossovers, Neumann et al. 2001).
        profile_sigma_m: f64 = key(zero_or(1e-3, 1e4)).or(SurfaceOptions::default().profile_sigma_m),
        /// Error in plan between images and shots, shared by all tie points; on a slope it becomes a height error. The
        /// default combines 110 m of the images and 70 m of MOLA.
        plan_sigma_m: f64 = key(zero_or(1e-3, 1e5)).or(SurfaceOptions::default().plan_sigma_m),
        /// Standard deviation of the position of a profile in plan, per axis (MOLA's 100 m in the horizontal, Neumann
        /// et al. 2001). Stated accuracies of footprints contain it; it weighs profiles where `adjustment.relief_for_plan`
        /// or `adjustment.common_bus` is "yes".
        profile_plan_sigma_m: f64 = key(from_to(1e-3, 1e5)).or(70.0),
        /// Least roughness: root mean square difference of heights 300 m apart. Larger values are estimated from the
        /// shots.
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
            relief_sigma_m: None,
            body,
        }
    }
}
