//! Projection of the map: stereographic about the middle of the site, which keeps angles everywhere, at poles and at the
//! antimeridian too (Snyder 1987, eq. 21-2 to 21-4).

use areograph_base::body::Body;
use areograph_geom::ellipsoid::spherical_to_xyz_m;
use nalgebra::Vector3;

use crate::{gis::crs_wkt, site::SiteProducts};

/// Free space around the images, as a share of their extent.
const MARGIN: f64 = 0.05;

/// The map of a site.
pub(super) struct Map {
    body: Body,
    /// Longitude and latitude of the middle, radians.
    middle_rad: [f64; 2],
    /// West, south, east, north, metres.
    pub(super) extent_m: [f64; 4],
}

impl Map {
    /// The map with the outlines of all images.
    pub(super) fn of(site: &SiteProducts) -> Self {
        let body = site.config.body;
        let outlines = site
            .images
            .iter()
            .flat_map(|image| &image.orientation.outline);
        let places: Vec<[f64; 2]> = outlines
            .flatten()
            .map(|place| [place.longitude_rad, place.latitude_rad])
            .collect();
        let sum: Vector3<f64> = places.iter().map(|place| direction(*place)).sum();
        let middle_rad = [sum.y.atan2(sum.x), sum.z.atan2(sum.x.hypot(sum.y))];
        let mut map = Self {
            body,
            middle_rad,
            extent_m: [0.0; 4],
        };
        let mut extent_m = [
            f64::INFINITY,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::NEG_INFINITY,
        ];
        for [east_m, north_m] in places.into_iter().map(|place| map.project(place)) {
            extent_m = [
                extent_m[0].min(east_m),
                extent_m[1].min(north_m),
                extent_m[2].max(east_m),
                extent_m[3].max(north_m),
            ];
        }
        let [west, south, east, north] = extent_m;
        let margin_m = MARGIN * (east - west).max(north - south);
        map.extent_m = [
            west - margin_m,
            south - margin_m,
            east + margin_m,
            north + margin_m,
        ];
        map
    }

    /// East and north of a place, longitude and latitude in radians, metres.
    fn project(&self, [longitude_rad, latitude_rad]: [f64; 2]) -> [f64; 2] {
        let [middle_longitude_rad, middle_latitude_rad] = self.middle_rad;
        let (sin, cos) = latitude_rad.sin_cos();
        let (sin_middle, cos_middle) = middle_latitude_rad.sin_cos();
        let (sin_apart, cos_apart) = (longitude_rad - middle_longitude_rad).sin_cos();
        let scale = 2.0 * self.body.map().radius_m
            / (1.0 + sin_middle * sin + cos_middle * cos * cos_apart);
        [
            scale * cos * sin_apart,
            scale * (cos_middle * sin - sin_middle * cos * cos_apart),
        ]
    }

    /// The coordinate system of the map as text for GIS.
    pub(super) fn wkt(&self) -> String {
        let [longitude_deg, latitude_deg] = self.middle_rad.map(f64::to_degrees);
        format!(
            "PROJCS[\"{} stereographic\",{},PROJECTION[\"Stereographic\"],PARAMETER[\"latitude_of_origin\",{latitude_deg:.6}],\
             PARAMETER[\"central_meridian\",{longitude_deg:.6}],PARAMETER[\"scale_factor\",1],PARAMETER[\"false_easting\",0],\
             PARAMETER[\"false_northing\",0],UNIT[\"metre\",1]]",
            self.body.names().name,
            crs_wkt(self.body)
        )
    }
}

/// The coordinate system of terrain models and orthoimages as text for GIS: equirectangular, true at this parallel.
pub(super) fn equirectangular_wkt(body: Body, parallel_rad: f64) -> String {
    format!(
        "PROJCS[\"{} equirectangular\",{},PROJECTION[\"Equirectangular\"],PARAMETER[\"standard_parallel_1\",{}],\
         PARAMETER[\"central_meridian\",0],PARAMETER[\"false_easting\",0],PARAMETER[\"false_northing\",0],UNIT[\"metre\",1]]",
        body.names().name,
        crs_wkt(body),
        parallel_rad.to_degrees()
    )
}

fn direction([longitude_rad, latitude_rad]: [f64; 2]) -> Vector3<f64> {
    spherical_to_xyz_m(longitude_rad, latitude_rad, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Angles and lengths of a kilometre are kept near the middle, at the antimeridian and near a pole.
    #[test]
    fn lengths_near_the_middle_are_true() {
        let radius_m = Body::Mars.map().radius_m;
        for (longitude_deg, latitude_deg) in [(175.3_f64, -14.6_f64), (180.0, 0.0), (30.0, 89.9)] {
            let middle_rad = [longitude_deg, latitude_deg].map(f64::to_radians);
            let map = Map {
                body: Body::Mars,
                middle_rad,
                extent_m: [0.0; 4],
            };
            let step_rad = 1000.0 / radius_m;
            let north = map.project([middle_rad[0], middle_rad[1] + step_rad]);
            let east = map.project([
                middle_rad[0] + step_rad / middle_rad[1].cos(),
                middle_rad[1],
            ]);
            assert!(
                north[0].abs() < 1e-6 && (north[1] - 1000.0).abs() < 1e-3,
                "{north:?}"
            );
            // Metres: near the pole a kilometre along the parallel of 5.9 km is bent.
            let bent_m = if latitude_deg > 89.0 { 5.0 } else { 1e-3 };
            assert!((east[0] - 1000.0).abs() < bent_m, "{east:?}");
        }
    }
}
