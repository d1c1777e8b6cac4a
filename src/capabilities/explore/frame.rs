//! The map of the page: places on the ground in metres from the middle of the site.

use std::f64::consts::FRAC_PI_2;

use serde::Serialize;

use crate::{
    capabilities::terrain::significant_surface,
    error::Result,
    geom::map_projection::MapProjection,
    products::SiteProducts,
    units::{RADIANS_PER_DEGREE, wrap_pi},
};

/// Latitude from which a site without a terrain model has a polar map, radians.
const POLAR_RAD: f64 = 75.0 * RADIANS_PER_DEGREE;

/// An equirectangular map, as that of terrain models, or about a pole an azimuthal one with true distances from the pole.
#[derive(Debug, Clone, Copy, Serialize)]
pub(super) struct MapFrame {
    /// East longitude and latitude of its middle.
    middle_deg: [f64; 2],
    /// Latitude at which distances to the east are true.
    parallel_deg: f64,
    /// Sphere of the map.
    radius_m: f64,
    polar: bool,
}

impl MapFrame {
    /// The map of a site: that of its terrain model, if it has one.
    ///
    /// # Errors
    /// A terrain model that cannot be read.
    pub(super) fn of(site: &SiteProducts) -> Result<Self> {
        let radius_m = site.config.body.map().radius_m;
        let footprints = site.footprints;
        let shots = footprints
            .longitude_rad
            .iter()
            .zip(&footprints.latitude_rad);
        let outlines = site.images.iter();
        let outlines = outlines.filter_map(|image| image.orientation.outline.as_deref());
        let corners = outlines
            .flatten()
            .map(|corner| (corner.longitude_rad, corner.latitude_rad));
        let middle = MapProjection::of_points(shots.chain(corners), radius_m);
        let surface = significant_surface(site)?;
        let parallel_rad = surface.map_or(middle.latitude_rad(), |of| of.model.parallel_rad);
        Ok(Self {
            middle_deg: [middle.longitude_rad(), middle.latitude_rad()]
                .map(|of_rad| of_rad / RADIANS_PER_DEGREE),
            parallel_deg: parallel_rad / RADIANS_PER_DEGREE,
            radius_m,
            polar: surface.is_none() && middle.latitude_rad().abs() > POLAR_RAD,
        })
    }

    /// East longitude and latitude of its middle.
    pub(super) fn middle_rad(&self) -> (f64, f64) {
        let [longitude_deg, latitude_deg] = self.middle_deg;
        (
            longitude_deg * RADIANS_PER_DEGREE,
            latitude_deg * RADIANS_PER_DEGREE,
        )
    }

    /// East and north of the middle, or of the pole, metres.
    pub(super) fn place_m(&self, longitude_rad: f64, latitude_rad: f64) -> (f64, f64) {
        let [middle_rad, latitude_0_rad] = self.middle_deg.map(|deg| deg * RADIANS_PER_DEGREE);
        let east_rad = wrap_pi(longitude_rad - middle_rad);
        if self.polar {
            let far_m = self.radius_m * (FRAC_PI_2 - latitude_rad.abs());
            let (sine, cosine) = east_rad.sin_cos();
            return (far_m * sine, -latitude_0_rad.signum() * far_m * cosine);
        }
        let parallel_rad = self.parallel_deg * RADIANS_PER_DEGREE;
        (
            self.radius_m * parallel_rad.cos() * east_rad,
            self.radius_m * (latitude_rad - latitude_0_rad),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_metres_on_either_side_of_the_antimeridian_and_about_a_pole() {
        let frame = MapFrame {
            middle_deg: [180.0, -30.0],
            parallel_deg: -60.0,
            radius_m: 1000.0,
            polar: false,
        };
        let (east_m, north_m) = frame.place_m(-179.0_f64.to_radians(), -29.0_f64.to_radians());
        // Metres: one degree, and half of it on the parallel; rounding.
        let degree_m = 1000.0 * RADIANS_PER_DEGREE;
        assert!((east_m - 0.5 * degree_m).abs() < 1e-9 && (north_m - degree_m).abs() < 1e-9);
        let frame = MapFrame {
            middle_deg: [90.0, -89.0],
            polar: true,
            ..frame
        };
        let (east_m, north_m) = frame.place_m(90.0_f64.to_radians(), -88.0_f64.to_radians());
        assert!(east_m.abs() < 1e-9 && (north_m - 2.0 * degree_m).abs() < 1e-9);
    }
}
