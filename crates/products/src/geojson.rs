//! Points with attributes as GeoJSON (RFC 7946, on Mars), one feature per line.

use std::{
    fmt::Write as _,
    fs::File,
    io::{BufRead as _, BufReader, BufWriter, Write},
    ops::Range,
    path::Path,
};

use rayon::prelude::*;
use serde::{Serialize, Serializer, ser::SerializeMap as _};
use serde_json::{Map, Value, json};

use super::{
    coordinates::bounding_box_deg,
    error::ProductError,
    files::{create, finish, open, to_value},
    gis::Features,
    table::{Kind, Meaning, Values},
};
use areograph_base::error::{IoError, Locate, Result};
use areograph_base::{body::Body, terms::Terms};

/// Name of the CRS of `body` in the `crs` member of GeoJSON 2008, which GIS still reads: RFC 7946 knows the Earth only.
pub(super) fn crs_urn(body: Body) -> String {
    format!("urn:ogc:def:crs:IAU:2015:{}", body.map().code)
}

#[derive(Serialize)]
pub(super) struct Feature<'a> {
    r#type: &'static str,
    geometry: Point,
    properties: Properties<'a>,
}

impl<'a> Feature<'a> {
    /// The point at this place with the attributes of a row.
    const fn of(
        names: &'a [&'a str],
        values: &'a [Values],
        row: usize,
        coordinates: [f64; 2],
    ) -> Self {
        Self {
            r#type: "Feature",
            geometry: Point {
                r#type: "Point",
                coordinates,
            },
            properties: Properties { names, values, row },
        }
    }
}

#[derive(Serialize)]
struct Point {
    r#type: &'static str,
    coordinates: [f64; 2],
}

/// The attributes of a row in the order of their columns; those without a value are left out.
struct Properties<'a> {
    names: &'a [&'a str],
    values: &'a [Values],
    row: usize,
}

impl Serialize for Properties<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for (name, values) in self.names.iter().zip(self.values) {
            match values {
                Values::Real(of) => map.serialize_entry(name, &of[self.row])?,
                Values::OptionalReal(of) => {
                    if let Some(value) = of[self.row] {
                        map.serialize_entry(name, &value)?;
                    }
                }
                Values::Natural(of) => map.serialize_entry(name, &of[self.row])?,
                Values::Integer(of) => map.serialize_entry(name, &of[self.row])?,
                Values::Flag(of) => map.serialize_entry(name, &of[self.row])?,
                Values::Time(of) => map.serialize_entry(name, &format!("{}Z", of[self.row]))?,
                Values::Text(of) => map.serialize_entry(name, of.value(self.row))?,
                Values::Bytes(_) => {}
            }
        }
        map.end()
    }
}

/// JSON Schema of points with these attributes.
pub(super) fn schema(title: &str, description: &str, attributes: &[Meaning]) -> Value {
    let closed = |properties: Value, optional: &[&str]| {
        let names = properties.as_object().into_iter().flatten();
        let names = names.map(|(name, _)| name.as_str());
        let required: Vec<&str> = names.filter(|name| !optional.contains(name)).collect();
        json!({
            "type": "object",
            "additionalProperties": false,
            "required": required,
            "properties": properties,
        })
    };
    let longitude = json!({ "type": "number", "minimum": -180, "maximum": 180 });
    let latitude = json!({ "type": "number", "minimum": -90, "maximum": 90 });
    let numbers = |of: &[&Value]| json!({ "type": "array", "prefixItems": of, "minItems": of.len(), "maxItems": of.len() });
    let optional: Vec<&str> = attributes
        .iter()
        .filter(|column| column.optional)
        .map(|column| column.name)
        .collect();
    let properties: Map<String, Value> = attributes
        .iter()
        .map(|column| (column.name.to_owned(), attribute(column)))
        .collect();
    let geometry = closed(
        json!({
            "type": { "const": "Point" },
            "coordinates": numbers(&[&longitude, &latitude]),
        }),
        &[],
    );
    let feature = closed(
        json!({
            "type": { "const": "Feature" },
            "geometry": geometry,
            "properties": closed(properties.into(), &optional),
        }),
        &[],
    );
    let crs_name = closed(
        json!({ "name": { "enum": Body::WORDS.map(|(_, body)| crs_urn(body)) } }),
        &[],
    );
    let crs = json!({ "type": { "const": "name" }, "properties": crs_name });
    let mut schema = closed(
        json!({
            "type": { "const": "FeatureCollection" },
            "name": { "type": "string" },
            "crs": closed(crs, &[]),
            "frame": {
                "description": "Frame of the coordinates, and offset of the CRS code's frame from this frame.",
                "type": "string",
                "minLength": 1,
            },
            "features": { "type": "array", "items": feature },
            "bbox": numbers(&[&longitude, &latitude, &longitude, &latitude]),
        }),
        &["bbox"],
    );
    schema["$schema"] = json!("https://json-schema.org/draft/2020-12/schema");
    schema["title"] = json!(title);
    schema["description"] = json!(description);
    schema
}

/// JSON Schema of an attribute.
fn attribute(column: &Meaning) -> Value {
    let mut schema = match column.kind {
        Kind::Real => json!({ "type": "number" }),
        Kind::Natural => json!({ "type": "integer", "minimum": 0 }),
        Kind::Integer => json!({ "type": "integer" }),
        Kind::Flag => json!({ "type": "boolean" }),
        Kind::Time => json!({ "type": "string", "format": "date-time" }),
        Kind::Text | Kind::List | Kind::Bytes => json!({ "type": "string" }),
    };
    schema["description"] = json!(Terms::MARS.fill(&column.description));
    if let Some([least, greatest]) = column.limits {
        schema["minimum"] = json!(least);
        schema["maximum"] = json!(greatest);
    }
    schema
}

/// Writes the points and reads them back, one line at a time: a document of a million features would take
/// gigabytes.
///
/// # Errors
/// Numbers that are not finite; errors of the disk; lines that are read back differently.
pub(super) fn write(path: &Path, features: Features) -> Result<u64> {
    let features = Features {
        attributes: features.attributes.for_gis(),
        ..features
    };
    let head = head(&features).in_file(path)?;
    write_lines(path, &head, &features)?;
    read_back(path, &head, &features)?;
    Ok(features.points.len() as u64)
}

/// Separator of two features.
pub(super) const SEPARATOR: &str = ",\n";

/// Calls `take` with each of these rows.
fn each(
    features: &Features,
    rows: Range<usize>,
    mut take: impl FnMut(usize, &Feature) -> std::result::Result<(), ProductError>,
) -> std::result::Result<(), ProductError> {
    let columns = features.attributes.columns();
    let names: Vec<&str> = columns.map(|column| column.name).collect();
    let values = features.attributes.values(rows.clone())?;
    for (row, index) in rows.enumerate() {
        let [longitude_deg, latitude_deg, _] = features.points[index];
        let feature = Feature::of(&names, &values, row, [longitude_deg, latitude_deg]);
        take(index, &feature)?;
    }
    Ok(())
}

/// Points with attributes, one line each, without the end of the last line.
pub(super) fn points_as_text(
    names: &[&str],
    values: &[Values],
    points_deg: &[[f64; 2]],
) -> std::result::Result<Vec<u8>, ProductError> {
    let mut text = Vec::new();
    for (row, point_deg) in points_deg.iter().enumerate() {
        if row > 0 {
            text.extend_from_slice(SEPARATOR.as_bytes());
        }
        let feature = Feature::of(names, values, row, *point_deg);
        serde_json::to_writer(&mut text, &feature)
            .map_err(ProductError::refused("encode GeoJSON"))?;
    }
    Ok(text)
}

/// Writes all features, one line each, without the end of the last line.
///
/// # Errors
/// Numbers that are not finite; errors of the disk.
fn write_features(file: &mut impl Write, features: &Features) -> Result<()> {
    let columns = features.attributes.columns();
    let names: Vec<&str> = columns.map(|column| column.name).collect();
    let points_deg = features.points_deg();
    let text_of = |rows: Range<usize>| {
        let values = features.attributes.values(rows.clone())?;
        Ok(points_as_text(&names, &values, &points_deg[rows])?)
    };
    let mut is_first = true;
    for wave in features.attributes.waves() {
        let texts: Vec<Result<Vec<u8>>> = wave.into_par_iter().map(text_of).collect();
        for text in texts {
            let separator = if is_first { "" } else { SEPARATOR };
            is_first = false;
            let text = [separator.as_bytes(), &text?].concat();
            file.write_all(&text).map_err(IoError::on("write"))?;
        }
    }
    Ok(())
}

fn write_lines(path: &Path, head: &str, features: &Features) -> Result<()> {
    let mut file = create(path)?;
    let put = |file: &mut BufWriter<File>, text: &str| {
        file.write_all(text.as_bytes())
            .map_err(IoError::on("write"))
            .in_file(path)
    };
    put(&mut file, head)?;
    write_features(&mut file, features).in_file(path)?;
    if !features.points.is_empty() {
        put(&mut file, "\n")?;
    }
    put(&mut file, TAIL)?;
    finish(path, file)
}

fn head(features: &Features) -> std::result::Result<String, ProductError> {
    let bounds_deg = bounding_box_deg(features.points_deg().into_iter());
    head_of(features.name, features.body, features.frame, bounds_deg)
}

/// The lines before the first feature of points on `body`, whose coordinates are in `frame`.
pub(super) fn head_of(
    name: &str,
    body: Body,
    frame: &str,
    bounds_deg: Option<[f64; 4]>,
) -> std::result::Result<String, ProductError> {
    let crs = json!({ "type": "name", "properties": { "name": crs_urn(body) } });
    let mut members = vec![
        ("type", json!("FeatureCollection")),
        ("name", json!(name)),
        ("crs", crs),
        ("frame", json!(frame)),
    ];
    if let Some(bounds_deg) = bounds_deg {
        members.push(("bbox", to_value(&bounds_deg)?));
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

/// Checks that the file holds `head`, every feature with exact numbers, and nothing else.
fn read_back(path: &Path, head: &str, features: &Features) -> Result<()> {
    let mut file = BufReader::new(open(path)?);
    let mut line = String::new();
    let mut next = |line: &mut String| {
        line.clear();
        file.read_line(line)
            .map_err(IoError::on("read"))
            .in_file(path)
    };
    let differs = |what: String| Err(ProductError::ReadBack { what }).in_file(path);
    for expected in head.split_inclusive('\n') {
        next(&mut line)?;
        if line != expected {
            return differs(format!("{line:?} before the features"));
        }
    }
    for wave in features.attributes.waves() {
        let mut read = Vec::with_capacity(wave.len());
        for rows in wave {
            let mut lines = Vec::with_capacity(rows.len());
            for _ in rows.clone() {
                next(&mut line)?;
                lines.push(line.clone());
            }
            read.push((rows, lines));
        }
        let compared: Vec<_> = read
            .into_par_iter()
            .map(|(rows, lines)| compare(features, rows, &lines))
            .collect();
        let compared: std::result::Result<(), _> = compared.into_iter().collect();
        compared.in_file(path)?;
    }
    for expected in TAIL.split_inclusive('\n').chain([""]) {
        next(&mut line)?;
        if line != expected {
            return differs(format!("{line:?} after the features"));
        }
    }
    Ok(())
}

/// Checks that the lines of these rows hold their features.
fn compare(
    features: &Features,
    rows: Range<usize>,
    lines: &[String],
) -> std::result::Result<(), ProductError> {
    let mut lines = lines.iter();
    each(features, rows, |index, feature| {
        let is_last = index + 1 == features.points.len();
        let end = if is_last { "\n" } else { SEPARATOR };
        let line = lines.next().and_then(|line| line.strip_suffix(end));
        let found = line.and_then(|text| serde_json::from_str::<Value>(text).ok());
        if found == Some(to_value(feature)?) {
            return Ok(());
        }
        let what = format!("feature {}", index + 1);
        Err(ProductError::ReadBack { what })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{files::write_text, gis::tests::example};

    #[test]
    fn a_changed_line_is_noticed() {
        let head = "{\n\"features\": [\n";
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("footprints.geojson");
        let features = Features {
            attributes: example().attributes.for_gis(),
            ..example()
        };
        write_lines(&path, head, &features).unwrap();
        read_back(&path, head, &features).unwrap();
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
            let failure = read_back(&path, head, &features).unwrap_err();
            assert_eq!(
                failure.cause.to_string(),
                format!("read back differently: {complaint}")
            );
        }
    }
}
