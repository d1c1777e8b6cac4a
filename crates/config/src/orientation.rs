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
        /// Number of equal intervals over the image; the number of epochs is larger by one. The default is from Shan et
        /// al. 2005; a second-order polynomial requires at least four epochs to leave residuals.
        intervals: u32 = key(whole_from_to(3, 10_000)).or(30),
        /// Origin of straight rays to the ground: one convention for all camera positions. Files for ISIS and ALE, in
        /// `exchange/centre`, follow the convention of these programs in every run. For every image, the effects of the
        /// other conventions are reported. Ranges are always geometric.
        light_time: LightTime = key(words_of(LightTime::WORDS, [
            "camera position when the light left the ground: light time to the surface and aberration",
            "camera position at the exposure, as for papers that state no convention",
            "apparent camera position from the centre of Mars (LT+S), as in ISIS and ALE",
        ])).or(LightTime::Surface),
        /// Largest position RMSE of the model in use (norm of x, y, z), at the samples for second-order polynomials,
        /// and halfway between the samples for interpolation. The default is about twice the largest value in Table 4
        /// of Shan et al. 2005 (2.3 m).
        position_rmse_max_m: f64 = key(above_to(0.0, 1e6)).or(5.0),
        /// Largest pointing RMSE of the model in use, for each angle, evaluated as for `position_rmse_max_m`. The
        /// default is twice the largest value in Table 4 of Shan et al. 2005 (5.0″).
        pointing_rmse_max_rad as "pointing_rmse_max_arcsec": f64 =
            key(above_to(0.0, 3600.0)).or(10.0).map(|arcsec| arcsec * RADIANS_PER_ARCSECOND),
    }
}

declare_table! {
    /// Projection of the footprints into the images.
    pub struct RegistrationConfig: Deserialize {
        /// Orientation model for the projection of points. Without this key, each image uses `rotation_vector` if this
        /// model is within the limits of `[orientation]`, and `samples` otherwise, with a remark. `registration.json`
        /// and the report state the differences between the model in use and the other models.
        model: Option<CameraModel> = key(words_of(CameraModel::WORDS, [
            "first-order polynomials of positions and angles (Shan, Lee & Yoon 2002)",
            "second-order polynomials (Shan et al. 2005); angles are poorly determined near the equator",
            "second-order polynomials of positions and rotation vector, which is well determined at every latitude",
            "interpolation between the samples, without a polynomial over the whole image",
        ])).unused(r#""samples""#),
        /// Convergence limit of the two published iterations. The default is the published limit. The iterations run in
        /// addition to Newton's method, which computes the coordinates of the products.
        // Below, steps drown in the rounding of coordinates: 1e-9 m of 4e6 m, lines of metres.
        tolerance_lines: f64 = key(from_to(1e-6, 100.0)).or(0.1),
        /// Maximum number of steps of the two published iterations. The default is not from a publication.
        steps_max: u32 = key(whole_from_to(1, 10_000)).or(100),
    }
}
