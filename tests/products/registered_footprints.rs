//! The table of registered footprints against the tables that it joins, and in the programs of its readers.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    reason = "helpers of tests may fail loudly"
)]

use std::{collections::BTreeMap, path::Path};

use arrow_array::{cast::AsArray as _, types::Float64Type};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

use crate::common::{
    json,
    mission::site_run,
    products_site::Site,
    readers::{output, python},
};
use areograph::capabilities::write_products;
use serde_json::{Value, json};

/// The rows of a CSV file by column.
fn rows(path: &Path) -> Vec<BTreeMap<String, String>> {
    let mut file = csv::Reader::from_path(path).unwrap();
    file.deserialize().map(Result::unwrap).collect()
}

fn number(row: &BTreeMap<String, String>, name: &str) -> f64 {
    row[name].parse().unwrap()
}

#[test]
fn footprints_inside_images_have_one_row_with_both_places() {
    let folder = site_run("gusev_crater");
    let registered = rows(&folder.join("registered_footprints.csv"));
    let footprints = rows(&folder.join("footprints.csv"));
    let inside = |name: &str| registered.iter().filter(|row| row[name] == "true").count();
    let counted = &json(&folder.join("manifest.json"))["counts"]["registered_inside"];
    assert_eq!(*counted, inside("before_inside"));
    assert!(inside("adjusted_inside") > 0);
    let mut compared = [0, 0];
    for row in &registered {
        assert!(row["before_inside"] == "true" || row["adjusted_inside"] == "true");
        let footprint = &footprints[row["footprint_row"].parse::<usize>().unwrap()];
        for name in [
            "longitude_deg",
            "latitude_deg",
            "topography_m",
            "orbit",
            "shot",
            "return_class",
        ] {
            assert_eq!(row[name], footprint[name], "{name}");
        }
        let [before, after] = ["before", "adjusted"]
            .map(|round| ["line", "sample"].map(|axis| number(row, &format!("{round}_{axis}"))));
        let isis = |round: &str| {
            let place = ["line", "sample"].map(|axis| format!("{round}_isis_{axis}"));
            let is_shown = !row[&place[0]].is_empty();
            is_shown.then(|| place.map(|name| number(row, &name) - 0.5))
        };
        if let Some(isis) = isis("before") {
            // Lines: 42 m along the track at 4.4 and 4.9 m per line, and the sign of the flight.
            let lines = before[0] - isis[0];
            assert!((7.0..10.0).contains(&lines.abs()), "{lines}");
            compared[0] += 1;
        }
        if let Some(isis) = isis("adjusted") {
            // Pixels, as the same rays: those of the second-order model differ from the tables in the kernels.
            let apart = (after[0] - isis[0]).hypot(after[1] - isis[1]);
            assert!(apart < 0.5, "{apart}");
            compared[1] += 1;
        }
        let moved_px = (after[0] - before[0]).hypot(after[1] - before[1]);
        assert!((number(row, "moved_px") - moved_px).abs() < 1e-9);
        // The footprints inside these images are part of the adjustment.
        assert!(number(row, "sigma_up_m") > 0.0);
    }
    // Only footprints at the ends of an image are missing in ISIS.
    assert!(
        compared.iter().all(|rows| rows * 10 > registered.len() * 9),
        "{compared:?}"
    );
    let shown = |id: &str| registered.iter().filter(|row| row["image"] == id).count();
    assert_eq!(shown("E02-00665") + shown("E02-01453"), registered.len());
}

/// Places of adjusted footprints, by formulas of the test's own.
#[test]
fn adjusted_footprints_have_places_on_the_map() {
    let folder = site_run("gusev_crater");
    let file = std::fs::File::open(folder.join("adjusted_footprints.parquet")).unwrap();
    let file = ParquetRecordBatchReaderBuilder::try_new(file).unwrap();
    let adjusted = file.build().unwrap().next().unwrap().unwrap();
    let footprints = rows(&folder.join("footprints.csv"));
    let real = |name: &str| {
        let column = adjusted.column_by_name(name).unwrap();
        column.as_primitive::<Float64Type>().values().to_vec()
    };
    let names = adjusted.column_by_name("footprint").unwrap();
    let names = names.as_string::<i32>();
    assert!(adjusted.num_rows() > 50);
    for round in ["", "adjusted_"] {
        let [x, y, z, longitude, latitude] = ["x_m", "y_m", "z_m", "longitude_deg", "latitude_deg"]
            .map(|name| real(&format!("{round}{name}")));
        for row in 0..adjusted.num_rows() {
            let expected_deg = [
                y[row].atan2(x[row]).to_degrees().rem_euclid(360.0),
                z[row].atan2(x[row].hypot(y[row])).to_degrees(),
            ];
            for (found, expected) in [longitude[row], latitude[row]].iter().zip(expected_deg) {
                // Rounding.
                assert!((found - expected).abs() < 1e-9, "{found} {expected}");
            }
            if round.is_empty() {
                let (_, footprint) = names.value(row).rsplit_once(':').unwrap();
                let footprint = &footprints[footprint.parse::<usize>().unwrap()];
                for (name, found) in [
                    ("longitude_deg", longitude[row]),
                    ("latitude_deg", latitude[row]),
                ] {
                    // Radius and angles were Cartesian in between.
                    assert!((number(footprint, name) - found).abs() < 1e-9);
                }
            }
        }
    }
}

/// TDB minus UTC in 1999 to 2005, seconds: 32 leap seconds and 32.184 s; TDB departs from TT by up to 1.7 ms.
const TDB_UTC_S: f64 = 64.184;
/// Noon of 2000-01-01 in UTC, seconds since 1970.
const NOON_2000_S: f64 = 946_728_000.0;

#[test]
fn utc_is_the_time_of_the_shot() {
    let folder = site_run("gusev_crater");
    for file in ["registered_footprints.csv", "footprints.csv"] {
        for row in rows(&folder.join(file)) {
            let time = chrono::DateTime::parse_from_rfc3339(&row["utc"]).unwrap();
            let utc_s = time.timestamp_micros() as f64 / 1e6;
            let apart_s = utc_s - NOON_2000_S + TDB_UTC_S - number(&row, "et_s");
            assert!(apart_s.abs() < 1.8e-3, "{file}: {apart_s} s");
        }
    }
}

#[test]
fn adjusted_places_are_those_of_the_adjusted_registration() {
    let folder = site_run("gusev_crater");
    let Some(mut script) = python("compare_registered.py", "GeoPandas and DuckDB") else {
        return;
    };
    let found: Value = serde_json::from_str(&output(script.arg(&folder))).unwrap();
    let registered = rows(&folder.join("registered_footprints.csv"));
    assert_eq!(found["before"], json!([registered.len(), 0.0]));
    assert_eq!(found["adjusted"], json!([registered.len(), 0.0]));
}

#[test]
fn geopandas_and_duckdb_read_the_times_as_times() {
    let folder = site_run("gusev_crater");
    let Some(mut script) = python("read_registered.py", "GeoPandas and DuckDB") else {
        return;
    };
    let path = folder.join("registered_footprints.parquet");
    let found: Value = serde_json::from_str(&output(script.arg(path))).unwrap();
    let registered = rows(&folder.join("registered_footprints.csv"));
    assert_eq!(found["rows"], registered.len());
    assert_eq!(found["crs"], json!(["IAU_2015", "49900"]));
    assert_eq!(found["time"], "datetime64[us, UTC]");
    assert_eq!(found["duckdb_time"], "TIMESTAMP WITH TIME ZONE");
    assert_eq!(found["span_ms"], found["geopandas_span_ms"]);
    let oldest = registered.iter().map(|row| &*row["utc"]).min().unwrap();
    let first = found["first"].as_str().unwrap().replace("+00:00", "Z");
    assert_eq!(first, oldest);
}

#[test]
fn a_site_without_images_has_no_such_table() {
    let folder = tempfile::tempdir().unwrap();
    Site::small()
        .with(false, |site| write_products(folder.path(), site, ""))
        .unwrap();
    assert!(!folder.path().join("registered_footprints.parquet").exists());
    assert!(!folder.path().join("registered_footprints.csv").exists());
}
