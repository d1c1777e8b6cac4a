//! `[[windows]]`: boxes and GeoJSON outlines on the ground.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::json;

use areograph_base::{
    body::Body,
    units::{METRES_PER_KM, RADIANS_PER_DEGREE},
};
use areograph_geom::{
    ellipsoid::{AreocentricLatitude, AreographicLatitude},
    window::WindowShape,
};

use super::{
    declare::{Declare as _, Keys, Many, declare_table, group, key},
    forms::{from_to, identifier, several, words},
    geojson,
    paths::FILE,
};

/// Bits of the column `Footprints::windows`.
pub(super) const WINDOWS_MAX: usize = 64;

/// Keys that give the outline.
const SHAPES: [&str; 4] = ["longitude_deg", "latitude_deg", "polygon", "image"];

/// Windows of a site.
pub(super) const WINDOWS: Many = Many {
    count: Some((1, WINDOWS_MAX)),
    purpose: "",
    further: &[&[
        " Instead of a box: polygons of a GeoJSON file (Polygon, MultiPolygon, Feature, FeatureCollection), with",
        " coordinates [longitude, latitude], closed rings less than 360 degrees wide, and at most 100000 vertices",
        " and 16 MiB. Divide polygons that cross 180 degrees, or continue longitudes to 360. An edge from 170 to -170",
        " crosses 180 degrees in a ring narrower than 90 degrees; every other edge spans at most 180 degrees as written.",
    ]],
};

/// A window on the ground.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WindowConfig {
    /// Identifier, unique in the site.
    pub id: String,
    /// Its outline in IAU 2000 areocentric latitude and east longitude.
    pub shape: WindowShape,
}

declare_table! {
    /// 1 to 64 windows; a footprint belongs to every window that contains its own position.
    fill WindowConfig {
        /// Identifier, unique in the site.
        id = key(identifier()).required().example(r#""site""#).example_in(1, r#""outline""#).example_in(2, r#""image""#),
        /// Outline.
        shape = group::<ShapeKeys>().then(shape),
    }
}

declare_table! {
    /// Outline of a window.
    struct ShapeKeys {
        /// West and east edges. If west exceeds east, the window crosses 0 (or 180) degrees: `[350, 10]` is 20 degrees
        /// wide. `[0, 360]` or `[-180, 180]` means all longitudes; a window that also reaches 90 or -90 degrees of
        /// latitude contains the pole.
        longitude_deg: Option<[f64; 2]> =
            key(several(from_to(-360.0, 360.0), "two numbers [west, east]")).example("[318.0, 318.7]"),
        /// South and north edges.
        latitude_deg: Option<[f64; 2]> =
            key(several(from_to(-90.0, 90.0), "two numbers [south, north]")).example("[-14.0, -12.9]"),
        /// Direction in which the longitudes in `longitude_deg` increase. With "west", the west edge is the larger
        /// number: `[184.95, 184.45]` is 0.5 degrees wide.
        longitude: LongitudeSense = key(words([
            ("east", LongitudeSense::East, ""),
            ("west", LongitudeSense::West, "as on older maps of Mars"),
        ])).or(LongitudeSense::East),
        /// Kind of the latitudes in `latitude_deg`. Areographic latitudes are converted with the ellipsoid of IAU 2000;
        /// polygons and products are always areocentric.
        latitude: LatitudeKind = key(words([
            ("areocentric", LatitudeKind::Areocentric, ""),
            ("areographic", LatitudeKind::Areographic, "only on Mars"),
        ])).or(LatitudeKind::Areocentric),
        /// GeoJSON file.
        polygon: Option<PathBuf> = key(FILE).example_in(1, r#""outline.geojson""#),
        /// Identifier of an image of the site. The window is the outline of this image, computed from image times and
        /// kernels (the first set, if there are rival sets).
        image: Option<String> = key(identifier()).example_in(2, r#""E02-02855""#),
        /// Smallest margin of the window beyond the outline of the image.
        margin_km: Option<f64> = key(from_to(0.0, 1_000.0)).example_in(2, "5.0"),
    }
}

fn shape(written: ShapeKeys, keys: &mut Keys<'_, '_>) -> WindowShape {
    keys.rule(|| {
        json!({"oneOf": [
            {"required": ["longitude_deg", "latitude_deg"], "not": {"anyOf": [
                {"required": ["polygon"]},
                {"required": ["image"]},
            ]}},
            {"required": ["polygon"], "not": {"anyOf": [
                {"required": ["longitude_deg"]},
                {"required": ["latitude_deg"]},
                {"required": ["image"]},
            ]}},
            {"required": ["image"], "not": {"anyOf": [
                {"required": ["longitude_deg"]},
                {"required": ["latitude_deg"]},
                {"required": ["polygon"]},
            ]}},
        ]})
    });
    let there = SHAPES.map(|key| keys.span_of(key).is_some());
    if !matches!(
        there,
        [true, true, false, false] | [false, false, true, false] | [false, false, false, true]
    ) {
        if !keys.is_no_table() && !keys.misspelt(&SHAPES) {
            keys.problem(
                "windows has no clear shape; expected longitude_deg and latitude_deg, polygon, or image"
                    .to_owned(),
            );
        }
        return nowhere();
    }
    if let Some(image) = written.image {
        return WindowShape::Image {
            image,
            margin_m: written.margin_km.unwrap_or_default() * METRES_PER_KM,
        };
    }
    keys.unused("margin_km", "only the outline of an image has a margin");
    if written.polygon.is_some() {
        for key in ["longitude", "latitude"] {
            keys.unused(
                key,
                "polygons have east longitudes and areocentric latitudes",
            );
        }
    }
    let coordinates = BoxCoordinates {
        longitude: written.longitude,
        latitude: written.latitude,
    };
    let bounds = bounds(
        written.longitude_deg,
        written.latitude_deg,
        coordinates,
        keys,
    );
    let outline = written.polygon.and_then(|path| outline(&path, keys));
    bounds.or(outline).unwrap_or_else(nowhere)
}

/// A placeholder for a refused shape.
const fn nowhere() -> WindowShape {
    WindowShape::Polygons {
        polygons: Vec::new(),
    }
}

fn outline(path: &Path, keys: &mut Keys<'_, '_>) -> Option<WindowShape> {
    if !path.is_file() {
        return None;
    }
    match geojson::read(path) {
        Ok(polygons) => Some(WindowShape::Polygons { polygons }),
        Err(error) => {
            let expected = format!("GeoJSON polygons; {}: {error}", path.display());
            keys.refuse("polygon", expected);
            None
        }
    }
}

fn bounds(
    longitude: Option<[f64; 2]>,
    latitude: Option<[f64; 2]>,
    coordinates: BoxCoordinates,
    keys: &mut Keys<'_, '_>,
) -> Option<WindowShape> {
    let longitudes = longitude.and_then(|written| {
        let pair = coordinates.east_deg(written);
        let wrapped = wrapped_longitudes(pair);
        if wrapped.is_none() {
            keys.refuse(
                "longitude_deg",
                "[west, east], with the east edge more than 0 and at most 360 degrees east of the west edge",
            );
        }
        if wrapped.is_some() {
            name_wide(pair, written, keys);
        }
        wrapped
    });
    let latitudes = latitude.filter(|[south, north]| {
        let ordered = south < north;
        if !ordered {
            keys.refuse("latitude_deg", "[south, north] with south below north");
        }
        ordered
    });
    let ([west, east], [south, north]) = (longitudes?, coordinates.areocentric_deg(latitudes?));
    Some(WindowShape::Box {
        west_rad: west * RADIANS_PER_DEGREE,
        east_rad: east * RADIANS_PER_DEGREE,
        south_rad: south * RADIANS_PER_DEGREE,
        north_rad: north * RADIANS_PER_DEGREE,
    })
}

/// Direction in which longitudes increase.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub enum LongitudeSense {
    /// Towards east, as in all products.
    #[default]
    East,
    /// Towards west.
    West,
}

/// Kind of a latitude.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub enum LatitudeKind {
    /// Angle of the direction from the centre of Mars with the equator, as in all products.
    #[default]
    Areocentric,
    /// Angle of the normal of the ellipsoid with the equator.
    Areographic,
}

/// Coordinates of the edges of a box as a user writes them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BoxCoordinates {
    /// Direction of the longitudes.
    pub longitude: LongitudeSense,
    /// Kind of the latitudes.
    pub latitude: LatitudeKind,
}

impl BoxCoordinates {
    /// East longitudes of the west and east edge, degrees.
    #[must_use]
    pub fn east_deg(self, edges_deg: [f64; 2]) -> [f64; 2] {
        match self.longitude {
            LongitudeSense::East => edges_deg,
            // All longitudes, in either order.
            LongitudeSense::West if ((edges_deg[1] - edges_deg[0]).abs() - 360.0).abs() <= 0.0 => {
                [0.0, 360.0]
            }
            // Not −0.
            LongitudeSense::West => edges_deg.map(|west| 0.0 - west),
        }
    }

    /// Areocentric latitudes of the south and north edge, degrees.
    #[must_use]
    pub fn areocentric_deg(self, edges_deg: [f64; 2]) -> [f64; 2] {
        match self.latitude {
            LatitudeKind::Areocentric => edges_deg,
            LatitudeKind::Areographic => edges_deg.map(|latitude_deg| {
                let latitude = AreographicLatitude(latitude_deg * RADIANS_PER_DEGREE);
                let AreocentricLatitude(latitude_rad) = latitude.to_areocentric(Body::Mars.model());
                latitude_rad / RADIANS_PER_DEGREE
            }),
        }
    }
}

/// Warns of a window that covers more than half of all longitudes, but not all: its edges may have been swapped.
fn name_wide(east_longitudes: [f64; 2], [west, east]: [f64; 2], keys: &mut Keys<'_, '_>) {
    if let Some(width) = suspicious_width_deg(east_longitudes)
        && let Some(span) = keys.span_of("longitude_deg")
    {
        keys.review().warn(
            span,
            format!(
                "longitude_deg spans {width}° eastward, from {west}° to {east}°; for the other {}°, write \
                 [{east}, {west}]",
                rounded(360.0 - width)
            ),
        );
    }
}

/// The width of a box that covers more than half of all longitudes, but not all: its edges may have been exchanged.
/// Degrees.
#[must_use]
pub fn suspicious_width_deg([west_deg, east_deg]: [f64; 2]) -> Option<f64> {
    let width_deg = rounded((east_deg - west_deg).rem_euclid(360.0));
    (width_deg > 180.0).then_some(width_deg)
}

/// An angle in degrees for a message, without the rounding errors of a difference.
fn rounded(angle_deg: f64) -> f64 {
    (angle_deg * 1e9).round() / 1e9
}

/// Longitudes in `0..360`, or `[0, 360]` for all of them; `None` when the width is 0 or over 360°.
///
/// Wrapped in degrees, where whole numbers stay exact.
pub(super) fn wrapped_longitudes([west, east]: [f64; 2]) -> Option<[f64; 2]> {
    let width = if west < east {
        east - west
    } else {
        (east - west).rem_euclid(360.0)
    };
    if !(width > 0.0 && width <= 360.0) {
        None
    } else if width < 360.0 {
        Some([wrap_degrees(west), wrap_degrees(east)])
    } else {
        Some([0.0, 360.0])
    }
}

/// The longitude in `0..360`.
fn wrap_degrees(longitude: f64) -> f64 {
    let wrapped = longitude.rem_euclid(360.0);
    // A tiny negative longitude rounds up to the full turn itself.
    if wrapped >= 360.0 { 0.0 } else { wrapped }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn longitudes_of_both_habits_mean_the_same_box() {
        assert_eq!(wrapped_longitudes([-42.0, -41.5]), Some([318.0, 318.5]));
        assert_eq!(wrapped_longitudes([318.0, 318.5]), Some([318.0, 318.5]));
        assert_eq!(wrapped_longitudes([350.0, 10.0]), Some([350.0, 10.0]));
        assert_eq!(wrapped_longitudes([-10.0, 10.0]), Some([350.0, 10.0]));
        assert_eq!(wrapped_longitudes([170.0, -170.0]), Some([170.0, 190.0]));
        assert_eq!(wrapped_longitudes([350.0, 360.0]), Some([350.0, 0.0]));
        for all in [[0.0, 360.0], [-180.0, 180.0], [-90.0, 270.0]] {
            assert_eq!(wrapped_longitudes(all), Some([0.0, 360.0]));
        }
        for refused in [[10.0, 10.0], [360.0, 0.0], [-180.0, 181.0]] {
            assert_eq!(wrapped_longitudes(refused), None, "{refused:?}");
        }
    }

    #[test]
    fn boxes_of_older_maps_mean_the_same_ground() {
        let older = BoxCoordinates {
            longitude: LongitudeSense::West,
            latitude: LatitudeKind::Areographic,
        };
        let [west, east] = older.east_deg([184.95, 184.45]);
        // Degrees; rounding of the sum with 360.
        let wrapped = wrapped_longitudes([west, east]).unwrap();
        assert!((wrapped[0] - 175.05).abs() + (wrapped[1] - 175.55).abs() < 1e-12);
        for all in [[0.0, 360.0], [180.0, -180.0], [-180.0, 180.0], [360.0, 0.0]] {
            assert_eq!(wrapped_longitudes(older.east_deg(all)), Some([0.0, 360.0]));
        }
        let [south, equator] = older.areocentric_deg([-15.27, 0.0]);
        // tan(areocentric) = (c/a)² tan(areographic), a = 3396.19 km and c = 3376.20 km (IAU 2000).
        let tangent = 15.27_f64.to_radians().tan() * (3376.20_f64 / 3396.19).powi(2);
        assert!((south + tangent.atan().to_degrees()).abs() < 1e-12);
        assert!(equator.abs() < 1e-300);
        for (pole, expected) in older
            .areocentric_deg([-90.0, 90.0])
            .iter()
            .zip([-90.0_f64, 90.0])
        {
            assert_eq!(pole.to_bits(), expected.to_bits());
        }
    }

    #[test]
    fn poles_and_full_turns_are_exact_in_radians() {
        let quarter = 90.0 * RADIANS_PER_DEGREE;
        assert_eq!(quarter.to_bits(), std::f64::consts::FRAC_PI_2.to_bits());
        let turn = 360.0 * RADIANS_PER_DEGREE;
        assert_eq!(turn.to_bits(), std::f64::consts::TAU.to_bits());
    }

    proptest! {
        #[test]
        fn wrapping_keeps_width_and_place(west in -180.0..360.0_f64, width in 0.001..359.999_f64) {
            let east = west + width;
            prop_assume!(east <= 360.0);
            let [west_wrapped, east_wrapped] = wrapped_longitudes([west, east]).unwrap();
            prop_assert!((0.0..360.0).contains(&west_wrapped) && (0.0..360.0).contains(&east_wrapped));
            let width_wrapped = (east_wrapped - west_wrapped).rem_euclid(360.0);
            // A few ulp of 360 degrees, 0.1 micrometres on the ground.
            prop_assert!((width_wrapped - width).abs() < 1e-12);
            prop_assert!(((west_wrapped - west) / 360.0).fract().abs() < 1e-14);
        }
    }
}
