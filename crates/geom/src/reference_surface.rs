//! The surface from which heights on a site are counted: the areoid, or the ellipsoid.
//!
//! Shots state its radius at their own positions only. Over a site, it departs from the ellipsoid by a smooth function,
//! here a polynomial of the second degree. Terms that the shots do not determine, as across the track of a single
//! profile, remain small by their a priori standard deviations.
//!
//! ```
//! use areograph_base::body::Body;
//! use areograph_geom::{ellipsoid::{on_ellipsoid_m, spherical_to_xyz_m}, reference_surface::ReferenceSurface};
//!
//! // Shots along a meridian that state a surface 12 m above the ellipsoid.
//! let above_m = |place_rad: [f64; 2]| {
//!     on_ellipsoid_m(Body::Mars.model(), &spherical_to_xyz_m(place_rad[0], place_rad[1], 1.0)).norm() + 12.0
//! };
//! let shots = (0..50).map(|shot| [3.0, -0.25 + 1e-4 * f64::from(shot)]).map(|place| (place, above_m(place)));
//! let corners = [[2.999, -0.252], [3.001, -0.246]];
//! let surface = ReferenceSurface::fitted(Body::Mars, &corners, shots).unwrap();
//! let beside = [3.001, -0.247];
//! assert!((surface.radius_m(beside) - above_m(beside)).abs() < 0.01); // metres; a constant is reproduced
//! ```

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use serde::{Deserialize, Serialize};

use crate::{
    ellipsoid::{local_axes, on_ellipsoid_m, spherical_to_xyz_m},
    height_grid::HeightGrid,
};
use areograph_base::body::Body;

/// Shots up to this distance from the middle determine the polynomial, kilometres: the areoid of degree 50 has waves of
/// 430 km, of which a polynomial of the second degree represents a tenth.
const NEAR_KM: f64 = 50.0;
/// Standard deviation of a stated radius, metres: PEDR files interpolate it linearly over frames of 6 km, and the
/// ellipsoid has the largest curvature, 2 mm/km².
const SHOT_SIGMA_M: f64 = 0.02;
/// A priori standard deviations: of the departure from the ellipsoid, metres (the areoid rises 2 km above it at Tharsis),
/// of its gradient, metres per kilometre (Tharsis has four times as much), and of half its curvature, metres per square kilometre
/// (waves of degree 50 with an amplitude of 10 m).
const A_PRIORI: [f64; 6] = [2_000.0, 0.5, 0.5, 1e-3, 1e-3, 1e-3];

/// A reference surface of heights.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ReferenceSurface {
    body: Body,
    /// Axes east, north and up in the middle.
    axes: Matrix3<f64>,
    /// Departure from the ellipsoid, metres, by powers of kilometres east and north of the middle.
    terms_m: SVector<f64, 6>,
    /// Largest distance of the surface from a radius that a shot states, metres.
    pub departure_m: f64,
    /// Largest standard deviation of its radius at the corners of the ground, metres: beside a single profile, the shots do
    /// not determine its gradient.
    pub sigma_m: f64,
}

impl ReferenceSurface {
    /// The surface of `body` over ground with these `corners_rad` (longitudes and latitudes, radians) through radii that shots state,
    /// metres, with their longitudes and latitudes. `None` without a shot.
    #[must_use]
    pub fn fitted(
        body: Body,
        corners_rad: &[[f64; 2]],
        shots: impl Iterator<Item = ([f64; 2], f64)> + Clone,
    ) -> Option<Self> {
        let middle: Vector3<f64> = corners_rad.iter().copied().map(direction).sum();
        let axes = local_axes(&middle);
        let mut surface = Self {
            body,
            axes,
            terms_m: SVector::zeros(),
            departure_m: 0.0,
            sigma_m: 0.0,
        };
        let is_near = |(place_rad, _): &([f64; 2], f64)| {
            let [east_km, north_km, up_km] = surface.local_km(&direction(*place_rad)).into();
            up_km > 0.0 && east_km.hypot(north_km) <= NEAR_KM
        };
        let near: Vec<_> = shots.clone().filter(is_near).collect();
        let used = if near.is_empty() {
            shots.collect()
        } else {
            near
        };
        if used.is_empty() {
            return None;
        }
        let weights = A_PRIORI.map(|sigma| sigma.powi(-2));
        let mut normals = SMatrix::<f64, 6, 6>::from_diagonal(&weights.into());
        let mut right = SVector::<f64, 6>::zeros();
        for (place_rad, radius_m) in &used {
            let up = direction(*place_rad);
            let powers = powers(&surface.local_km(&up)) / SHOT_SIGMA_M;
            normals += powers * powers.transpose();
            right += powers * ((radius_m - surface.ellipsoid_m(&up)) / SHOT_SIGMA_M);
        }
        let factor = normals.cholesky()?;
        surface.terms_m = factor.solve(&right);
        let sigmas_m = corners_rad.iter().map(|place_rad| {
            let powers = powers(&surface.local_km(&direction(*place_rad)));
            powers.dot(&factor.solve(&powers)).max(0.0).sqrt()
        });
        surface.sigma_m = sigmas_m.fold(0.0, f64::max);
        let departures_m = used
            .iter()
            .map(|(place_rad, radius_m)| (surface.radius_m(*place_rad) - radius_m).abs());
        surface.departure_m = departures_m.fold(0.0, f64::max);
        Some(surface)
    }

    /// Radius at a longitude and latitude in radians, metres.
    #[must_use]
    pub fn radius_m(&self, place_rad: [f64; 2]) -> f64 {
        let up = direction(place_rad);
        self.ellipsoid_m(&up) + powers(&self.local_km(&up)).dot(&self.terms_m)
    }

    /// Heights of a grid above this surface, metres, row by row; NaN where missing.
    #[must_use]
    #[allow(
        clippy::cast_possible_truncation,
        reason = "planetary heights keep millimetre precision"
    )]
    pub fn heights_m(&self, grid: &HeightGrid) -> Vec<f32> {
        let columns = grid.size[1];
        let cells = grid.heights_m.iter().enumerate();
        let height_m = |(at, height_m): (usize, &f32)| {
            if height_m.is_nan() {
                return f32::NAN;
            }
            let place_rad = grid.place_rad([(at / columns) as f64, (at % columns) as f64]);
            (grid.radius_m + f64::from(*height_m) - self.radius_m(place_rad)) as f32
        };
        cells.map(height_m).collect()
    }

    fn ellipsoid_m(&self, up: &Vector3<f64>) -> f64 {
        on_ellipsoid_m(self.body.model(), up).norm()
    }

    fn local_km(&self, up: &Vector3<f64>) -> Vector3<f64> {
        1e-3 * self.body.map().radius_m * (self.axes * up)
    }
}

fn direction([longitude_rad, latitude_rad]: [f64; 2]) -> Vector3<f64> {
    spherical_to_xyz_m(longitude_rad, latitude_rad, 1.0)
}

fn powers(local_km: &Vector3<f64>) -> SVector<f64, 6> {
    let [east, north] = [local_km.x, local_km.y];
    SVector::from([1.0, east, north, east * east, east * north, north * north])
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [[f64; 2]; 2] = [[2.9985, -0.255], [3.001, -0.245]];

    /// Radius of an areoid with waves of 430 km and an amplitude of 10 m, tilted by 1 m/km.
    fn areoid_m([longitude_rad, latitude_rad]: [f64; 2]) -> f64 {
        let [east_km, north_km] = [longitude_rad - 3.0, latitude_rad + 0.25].map(|of| of * 3_396.0);
        let wave_m = 10.0 * (std::f64::consts::TAU * (east_km + 2.0 * north_km) / 960.0).sin();
        let up = direction([longitude_rad, latitude_rad]);
        on_ellipsoid_m(Body::Mars.model(), &up).norm() + east_km + wave_m
    }

    #[test]
    fn profiles_determine_the_areoid_between_them() {
        // Two profiles 12 km apart, and shots far away that do not count.
        let places = (0..200).flat_map(|shot| {
            let north_rad = -0.26 + 1e-4 * f64::from(shot);
            [[2.998, north_rad], [3.0015, north_rad], [3.2, north_rad]]
        });
        let shots = places.map(|place_rad| (place_rad, areoid_m(place_rad)));
        let surface = ReferenceSurface::fitted(Body::Mars, &CORNERS, shots.clone());
        let surface = surface.expect("there are shots");
        // The third powers of the waves over 34 km, metres.
        assert!(surface.departure_m < 0.2, "{}", surface.departure_m);
        assert!(surface.sigma_m < 0.1, "{}", surface.sigma_m);
        let of_one = shots.step_by(3);
        let beside = ReferenceSurface::fitted(Body::Mars, &CORNERS, of_one).expect("as above");
        // 0.5 m/km times the 9.9 km to the farthest corner, and the curvature.
        assert!((4.9..5.9).contains(&beside.sigma_m), "{}", beside.sigma_m);
        for place_rad in [[3.0, -0.25], [2.9985, -0.255], [3.001, -0.245]] {
            let off_m = surface.radius_m(place_rad) - areoid_m(place_rad);
            assert!(off_m.abs() < 0.2, "{off_m}"); // as above
        }
    }

    #[test]
    fn there_is_no_surface_without_shots() {
        let none = ReferenceSurface::fitted(Body::Mars, &CORNERS, std::iter::empty());
        assert_eq!(none, None);
    }
}
