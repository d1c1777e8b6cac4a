//! Footprints as GeoJSON (RFC 7946, on Mars), one feature per line.

use std::path::Path;

use serde::Serialize;

use super::{
    coordinates::bounding_box_deg,
    fault::ProductFault,
    files::write_json_text,
    footprints::{file_name, window_ids},
    site::SiteProducts,
};
use crate::error::{Place, Result};

#[derive(Debug, Serialize)]
struct Collection {
    r#type: &'static str,
    name: String,
    crs: NamedCrs,
    #[serde(skip_serializing_if = "Option::is_none")]
    bbox: Option<[f64; 4]>,
    features: Vec<Feature>,
}

/// The `crs` member of GeoJSON 2008, which GIS still reads: RFC 7946 knows the Earth only.
#[derive(Debug, Serialize)]
struct NamedCrs {
    r#type: &'static str,
    properties: CrsName,
}

#[derive(Debug, Serialize)]
struct CrsName {
    name: &'static str,
}

#[derive(Debug, Serialize)]
struct Feature {
    r#type: &'static str,
    geometry: Point,
    properties: Properties,
}

#[derive(Debug, Serialize)]
struct Point {
    r#type: &'static str,
    coordinates: [f64; 2],
}

#[derive(Debug, Serialize)]
struct Properties {
    et_s: f64,
    utc: String,
    orbit: u32,
    source_file: String,
    record: u32,
    shot: u8,
    radius_m: f64,
    radius_crossover_m: f64,
    topography_m: f64,
    range_m: f64,
    windows: String,
}

/// Writes the footprints, which lie at `points` (degrees).
pub(super) fn write(path: &Path, site: &SiteProducts, points: &[[f64; 2]]) -> Result<u64> {
    let collection = Collection {
        r#type: "FeatureCollection",
        name: site.config.site.clone(),
        crs: NamedCrs {
            r#type: "name",
            properties: CrsName {
                name: "urn:ogc:def:crs:IAU:2015:49900",
            },
        },
        bbox: bounding_box_deg(points),
        features: points
            .iter()
            .enumerate()
            .map(|(row, point)| feature(site, row, *point))
            .collect(),
    };
    let text = lines(&collection)
        .map_err(ProductFault::refused("encode GeoJSON"))
        .in_file(path)?;
    write_json_text(path, &collection, &text)?;
    Ok(points.len() as u64)
}

fn feature(site: &SiteProducts, row: usize, point: [f64; 2]) -> Feature {
    let shot = site.footprints.row(row);
    Feature {
        r#type: "Feature",
        geometry: Point {
            r#type: "Point",
            coordinates: point,
        },
        properties: Properties {
            et_s: shot.et_s,
            utc: site.utc[row].clone(),
            orbit: shot.orbit,
            source_file: file_name(site, shot.file),
            record: shot.record,
            shot: shot.shot,
            radius_m: shot.radius_m,
            radius_crossover_m: shot.radius_crossover_m,
            topography_m: shot.radius_crossover_m - shot.areoid_radius_m,
            range_m: shot.range_m,
            windows: window_ids(site, shot.windows),
        },
    }
}

/// The collection with one feature per line, so that a person and `diff` can read it.
fn lines(collection: &Collection) -> serde_json::Result<String> {
    let mut members = vec![
        format!("\"type\": {}", serde_json::to_string(collection.r#type)?),
        format!("\"name\": {}", serde_json::to_string(&collection.name)?),
        format!("\"crs\": {}", serde_json::to_string(&collection.crs)?),
    ];
    if let Some(bounds) = collection.bbox {
        members.push(format!("\"bbox\": {}", serde_json::to_string(&bounds)?));
    }
    let features = collection
        .features
        .iter()
        .map(serde_json::to_string)
        .collect::<serde_json::Result<Vec<_>>>()?;
    members.push(format!("\"features\": [\n{}\n]", features.join(",\n")));
    Ok(format!("{{\n{}\n}}\n", members.join(",\n")))
}
