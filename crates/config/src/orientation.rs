//! `[orientation]` and `[registration]`: the sensor model and its use.

use serde::Deserialize;

use areograph_base::units::RADIANS_PER_ARCSECOND;
use areograph_geom::{light_time::LightTime, pushbroom::CameraModel};

use super::{
    declare::{Declare as _, declare_table, key},
    forms::{above_to, from_to, whole_from_to, words_of},
};

declare_table! {
    /// Sampling of exterior orientation and limits of the sensor model.
    pub struct OrientationConfig: Deserialize {
        /// Equal intervals over the image; one epoch more than intervals. The default is that of Shan et
        /// al. 2005; a second-order polynomial through four epochs is the least that leaves residuals.
        intervals: u32 = key(whole_from_to(3, 10_000)).or(30),
        /// Origin of straight rays to the ground: one convention for all positions of the camera in all products. The
        /// distances of the other conventions from it are reported for every image. Ranges are always geometric.
        light_time: LightTime = key(words_of(LightTime::WORDS, [
            "position of the camera when the light left the ground: light time to the surface and aberration",
            "position of the camera at the exposure, as for papers that do not state a convention",
            "apparent position of the camera from the centre of Mars (LT+S): to match ISIS and ALE",
        ])).or(LightTime::Surface),
        /// Largest position RMSE of the model in use, norm of x, y, z: of polynomials of second order at the samples, of
        /// an interpolation between the samples halfway between them. The default is about twice the largest in Table 4
        /// of Shan et al. 2005 (2.3 m).
        position_rmse_max_m: f64 = key(above_to(0.0, 1e6)).or(5.0),
        /// Largest pointing RMSE of the model in use, for each angle, at the same places. The default is twice the
        /// largest in Table 4 of Shan et al. 2005 (5.0″).
        pointing_rmse_max_rad as "pointing_rmse_max_arcsec": f64 =
            key(above_to(0.0, 3600.0)).or(10.0).map(|arcsec| arcsec * RADIANS_PER_ARCSECOND),
    }
}

declare_table! {
    /// Projection of the footprints into the images.
    pub struct RegistrationConfig: Deserialize {
        /// The orientation that points are projected with. Without it, each image uses `rotation_vector` if that keeps the
        /// limits of `[orientation]`, and `samples` otherwise, with a remark. The distances of the other models from the
        /// one in use are reported in `registration.json` and in the report.
        model: Option<CameraModel> = key(words_of(CameraModel::WORDS, [
            "positions and angles as polynomials of first order (Shan, Lee & Yoon 2002)",
            "positions and angles of second order (Shan et al. 2005); angles are poorly determined near the equator",
            "polynomials of second order with a rotation vector, which is well determined at every latitude",
            "interpolation between the samples, no polynomial over the whole image",
        ])).unused(r#""samples""#),
        /// Convergence limit of the two published iterations. The default is the papers' limit. The iterations run
        /// beside Newton's method, which computes the product.
        // Below, steps drown in the rounding of coordinates: 1e-9 m of 4e6 m, lines of metres.
        tolerance_lines: f64 = key(from_to(1e-6, 100.0)).or(0.1),
        /// Maximum number of steps of these iterations. The default is not from a publication.
        steps_max: u32 = key(whole_from_to(1, 10_000)).or(100),
    }
}
