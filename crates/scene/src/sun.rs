//! The orbit of Mars around the Sun, for light time, aberration and illumination angles.

use nalgebra::Vector3;

use super::orbit::{OrbitState, eccentric_anomaly};
use areograph_base::{
    time::Et,
    units::{RADIANS_PER_DEGREE, SECONDS_PER_DAY},
};
use areograph_geom::body_rotation::{frame_rotation_1, frame_rotation_3};

/// Metres in an astronomical unit.
const ASTRONOMICAL_UNIT_M: f64 = 149_597_870_700.0;
/// Obliquity of the ecliptic at J2000, degrees.
const OBLIQUITY_DEG: f64 = 23.439_28;

/// Position of Mars from the Sun at `et`, metres, J2000.
///
/// # Accuracy
/// About 25″ of longitude in 1800–2050, 0.03° as an illumination angle.
/// # Source
/// Standish, "Keplerian elements for approximate positions of the major planets", table 1.
pub(super) fn mars_from_sun_m(et: Et) -> Vector3<f64> {
    let centuries = et.seconds() / (36_525.0 * SECONDS_PER_DAY);
    let at = |value: f64, per_century: f64| value + per_century * centuries;
    let semi_major_axis_m = at(1.523_710_34, 0.000_018_47) * ASTRONOMICAL_UNIT_M;
    let eccentricity = at(0.093_394_10, 0.000_078_82);
    let inclination_rad = at(1.849_691_42, -0.008_131_31) * RADIANS_PER_DEGREE;
    let longitude_deg = at(-4.553_432_05, 19_140.302_684_99);
    let periapsis_deg = at(-23.943_629_59, 0.444_410_88);
    let node_deg = at(49.559_538_91, -0.292_573_43);

    let mean_rad = (longitude_deg - periapsis_deg).rem_euclid(360.0) * RADIANS_PER_DEGREE;
    let (sin, cos) = eccentric_anomaly(mean_rad, eccentricity).sin_cos();
    let minor = (1.0 - eccentricity * eccentricity).sqrt();
    let in_plane = semi_major_axis_m * Vector3::new(cos - eccentricity, minor * sin, 0.0);
    frame_rotation_1(-OBLIQUITY_DEG * RADIANS_PER_DEGREE)
        * frame_rotation_3(-node_deg * RADIANS_PER_DEGREE)
        * frame_rotation_1(-inclination_rad)
        * frame_rotation_3(-(periapsis_deg - node_deg) * RADIANS_PER_DEGREE)
        * in_plane
}

/// State of Mars from the Sun at `et`, J2000; its velocity by central differences over two minutes.
pub(super) fn mars_state_from_sun(et: Et) -> OrbitState {
    const STEP_S: f64 = 60.0;
    OrbitState {
        position_m: mars_from_sun_m(et),
        velocity_m_s: (mars_from_sun_m(et.plus(STEP_S)) - mars_from_sun_m(et.plus(-STEP_S)))
            / (2.0 * STEP_S),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mars_was_nearest_to_the_sun_in_october_2001() {
        // Perihelion passage of 2001-10-12, 1.381 au; ET counts from 2000-01-01.
        let distance_au = |day: f64| {
            mars_from_sun_m(Et::from_seconds(day * SECONDS_PER_DAY)).norm() / ASTRONOMICAL_UNIT_M
        };
        let days: Vec<f64> = (300..1000).map(f64::from).collect();
        let nearest = days
            .into_iter()
            .min_by(|a, b| distance_au(*a).total_cmp(&distance_au(*b)))
            .unwrap();
        assert!((nearest - 649.5).abs() < 2.0, "day {nearest}"); // days; the extremum is flat
        assert!((distance_au(nearest) - 1.3814).abs() < 0.0005);
    }
}
