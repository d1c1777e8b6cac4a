//! The site as a STAC Item (1.1.0): location, time, and every product with its size and hash.

use std::path::Path;

use chrono::{NaiveDateTime, TimeDelta};
use rayon::prelude::*;
use serde_json::{Map, Value, json};

use crate::{
    coordinates::{bounding_box_deg, degrees, frame, signed_longitude_deg},
    error::ProductError,
    files::write_json,
    footprints::points_deg,
    gis::crs_code,
    light_time::convention,
    product::{Content, Context, Declaration, Program, Role, Use, Write},
    site::SiteProducts,
};
use areograph_base::{
    error::{Locate, Result},
    utc::Utc,
};
use areograph_store::files::hash_file;

const EXTENSIONS: [&str; 3] = [
    "https://stac-extensions.github.io/file/v2.1.0/schema.json",
    "https://stac-extensions.github.io/projection/v2.0.0/schema.json",
    "https://stac-extensions.github.io/ssys/v1.1.0/schema.json",
];
/// Code of BLAKE3 with 32 bytes in the multihash table, before the hash itself.
const BLAKE3_MULTIHASH: &str = "1e20";
/// Degrees (6 cm) by which the box reaches beyond its outermost points, so that a single point has an area too.
const MARGIN_DEG: f64 = 1e-6;

pub(crate) static ITEM: Declaration = Declaration {
    path: "exchange/stac_item.json",
    what: "STAC item of the site: location, time, files with sizes and hashes; not written if the location is unknown",
    readers: "STAC catalogues",
    rows: "",
    role: Role::Metadata,
    content: Content::Foreign,
    write: Write::Site(|path, of| {
        let item = item(of)?;
        item.map(|item| write_json(path, &item).map(|()| 0))
            .transpose()
    }),
    uses: &[Use {
        program: Program::Catalogue,
        lines: "stac-validator stac_item.json",
    }],
};

/// The item; `None` without a known location of the site.
///
/// # Errors
/// A product that cannot be read; a time that is not ISO 8601.
fn item(of: &Context) -> Result<Option<Value>> {
    let site = of.site;
    let outlines = outlines_deg(site);
    let points = points_deg(site).chain(outlines.iter().copied());
    let Some(bounds) = bounding_box_deg(points).map(with_margin) else {
        return Ok(None);
    };
    let Some([start, end]) = period(site)? else {
        return Ok(None);
    };
    let spacecraft = site.spacecraft();
    Ok(Some(json!({
        "type": "Feature",
        "stac_version": "1.1.0",
        "stac_extensions": EXTENSIONS,
        "id": site.config.site,
        "bbox": bounds,
        "geometry": outline(bounds),
        "properties": {
            "title": site.config.site,
            "description": description(site),
            "areograph:frame": frame(site.config.body),
            "areograph:light_time": convention(site),
            "datetime": start,
            "start_datetime": start,
            "end_datetime": end,
            "mission": spacecraft,
            "platform": spacecraft.to_lowercase().replace(' ', "-"),
            "instruments": instruments(site),
            "proj:code": crs_code(site.config.body),
            "ssys:targets": [site.config.body.names().name],
            "ssys:target_class": site.config.body.names().class.to_lowercase(),
        },
        "links": [],
        "assets": assets(of)?,
    })))
}

fn description(site: &SiteProducts) -> String {
    match site.config.description.as_str() {
        "" => format!(
            "{} footprints and images of {}",
            site.config.altimeter.name, site.config.site
        ),
        text => text.to_owned(),
    }
}

/// The altimeter, and the cameras in the order of their images.
fn instruments(site: &SiteProducts) -> Vec<String> {
    let altimeter = (!site.footprints.is_empty()).then_some(&site.config.altimeter.id);
    let cameras = site.images.iter().map(|image| &image.times.instrument.id);
    let mut names: Vec<String> = Vec::new();
    for id in altimeter.into_iter().chain(cameras) {
        let name = id.replace('_', "-");
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
}

/// Outlines of the images on the ground.
fn outlines_deg(site: &SiteProducts) -> Vec<[f64; 2]> {
    site.images
        .iter()
        .filter_map(|image| image.orientation.outline.as_ref())
        .flatten()
        .map(|point| {
            let longitude_deg = signed_longitude_deg(point.longitude_rad);
            [longitude_deg, degrees(point.latitude_rad)]
        })
        .collect()
}

/// A little more on every side, but not across the antimeridian or a pole.
fn with_margin([west, south, east, north]: [f64; 4]) -> [f64; 4] {
    [
        (west - MARGIN_DEG).max(-180.0),
        (south - MARGIN_DEG).max(-90.0),
        (east + MARGIN_DEG).min(180.0),
        (north + MARGIN_DEG).min(90.0),
    ]
}

/// The box as a polygon; two, cut at the antimeridian, when it crosses there (RFC 7946, 3.1.9).
fn outline([west, south, east, north]: [f64; 4]) -> Value {
    let ring = |west: f64, east: f64| {
        json!([[
            [west, south],
            [east, south],
            [east, north],
            [west, north],
            [west, south]
        ]])
    };
    if west <= east {
        json!({ "type": "Polygon", "coordinates": ring(west, east) })
    } else {
        json!({ "type": "MultiPolygon", "coordinates": [ring(west, 180.0), ring(-180.0, east)] })
    }
}

/// First and last UTC of shots and images; `None` without any.
fn period(site: &SiteProducts) -> Result<Option<[String; 2]>> {
    let shots = site
        .utc
        .iter()
        .min()
        .into_iter()
        .chain(site.utc.iter().max());
    let mut instants: Vec<NaiveDateTime> = shots.map(Utc::calendar).collect();
    for image in site.images {
        let start = instant(&image.times.utc_start)?;
        #[allow(
            clippy::cast_possible_truncation,
            reason = "images last less than 600 s"
        )]
        let duration = TimeDelta::milliseconds((1e3 * image.times.duration_s()).ceil() as i64);
        instants.extend([start, start + duration]);
    }
    let text = |instant: &NaiveDateTime| instant.format("%Y-%m-%dT%H:%M:%S%.3fZ").to_string();
    let ends = instants.iter().min().zip(instants.iter().max());
    Ok(ends.map(|(first, last)| [text(first), text(last)]))
}

fn instant(utc: &str) -> Result<NaiveDateTime> {
    Ok(NaiveDateTime::parse_from_str(utc, "%Y-%m-%dT%H:%M:%S%.f")
        .map_err(ProductError::refused("read a UTC string"))?)
}

/// The products by their paths, with the data needed to fetch and check them.
fn assets(of: &Context) -> Result<Value> {
    let files = of.written.par_iter();
    let hashes: Vec<(String, u64)> = files
        .map(|(product, _)| {
            let path = of.directory.join(&product.path);
            hash_file(&path).in_file(&path)
        })
        .collect::<Result<_>>()?;
    let mut assets = Map::new();
    for ((product, declaration), (blake3, bytes)) in of.written.iter().zip(hashes) {
        let relative = slashes(&product.path);
        let mut asset = json!({
            "href": format!("../{relative}"),
            "description": of.site.config.terms().fill(declaration.what),
            "roles": [declaration.role.name()],
            "file:size": bytes,
            "file:checksum": format!("{BLAKE3_MULTIHASH}{blake3}"),
        });
        if let Some(media) = declaration.media_type() {
            asset["type"] = json!(media);
        }
        assets.insert(relative, asset);
    }
    Ok(Value::Object(assets))
}

fn slashes(path: &Path) -> String {
    let parts: Vec<_> = path.iter().map(|part| part.to_string_lossy()).collect();
    parts.join("/")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_across_the_antimeridian_are_cut_there() {
        let bounds = bounding_box_deg([[179.5, 1.0], [-179.0, 3.0]].into_iter()).map(with_margin);
        let cut = outline(bounds.unwrap());
        assert_eq!(cut["type"], "MultiPolygon");
        let corner =
            |part: usize, index: usize| cut["coordinates"][part][0][index][0].as_f64().unwrap();
        assert!(corner(0, 0) < 179.5 && (corner(0, 1) - 180.0).abs() < 1e-12); // degrees, rounding
        assert!((corner(1, 0) + 180.0).abs() < 1e-12 && corner(1, 1) > -179.0);
    }

    #[test]
    fn one_point_at_a_pole_on_the_antimeridian_has_an_area_within_the_sphere() {
        let [west, south, east, north] = with_margin([-180.0, 90.0, -180.0, 90.0]);
        assert!(west < east && south < north && north <= 90.0 && west >= -180.0);
        assert_eq!(outline([west, south, east, north])["type"], "Polygon");
    }
}
