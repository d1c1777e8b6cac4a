//! The QGIS project of a site: its rules, its layers in QGIS itself, and its residuals against the tie points.
#![allow(clippy::unwrap_used, reason = "helpers of tests may fail loudly")]

use std::{collections::BTreeMap, fs::File, io::Read as _, path::Path};

use crate::common::{
    json,
    mission::site_run,
    readers::{output, system_python},
};
use arrow_array::{Array as _, cast::AsArray as _, types::Float64Type};
use nalgebra::{DMatrix, Matrix2, Vector2};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use serde_json::Value;

/// Radius of the sphere of maps, metres.
const RADIUS_M: f64 = 3_396_190.0;

/// The document of a project.
pub(crate) fn document(project: &Path) -> String {
    let mut archive = zip::ZipArchive::new(File::open(project).unwrap()).unwrap();
    assert_eq!(archive.len(), 1);
    let mut text = String::new();
    archive
        .by_index(0)
        .unwrap()
        .read_to_string(&mut text)
        .unwrap();
    text
}

/// What stands between two tags, wherever they occur.
fn between<'t>(text: &'t str, start: &str, end: &str) -> Vec<&'t str> {
    let parts = text.split(start).skip(1);
    parts.map(|part| part.split_once(end).unwrap().0).collect()
}

/// Every layer refers to a file of the site by a relative path, and is in the tree of layers.
pub(crate) fn layers_refer_to_products(project: &Path) -> Vec<String> {
    let text = document(project);
    let sources = between(&text, "<datasource>", "</datasource>");
    for source in &sources {
        let file = source.split('|').next().unwrap();
        assert!(file.starts_with('.'), "{file}");
        assert!(project.parent().unwrap().join(file).is_file(), "{file}");
    }
    let ids = between(&text, "<id>", "</id>");
    assert_eq!(ids.len(), sources.len());
    for id in ids {
        // QGIS replaces shorter identifiers, so that the tree would be empty.
        assert!(id.len() > 10, "{id}");
        assert!(text.contains(&format!("<layer-tree-layer id=\"{id}\"")));
    }
    sources.into_iter().map(str::to_owned).collect()
}

/// What QGIS states about a project, if it is there.
pub(crate) fn in_qgis(project: &Path, test: &str) -> Option<Value> {
    let mut command = system_python("qgis_project.py", "qgis.core", test)?;
    let picture = project.with_extension("png");
    let text = output(command.arg(project).arg(&picture));
    Some(serde_json::from_str(&text).unwrap())
}

#[test]
fn qgis_opens_the_project_and_draws_every_layer() {
    let folder = site_run("gusev_crater");
    // QGIS writes indexes beside GeoPackages; the products stay as they are.
    let copy = tempfile::tempdir().unwrap();
    let exchange = copy.path().join("exchange");
    std::fs::create_dir(&exchange).unwrap();
    for file in std::fs::read_dir(folder.join("exchange")).unwrap() {
        let file = file.unwrap();
        if file.file_type().unwrap().is_dir() {
            continue; // files for ISIS and ALE
        }
        std::fs::copy(file.path(), exchange.join(file.file_name())).unwrap();
    }
    let project = exchange.join("site.qgz");
    let sources = layers_refer_to_products(&project);
    let names = [
        "tie_residuals.geojson",
        "registered_footprints.gpkg",
        "footprints.gpkg",
        "image_outlines.geojson",
    ];
    for (source, name) in sources.iter().zip(names) {
        assert!(source.starts_with(&format!("./{name}")), "{source}");
    }
    let Some(found) = in_qgis(&project, "a project in QGIS") else {
        return;
    };
    assert_eq!(
        (&found["read"], &found["errors"]),
        (&true.into(), &Value::Array(Vec::new()))
    );
    assert!(
        found["crs"]
            .as_str()
            .unwrap()
            .starts_with("+proj=stere +lat_0=-14.6"),
        "{}",
        found["crs"]
    );
    let layers = found["layers"].as_array().unwrap();
    assert_eq!(layers.len(), names.len());
    let manifest = json(&folder.join("manifest.json"));
    let rows = |path: &str| {
        let mut products = manifest["products"].as_array().unwrap().iter();
        products.find(|product| product["path"] == path).unwrap()["rows"].clone()
    };
    for (layer, name) in layers.iter().zip(names) {
        assert_eq!(layer["valid"], true, "{layer}");
        assert_eq!(
            layer["features"],
            rows(&format!("exchange/{name}")),
            "{layer}"
        );
        assert_eq!(layer["crs"], "+proj=longlat +R=3396190 +no_defs");
    }
    // Arrows, outlines, and the highest and lowest class of heights.
    for colour in ["#ff7f00", "#e31a1c", "#fde725", "#440154"] {
        assert!(
            found["colours"][colour].as_u64().unwrap_or_default() > 20,
            "{colour}: {}",
            found["colours"]
        );
    }
}

/// Line and sample in an image, and metres towards east and north on the ground.
type Pair = ([f64; 2], [f64; 2]);

/// The rows of a small table.
pub(crate) fn table(path: &Path) -> arrow_array::RecordBatch {
    let file = File::open(path).unwrap();
    let reader = ParquetRecordBatchReaderBuilder::try_new(file).unwrap();
    let reader = reader.with_batch_size(1 << 20).build();
    reader.unwrap().next().unwrap().unwrap()
}

/// Real numbers of a column, NaN where missing.
pub(crate) fn column(table: &arrow_array::RecordBatch, name: &str) -> Vec<f64> {
    let values = table
        .column_by_name(name)
        .unwrap()
        .as_primitive::<Float64Type>();
    (0..values.len())
        .map(|row| {
            if values.is_null(row) {
                f64::NAN
            } else {
                values.value(row)
            }
        })
        .collect()
}

/// The step on the ground towards east and north for a line and for a sample, fitted to pairs of image and ground points.
fn fitted(points: &[Pair]) -> Matrix2<f64> {
    let design = DMatrix::from_fn(points.len(), 3, |row, column| match column {
        2 => 1.0,
        axis => points[row].0[axis],
    });
    let ground = DMatrix::from_fn(points.len(), 2, |row, axis| points[row].1[axis]);
    let solution = design.svd(true, true).solve(&ground, 1e-12).unwrap();
    Matrix2::from_fn(|axis, step| solution[(step, axis)])
}

/// Residuals on the ground follow from those in the image by the steps that the tie points themselves show.
#[test]
fn residuals_on_the_ground_agree_with_places_of_tie_points() {
    let folder = site_run("gusev_crater");
    let table = table(&folder.join("ties.parquet"));
    let images = table.column_by_name("image").unwrap().as_string::<i32>();
    let [lines, samples, longitudes, latitudes] = [
        "line",
        "sample",
        "adjusted_longitude_deg",
        "adjusted_latitude_deg",
    ]
    .map(|name| column(&table, name));
    let mut points: BTreeMap<&str, Vec<Pair>> = BTreeMap::new();
    for row in 0..table.num_rows() {
        if longitudes[row].is_finite() {
            // About a meridian of the site: far from it, meridians are not parallel.
            let apart_rad = (longitudes[row] - 175.3).to_radians();
            let east_m = RADIUS_M * apart_rad * latitudes[row].to_radians().cos();
            let north_m = RADIUS_M * latitudes[row].to_radians();
            points
                .entry(images.value(row))
                .or_default()
                .push(([lines[row], samples[row]], [east_m, north_m]));
        }
    }
    let residuals = json(&folder.join("exchange/tie_residuals.geojson"));
    let features = residuals["features"].as_array().unwrap();
    assert!(features.len() > 50);
    let mut longest_m: f64 = 0.0;
    for feature in features {
        let of = |name: &str| feature["properties"][name].as_f64().unwrap();
        let steps = fitted(&points[feature["properties"]["image"].as_str().unwrap()]);
        let expected_m = steps * Vector2::new(of("residual_line"), of("residual_sample"));
        let found_m = Vector2::new(of("residual_east_m"), of("residual_north_m"));
        // Relief shifts tie points by up to a per cent of the extent of the image; the meridians converge.
        let allowed_m = 0.03 * expected_m.norm() + 1e-6;
        assert!(
            (found_m - expected_m).norm() < allowed_m,
            "{found_m} {expected_m}"
        );
        longest_m = longest_m.max(found_m.norm());
    }
    // Noise of tie points is a few tenths of a pixel of 3 m.
    assert!((0.1..20.0).contains(&longest_m), "{longest_m}");
}
