//! Projection of the map: stereographic about the middle of the site, which keeps angles everywhere, at poles and at the
//! antimeridian too (Snyder 1987, *Map projections – a working manual*, section 21).

use areograph_base::body::Body;
use areograph_geom::ellipsoid::{Spherical, local_axes, spherical_to_xyz_m};
use nalgebra::Vector3;

use crate::{gis::crs_wkt, site::SiteProducts};

/// Free space around the images, as a share of their extent.
const MARGIN: f64 = 0.05;

/// The map of a site.
pub(super) struct Map {
    body: Body,
    /// Middle, a unit vector.
    middle: Vector3<f64>,
    /// West, south, east, north, metres.
    pub(super) extent_m: [f64; 4],
}

impl Map {
    /// The map with the outlines of all images.
    pub(super) fn of(site: &SiteProducts) -> Self {
        let outlines = site
            .images
            .iter()
            .flat_map(|image| &image.orientation.outline);
        let places = outlines.flatten();
        let places =
            places.map(|place| spherical_to_xyz_m(place.longitude_rad, place.latitude_rad, 1.0));
        let places: Vec<Vector3<f64>> = places.collect();
        let middle = places.iter().sum::<Vector3<f64>>();
        let mut map = Self::about(site.config.body, &middle);
        let mut extent_m = [
            f64::INFINITY,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::NEG_INFINITY,
        ];
        for [x_m, y_m] in places.iter().map(|place| map.project(place)) {
            extent_m = [
                extent_m[0].min(x_m),
                extent_m[1].min(y_m),
                extent_m[2].max(x_m),
                extent_m[3].max(y_m),
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

    fn about(body: Body, middle: &Vector3<f64>) -> Self {
        let middle = middle.try_normalize(0.0).unwrap_or_else(Vector3::x);
        Self {
            body,
            middle,
            extent_m: [0.0; 4],
        }
    }

    /// Map coordinates of the direction of a place, metres.
    fn project(&self, place: &Vector3<f64>) -> [f64; 2] {
        let direction = place.try_normalize(0.0).unwrap_or(self.middle);
        let local = local_axes(&self.middle) * direction;
        let scale = 2.0 * self.body.map().radius_m / (1.0 + local.z);
        [scale * local.x, scale * local.y]
    }

    /// A small displacement of a place along the axes of the map, metres; the scale of the map is left out.
    pub(super) fn step_m(&self, place_m: &Vector3<f64>, step_m: &Vector3<f64>) -> [f64; 2] {
        let [from, to] = [*place_m, place_m + step_m].map(|place| self.project(&place));
        let [x_m, y_m] = [to[0] - from[0], to[1] - from[1]];
        let up = place_m.try_normalize(0.0).unwrap_or(self.middle);
        let horizontal_m = (step_m - up * up.dot(step_m)).norm();
        let length_m = x_m.hypot(y_m);
        let scale = if length_m > 0.0 {
            horizontal_m / length_m
        } else {
            0.0
        };
        [scale * x_m, scale * y_m]
    }

    /// The coordinate system of the map as text for GIS.
    pub(super) fn wkt(&self) -> String {
        let middle = Spherical::from_xyz_m(&self.middle);
        format!(
            "PROJCS[\"{} stereographic\",{},PROJECTION[\"Stereographic\"],PARAMETER[\"latitude_of_origin\",{:.9}],\
             PARAMETER[\"central_meridian\",{:.9}],PARAMETER[\"scale_factor\",1],PARAMETER[\"false_easting\",0],\
             PARAMETER[\"false_northing\",0],UNIT[\"metre\",1]]",
            self.body.names().name,
            crs_wkt(self.body),
            middle.latitude.0.to_degrees(),
            middle.longitude_rad.to_degrees(),
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

#[cfg(test)]
mod tests {
    use super::*;

    fn place(longitude_deg: f64, latitude_deg: f64) -> Vector3<f64> {
        let radius_m = Body::Mars.map().radius_m;
        spherical_to_xyz_m(
            longitude_deg.to_radians(),
            latitude_deg.to_radians(),
            radius_m,
        )
    }

    /// Near the middle, a kilometre towards east and north is one on the map, at both meridians and near a pole.
    #[test]
    fn lengths_and_directions_near_the_middle_are_true() {
        for (longitude_deg, latitude_deg) in
            [(175.3, -14.6), (180.0, 0.0), (0.0, 40.0), (30.0, 89.9)]
        {
            let middle_m = place(longitude_deg, latitude_deg);
            let map = Map::about(Body::Mars, &middle_m);
            let axes = local_axes(&middle_m);
            for (axis, expected) in [(0, [1000.0, 0.0]), (1, [0.0, 1000.0])] {
                let step_m = 1000.0 * axes.row(axis).transpose();
                let projected = map.project(&(middle_m + step_m));
                let stepped = map.step_m(&middle_m, &step_m);
                for at in 0..2 {
                    // Metres: the chord of a kilometre is 22 micrometres shorter than the step.
                    assert!((projected[at] - expected[at]).abs() < 1e-3, "{projected:?}");
                    assert!((stepped[at] - expected[at]).abs() < 1e-6, "{stepped:?}");
                }
            }
        }
    }

    /// Half a degree from the pole, north on the other side points down on the map.
    #[test]
    fn steps_turn_with_the_meridians() {
        let map = Map::about(Body::Mars, &place(0.0, 89.5));
        let beyond_m = place(180.0, 89.5);
        let north = local_axes(&beyond_m).row(1).transpose();
        let [x_m, y_m] = map.step_m(&beyond_m, &north);
        assert!(x_m.abs() < 1e-6 && (y_m + 1.0).abs() < 1e-6, "{x_m} {y_m}");
    }
}
