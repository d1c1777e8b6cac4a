//! Areocentric and areographic coordinates, and the intersection of a ray with the ellipsoid.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use areograph_base::{
    body::BodyModel,
    frames::{Frame, Position},
    units::wrap_two_pi,
};

/// Latitude of the direction from the centre of Mars, radians.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Serialize, Deserialize)]
#[serde(transparent)]
pub struct AreocentricLatitude(pub f64);

/// Latitude of the ellipsoid's normal, radians.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Serialize, Deserialize)]
#[serde(transparent)]
pub struct AreographicLatitude(pub f64);

impl AreocentricLatitude {
    /// The areographic latitude of the ellipsoid point in this direction, with the radii of `model`.
    ///
    /// `tan(areographic) = (a/c)² tan(areocentric)`.
    #[must_use]
    pub fn to_areographic(self, model: &BodyModel) -> AreographicLatitude {
        let (sin, cos) = self.0.sin_cos();
        let ratio = model.equatorial_radius_m / model.polar_radius_m;
        AreographicLatitude((ratio * ratio * sin).atan2(cos))
    }
}

impl AreographicLatitude {
    /// The direction of the ellipsoid point with this areographic latitude, with the radii of `model`.
    ///
    /// `tan(areocentric) = (c/a)² tan(areographic)`.
    #[must_use]
    pub fn to_areocentric(self, model: &BodyModel) -> AreocentricLatitude {
        let (sin, cos) = self.0.sin_cos();
        let ratio = model.polar_radius_m / model.equatorial_radius_m;
        AreocentricLatitude((ratio * ratio * sin).atan2(cos))
    }
}

/// Areocentric spherical coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Spherical {
    /// East longitude, radians, `0..2π`.
    pub longitude_rad: f64,
    /// Areocentric latitude.
    pub latitude: AreocentricLatitude,
    /// Distance from the centre of Mars, metres.
    pub radius_m: f64,
}

/// Cartesian components, metres, of areocentric spherical coordinates in radians and metres.
#[must_use]
pub fn spherical_to_xyz_m(longitude_rad: f64, latitude_rad: f64, radius_m: f64) -> Vector3<f64> {
    let (sin_latitude, cos_latitude) = latitude_rad.sin_cos();
    let (sin_longitude, cos_longitude) = longitude_rad.sin_cos();
    radius_m
        * Vector3::new(
            cos_latitude * cos_longitude,
            cos_latitude * sin_longitude,
            sin_latitude,
        )
}

impl Spherical {
    /// Areocentric coordinates of Cartesian components in metres.
    #[must_use]
    pub fn from_xyz_m(xyz_m: &Vector3<f64>) -> Self {
        let equatorial_m = xyz_m.x.hypot(xyz_m.y);
        Self {
            longitude_rad: wrap_two_pi(xyz_m.y.atan2(xyz_m.x)),
            latitude: AreocentricLatitude(xyz_m.z.atan2(equatorial_m)),
            radius_m: xyz_m.norm(),
        }
    }

    /// The position in body-fixed frame `F`.
    #[must_use]
    pub fn position<F: Frame>(&self) -> Position<F> {
        Position::new(spherical_to_xyz_m(
            self.longitude_rad,
            self.latitude.0,
            self.radius_m,
        ))
    }
}

/// Rows that rotate Mars-fixed vectors into east, north and up at a point; at a pole east is the Y axis.
#[must_use]
pub fn local_axes(place_m: &Vector3<f64>) -> Matrix3<f64> {
    let up = place_m.try_normalize(0.0).unwrap_or_else(Vector3::z);
    let east = Vector3::z().cross(&up);
    let east = east.try_normalize(1e-9).unwrap_or_else(Vector3::y);
    Matrix3::from_rows(&[
        east.transpose(),
        up.cross(&east).transpose(),
        up.transpose(),
    ])
}

/// Whether a camera is above the horizon of a point, on the sphere through the point; both body-fixed, metres.
///
/// The ray of a camera also passes through points of the far side, which the body hides.
#[must_use]
pub fn is_above_horizon(camera_m: &Vector3<f64>, point_m: &Vector3<f64>) -> bool {
    // False for NaN.
    point_m.dot(&(camera_m - point_m)) > 0.0
}

/// First intersection of the ray from `origin` along `direction` with the ellipsoid of `model`, metres.
///
/// `direction` need not have unit length. `None` when the ray misses the ellipsoid or points away from it.
#[must_use]
pub fn ray_meets_ellipsoid<F: Frame>(
    model: &BodyModel,
    origin: &Position<F>,
    direction: &Vector3<f64>,
) -> Option<Position<F>> {
    let scale = Vector3::new(
        1.0 / model.equatorial_radius_m,
        1.0 / model.equatorial_radius_m,
        1.0 / model.polar_radius_m,
    );
    let start = origin.xyz_m.component_mul(&scale);
    let step = direction.component_mul(&scale);
    let a = step.norm_squared();
    let half_b = start.dot(&step);
    let c = start.norm_squared() - 1.0;
    let discriminant = half_b * half_b - a * c;
    if !(discriminant >= 0.0 && a > 0.0) {
        return None;
    }
    let along = (-half_b - discriminant.sqrt()) / a;
    (along > 0.0).then(|| Position::new(origin.xyz_m + along * direction))
}

/// Distance from `origin` along `direction` to the ellipsoid of `model`, metres; for a direction that misses it, to
/// the horizon of a sphere with its equatorial radius.
#[must_use]
pub fn range_to_ellipsoid_m<F: Frame>(
    model: &BodyModel,
    origin: &Position<F>,
    direction: &Vector3<f64>,
) -> f64 {
    let radius_m = model.equatorial_radius_m;
    let horizon_m = || {
        let square_m2 = origin.xyz_m.norm_squared() - radius_m * radius_m;
        square_m2.max(0.0).sqrt()
    };
    let ground = ray_meets_ellipsoid(model, origin, direction);
    ground.map_or_else(horizon_m, |ground| origin.distance_m(&ground))
}

/// The point of the ellipsoid of `model` in the direction of `place_m`, metres.
#[must_use]
pub fn on_ellipsoid_m(model: &BodyModel, place_m: &Vector3<f64>) -> Vector3<f64> {
    let up = place_m.normalize();
    let (a, c) = (model.equatorial_radius_m, model.polar_radius_m);
    up / ((up.x / a).powi(2) + (up.y / a).powi(2) + (up.z / c).powi(2)).sqrt()
}

/// Height of a point above the ellipsoid of `model` along the radius, metres, and its change with the point.
#[must_use]
pub fn height_m(model: &BodyModel, place_m: &Vector3<f64>) -> (f64, Vector3<f64>) {
    let up = place_m.normalize();
    let below_m = on_ellipsoid_m(model, place_m);
    let (a, c) = (model.equatorial_radius_m, model.polar_radius_m);
    // The radius is q^(-1/2) of the direction; what changes the direction is across `up`.
    let by_up =
        -below_m.norm().powi(3) * Vector3::new(up.x / (a * a), up.y / (a * a), up.z / (c * c));
    let across = (by_up - up * by_up.dot(&up)) / place_m.norm();
    (place_m.norm() - below_m.norm(), up - across)
}

#[cfg(test)]
mod tests {
    use super::*;
    use areograph_base::{body::Body, frames::BodyFixed};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn spherical_round_trip(
            longitude_rad in 0.0..std::f64::consts::TAU,
            latitude_rad in -1.57..1.57_f64,
            radius_m in 3.3e6..3.9e6_f64,
        ) {
            let back = Spherical::from_xyz_m(&spherical_to_xyz_m(longitude_rad, latitude_rad, radius_m));
            // 1e-12 rad of longitude at 1.57 rad latitude is nanometres; radius to a micrometre.
            let turn = areograph_base::units::wrap_pi(back.longitude_rad - longitude_rad) * latitude_rad.cos();
            prop_assert!(turn.abs() < 1e-14);
            prop_assert!((back.latitude.0 - latitude_rad).abs() < 1e-14);
            prop_assert!((back.radius_m - radius_m).abs() < 1e-6);
        }
    }

    #[test]
    fn a_nadir_ray_from_above_the_pole_meets_the_polar_radius() {
        let origin = Position::<BodyFixed>::new(Vector3::new(0.0, 0.0, 3.76e6));
        let hit = ray_meets_ellipsoid(Body::Mars.model(), &origin, &Vector3::new(0.0, 0.0, -2.0))
            .unwrap();
        assert!((hit.xyz_m.z - 3_376_200.0).abs() < 1e-6); // micrometre
        assert!(
            ray_meets_ellipsoid(Body::Mars.model(), &origin, &Vector3::new(0.0, 0.0, 1.0))
                .is_none()
        );
        assert!(
            ray_meets_ellipsoid(Body::Mars.model(), &origin, &Vector3::new(1.0, 0.0, 0.0))
                .is_none()
        );
        let range_m = range_to_ellipsoid_m(Body::Mars.model(), &origin, &-Vector3::z());
        assert!((range_m - (3.76e6 - 3_376_200.0)).abs() < 1e-6); // micrometre
        let horizon_m = range_to_ellipsoid_m(Body::Mars.model(), &origin, &Vector3::x());
        assert!((horizon_m - 1_613_534.5).abs() < 1.0); // √(3.76² − 3.39619²) Mm
    }
}
