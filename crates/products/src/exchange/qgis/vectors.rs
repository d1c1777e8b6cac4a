//! Layers of the project that no other product contains: outlines of images, and residuals of tie points.

use std::{fmt::Write as _, path::Path};

use areograph_base::{
    error::{Locate as _, Result},
    units::wrap_pi,
};
use areograph_geom::ellipsoid::{Spherical, local_axes, spherical_to_xyz_m};
use areograph_stages::{
    adjust::{ImageResidual, PointKind},
    orientation::GroundPoint,
};
use nalgebra::Vector3;
use serde::Serialize;

use super::map::Map;
use crate::{
    coordinates::{degrees, frame, signed_longitude_deg},
    error::ProductError,
    files::write_text,
    geojson::head_of,
    site::{ImageProducts, SiteProducts},
};

/// Length of the longest arrow on the map, as a share of the length of an image.
const ARROW_SHARE: f64 = 0.03;

#[derive(Serialize)]
pub(super) struct Feature<C, P> {
    r#type: &'static str,
    geometry: Geometry<C>,
    properties: P,
}

#[derive(Serialize)]
struct Geometry<C> {
    r#type: &'static str,
    coordinates: C,
}

impl<C, P> Feature<C, P> {
    const fn of(geometry: &'static str, coordinates: C, properties: P) -> Self {
        Self {
            r#type: "Feature",
            geometry: Geometry {
                r#type: geometry,
                coordinates,
            },
            properties,
        }
    }
}

/// Writes features, one in a line, and reads them back.
pub(super) fn write<C: Serialize, P: Serialize>(
    path: &Path,
    site: &SiteProducts,
    name: &str,
    features: impl Iterator<Item = Feature<C, P>>,
) -> Result<u64> {
    let body = site.config.body;
    let mut text = head_of(name, body, frame(body), None).in_file(path)?;
    let mut count = 0;
    for feature in features {
        let line = serde_json::to_string(&feature)
            .map_err(ProductError::refused("write GeoJSON"))
            .in_file(path)?;
        let separator = if count == 0 { "" } else { ",\n" };
        let _infallible = write!(text, "{separator}{line}");
        count += 1;
    }
    text += "\n]\n}\n";
    write_text(path, &text)?;
    Ok(count)
}

/// Attributes of an image.
#[derive(Serialize)]
pub(super) struct Image<'a> {
    image: &'a str,
    utc: &'a str,
    lines: u32,
    /// Length of a pixel across the track on the ground.
    pixel_m: Option<f64>,
    invalid_because: String,
}

/// The outlines of the images with their initial orientation; longitudes go on beyond ±180 degrees where an outline
/// crosses the antimeridian.
pub(super) fn outlines<'a>(
    site: &'a SiteProducts<'a>,
) -> impl Iterator<Item = Feature<[Vec<[f64; 2]>; 1], Image<'a>>> {
    site.images.iter().filter_map(|image| {
        let outline = image.orientation.outline.as_deref()?;
        let [first, ..] = outline else { return None };
        let start_deg = signed_longitude_deg(first.longitude_rad);
        let corner = |place: &GroundPoint| {
            let apart_rad = wrap_pi(place.longitude_rad - first.longitude_rad);
            [start_deg + degrees(apart_rad), degrees(place.latitude_rad)]
        };
        let ring = outline.iter().chain([first]).map(corner).collect();
        let properties = Image {
            image: &image.times.id,
            utc: &image.times.utc_start,
            lines: image.times.lines_delivered,
            pixel_m: steps_m(image, 0.0).map(|[_, sample]| sample.norm()),
            invalid_because: image.invalid_because().join("; "),
        };
        Some(Feature::of("Polygon", [ring], properties))
    })
}

/// Displacement on the ground by a line and by a sample, body-fixed, metres, in the part of an image around `x_lines` from
/// its middle. `None` without an outline.
///
/// The outline has the first edge in the order of the lines, and then the last edge backwards.
fn steps_m(image: &ImageProducts, x_lines: f64) -> Option<[Vector3<f64>; 2]> {
    let outline = image.orientation.outline.as_deref()?;
    let size = [
        f64::from(image.times.lines_delivered),
        image.times.detector().samples,
    ];
    steps_of_outline_m(outline, image.times.body.map().radius_m, size, x_lines)
}

/// [`steps_m`] for an image of this many lines and samples, on a sphere.
fn steps_of_outline_m(
    outline: &[GroundPoint],
    radius_m: f64,
    [lines, samples]: [f64; 2],
    x_lines: f64,
) -> Option<[Vector3<f64>; 2]> {
    let intervals = (outline.len() / 2)
        .checked_sub(1)
        .filter(|count| *count > 0)?;
    let share = (x_lines / lines + 0.5).clamp(0.0, 1.0);
    let at = (0..intervals)
        .take_while(|interval| *interval as f64 <= share * intervals as f64)
        .last()?;
    let place = |index: usize| {
        let GroundPoint {
            longitude_rad,
            latitude_rad,
        } = outline[index];
        spherical_to_xyz_m(longitude_rad, latitude_rad, radius_m)
    };
    let along_m = place(at + 1) - place(at);
    let across_m = place(outline.len() - 1 - at) - place(at);
    Some([along_m * (intervals as f64 / lines), across_m / samples])
}

/// A residual of a tie point in an image as a displacement on the ground, body-fixed, metres.
#[must_use]
pub fn on_ground_m(image: &ImageProducts, residual: &ImageResidual) -> Option<Vector3<f64>> {
    let [line, sample] = steps_m(image, residual.x_lines)?;
    let [lines, samples] = residual.in_image_px;
    Some(line * lines + sample * samples)
}

/// The residuals of all measurements of adjusted tie points, with their images.
pub fn tie_residuals<'a>(
    site: &'a SiteProducts<'a>,
) -> impl Iterator<Item = (&'a ImageProducts<'a>, &'a ImageResidual)> {
    let adjusted = site.adjustment().map(|(_, adjustment)| adjustment.adjusted);
    let views = adjusted.into_iter().flat_map(|adjusted| &adjusted.views);
    let ties = views.filter(|view| view.kind == PointKind::Tie);
    ties.map(|view| (&site.images[view.image], view))
}

/// Whether a tie point was used in the adjustment.
pub(super) fn has_residuals(site: &SiteProducts) -> bool {
    tie_residuals(site).next().is_some()
}

/// Magnification at which the longest arrow is a small share of the longest image: 1, 2 or 5 times a power of ten.
pub(super) fn magnification(site: &SiteProducts) -> f64 {
    let lengths_m = site.images.iter().filter_map(|image| {
        let [line, _] = steps_m(image, 0.0)?;
        Some(f64::from(image.times.lines_delivered) * line.norm())
    });
    let room_m = ARROW_SHARE * lengths_m.fold(0.0, f64::max);
    let longest_m = tie_residuals(site)
        .filter_map(|(image, view)| Some(on_ground_m(image, view)?.norm()))
        .fold(0.0, f64::max);
    if !(longest_m > 0.0 && room_m > 0.0) {
        return 1.0;
    }
    let largest = room_m / longest_m;
    let decade = 10.0_f64.powf(largest.log10().floor());
    let mut steps = [5.0, 2.0].into_iter().map(|step| step * decade);
    steps.find(|step| *step <= largest).unwrap_or(decade)
}

/// Attributes of a measurement.
#[derive(Serialize)]
pub(super) struct Residual<'a> {
    tie: &'a str,
    image: &'a str,
    /// Height above the sphere of the maps.
    height_m: f64,
    /// Measured minus adjusted.
    residual_line: f64,
    residual_sample: f64,
    residual_east_m: Option<f64>,
    residual_north_m: Option<f64>,
    /// The same along the axes of the map of the project.
    residual_map_x_m: Option<f64>,
    residual_map_y_m: Option<f64>,
    /// Largest standardised residual of the measurement, without sign.
    standardised: Option<f64>,
}

/// The measurements of all adjusted tie points.
pub(super) fn residuals<'a>(
    site: &'a SiteProducts<'a>,
    map: &'a Map,
) -> impl Iterator<Item = Feature<[f64; 2], Residual<'a>>> {
    let adjusted = site.adjustment().map(|(_, adjustment)| adjustment.adjusted);
    let points = adjusted.map_or(&[][..], |adjusted| &adjusted.points);
    tie_residuals(site).filter_map(move |(image, view)| {
        let point = points.get(view.point)?;
        let place = Spherical::from_xyz_m(&point.ground.xyz_m);
        let on_ground_m = on_ground_m(image, view);
        let local_m = on_ground_m.map(|step_m| local_axes(&point.ground.xyz_m) * step_m);
        let on_map_m = on_ground_m.map(|step_m| map.step_m(&point.ground.xyz_m, &step_m));
        let [residual_line, residual_sample] = view.in_image_px;
        let standardised = [view.along_px, view.across_px].map(|of| of.standardised);
        let standardised = standardised.into_iter().flatten().map(f64::abs);
        let coordinates = [
            signed_longitude_deg(place.longitude_rad),
            degrees(place.latitude.0),
        ];
        let properties = Residual {
            tie: &point.id,
            image: &image.times.id,
            height_m: place.radius_m - site.config.body.map().radius_m,
            residual_line,
            residual_sample,
            residual_east_m: local_m.map(|of| of.x),
            residual_north_m: local_m.map(|of| of.y),
            residual_map_x_m: on_map_m.map(|[x_m, _]| x_m),
            residual_map_y_m: on_map_m.map(|[_, y_m]| y_m),
            standardised: standardised.reduce(f64::max),
        };
        Some(Feature::of("Point", coordinates, properties))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const RADIUS_M: f64 = 3_396_190.0;

    /// The outline of an image of two intervals that flies north, ten kilometres long and two wide, east of its first edge.
    fn outline(longitude_deg: f64, latitude_deg: f64) -> Vec<GroundPoint> {
        let width_rad = 2000.0 / RADIUS_M / latitude_deg.to_radians().cos();
        let place = |line: f64, sample: f64| GroundPoint {
            longitude_rad: (longitude_deg.to_radians() + sample * width_rad)
                .rem_euclid(std::f64::consts::TAU),
            latitude_rad: latitude_deg.to_radians() + line * 10_000.0 / RADIUS_M,
        };
        let first = [0.0, 0.5, 1.0].map(|line| place(line, 0.0));
        let last = [1.0, 0.5, 0.0].map(|line| place(line, 1.0));
        [first, last].concat()
    }

    /// A line is 5 m north and a sample 4 m east, wherever the meridians 0 and 180 degrees run through the image.
    #[test]
    fn steps_are_those_of_the_ground_at_every_meridian() {
        for (longitude_deg, latitude_deg) in [
            (359.99, 0.0),
            (0.0, 10.0),
            (179.99, -20.0),
            (180.01, 5.0),
            (90.0, 85.0),
        ] {
            let outline = outline(longitude_deg, latitude_deg);
            for x_lines in [-1000.0, 0.0, 999.0, 1e9] {
                let steps =
                    steps_of_outline_m(&outline, RADIUS_M, [2000.0, 500.0], x_lines).unwrap();
                let index = usize::from(x_lines >= 0.0);
                let place_m = spherical_to_xyz_m(
                    outline[index].longitude_rad,
                    outline[index].latitude_rad,
                    RADIUS_M,
                );
                let [line, sample] = steps.map(|step| local_axes(&place_m) * step);
                // Metres: chords bend, and at 85 degrees the parallel of the second half is shorter by 0.8 %.
                assert!((line.y - 5.0).abs() < 0.01 && line.x.abs() < 0.01, "{line}");
                assert!(
                    (sample.x - 4.0).abs() < 0.08 && sample.y.abs() < 0.08,
                    "{sample}"
                );
            }
        }
    }

    #[test]
    fn an_outline_without_an_interval_has_no_steps() {
        let places = outline(10.0, 10.0);
        assert!(steps_of_outline_m(&places[..2], RADIUS_M, [2000.0, 500.0], 0.0).is_none());
        assert!(steps_of_outline_m(&[], RADIUS_M, [2000.0, 500.0], 0.0).is_none());
    }
}
