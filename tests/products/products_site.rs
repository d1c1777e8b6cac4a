//! Products of a small site: read by outside means, judged by their schemas, made twice.

#![allow(clippy::unwrap_used, reason = "helpers of tests may fail loudly")]

use crate::common;
use crate::common::products_site as fixture;

use std::{
    fs::{self, File},
    path::{Path, PathBuf},
};

use areograph::{
    body::Body,
    body::MARS_IAU2000,
    capabilities,
    capabilities::write_products,
    error::Kind,
    footprints::Footprint,
    geom::body_rotation::body_matrix,
    spice::{KernelSet, Session},
    store::manifest::Manifest,
    time::Et,
    units::{RADIANS_PER_DEGREE, SECONDS_PER_DAY},
    utc::Utc,
};
use areograph_testing::replace;
use arrow_array::RecordBatch;
use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, UInt32Type};
use common::json;
use fixture::{SHOTS, START_S, Site};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use serde_json::Value;

/// Products in a folder below `target`, where a person may look at them.
fn written(name: &str, site: &Site, image: bool) -> (PathBuf, Vec<(String, u64)>) {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"))
        .join("products_site")
        .join(name);
    if folder.exists() {
        fs::remove_dir_all(&folder).unwrap();
    }
    let products = site
        .with(image, |site| {
            write_products(&folder, site, &capabilities::page(site)?)
        })
        .unwrap();
    let list = products
        .iter()
        .map(|product| (product.path.to_string_lossy().into_owned(), product.rows));
    (folder, list.collect())
}

fn check_schema(schema: &str, document: &Value) {
    let path = format!(
        "{}/config/schema/{schema}.schema.json",
        env!("CARGO_MANIFEST_DIR")
    );
    let validator = jsonschema::validator_for(&json(Path::new(&path))).unwrap();
    let errors: Vec<String> = validator
        .iter_errors(document)
        .map(|error| format!("{}: {error}", error.instance_path()))
        .collect();
    assert!(errors.is_empty(), "{schema}: {errors:?}");
}

fn table(path: &Path) -> (RecordBatch, Vec<(String, Option<String>)>) {
    let builder = ParquetRecordBatchReaderBuilder::try_new(File::open(path).unwrap()).unwrap();
    let keys = builder
        .metadata()
        .file_metadata()
        .key_value_metadata()
        .cloned()
        .unwrap_or_default();
    let batch = builder.build().unwrap().next().unwrap().unwrap();
    (
        batch,
        keys.into_iter()
            .map(|entry| (entry.key, entry.value))
            .collect(),
    )
}

fn number(batch: &RecordBatch, column: &str, row: usize) -> f64 {
    batch
        .column_by_name(column)
        .unwrap()
        .as_primitive::<Float64Type>()
        .value(row)
}

/// The CRS code names another frame than the coordinates have; the text must give both.
fn says_the_frame(text: &str) {
    let meridian = format!("IAU 2000 (W0 = {:.3} deg)", MARS_IAU2000.meridian_deg);
    assert!(
        text.contains(&meridian) && text.contains("IAU_2015:49900"),
        "{text}"
    );
}

/// The differences that [`says_the_frame`] finds told, from NAIF's constants of the 2015 report.
#[test]
fn the_frame_of_the_crs_code_is_as_far_away_as_products_say() {
    let test = "the_frame_of_the_crs_code_is_as_far_away_as_products_say";
    let Some(folder) = common::real_data("mgs_text", test) else {
        return;
    };
    let kernels = ["naif0012.tls", "pck00011.tpc"].map(|name| folder.join(name));
    let session = Session::open(&KernelSet::from_files(&kernels).unwrap()).unwrap();
    let (mut least, mut most, mut pole) = (f64::INFINITY, f64::NEG_INFINITY, 0.0_f64);
    for day in -366..=730 {
        let et = Et::from_seconds(f64::from(day) * SECONDS_PER_DAY);
        let turn = session.body_matrix(Body::Mars, et).unwrap()
            * body_matrix(&MARS_IAU2000, et).transpose();
        let smaller_deg = -turn[(1, 0)].atan2(turn[(0, 0)]) / RADIANS_PER_DEGREE;
        (least, most) = (least.min(smaller_deg), most.max(smaller_deg));
        pole = pole.max(turn[(2, 0)].hypot(turn[(2, 1)]) / RADIANS_PER_DEGREE);
    }
    // Degrees, half a unit of the last digit that is told.
    close(least, 0.0014, 5e-5);
    close(most, 0.0018, 5e-5);
    close(pole, 0.0005, 5e-5);
}

fn close(value: f64, expected: f64, tolerance: f64) {
    assert!(
        (value - expected).abs() <= tolerance,
        "{value}, expected {expected} within {tolerance}"
    );
}

/// The products that are no figures of the report, of which there are so many.
fn without_figures(products: Vec<(String, u64)>, figures: usize) -> Vec<(String, u64)> {
    let is_figure = |(path, _): &(String, u64)| path.starts_with("report/figures/");
    let (found, others): (Vec<_>, Vec<_>) = products.into_iter().partition(is_figure);
    assert_eq!(found.len(), figures, "{found:?}");
    others
}

#[test]
fn every_product_is_there_with_its_rows() {
    let (folder, products) = written("rows", &Site::small(), true);
    let products = without_figures(products, 7);
    let shots = u64::from(SHOTS);
    let expected = [
        ("footprints.csv", shots),
        ("footprints.parquet", shots),
        ("footprints.xml", shots),
        ("footprints.geojson", shots),
        ("ranges.parquet", shots),
        ("ranges.json", 1),
        ("profiles.json", 0),
        ("registration.parquet", shots),
        ("registration.json", 1),
        ("images/m04-02852/orientation.parquet", 31),
        ("images/m04-02852/orientation.json", 31),
        ("images/m04-02852/isd.json", 40),
        ("exchange/centre/m04-02852_isd.json", 40),
        ("images/m04-02852/control_points.csv", 85),
        ("registered_footprints.parquet", 32),
        ("registered_footprints.csv", 32),
        ("report/explore.html", 60),
        ("report/explore/relief.png", 0),
        ("report/index.html", 0),
        ("report/page.postcard", 0),
        ("kernels.tm", 0),
        ("exchange/lola_like.csv", shots),
        ("exchange/lola_like.csv.json", 0),
        ("exchange/ode_pts.csv", shots),
        ("exchange/ode_pts.csv.json", 0),
        ("exchange/footprints.gpkg", shots),
        ("exchange/registered_footprints.gpkg", 32),
        ("exchange/footprints.shp", shots),
        ("exchange/footprints.shx", 0),
        ("exchange/footprints.dbf", 0),
        ("exchange/footprints.prj", 0),
        ("exchange/footprints.cpg", 0),
        ("exchange/kernels.json", 3),
        ("exchange/image_outlines.geojson", 1),
        ("exchange/site.qgz", 0),
        ("exchange/README.txt", 0),
        ("exchange/stac_item.json", 0),
    ];
    assert_eq!(
        products,
        expected.map(|(path, rows)| (path.to_owned(), rows))
    );
    assert!(products.iter().all(|(path, _)| folder.join(path).is_file()));
}

#[test]
fn footprints_are_geoparquet_across_the_antimeridian() {
    let (folder, _) = written("geoparquet", &Site::small(), true);
    let (batch, keys) = table(&folder.join("footprints.parquet"));
    let geo = keys
        .iter()
        .find(|(key, _)| key == "geo")
        .unwrap()
        .1
        .clone()
        .unwrap();
    let geo: Value = serde_json::from_str(&geo).unwrap();
    assert_eq!(geo["version"], "1.1.0");
    let frame = keys.iter().find(|(key, _)| key == "frame").unwrap();
    says_the_frame(frame.1.as_deref().unwrap());
    let column = &geo["columns"]["geometry"];
    assert_eq!(column["encoding"], "WKB");
    assert_eq!(column["crs"]["id"]["code"], 49900);
    let bounds: Vec<f64> = column["bbox"]
        .as_array()
        .unwrap()
        .iter()
        .map(|v| v.as_f64().unwrap())
        .collect();
    assert!(
        bounds[0] > 179.99 && bounds[2] < -179.99,
        "west > east across the antimeridian: {bounds:?}"
    );
    let points = batch.column_by_name("geometry").unwrap().as_binary::<i32>();
    for (row, side) in [(0, 180.0), (59, -180.0)] {
        let bytes = points.value(row);
        assert_eq!(bytes[..5], [1, 1, 0, 0, 0]);
        let longitude = f64::from_le_bytes(bytes[5..13].try_into().unwrap());
        close(longitude, side, 0.003); // the profile spans 1e-4 rad
        close(
            f64::from_le_bytes(bytes[13..].try_into().unwrap()),
            number(&batch, "latitude_deg", row),
            0.0,
        );
    }
    close(
        number(&batch, "topography_m", 3),
        3_394_001.37 - 3_395_500.0,
        1e-9,
    ); // rounding at 3e6 m
    let tangent = |column: &str| number(&batch, column, 3).to_radians().tan();
    close(
        tangent("latitude_areographic_deg") / tangent("latitude_deg"),
        1.011_876_8,
        5e-8,
    ); // (a/c)^2 of IAU 2000, seven printed decimals
    let xyz = ["x_m", "y_m", "z_m"].map(|axis| number(&batch, axis, 7));
    close(
        xyz.iter().map(|c| c * c).sum::<f64>().sqrt(),
        3_394_001.37,
        1e-8,
    );
    assert_eq!(
        batch
            .column_by_name("source_file")
            .unwrap()
            .as_string::<i32>()
            .value(0),
        "ap19019l.b"
    );
    assert_eq!(
        batch
            .column_by_name("windows")
            .unwrap()
            .as_list::<i32>()
            .value(0)
            .as_string::<i32>()
            .iter()
            .collect::<Vec<_>>(),
        [Some("antimeridian")]
    );
}

/// More rows than stand in memory at once.
#[test]
fn a_long_table_comes_back_in_pieces() {
    const ROWS: u32 = 70_000;
    let mut site = Site::empty();
    let shot = Site::small().footprints.row(0);
    for record in 0..ROWS {
        site.footprints.push(&Footprint { record, ..shot });
        site.utc
            .push(Utc::parse("1999-08-24T14:12:13.000").unwrap());
    }
    let (folder, products) = written("long", &site, false);
    assert_eq!(
        products[1],
        ("footprints.parquet".to_owned(), u64::from(ROWS))
    );
    let file = File::open(folder.join("footprints.parquet")).unwrap();
    let reader = ParquetRecordBatchReaderBuilder::try_new(file)
        .unwrap()
        .build();
    let records: Vec<u32> = reader
        .unwrap()
        .flat_map(|batch| {
            let batch = batch.unwrap();
            let column = batch.column_by_name("record").unwrap();
            column.as_primitive::<UInt32Type>().values().to_vec()
        })
        .collect();
    assert!(records.into_iter().eq(0..ROWS));
    let features = json(&folder.join("footprints.geojson"));
    assert_eq!(features["features"][69_999]["properties"]["record"], 69_999);
}

#[test]
fn documents_keep_their_schemas() {
    let (folder, _) = written("schemas", &Site::small(), true);
    let ranges = json(&folder.join("ranges.json"));
    check_schema("ranges", &ranges);
    assert_eq!(ranges["valid"], false);
    assert_eq!(ranges["profiles"][0]["id"], "antimeridian/9019");
    assert_eq!(ranges["profiles"][0]["simultaneous"][0]["shots"], 60);
    assert!(
        ranges["profiles"][0]["bias_scan"]
            .get("uncertainty_s")
            .is_none()
    );
    let footprints = json(&folder.join("footprints.geojson"));
    check_schema("footprints", &footprints);
    let registration = json(&folder.join("registration.json"));
    check_schema("registration", &registration);
    assert_eq!(footprints["features"].as_array().unwrap().len(), 60);
    says_the_frame(footprints["frame"].as_str().unwrap());
    let image = folder.join("images/m04-02852");
    let orientation = json(&image.join("orientation.json"));
    check_schema("orientation", &orientation);
    // 10 m of bend: exact in second order, 10 x 0.31752 m (s_31) in first.
    close(
        orientation["first_order"]["x_m"]["rmse"].as_f64().unwrap(),
        3.1752,
        1e-4,
    );
    close(
        orientation["second_order"]["x_m"]["rmse"].as_f64().unwrap(),
        0.0,
        1e-8,
    );
    check_schema("isd", &json(&image.join("isd.json")));
}

#[test]
fn a_manifest_keeps_its_schema() {
    let hash = "0f".repeat(32);
    let mut document = serde_json::json!({
        "tool": "areograph", "version": "0.1.0", "site": "small",
        "verdict": { "valid": false, "reasons": ["profile a/1: 3 shots; expected at least 20"], "remarks": ["b"] },
        "configuration": { "file_name": "small.toml", "blake3": hash, "keys": { "site": "small" } },
        "biases": [{ "name": "ck_bias", "correction_s": -1.15, "scope": "attitude", "source": "mocAddendum004.ti" }],
        "kernels": [{
            "name": "a.bsp", "role": "SPK", "bytes": 1024, "blake3": hash,
            "coverage_used": [{ "start": START_S, "stop": START_S + 6.0 }],
        }],
        "kernel_choice": [{
            "set": "nav", "chosen": true, "epochs": 60, "distance_rms_m": 1.5, "distance_max_m": 2.0,
            "radial_mean_m": 0.1, "along_track_mean_m": -1.0, "cross_track_mean_m": 1.0,
            "ephemerides": [{ "name": "a.bsp", "blake3": hash }],
        }],
        "stages": [{ "name": "tag_times", "fingerprint": hash }],
        "products": [{ "path": "ranges.json", "bytes": 10, "blake3": hash, "rows": 1 }],
        "counts": { "footprints": 60 }, "figures": { "range_mean_m": 1.5 }, "rejected": { "class": 7 },
        "complaints": { "count": 0, "texts": [] }, "notes": [], "finished_utc": "2026-01-01T00:00:00Z",
    });
    // The program's own type and the schema mean the same document.
    let manifest: Manifest = serde_json::from_value(document.clone()).unwrap();
    document = serde_json::to_value(manifest).unwrap();
    check_schema("manifest", &document);
}

#[test]
fn camera_model_times_and_detectors_are_those_of_a_summed_image() {
    let (folder, _) = written("isd", &Site::small(), true);
    let isd = json(&folder.join("images/m04-02852/isd.json"));
    let value = |pointer: &str| isd.pointer(pointer).and_then(Value::as_f64).unwrap();
    let period_s = 8.0 * 0.000_482_1;
    assert_eq!(isd["image_lines"], 1280);
    close(value("/line_scan_rate/0/2"), period_s, 0.0);
    // usgscsm: t(line) = centre + start + rate (line - 0.5 + 0.5), the first line's centre at 0.5.
    let line_s = |line: f64| {
        value("/center_ephemeris_time")
            + value("/line_scan_rate/0/1")
            + value("/line_scan_rate/0/2") * line
    };
    close(line_s(0.5), START_S + 0.5 * period_s, 4e-9); // two roundings of ET near 1e7 s
    close(line_s(1280.0), START_S + 1280.0 * period_s, 4e-9);
    // usgscsm: detector = sample x summing + start - centre; detector pixels 0 to 7 have their middle at 3.5.
    let detector = 0.5 * value("/detector_sample_summing") + value("/starting_detector_sample")
        - value("/detector_center/sample");
    close(detector, 3.5 - 1023.5, 0.0);
    close(
        value("/instrument_position/positions/0/0"),
        -1745.7033,
        1e-9,
    ); // kilometres
}

/// Members of ALE's image support data that `usgscsm` may look for.
#[test]
fn camera_model_has_the_keys_of_the_truth() {
    let Some(path) = common::real_data(
        "ale_mgs/isds/mgsmocna_isd.json",
        "keys of the image support data",
    ) else {
        return;
    };
    let (folder, _) = written("keys", &Site::small(), true);
    let ours = json(&folder.join("images/m04-02852/isd.json"));
    let truth = json(&path);
    let mut missing = Vec::new();
    collect_missing(&truth, &ours, "", &mut missing);
    missing.retain(|key| !key.starts_with("/naif_keywords/"));
    assert!(missing.is_empty(), "{missing:?}");
}

fn collect_missing(truth: &Value, ours: &Value, at: &str, missing: &mut Vec<String>) {
    let Some(members) = truth.as_object() else {
        if truth.is_array() != ours.is_array() || truth.is_number() != ours.is_number() {
            missing.push(format!("{at} has another kind"));
        }
        return;
    };
    for (key, member) in members {
        match ours.get(key) {
            Some(found) => collect_missing(member, found, &format!("{at}/{key}"), missing),
            None => missing.push(format!("{at}/{key}")),
        }
    }
}

#[test]
fn exchange_files_have_the_columns_that_isis_and_asp_read() {
    let (folder, _) = written("exchange", &Site::small(), true);
    let lola = fs::read_to_string(folder.join("exchange/lola_like.csv")).unwrap();
    let fields: Vec<&str> = lola.lines().nth(1).unwrap().split(',').collect();
    assert_eq!(fields[0], "1999-08-24T14:12:13.000000");
    assert!(fields[1].starts_with("179.997135")); // east longitude, degrees
    assert_eq!(&fields[3..5], ["3394.001370", "380.000100"]);
    let ode = fs::read_to_string(folder.join("exchange/ode_pts.csv")).unwrap();
    assert!(ode.starts_with("LONG_EAST,LAT_NORTH,TOPOGRAPHY,RANGE,PLANET_RAD,"));
    assert_eq!(
        ode.lines().nth(1).unwrap().split(',').nth(4),
        Some("3394001.370")
    );
    assert_eq!(lola.lines().count(), 61);
    assert!(!lola.contains('"') && !ode.contains('"'));
    says_the_frame(&fs::read_to_string(folder.join("exchange/README.txt")).unwrap());
}

#[test]
fn the_same_site_gives_the_same_bytes() {
    let (first, products) = written("first", &Site::small(), true);
    let (second, _) = written("second", &Site::small(), true);
    for (path, _) in products {
        assert!(
            fs::read(first.join(&path)).unwrap() == fs::read(second.join(&path)).unwrap(),
            "{path}"
        );
    }
}

#[test]
fn an_empty_site_has_empty_products() {
    let (folder, products) = written("empty", &Site::empty(), false);
    let products = without_figures(products, 2);
    let rows: Vec<(&str, u64)> = products
        .iter()
        .map(|(path, rows)| (path.as_str(), *rows))
        .collect();
    // No exchange file of footprints, and nothing says where the site is.
    assert_eq!(
        rows,
        [
            ("footprints.parquet", 0),
            ("ranges.parquet", 0),
            ("ranges.json", 0),
            ("profiles.json", 0),
            ("registration.parquet", 0),
            ("registration.json", 0),
            ("report/index.html", 0),
            ("report/page.postcard", 0),
            ("kernels.tm", 0),
            ("exchange/kernels.json", 3),
            ("exchange/README.txt", 0),
        ]
    );
    let ranges = json(&folder.join("ranges.json"));
    check_schema("ranges", &ranges);
    let reason = ranges["invalid_because"][0].as_str().unwrap();
    assert!(reason.starts_with("no footprint in any window"), "{reason}");
    check_schema("registration", &json(&folder.join("registration.json")));
    let page = fs::read_to_string(folder.join("report/index.html")).unwrap();
    assert!(page.contains("Invalid, for one reason:"));
}

#[test]
fn numbers_that_are_not_finite_are_refused_with_their_place() {
    let mut site = Site::small();
    replace(&mut site.footprints.range_m, 4, f64::NAN);
    let folder = tempfile::tempdir().unwrap();
    let failure = site
        .with(true, |site| {
            write_products(folder.path(), site, &capabilities::page(site)?)
        })
        .unwrap_err();
    assert_eq!(failure.kind(), Kind::Bug);
    assert_eq!(
        failure.cause.to_string(),
        "column range_m, row 5 of 60 is not a finite number"
    );

    let mut site = Site::small();
    site.orientation.tables.velocity_m_s[1][2] = f64::INFINITY;
    let failure = site
        .with(true, |site| {
            write_products(folder.path(), site, &capabilities::page(site)?)
        })
        .unwrap_err();
    assert_eq!(
        failure.cause.to_string(),
        "/instrument_position/velocities/1/2 is not a finite number"
    );
    assert!(failure.file.unwrap().ends_with("images/m04-02852/isd.json"));
}

#[test]
fn parts_that_do_not_belong_together_are_refused() {
    let mut site = Site::small();
    drop(site.utc.split_off(site.utc.len() - 1));
    let folder = tempfile::tempdir().unwrap();
    let failure = site
        .with(true, |site| {
            write_products(folder.path(), site, &capabilities::page(site)?)
        })
        .unwrap_err();
    assert_eq!(
        failure.cause.to_string(),
        "UTC of footprints: 59; expected 60"
    );
}
