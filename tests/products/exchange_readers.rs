//! Exchange products read back by the programs that they are for.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly"
)]

use crate::common;
use crate::common::products_site as fixture;
use crate::common::readers;

use std::{
    f64::consts::{FRAC_PI_2, TAU},
    fs,
    path::Path,
};

use areograph::{
    capabilities::write_products,
    footprints::{Footprint, Footprints},
    geom::ellipsoid::spherical_to_xyz_m,
    stages::{describe_kernels::KernelLine, group_profiles::group_profiles},
    time::{Et, Interval, Intervals},
};
use common::json;
use fixture::{SHOTS, START_S, Site};
use nalgebra::Vector3;
use readers::{output, program, python};
use serde_json::Value;

/// The products of a site in a folder of their own.
fn written(site: &Site, image: bool) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    site.with(image, |site| {
        write_products(folder.path(), site, "<html></html>")
    })
    .unwrap();
    folder
}

fn close(value: f64, expected: f64, tolerance: f64) {
    assert!(
        (value - expected).abs() <= tolerance,
        "{value}, expected {expected} within {tolerance}"
    );
}

/// Longitude in -180..180 and latitude, degrees, and height above the sphere, metres.
fn gis_point(shot: &Footprint) -> [f64; 3] {
    let east = shot.longitude_rad.to_degrees();
    let signed = if east >= 180.0 { east - 360.0 } else { east };
    let height_m = shot.radius_crossover_m - 3_396_190.0;
    [signed, shot.latitude_rad.to_degrees(), height_m]
}

/// Column numbers and units as `pc_align --csv-format` reads them: `2:lon 3:lat 4:radius_km`.
fn pc_align_points(folder: &Path, name: &str) -> Vec<Vector3<f64>> {
    let sidecar = json(&folder.join(format!("exchange/{name}.json")));
    assert_eq!(
        (&sidecar["file"], &sidecar["datum"]),
        (&name.into(), &"D_MARS".into())
    );
    let format: Vec<(usize, String)> = sidecar["csv_format"]
        .as_str()
        .unwrap()
        .split_whitespace()
        .map(|term| {
            let (column, meaning) = term.split_once(':').unwrap();
            (column.parse().unwrap(), meaning.to_owned())
        })
        .collect();
    let text = fs::read_to_string(folder.join("exchange").join(name)).unwrap();
    text.lines()
        .skip(1)
        .map(|line| {
            // The tool separates at commas, spaces and tabs alike, and knows no quotes.
            let fields: Vec<&str> = line.split([',', ' ', '\t']).collect();
            let (mut longitude, mut latitude, mut radius_m) = (f64::NAN, f64::NAN, f64::NAN);
            for (column, meaning) in &format {
                let value: f64 = fields[column - 1].parse().unwrap();
                match meaning.as_str() {
                    "lon" => longitude = value.to_radians(),
                    "lat" => latitude = value.to_radians(),
                    "radius_km" => radius_m = 1e3 * value,
                    "radius_m" => radius_m = value,
                    other => panic!("{other}"),
                }
            }
            spherical_to_xyz_m(longitude, latitude, radius_m)
        })
        .collect()
}

#[test]
fn pc_align_reads_both_tables_by_the_format_of_their_sidecars() {
    let site = Site::small();
    let folder = written(&site, true);
    for name in ["lola_like.csv", "ode_pts.csv"] {
        let points = pc_align_points(folder.path(), name);
        assert_eq!(points.len(), site.footprints.len());
        for (row, point) in points.iter().enumerate() {
            let shot = site.footprints.row(row);
            let truth = spherical_to_xyz_m(
                shot.longitude_rad,
                shot.latitude_rad,
                shot.radius_crossover_m,
            );
            // Metres: millimetres of radius, 1e-9 degrees of latitude and longitude.
            assert!((point - truth).norm() < 1e-3);
        }
    }
}

#[test]
fn lrolola2isis_reads_five_columns_after_one_line() {
    let site = Site::small();
    let folder = written(&site, true);
    let text = fs::read_to_string(folder.path().join("exchange/lola_like.csv")).unwrap();
    let mut rows = 0;
    for (row, line) in text.lines().skip(1).enumerate() {
        let fields: Vec<&str> = line.split(',').collect();
        let number = |column: usize| -> f64 { fields[column].parse().unwrap() };
        let shot = site.footprints.row(row);
        assert_eq!(fields[0], site.utc.at(row).to_string());
        assert!((0.0..360.0).contains(&number(1)));
        close(number(1), shot.longitude_rad.to_degrees(), 1e-9); // degrees, printed to as many
        close(number(2), shot.latitude_rad.to_degrees(), 1e-9);
        close(number(3), shot.radius_crossover_m / 1e3, 1e-6); // kilometres
        close(number(4), shot.range_m / 1e3, 1e-6);
        rows = row + 1;
    }
    assert_eq!(rows, site.footprints.len());
}

const GIS_FILES: [&str; 3] = [
    "exchange/footprints.gpkg",
    "exchange/footprints.shp",
    "footprints.geojson",
];

#[test]
fn gdal_summarises_geopackage_shapefile_and_geojson() {
    let test = "GDAL's summaries";
    let folder = written(&Site::small(), true);
    for file in GIS_FILES {
        let Some(mut ogrinfo) = program("ogrinfo", test) else {
            return;
        };
        let path = folder.path().join(file);
        let text = output(ogrinfo.args(["-ro", "-al", "-so"]).arg(&path));
        assert!(!text.contains("Warning"), "{file}: {text}");
        assert!(text.contains(&format!("Feature Count: {SHOTS}")), "{text}");
        assert!(text.contains("ELLIPSOID[\"Mars (2015) - Sphere\",3396190,0"));
        assert!(text.contains("49900"), "{file}: {text}");
        let three_dimensions = file != "footprints.geojson";
        assert_eq!(
            text.contains("Geometry: 3D Point"),
            three_dimensions,
            "{text}"
        );
        assert!(text.contains("Extent: (-180.000000, -5.729578) - (179.99990"));
        if file.ends_with("shp") {
            // The date of the newest shot, whatever today is.
            assert!(text.contains("DBF_DATE_LAST_UPDATE=1999-08-24"), "{text}");
        }
    }
}

#[test]
fn gdal_reads_every_footprint() {
    let test = "GDAL's rows";
    let mut site = Site::small();
    site.footprints.files[0].name = "ap19019l å.b".to_owned();
    let folder = written(&site, true);
    for file in GIS_FILES {
        let Some(mut ogr2ogr) = program("ogr2ogr", test) else {
            return;
        };
        let path = folder.path().join(file);
        let text = output(
            ogr2ogr
                .args(["-f", "CSV", "/vsistdout/"])
                .arg(&path)
                .args(["-lco", "GEOMETRY=AS_XYZ"]),
        );
        let mut lines = text.lines();
        let names: Vec<&str> = lines.next().unwrap().split(',').collect();
        let mut rows = 0;
        for (row, line) in lines.enumerate() {
            let fields: Vec<&str> = line
                .split(',')
                .map(|field| field.trim_matches('"'))
                .collect();
            let field = |name: &str| fields[names.iter().position(|n| *n == name).unwrap()];
            let number = |name: &str| -> f64 { field(name).parse().unwrap() };
            let shot = site.footprints.row(row);
            let [x, y, z] = gis_point(&shot);
            // GDAL prints 15 digits; shapefiles hold times to a microsecond, lengths to a millimetre.
            close(number("X"), x, 1e-12);
            close(number("Y"), y, 1e-12);
            if file != "footprints.geojson" {
                close(number("Z"), z, 1e-9);
            }
            close(number("et_s"), shot.et_s, 1e-6);
            close(number("radius_m"), shot.radius_m, 1e-3);
            close(number("range_m"), shot.range_m, 1e-3);
            close(number("orbit"), f64::from(shot.orbit), 0.0);
            close(number("record"), f64::from(shot.record), 0.0);
            let source = if file.ends_with("shp") {
                "file"
            } else {
                "source_file"
            };
            assert_eq!(field(source), "ap19019l å.b");
            rows = row + 1;
        }
        assert_eq!(rows, site.footprints.len(), "{file}");
    }
}

#[test]
fn geopandas_and_duckdb_read_the_geoparquet() {
    let site = Site::small();
    let folder = written(&site, true);
    let Some(mut script) = python("read_geoparquet.py", "GeoPandas and DuckDB") else {
        return;
    };
    let found = output(script.arg(folder.path().join("footprints.parquet")));
    let found: Value = serde_json::from_str(&found).unwrap();
    let range_m: f64 = site.footprints.range_m.iter().sum();
    for reader in ["geopandas", "duckdb"] {
        assert_eq!(found[reader]["rows"], SHOTS);
        close(found[reader]["range_m"].as_f64().unwrap(), range_m, 1e-6); // rounding of a sum
    }
    let frame = &found["geopandas"];
    assert_eq!(frame["crs"], serde_json::json!(["IAU_2015", "49900"]));
    assert_eq!(frame["types"], serde_json::json!(["Point"]));
    let [x, y, _] = gis_point(&site.footprints.row(0));
    close(frame["first"][0].as_f64().unwrap(), x, 1e-12); // degrees, rounding of the conversion
    close(frame["first"][1].as_f64().unwrap(), y, 1e-12);
    assert_eq!(found["duckdb"]["orbits"], 1);
    assert_eq!(frame["columns"], found["duckdb"]["columns"]);
}

/// What the validator read; `None` when it is absent.
fn validated(folder: &Path, test: &str) -> Option<Value> {
    let mut script = python("validate_stac.py", test)?;
    let text = output(script.arg(folder.join("exchange/stac_item.json")));
    Some(serde_json::from_str(&text).unwrap())
}

#[test]
fn stac_validator_accepts_the_item_and_its_hashes_are_those_of_the_files() {
    let folder = written(&Site::small(), true);
    let path = folder.path().join("exchange/stac_item.json");
    let item = json(&path);
    let assets = item["assets"].as_object().unwrap();
    assert!(assets.len() > 15);
    for (key, asset) in assets {
        let bytes = fs::read(path.with_file_name(asset["href"].as_str().unwrap())).unwrap();
        let hash = blake3::hash(&bytes).to_hex();
        assert_eq!(asset["file:checksum"], format!("1e20{hash}"), "{key}");
        assert_eq!(asset["file:size"], bytes.len(), "{key}");
    }
    let properties = &item["properties"];
    assert_eq!(properties["start_datetime"], "1999-08-24T14:12:13.000Z");
    // The image starts at 13.635 s and lasts 1536 x 3.8568 ms.
    assert_eq!(properties["end_datetime"], "1999-08-24T14:12:19.560Z");
    let Some(found) = validated(folder.path(), "the STAC validator") else {
        return;
    };
    assert_eq!(found["id"], "small");
    assert_eq!(found["geometry"], "MultiPolygon"); // across the antimeridian
    assert!(found["bbox"][0].as_f64() > found["bbox"][2].as_f64());
    assert_eq!(found["validated"].as_array().unwrap().len(), 4);
}

/// The small site with its shots moved to other places, given in radians.
fn moved(place: impl Fn(f64) -> (f64, f64)) -> Site {
    let mut site = Site::small();
    let mut shots = Footprints::new(site.footprints.files.clone());
    for row in 0..site.footprints.len() {
        let (longitude_rad, latitude_rad) = place(row as f64 / f64::from(SHOTS));
        shots.push(&Footprint {
            longitude_rad,
            latitude_rad,
            ..site.footprints.row(row)
        });
    }
    site.footprints = shots;
    site.profiles = group_profiles(
        &site.footprints,
        &site.config.windows,
        std::slice::from_ref(&site.times),
    );
    site
}

#[test]
fn sites_at_poles_and_at_zero_longitude_have_valid_items() {
    let pole = moved(|along| (along * TAU, FRAC_PI_2 - 0.01 - 0.01 * along));
    let zero = moved(|along| ((TAU + 0.02 * (along - 0.5)) % TAU, 0.1 + 0.01 * along));
    for (site, round) in [(pole, true), (zero, false)] {
        let folder = written(&site, false);
        let item = json(&folder.path().join("exchange/stac_item.json"));
        let bounds: Vec<f64> = (0..4).map(|k| item["bbox"][k].as_f64().unwrap()).collect();
        assert!(bounds[0] >= -180.0 && bounds[2] <= 180.0 && bounds[0] < bounds[2]);
        assert_eq!(
            round,
            bounds[2] - bounds[0] >= 360.0 && bounds[3] >= 90.0,
            "{bounds:?}"
        );
        for row in 0..site.footprints.len() {
            let [x, y, _] = gis_point(&site.footprints.row(row));
            assert!((bounds[0]..=bounds[2]).contains(&x) && (bounds[1]..=bounds[3]).contains(&y));
        }
        if validated(folder.path(), "the STAC validator").is_none() {
            return;
        }
    }
}

#[test]
fn a_site_of_images_has_an_item_and_no_tables() {
    let folder = written(&Site::empty(), true);
    let exchange = folder.path().join("exchange");
    let mut names: Vec<String> = fs::read_dir(&exchange)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(
        names,
        [
            "README.txt",
            "centre",
            "image_outlines.geojson",
            "kernels.json",
            "site.qgz",
            "stac_item.json"
        ]
    );
    assert!(!folder.path().join("footprints.xml").exists());
    let readme = fs::read_to_string(exchange.join("README.txt")).unwrap();
    assert!(readme.contains("has no footprints") && !readme.contains("pc_align"));
    assert!(readme.contains("images/m04-02852/isd.json"));
    let item = json(&exchange.join("stac_item.json"));
    assert_eq!(
        item["properties"]["instruments"],
        serde_json::json!(["moc-na"])
    );
    validated(folder.path(), "the STAC validator");
}

fn kernel(name: &str, role: &str, held: Option<&[[f64; 2]]>) -> KernelLine {
    let interval =
        |[start, stop]: &[f64; 2]| Interval::new(Et::from_seconds(*start), Et::from_seconds(*stop));
    KernelLine {
        name: name.to_owned(),
        role: role.to_owned(),
        bytes: 1024,
        blake3: "0f".repeat(32),
        held: held.map(|held| Intervals::union_of(held.iter().map(interval))),
        used: Vec::new(),
    }
}

#[test]
fn the_kernel_report_keeps_its_schema_with_qualities_and_gaps() {
    let path = format!(
        "{}/config/schema/kernels.schema.json",
        env!("CARGO_MANIFEST_DIR")
    );
    let schema = jsonschema::validator_for(&json(Path::new(&path))).unwrap();
    let mut site = Site::small();
    let held = [[START_S - 100.0, START_S], [START_S + 1.0, START_S + 100.0]];
    site.kernels = vec![
        kernel("naif0012.tls", "LSK", None),
        kernel("mocAddendum004.ti", "IK", None),
        kernel("de421.bsp", "SPK", Some(&[])),
        kernel("mgs_map2.bsp", "SPK", Some(&held[..1])),
        kernel("mgs_sc_map2.bc", "CK", Some(&held)),
    ];
    let report = |site: &Site| json(&written(site, true).path().join("exchange/kernels.json"));
    let found = report(&site);
    assert!(schema.is_valid(&found), "{found}");
    assert_eq!(found["tspk"], serde_json::json!(["de421.bsp"]));
    assert_eq!(found["iak"], serde_json::json!(["mocAddendum004.ti"]));
    assert_eq!(found["mgs_ck_quality"], "reconstructed");
    assert_eq!(found["mgs_spk_quality"], "reconstructed");
    assert_eq!(
        found["areograph"]["kernels"][4]["coverage_et_s"],
        serde_json::json!(held)
    );
    // One kernel of commanded attitude lowers the quality of all.
    site.kernels
        .push(kernel("mgs_ext_roto_all_v9.bc", "CK", Some(&held)));
    assert_eq!(report(&site)["mgs_ck_quality"], "predicted");
    site.kernels.push(kernel("smoothed.bc", "CK", Some(&held)));
    let mut found = report(&site);
    assert_eq!(found["mgs_ck_quality"], "noquality");
    found.as_object_mut().unwrap().remove("mgs_ck_quality");
    assert!(!schema.is_valid(&found));
}

/// Texts of all elements `tag`, in order.
fn elements<'a>(xml: &'a str, tag: &str) -> Vec<&'a str> {
    xml.split(&format!("<{tag}"))
        .skip(1)
        .filter(|rest| rest.starts_with(['>', ' ']))
        .map(|rest| {
            let text = rest.split_once('>').unwrap().1;
            text.split_once(&format!("</{tag}>")).unwrap().0
        })
        .collect()
}

#[test]
fn the_pds4_label_describes_every_field_of_the_table() {
    let test = "xmllint";
    let folder = written(&Site::small(), true);
    let label = folder.path().join("footprints.xml");
    let xml = fs::read_to_string(&label).unwrap();
    let csv = fs::read_to_string(folder.path().join("footprints.csv")).unwrap();
    let one = |tag: &str| -> String {
        let found = elements(&xml, tag);
        assert_eq!(found.len(), 1, "{tag}");
        found[0].to_owned()
    };
    assert_eq!(one("file_name"), "footprints.csv");
    assert_eq!(one("file_size"), csv.len().to_string());
    assert_eq!(one("start_date_time"), "1999-08-24T14:12:13.000000Z");
    let header = csv.split_inclusive('\n').next().unwrap();
    assert_eq!(
        elements(&xml, "offset"),
        ["0".to_owned(), header.len().to_string()]
    );
    assert_eq!(
        elements(&xml, "object_length"),
        [header.len(), csv.len() - header.len()].map(|bytes| bytes.to_string())
    );
    // Records of the file, then of the table.
    assert_eq!(elements(&xml, "records"), ["61", "60"]);
    let names: Vec<&str> = header.trim_end().split(',').collect();
    assert_eq!(one("fields"), names.len().to_string());
    let fields: Vec<&str> = elements(&xml, "Field_Delimited");
    assert_eq!(fields.len(), names.len());
    let rows: Vec<Vec<&str>> = csv
        .lines()
        .skip(1)
        .map(|line| line.split(',').collect())
        .collect();
    for (column, (field, name)) in fields.iter().zip(&names).enumerate() {
        assert_eq!(elements(field, "name"), [*name]);
        assert_eq!(elements(field, "field_number"), [(column + 1).to_string()]);
        assert!(elements(field, "description")[0].len() > 5, "{name}");
        let unit = match name.rsplit('_').next().unwrap() {
            unit @ ("m" | "s" | "deg") => vec![unit],
            _ => vec![],
        };
        assert_eq!(elements(field, "unit"), unit, "{name}");
        let kind = elements(field, "data_type")[0];
        for row in &rows {
            let fits = match kind {
                "ASCII_Real" => row[column].parse::<f64>().is_ok_and(f64::is_finite),
                "ASCII_Integer" => row[column].parse::<i64>().is_ok(),
                "ASCII_Boolean" => ["true", "false"].contains(&row[column]),
                "ASCII_Date_Time_YMD_UTC" => {
                    chrono::DateTime::parse_from_rfc3339(row[column]).is_ok()
                }
                "UTF8_String" => !row[column].contains('"'),
                _ => false,
            };
            assert!(fits, "{name}: {} is no {kind}", row[column]);
        }
    }
    if let Some(mut md5sum) = program("md5sum", test) {
        let sum = output(md5sum.arg(folder.path().join("footprints.csv")));
        assert!(sum.starts_with(&one("md5_checksum")));
    }
    if let Some(mut xmllint) = program("xmllint", test) {
        output(xmllint.arg("--noout").arg(&label));
    }
}
