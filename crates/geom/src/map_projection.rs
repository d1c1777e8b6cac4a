//! A map without seams: Lambert's azimuthal equal-area projection about the middle of the points shown.

use nalgebra::Vector3;

use super::ellipsoid::{Spherical, spherical_to_xyz_m};

/// A sphere seen from above a centre; uniform at poles and at 0°, only the antipode is undefined.
///
/// # Source
/// Snyder 1987, Map Projections, USGS Professional Paper 1395, eq. 24-2 to 24-4.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapProjection {
    longitude_rad: f64,
    latitude_rad: f64,
    radius_m: f64,
}

impl MapProjection {
    /// A map of a sphere of `radius_m` about east longitude and areocentric latitude in radians.
    #[must_use]
    pub const fn about(longitude_rad: f64, latitude_rad: f64, radius_m: f64) -> Self {
        Self {
            longitude_rad,
            latitude_rad,
            radius_m,
        }
    }

    /// A map about the middle of `points` (longitude, latitude), radians.
    ///
    /// Points spread evenly over the globe have no middle: then 0° N 0° E.
    #[must_use]
    pub fn of_points(points: impl Iterator<Item = (f64, f64)>, radius_m: f64) -> Self {
        let sum: Vector3<f64> = points
            .map(|(longitude_rad, latitude_rad)| {
                spherical_to_xyz_m(longitude_rad, latitude_rad, 1.0)
            })
            .sum();
        if sum.norm() < f64::EPSILON {
            return Self::about(0.0, 0.0, radius_m);
        }
        let middle = Spherical::from_xyz_m(&sum);
        Self::about(middle.longitude_rad, middle.latitude.0, radius_m)
    }

    /// East longitude of the centre, radians.
    #[must_use]
    pub const fn longitude_rad(&self) -> f64 {
        self.longitude_rad
    }

    /// Areocentric latitude of the centre, radians.
    #[must_use]
    pub const fn latitude_rad(&self) -> f64 {
        self.latitude_rad
    }

    /// East and north of the centre on the map, metres; `None` for the antipode.
    #[must_use]
    pub fn project(&self, longitude_rad: f64, latitude_rad: f64) -> Option<(f64, f64)> {
        let (sin_centre, cos_centre) = self.latitude_rad.sin_cos();
        let (sin_latitude, cos_latitude) = latitude_rad.sin_cos();
        let (sin_turn, cos_turn) = (longitude_rad - self.longitude_rad).sin_cos();
        let cos_distance = sin_centre * sin_latitude + cos_centre * cos_latitude * cos_turn;
        // Below this the position depends on the last bits of the coordinates.
        if 1.0 + cos_distance < 1e-12 {
            return None;
        }
        let scale_m = self.radius_m * (2.0 / (1.0 + cos_distance)).sqrt();
        Some((
            scale_m * cos_latitude * sin_turn,
            scale_m * (cos_centre * sin_latitude - sin_centre * cos_latitude * cos_turn),
        ))
    }

    /// East longitude and areocentric latitude, radians, of a map point in metres; `None` outside the disc that
    /// contains the entire sphere.
    #[must_use]
    pub fn unproject(&self, (x_m, y_m): (f64, f64)) -> Option<(f64, f64)> {
        let distance_m = x_m.hypot(y_m);
        let half_sine = distance_m / (2.0 * self.radius_m);
        if !(half_sine < 1.0) {
            return None;
        }
        if distance_m < f64::EPSILON * self.radius_m {
            return Some((self.longitude_rad, self.latitude_rad));
        }
        let (sin_distance, cos_distance) = (2.0 * half_sine.asin()).sin_cos();
        let (sin_centre, cos_centre) = self.latitude_rad.sin_cos();
        let sine = cos_distance * sin_centre + y_m * sin_distance * cos_centre / distance_m;
        let turn_rad = (x_m * sin_distance)
            .atan2(distance_m * cos_centre * cos_distance - y_m * sin_centre * sin_distance);
        Some((self.longitude_rad + turn_rad, sine.clamp(-1.0, 1.0).asin()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use areograph_base::units::RADIANS_PER_DEGREE;

    const DEGREE: f64 = RADIANS_PER_DEGREE;

    #[test]
    fn snyders_worked_example_comes_back() {
        // Snyder 1987, p. 332: R = 3, centre 40° N 100° W, point 20° S 100° E: x -4.2339303, y 4.0257775.
        let map = MapProjection::about(-100.0 * DEGREE, 40.0 * DEGREE, 3.0);
        let (x, y) = map.project(100.0 * DEGREE, -20.0 * DEGREE).unwrap();
        assert!((x + 4.233_930_3).abs() < 5e-8, "{x}"); // the published digits
        assert!((y - 4.025_777_5).abs() < 5e-8, "{y}");
    }

    #[test]
    fn areas_keep_their_size_at_the_pole_and_across_the_meridian() {
        for (longitude_deg, latitude_deg) in
            [(0.0, 0.0), (359.9, -14.0), (10.0, 89.9), (180.0, -89.0)]
        {
            let map = MapProjection::about(longitude_deg * DEGREE, latitude_deg * DEGREE, 1e6);
            let (east, north) = (0.01 * DEGREE / (latitude_deg * DEGREE).cos(), 0.01 * DEGREE);
            let centre = (longitude_deg * DEGREE, latitude_deg * DEGREE);
            let (x, _) = map.project(centre.0 + east, centre.1).unwrap();
            let (_, y) = map.project(centre.0, centre.1 - north).unwrap();
            let expected_m = 1e6 * 0.01 * DEGREE;
            // At 0.1° from the pole a step along the parallel bends by a tenth of itself: 1 %.
            assert!((x / expected_m - 1.0).abs() < 0.01, "{x}");
            assert!((y / expected_m + 1.0).abs() < 1e-6, "{y}");
        }
    }

    #[test]
    fn places_come_back() {
        for (longitude_deg, latitude_deg) in [(318.0, -14.0), (0.0, 90.0), (180.0, -89.5)] {
            let map = MapProjection::about(longitude_deg * DEGREE, latitude_deg * DEGREE, 1e6);
            for place in [(0.0, 0.0), (1e5, -2e5), (-1.2e6, 1e6)] {
                let (longitude_rad, latitude_rad) = map.unproject(place).unwrap();
                let (x, y) = map.project(longitude_rad, latitude_rad).unwrap();
                // A micrometre, beside rounding of angles near the pole.
                assert!((x - place.0).hypot(y - place.1) < 1e-3, "{x} {y} {place:?}");
            }
            assert!(map.unproject((2e6, 1e5)).is_none());
        }
    }

    #[test]
    fn the_middle_of_points_around_a_pole_is_the_pole() {
        let ring = (0..8).map(|k| (f64::from(k) * 45.0 * DEGREE, 85.0 * DEGREE));
        let map = MapProjection::of_points(ring, 1.0);
        assert!((map.latitude_rad() - 90.0 * DEGREE).abs() < 1e-12); // rounding
        assert!(map.project(map.longitude_rad(), -90.0 * DEGREE).is_none());
        assert!(
            MapProjection::of_points(std::iter::empty(), 1.0)
                .latitude_rad()
                .abs()
                < 1e-12
        );
    }
}
