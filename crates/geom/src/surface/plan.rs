//! Planimetric coordinates, east and north of the middle of a site.

use nalgebra::{Vector2, Vector3};

use crate::ellipsoid::{local_axes, on_ellipsoid_m};
use areograph_base::body::BodyModel;

/// An azimuthal equidistant map on the sphere through the middle of a site: distances of a few kilometres are true to
/// 1e-4 within 80 km of it, at the poles too.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    up: Vector3<f64>,
    east: Vector3<f64>,
    north: Vector3<f64>,
    radius_m: f64,
}

impl Plan {
    /// The map around the middle of the directions to `places_m`, at the height of the ellipsoid there.
    pub(super) fn around(model: &BodyModel, places_m: impl Iterator<Item = Vector3<f64>>) -> Self {
        let sum: Vector3<f64> = places_m.map(|place| place.normalize()).sum();
        let up = sum.try_normalize(0.0).unwrap_or_else(Vector3::z);
        let axes = local_axes(&up);
        Self {
            up,
            east: axes.row(0).transpose(),
            north: axes.row(1).transpose(),
            radius_m: on_ellipsoid_m(model, &up).norm(),
        }
    }

    /// East and north of a Mars-fixed point, metres.
    pub(super) fn of(&self, place_m: &Vector3<f64>) -> Vector2<f64> {
        let across = Vector2::new(self.east.dot(place_m), self.north.dot(place_m));
        let sine = across.norm();
        if sine == 0.0 {
            return Vector2::zeros();
        }
        across * (self.radius_m * sine.atan2(self.up.dot(place_m)) / sine)
    }

    /// Change of a slope's height, metres, with the position: `slope` are metres per metre towards east and north. True
    /// to 1e-4 within 50 km of the middle.
    pub(super) fn by_place(&self, place_m: &Vector3<f64>, slope: &Vector2<f64>) -> Vector3<f64> {
        let up = place_m.normalize();
        let towards = self.east * slope.x + self.north * slope.y;
        (towards - up * up.dot(&towards)) * (self.radius_m / place_m.norm())
    }
}
