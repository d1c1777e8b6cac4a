//! Conformal maps of a sphere: small figures keep their shape, so that rectified pictures fit by a similarity.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use serde::Serialize;

/// Kind of conformal projection.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Projection {
    /// Mercator's, on the equator.
    Mercator,
    /// Stereographic, about any point.
    Stereographic,
}

/// A conformal map.
///
/// # Source
/// Snyder 1987, Map Projections, USGS Professional Paper 1395, eq. 7-1 to 7-5 and 21-2 to 21-15, on a sphere.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ConformalMap {
    /// The projection.
    pub projection: Projection,
    /// East longitude of the central meridian or of the centre, radians.
    pub longitude_rad: f64,
    /// Areocentric latitude at which the scale is true, or of the centre, radians.
    pub latitude_rad: f64,
    /// Radius of the sphere, metres.
    pub radius_m: f64,
}

impl ConformalMap {
    /// East and north on the map, metres; `None` for a pole of Mercator's projection and for the antipode of the
    /// centre.
    #[must_use]
    pub fn project(&self, longitude_rad: f64, latitude_rad: f64) -> Option<(f64, f64)> {
        let turn_rad = (longitude_rad - self.longitude_rad + PI).rem_euclid(TAU) - PI;
        let (sin, cos) = latitude_rad.sin_cos();
        let (sin_centre, cos_centre) = self.latitude_rad.sin_cos();
        match self.projection {
            Projection::Mercator => {
                let equator_m = self.radius_m * cos_centre;
                let far = FRAC_PI_2 - latitude_rad.abs() > 1e-9;
                far.then(|| (equator_m * turn_rad, equator_m * (sin / cos).asinh()))
            }
            Projection::Stereographic => {
                let (sin_turn, cos_turn) = turn_rad.sin_cos();
                let cos_distance = sin_centre * sin + cos_centre * cos * cos_turn;
                let scale_m = 2.0 * self.radius_m / (1.0 + cos_distance);
                (1.0 + cos_distance > 1e-12).then_some((
                    scale_m * cos * sin_turn,
                    scale_m * (cos_centre * sin - sin_centre * cos * cos_turn),
                ))
            }
        }
    }

    /// East longitude in `-π..π` and areocentric latitude, radians, of a map point, metres.
    #[must_use]
    pub fn unproject(&self, (x_m, y_m): (f64, f64)) -> (f64, f64) {
        let (sin_centre, cos_centre) = self.latitude_rad.sin_cos();
        let (turn_rad, latitude_rad) = match self.projection {
            Projection::Mercator => {
                let equator_m = self.radius_m * cos_centre;
                (x_m / equator_m, (y_m / equator_m).sinh().atan())
            }
            Projection::Stereographic => {
                let distance_m = x_m.hypot(y_m);
                let angle_rad = 2.0 * (distance_m / (2.0 * self.radius_m)).atan();
                let (sin, cos) = angle_rad.sin_cos();
                let (east, north) = if distance_m > 0.0 {
                    (x_m / distance_m, y_m / distance_m)
                } else {
                    (0.0, 0.0)
                };
                let sine = (cos * sin_centre + north * sin * cos_centre).clamp(-1.0, 1.0);
                let turn = (east * sin).atan2(cos_centre * cos - north * sin_centre * sin);
                (turn, sine.asin())
            }
        };
        let longitude_rad = (self.longitude_rad + turn_rad + PI).rem_euclid(TAU) - PI;
        (longitude_rad, latitude_rad)
    }

    /// Metres on the map for a metre on the sphere at a map point.
    #[must_use]
    pub fn scale(&self, place_m: (f64, f64)) -> f64 {
        match self.projection {
            Projection::Mercator => self.latitude_rad.cos() / self.unproject(place_m).1.cos(),
            Projection::Stereographic => {
                1.0 + (place_m.0.hypot(place_m.1) / (2.0 * self.radius_m)).powi(2)
            }
        }
    }

    /// Change of the scale with distance on the sphere, `|∇ ln k|`, per metre, at a map point.
    #[must_use]
    pub fn scale_gradient(&self, place_m: (f64, f64)) -> f64 {
        match self.projection {
            Projection::Mercator => self.unproject(place_m).1.tan().abs() / self.radius_m,
            // tan(c/2) of the angle from the centre.
            Projection::Stereographic => place_m.0.hypot(place_m.1) / (2.0 * self.radius_m.powi(2)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use areograph_base::units::RADIANS_PER_DEGREE as DEGREE;

    fn map(
        projection: Projection,
        longitude_deg: f64,
        latitude_deg: f64,
        radius_m: f64,
    ) -> ConformalMap {
        ConformalMap {
            projection,
            longitude_rad: longitude_deg * DEGREE,
            latitude_rad: latitude_deg * DEGREE,
            radius_m,
        }
    }

    #[test]
    fn snyders_worked_example_comes_back() {
        // Snyder 1987, p. 266: R = 1, central meridian 180° W, point 35° N 75° W: x 1.8325957, y 0.6528366.
        let mercator = map(Projection::Mercator, -180.0, 0.0, 1.0);
        let (x, y) = mercator.project(-75.0 * DEGREE, 35.0 * DEGREE).unwrap();
        assert!(
            (x - 1.832_595_7).abs() < 5e-8 && (y - 0.652_836_6).abs() < 5e-8,
            "{x} {y}"
        );
    }

    #[test]
    fn places_come_back_and_small_figures_keep_their_shape() {
        for map in [
            map(Projection::Mercator, 300.0, 15.0, 3.39619e6),
            map(Projection::Stereographic, 179.0, -80.0, 3.39619e6),
            map(Projection::Stereographic, 10.0, 90.0, 3.39619e6),
        ] {
            for place in [(0.0, 1e5), (1e5, -2e5), (-6e5, 4e5)] {
                let (longitude, latitude) = map.unproject(place);
                let (x, y) = map.project(longitude, latitude).unwrap();
                assert!((x - place.0).hypot(y - place.1) < 1e-6, "{x} {y} {place:?}"); // rounding
                // A metre to the north and one to the east are the map's scale, at right angles.
                let step = 1.0 / map.radius_m;
                let (north_x, north_y) = map.project(longitude, latitude + step).unwrap();
                let (east_x, east_y) = map
                    .project(longitude + step / latitude.cos(), latitude)
                    .unwrap();
                let (north, east) = ((north_x - x, north_y - y), (east_x - x, east_y - y));
                let k = map.scale(place);
                for length in [north.0.hypot(north.1), east.0.hypot(east.1)] {
                    assert!((length / k - 1.0).abs() < 1e-5, "{length} {k}"); // over a metre
                }
                assert!((north.0 * east.0 + north.1 * east.1).abs() < 1e-4);
                // The gradient of the scale, along the map's own direction of steepest change.
                let ahead = 100.0 / k;
                let steepest = (0..360).map(|angle| {
                    let (sin, cos) = (f64::from(angle) * DEGREE).sin_cos();
                    let there = map.scale((place.0 + k * ahead * cos, place.1 + k * ahead * sin));
                    (there / k).ln() / ahead
                });
                let steepest = steepest.fold(0.0, f64::max);
                let stated = map.scale_gradient(place);
                assert!(
                    (steepest - stated).abs() < 1e-3 * stated + 1e-12,
                    "{steepest} {stated}"
                );
            }
        }
        let mercator = map(Projection::Mercator, 0.0, 0.0, 1.0);
        assert!(mercator.project(0.0, FRAC_PI_2).is_none());
    }
}
