//! Layers of the project that no other product contains: outlines of images, and residuals of tie points.

use areograph_geom::ellipsoid::Spherical;
use areograph_stages::{
    adjust::{ImageResidual, PointKind},
    orientation::GroundPoint,
};
use nalgebra::{Matrix2, Vector2};
use serde::Serialize;
use serde_json::{Map, Value, json};

use crate::{
    coordinates::{degrees, frame, signed_longitude_deg},
    geojson::crs_urn,
    site::{ImageProducts, SiteProducts},
};

/// Length of the longest arrow on the map, as a share of the length of an image.
const ARROW_SHARE: f64 = 0.03;

/// Features with their coordinate system.
#[derive(Serialize)]
pub(super) struct Collection {
    r#type: &'static str,
    name: &'static str,
    crs: Value,
    frame: &'static str,
    pub(super) features: Vec<Value>,
}

impl Collection {
    fn of(site: &SiteProducts, name: &'static str, features: Vec<Value>) -> Self {
        let body = site.config.body;
        Self {
            r#type: "FeatureCollection",
            name,
            crs: json!({ "type": "name", "properties": { "name": crs_urn(body) } }),
            frame: frame(body),
            features,
        }
    }
}

fn feature(geometry: &str, coordinates: &Value, properties: &Map<String, Value>) -> Value {
    json!({
        "type": "Feature",
        "geometry": { "type": geometry, "coordinates": coordinates },
        "properties": properties,
    })
}

fn properties<const N: usize>(of: [(&str, Value); N]) -> Map<String, Value> {
    of.map(|(name, value)| (name.to_owned(), value))
        .into_iter()
        .collect()
}

/// The outlines of the images with the orientation of the kernels.
pub(super) fn outlines(site: &SiteProducts) -> Collection {
    let features = site.images.iter().filter_map(|image| {
        let outline = image.orientation.outline.as_deref()?;
        let [first, ..] = outline else { return None };
        // Continuous where the outline crosses the antimeridian.
        let start_deg = signed_longitude_deg(first.longitude_rad);
        let corner = |place: &GroundPoint| {
            let apart_deg = signed_longitude_deg(place.longitude_rad - first.longitude_rad);
            [start_deg + apart_deg, degrees(place.latitude_rad)]
        };
        let ring: Vec<[f64; 2]> = outline.iter().chain([first]).map(corner).collect();
        let invalid_because = image.invalid_because().join("; ");
        Some(feature(
            "Polygon",
            &json!([ring]),
            &properties([
                ("image", json!(image.times.id)),
                ("utc", json!(image.times.utc_start)),
                ("lines", json!(image.times.lines_delivered)),
                ("pixel_m", json!(pixel_m(image))),
                ("invalid_because", json!(invalid_because)),
            ]),
        ))
    });
    Collection::of(site, "image_outlines", features.collect())
}

/// Ground sizes of a line and a pixel as steps towards east and north, metres: the columns are those of the line and the
/// sample. `None` without an outline.
///
/// The outline has the first edge in the order of the lines, and then the last edge backwards.
fn steps_m(image: &ImageProducts) -> Option<Matrix2<f64>> {
    let outline = image.orientation.outline.as_deref()?;
    let length = outline.len() / 2;
    let ([start, .., end], across) = (outline.get(..length)?, outline.last()?) else {
        return None;
    };
    let radius_m = image.times.body.map().radius_m;
    let step = |to: &GroundPoint| {
        let apart_deg = signed_longitude_deg(to.longitude_rad - start.longitude_rad);
        let east = apart_deg.to_radians() * start.latitude_rad.cos();
        radius_m * Vector2::new(east, to.latitude_rad - start.latitude_rad)
    };
    let lines = f64::from(image.times.lines_delivered);
    Some(Matrix2::from_columns(&[
        step(end) / lines,
        step(across) / image.times.detector().samples,
    ]))
}

/// Length of a pixel across the track on the ground, metres.
fn pixel_m(image: &ImageProducts) -> Option<f64> {
    Some(steps_m(image)?.column(1).norm())
}

/// A residual of a tie point in an image as a displacement on the ground towards east and north, metres.
fn on_ground_m(image: &ImageProducts, residual: &ImageResidual) -> Option<Vector2<f64>> {
    Some(steps_m(image)? * Vector2::from(residual.in_image_px))
}

fn tie_residuals<'a>(
    site: &'a SiteProducts<'a>,
) -> impl Iterator<Item = (&'a ImageProducts<'a>, &'a ImageResidual)> {
    let adjusted = site.adjustment().map(|(_, adjustment)| adjustment.adjusted);
    let views = adjusted.into_iter().flat_map(|adjusted| &adjusted.views);
    let ties = views.filter(|view| view.kind == PointKind::Tie);
    ties.map(|view| (&site.images[view.image], view))
}

/// Magnification at which the longest arrow is a small share of the longest image: 1, 2 or 5 times a power of ten.
pub(super) fn magnification(site: &SiteProducts) -> f64 {
    let lengths_m = site.images.iter().filter_map(|image| {
        let lines = f64::from(image.times.lines_delivered);
        Some(lines * steps_m(image)?.column(0).norm())
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
    let steps = [5.0, 2.0].into_iter().map(|step| step * decade);
    steps
        .into_iter()
        .find(|step| *step <= largest)
        .unwrap_or(decade)
}

/// The measurements of all adjusted tie points.
pub(super) fn residuals(site: &SiteProducts) -> Collection {
    let adjusted = site.adjustment().map(|(_, adjustment)| adjustment.adjusted);
    let points = adjusted.map_or(&[][..], |adjusted| &adjusted.points);
    let features = tie_residuals(site).filter_map(|(image, view)| {
        let point = points.get(view.point)?;
        let place = Spherical::from_xyz_m(&point.ground.xyz_m);
        let on_ground_m = on_ground_m(image, view)?;
        let [line, sample] = view.in_image_px;
        let standardised = [view.along_px, view.across_px].map(|of| of.standardised);
        let standardised = standardised
            .into_iter()
            .flatten()
            .map(f64::abs)
            .reduce(f64::max);
        Some(feature(
            "Point",
            &json!([
                signed_longitude_deg(place.longitude_rad),
                degrees(place.latitude.0)
            ]),
            &properties([
                ("tie", json!(point.id)),
                ("image", json!(image.times.id)),
                (
                    "height_m",
                    json!(place.radius_m - site.config.body.map().radius_m),
                ),
                ("residual_line", json!(line)),
                ("residual_sample", json!(sample)),
                ("residual_east_m", json!(on_ground_m.x)),
                ("residual_north_m", json!(on_ground_m.y)),
                ("standardised", json!(standardised)),
            ]),
        ))
    });
    Collection::of(site, "tie_residuals", features.collect())
}
