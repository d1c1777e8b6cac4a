//! Position of the Sun while an image is taken.

use nalgebra::Vector3;

use super::super::{drawn::Flown, plan::PlannedImage, sun::mars_from_sun_m};
use areograph_base::{
    body::MARS_IAU2000,
    time::Et,
    units::{RADIANS_PER_DEGREE, SECONDS_PER_DAY},
};
use areograph_geom::{body_rotation::body_matrix, ellipsoid::local_axes};

/// The image lit as if it had been taken half a Mars year later at the same hour: the images of the other pairs were
/// taken within seven weeks.
const OF_OTHER_SEASON: &str = "E02-01453";
/// Half a year of Mars, seconds.
const HALF_YEAR_S: f64 = 343.49 * SECONDS_PER_DAY;

/// Towards the Sun at the middle of an image's exposure, unit vector in IAU 2000.
pub(super) fn sun(flown: &Flown) -> Vector3<f64> {
    let exposed = flown.arc.exposed;
    let middle = exposed.start.plus(0.5 * exposed.duration_s());
    let towards = |et: Et| (body_matrix(&MARS_IAU2000, et) * -mars_from_sun_m(et)).normalize();
    let sun = towards(middle);
    if flown.arc.image.id != OF_OTHER_SEASON {
        return sun;
    }
    let declination_sin = towards(middle.plus(HALF_YEAR_S)).z;
    let hour = Vector3::new(sun.x, sun.y, 0.0).normalize();
    (1.0 - declination_sin * declination_sin).sqrt() * hour + declination_sin * Vector3::z()
}

/// Incidence angle of the Sun over the site of an image, and its azimuth from north to east, degrees.
pub(super) fn incidence_and_azimuth_deg(image: &PlannedImage, sun: &Vector3<f64>) -> [f64; 2] {
    let local = local_axes(&image.site.direction()) * sun;
    let azimuth_rad = local.x.atan2(local.y).rem_euclid(std::f64::consts::TAU);
    [local.z.acos(), azimuth_rad].map(|angle_rad| angle_rad / RADIANS_PER_DEGREE)
}
