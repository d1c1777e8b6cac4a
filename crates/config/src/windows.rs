//! `[[windows]]`: boxes and GeoJSON outlines on the ground.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::json;

use areograph_base::units::{METRES_PER_KM, RADIANS_PER_DEGREE};
use areograph_geom::window::WindowShape;

use super::{
    declare::{Declare as _, Keys, Many, declare_table, group, key},
    forms::{from_to, identifier, several},
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
            key(several(from_to(-180.0, 360.0), "two numbers [west, east]")).example("[318.0, 318.7]"),
        /// South and north edges, areocentric.
        latitude_deg: Option<[f64; 2]> =
            key(several(from_to(-90.0, 90.0), "two numbers [south, north]")).example("[-14.0, -12.9]"),
        /// GeoJSON file.
        polygon: Option<PathBuf> = key(FILE).example_in(1, r#""outline.geojson""#),
        /// Identifier of an image of the site. The window is the outline of this image, computed from image times and
        /// kernels (of rival sets, the first).
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
    let bounds = bounds(written.longitude_deg, written.latitude_deg, keys);
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
    keys: &mut Keys<'_, '_>,
) -> Option<WindowShape> {
    let longitudes = longitude.and_then(|pair| {
        let wrapped = wrapped_longitudes(pair);
        if wrapped.is_none() {
            keys.refuse(
                "longitude_deg",
                "[west, east], with the east edge more than 0 and at most 360 degrees east of the west edge",
            );
        }
        if wrapped.is_some() {
            name_wide(pair, keys);
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
    let ([west, east], [south, north]) = (longitudes?, latitudes?);
    Some(WindowShape::Box {
        west_rad: west * RADIANS_PER_DEGREE,
        east_rad: east * RADIANS_PER_DEGREE,
        south_rad: south * RADIANS_PER_DEGREE,
        north_rad: north * RADIANS_PER_DEGREE,
    })
}

/// Warns of a window that covers more than half of all longitudes, but not all: its edges may have been swapped.
fn name_wide([west, east]: [f64; 2], keys: &mut Keys<'_, '_>) {
    let width = (east - west).rem_euclid(360.0);
    if width > 180.0
        && let Some(span) = keys.span_of("longitude_deg")
    {
        keys.review().warn(
            span,
            format!(
                "longitude_deg spans {width}° eastward, from {west}° to {east}°; for the other {}°, write \
                 [{east}, {west}]",
                360.0 - width
            ),
        );
    }
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
