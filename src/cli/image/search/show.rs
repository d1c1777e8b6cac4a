//! The result of a search in each output format.

use serde_json::{Value, json};

use crate::{
    cli::output,
    stages::select_images::{Found, Pair, camera_of, identifier},
    units::{METRES_PER_KM, RADIANS_PER_DEGREE, SECONDS_PER_MS},
};

/// Pairs that are shown for reading; all are counted.
const PAIRS_PRINTED: usize = 20;

/// Degrees with two digits, as in the index; empty for an unknown angle.
fn degrees(angle_rad: Option<f64>) -> String {
    angle_rad.map_or_else(String::new, |angle| {
        format!("{:.2}", angle / RADIANS_PER_DEGREE)
    })
}

fn decimals(value: Option<f64>) -> String {
    value.map_or_else(String::new, |value| format!("{value:.2}"))
}

fn count(value: Option<u32>) -> String {
    value.map_or_else(String::new, |value| value.to_string())
}

/// Identifier as in site files.
fn id(found: &Found) -> String {
    identifier(&found.image)
}

/// Heading and value of a column.
type ImageColumn = (&'static str, fn(&Found) -> String);

const IMAGES: [ImageColumn; 19] = [
    ("product_id", |found| found.image.product_id.clone()),
    ("camera", |found| {
        found.image.instrument.join(" ").trim().to_owned()
    }),
    ("utc_start", |found| found.image.utc_start.clone()),
    ("samples", |found| found.image.size[0].to_string()),
    ("lines", |found| found.image.size[1].to_string()),
    ("pixel_m", |found| decimals(found.image.pixel_m)),
    ("emission_deg", |found| degrees(found.image.angles_rad[0])),
    ("incidence_deg", |found| degrees(found.image.angles_rad[1])),
    ("phase_deg", |found| degrees(found.image.angles_rad[2])),
    ("solar_longitude_deg", |found| {
        degrees(found.image.solar_longitude_rad)
    }),
    ("longitude_deg", |found| degrees(Some(found.centre_rad[0]))),
    ("latitude_deg", |found| degrees(Some(found.centre_rad[1]))),
    ("off_kernels_km", |found| {
        decimals(found.off_kernels_m.map(|metres| metres / METRES_PER_KM))
    }),
    ("quality", |found| found.image.quality.clone()),
    ("windows", |found| found.windows.join(";")),
    ("crosstrack_summing", |found| count(found.image.summing[0])),
    ("downtrack_summing", |found| count(found.image.summing[1])),
    ("file", |found| found.image.file.clone()),
    ("rationale", |found| found.image.rationale.clone()),
];

/// Columns of [`IMAGES`] that are shown for reading.
const SHOWN: usize = 14;

type PairColumn = (&'static str, fn(&Pair<'_>) -> String);

const PAIRS: [PairColumn; 7] = [
    ("product_id_1", |pair| {
        pair.images[0].image.product_id.clone()
    }),
    ("product_id_2", |pair| {
        pair.images[1].image.product_id.clone()
    }),
    ("overlap", |pair| decimals(Some(pair.overlap))),
    ("convergence_deg", |pair| degrees(pair.convergence_rad)),
    ("pixel_ratio", |pair| decimals(pair.pixel_ratio)),
    ("sun_difference_deg", |pair| degrees(pair.sun_rad)),
    ("score", |pair| format!("{:.3}", pair.score)),
];

/// Images and the best pairs in columns.
pub(super) fn table(found: &[Found], pairs: &[Pair<'_>]) {
    let rows = found.iter().map(|found| {
        IMAGES[..SHOWN]
            .iter()
            .map(|(_, value)| value(found))
            .collect()
    });
    aligned(
        &IMAGES[..SHOWN]
            .iter()
            .map(|(name, _)| *name)
            .collect::<Vec<_>>(),
        rows.collect(),
    );
    output::line(format_args!("{} images", found.len()));
    if pairs.is_empty() {
        return;
    }
    output::line("");
    let best = pairs.iter().take(PAIRS_PRINTED);
    let rows = best.map(|pair| PAIRS.iter().map(|(_, value)| value(pair)).collect());
    aligned(
        &PAIRS.iter().map(|(name, _)| *name).collect::<Vec<_>>(),
        rows.collect(),
    );
    output::line(format_args!(
        "{} pairs, best first; --format pairs prints all",
        pairs.len()
    ));
}

fn aligned(names: &[&str], rows: Vec<Vec<String>>) {
    let head: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
    let rows: Vec<Vec<String>> = std::iter::once(head).chain(rows).collect();
    let widths: Vec<usize> = (0..names.len())
        .map(|column| {
            rows.iter()
                .map(|row| row[column].chars().count())
                .max()
                .unwrap_or(0)
        })
        .collect();
    for row in rows {
        let cells = row
            .iter()
            .zip(&widths)
            .map(|(cell, width)| format!("{cell:width$}"));
        output::line(cells.collect::<Vec<_>>().join("  ").trim_end());
    }
}

/// A line for each image.
pub(super) fn csv(found: &[Found]) {
    let names = IMAGES.map(|(name, _)| name.to_owned());
    let rows = found
        .iter()
        .map(|found| IMAGES.map(|(_, value)| value(found)));
    lines(std::iter::once(names).chain(rows));
}

/// A line for each pair.
pub(super) fn pairs_csv(pairs: &[Pair<'_>]) {
    let names = PAIRS.map(|(name, _)| name.to_owned());
    let rows = pairs.iter().map(|pair| PAIRS.map(|(_, value)| value(pair)));
    lines(std::iter::once(names).chain(rows));
}

fn lines<const N: usize>(rows: impl Iterator<Item = [String; N]>) {
    let mut writer = csv::Writer::from_writer(Vec::new());
    // Writing to memory does not fail.
    rows.for_each(|row| drop(writer.write_record(row)));
    output::text(&writer.into_inner().unwrap_or_default());
}

/// Outlines with the attributes of each image.
pub(super) fn geojson(found: &[Found], pairs: &[Pair<'_>]) -> Value {
    let features = found.iter().map(|found| {
        let partners = pairs.iter().filter_map(|pair| match pair.images {
            [one, other] if std::ptr::eq(one, found) => Some(id(other)),
            [one, other] if std::ptr::eq(other, found) => Some(id(one)),
            _ => None,
        });
        let mut properties: serde_json::Map<String, Value> = IMAGES
            .iter()
            .map(|(name, value)| {
                let text = value(found);
                let number = text.parse::<f64>().ok().filter(|_| *name != "product_id");
                let value = number.map_or_else(|| json!(text), |number| json!(number));
                ((*name).to_owned(), value)
            })
            .collect();
        properties.insert("partners".to_owned(), partners.collect());
        json!({
            "type": "Feature",
            "id": id(found),
            "geometry": geometry(found),
            "properties": properties,
        })
    });
    json!({"type": "FeatureCollection", "features": features.collect::<Vec<_>>()})
}

/// The outline, in several polygons where it crosses the antimeridian or contains a pole.
fn geometry(found: &Found) -> Value {
    let rings = found.outline.rings_rad().into_iter();
    let polygons: Vec<[Vec<[f64; 2]>; 1]> = rings
        .map(|ring| {
            [ring
                .into_iter()
                .map(|place| place.map(rounded_degrees))
                .collect()]
        })
        .collect();
    match &polygons[..] {
        [polygon] => json!({"type": "Polygon", "coordinates": polygon}),
        _ => json!({"type": "MultiPolygon", "coordinates": polygons}),
    }
}

/// To 0.0001°, finer than the index.
fn rounded_degrees(angle_rad: f64) -> f64 {
    (angle_rad / RADIANS_PER_DEGREE * 1e4).round() / 1e4
}

/// Tables of a site file.
pub(super) fn toml(found: &[Found]) {
    for found in found {
        let image = &found.image;
        output::line("[[images]]");
        output::line(format_args!("id = {:?}", id(found)));
        match camera_of(image) {
            Some(camera) => output::line(format_args!("instrument = {:?}", camera.id)),
            None => output::line("# instrument: the index does not identify the camera"),
        }
        match &image.sclk_start {
            Some(clock) => output::line(format_args!("sclk_start = {clock:?}")),
            None => output::line(format_args!("utc_start = {:?}", image.utc_start)),
        }
        if let Some(exposure_s) = image.exposure_s {
            output::line(format_args!(
                "exposure_ms = {:.6}",
                exposure_s / SECONDS_PER_MS
            ));
        }
        let [across, along] = image.summing;
        for (key, summing) in [("downtrack_summing", along), ("crosstrack_summing", across)] {
            if let Some(summing) = summing {
                output::line(format_args!("{key} = {summing}"));
            }
        }
        output::line(format_args!("lines_header = {}", image.size[1]));
        output::line(format_args!("samples = {}", image.size[0]));
        if let Some(first_detector) = image.first_detector {
            output::line(format_args!("first_detector = {first_detector}"));
        }
        output::line("");
    }
}
