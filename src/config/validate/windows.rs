//! `[[windows]]`: boxes and GeoJSON outlines on the ground.

use toml::Spanned;

use crate::{geom::window::WindowShape, units::RADIANS_PER_DEGREE};

use super::{
    super::{
        geojson,
        problems::Review,
        raw::{Entry, RawWindow},
        site::WindowConfig,
    },
    no_repeats,
    values::{Accept, Target},
};

/// Bits of the column `Footprints::windows`.
const WINDOWS_MAX: usize = 64;

/// The windows; none are needed when no PEDR files are searched.
pub(super) fn windows(
    raw: Entry<Vec<Spanned<RawWindow>>>,
    searched: bool,
    review: &mut Review<'_>,
) -> Vec<WindowConfig> {
    let Some(raw) = raw else {
        if searched {
            review.missing(
                None,
                "windows",
                format!("1 to {WINDOWS_MAX} tables [[windows]]"),
            );
        }
        return Vec::new();
    };
    let count = raw.get_ref().len();
    if !(1..=WINDOWS_MAX).contains(&count) {
        review.problem(
            Some(raw.span()),
            format!("windows has {count} entries; expected 1 to {WINDOWS_MAX}"),
        );
        return Vec::new();
    }
    if !searched {
        review.warn(
            raw.span(),
            "windows are never used: there is no table pedr".to_owned(),
        );
    }
    let raw = raw.into_inner();
    no_repeats(
        "windows.id",
        raw.iter().map(|window| window.get_ref().id.as_ref()),
        review,
    );
    raw.iter()
        .map(|window| self::window(window, review))
        .collect()
}

fn window(raw: &Spanned<RawWindow>, review: &mut Review<'_>) -> WindowConfig {
    let fields = raw.get_ref();
    let id = review.identifier("windows.id", &fields.id, Some(raw.span()), true);
    let shape = match (&fields.longitude_deg, &fields.latitude_deg, &fields.polygon) {
        (Some(longitude), Some(latitude), None) => bounds(longitude, latitude, review),
        (None, None, Some(polygon)) => outline(polygon, review),
        _ => {
            review.problem(
                Some(raw.span()),
                "windows has no clear shape; expected either longitude_deg and latitude_deg, or polygon".to_owned(),
            );
            None
        }
    };
    WindowConfig {
        id,
        shape: shape.unwrap_or(WindowShape::Polygons {
            polygons: Vec::new(),
        }),
    }
}

fn outline(raw: &Spanned<String>, review: &mut Review<'_>) -> Option<WindowShape> {
    let path = review.existing("windows.polygon", raw, Target::File);
    if !path.is_file() {
        return None;
    }
    match geojson::read(&path) {
        Ok(polygons) => Some(WindowShape::Polygons { polygons }),
        Err(fault) => {
            let expected = format!("GeoJSON polygons; {}: {fault}", path.display());
            review.refuse(raw.span(), "windows.polygon", expected);
            None
        }
    }
}

fn bounds(
    longitude: &Spanned<Vec<Spanned<f64>>>,
    latitude: &Spanned<Vec<Spanned<f64>>>,
    review: &mut Review<'_>,
) -> Option<WindowShape> {
    let longitudes = pair(
        "windows.longitude_deg",
        "[west, east]",
        longitude,
        Accept::FromTo(-180.0, 360.0),
        review,
    );
    let latitudes = pair(
        "windows.latitude_deg",
        "[south, north]",
        latitude,
        Accept::FromTo(-90.0, 90.0),
        review,
    );
    let longitudes = longitudes.and_then(|pair| {
        let wrapped = wrapped_longitudes(pair);
        if wrapped.is_none() {
            review.refuse(
                longitude.span(),
                "windows.longitude_deg",
                "[west, east], above 0 and at most 360 degrees wide going east",
            );
        }
        wrapped
    });
    let latitudes = latitudes.filter(|[south, north]| {
        let ordered = south < north;
        if !ordered {
            review.refuse(
                latitude.span(),
                "windows.latitude_deg",
                "[south, north] with south below north",
            );
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

/// Two numbers in range.
fn pair(
    key: &str,
    meaning: &str,
    raw: &Spanned<Vec<Spanned<f64>>>,
    accept: Accept,
    review: &mut Review<'_>,
) -> Option<[f64; 2]> {
    let [first, second] = raw.get_ref().as_slice() else {
        review.refuse(raw.span(), key, format!("two numbers {meaning}"));
        return None;
    };
    let first = review.optional_number(key, Some(first), accept);
    let second = review.optional_number(key, Some(second), accept);
    Some([first?, second?])
}

/// Longitudes in `0..360`, or `[0, 360]` for all of them; `None` when the width is none or over 360°.
///
/// Wrapped in degrees, where whole numbers stay exact.
fn wrapped_longitudes([west, east]: [f64; 2]) -> Option<[f64; 2]> {
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
