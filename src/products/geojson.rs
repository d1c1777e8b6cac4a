//! Footprints as GeoJSON (RFC 7946, on Mars), one feature per line.

use std::{
    fmt::Write as _,
    io::{BufRead as _, BufReader, Write as _},
    path::Path,
};

use serde::Serialize;
use serde_json::{Value, json};

use super::{
    coordinates::{FRAME, bounding_box_deg},
    fault::ProductFault,
    files::{create, finish, open, to_value},
    site::SiteProducts,
};
use crate::error::{IoFault, Place, Result};

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

/// Writes the footprints, which lie at `points` (degrees), and reads them back, one line at a time: a
/// document of a million features would take gigabytes.
///
/// # Errors
/// What the disk refuses; lines that come back different.
pub(super) fn write(path: &Path, site: &SiteProducts, points: &[[f64; 2]]) -> Result<u64> {
    let features = || {
        points
            .iter()
            .enumerate()
            .map(|(row, point)| feature(site, row, *point))
    };
    let head = head(site, points).in_file(path)?;
    write_lines(path, &head, features())?;
    read_back(path, &head, features())?;
    Ok(points.len() as u64)
}

fn write_lines(
    path: &Path,
    head: &str,
    features: impl ExactSizeIterator<Item = Feature>,
) -> Result<()> {
    let mut file = create(path)?;
    let mut put = |text: &str| {
        file.write_all(text.as_bytes())
            .map_err(IoFault::on("write"))
            .in_file(path)
    };
    put(head)?;
    let rows = features.len();
    for (row, feature) in features.enumerate() {
        let line = serde_json::to_string(&feature)
            .map_err(ProductFault::refused("encode GeoJSON"))
            .in_file(path)?;
        put(&line)?;
        put(separator(row, rows))?;
    }
    put(TAIL)?;
    finish(path, file)
}

/// The lines before the first feature.
fn head(site: &SiteProducts, points: &[[f64; 2]]) -> std::result::Result<String, ProductFault> {
    let crs = NamedCrs {
        r#type: "name",
        properties: CrsName {
            name: "urn:ogc:def:crs:IAU:2015:49900",
        },
    };
    let mut members = vec![
        ("type", json!("FeatureCollection")),
        ("name", json!(site.config.site)),
        ("crs", to_value(&crs)?),
        ("frame", json!(FRAME)),
    ];
    if let Some(bounds) = bounding_box_deg(points) {
        members.push(("bbox", to_value(&bounds)?));
    }
    let mut head = "{\n".to_owned();
    for (name, member) in members {
        let _infallible = writeln!(head, "\"{name}\": {member},");
    }
    head += "\"features\": [\n";
    Ok(head)
}

/// The lines after the last feature.
const TAIL: &str = "]\n}\n";

/// What follows the feature in `row` of `rows`.
const fn separator(row: usize, rows: usize) -> &'static str {
    if row + 1 < rows { ",\n" } else { "\n" }
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
            source_file: site.file_name(shot.file),
            record: shot.record,
            shot: shot.shot,
            radius_m: shot.radius_m,
            radius_crossover_m: shot.radius_crossover_m,
            topography_m: shot.radius_crossover_m - shot.areoid_radius_m,
            range_m: shot.range_m,
            windows: site.window_ids(shot.windows),
        },
    }
}

/// Checks that the file holds `head`, every feature with exact numbers, and nothing else.
fn read_back(
    path: &Path,
    head: &str,
    features: impl ExactSizeIterator<Item = Feature>,
) -> Result<()> {
    let mut file = BufReader::new(open(path)?);
    let mut line = String::new();
    let mut next = |line: &mut String| {
        line.clear();
        file.read_line(line)
            .map_err(IoFault::on("read"))
            .in_file(path)
    };
    let differs = |what: String| Err(ProductFault::ReadBack { what }).in_file(path);
    for expected in head.split_inclusive('\n') {
        next(&mut line)?;
        if line != expected {
            return differs(format!("{line:?} before the features"));
        }
    }
    let rows = features.len();
    for (row, feature) in features.enumerate() {
        next(&mut line)?;
        let expected = to_value(&feature).in_file(path)?;
        let found = line
            .strip_suffix(separator(row, rows))
            .and_then(|text| serde_json::from_str::<Value>(text).ok());
        if found != Some(expected) {
            return differs(format!("feature {}", row + 1));
        }
    }
    for expected in TAIL.split_inclusive('\n').chain([""]) {
        next(&mut line)?;
        if line != expected {
            return differs(format!("{line:?} after the features"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::products::files::write_text;

    fn features() -> impl ExactSizeIterator<Item = Feature> {
        [1.0_f64, 2.0]
            .map(f64::sqrt)
            .into_iter()
            .map(|et_s| Feature {
                r#type: "Feature",
                geometry: Point {
                    r#type: "Point",
                    coordinates: [0.1 + 0.2, -0.0],
                },
                properties: Properties {
                    et_s,
                    utc: "1999-08-24T14:12:13.000".to_owned(),
                    orbit: 9019,
                    source_file: "a\n\"b\"".to_owned(),
                    record: 11,
                    shot: 1,
                    radius_m: 3_394_000.12,
                    radius_crossover_m: 3_394_001.37,
                    topography_m: -1_498.63,
                    range_m: 380_000.1,
                    windows: String::new(),
                },
            })
    }

    #[test]
    fn a_changed_line_is_noticed() {
        let head = "{\n\"features\": [\n";
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("footprints.geojson");
        write_lines(&path, head, features()).unwrap();
        read_back(&path, head, features()).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        for (from, to, complaint) in [
            ("{\n", "[\n", "\"[\\n\" before the features"),
            // The last digit of the square root of 2.
            ("1.4142135623730951", "1.414213562373095", "feature 2"),
            ("},\n", "}\n", "feature 1"),
            ("]\n}\n", "]\n", "\"\" after the features"),
            ("]\n}\n", "]\n}\n}\n", "\"}\\n\" after the features"),
        ] {
            assert!(text.contains(from), "{from}");
            write_text(&path, &text.replacen(from, to, 1)).unwrap();
            let failure = read_back(&path, head, features()).unwrap_err();
            assert_eq!(
                failure.fault.to_string(),
                format!("read back differently: {complaint}")
            );
        }
    }
}
