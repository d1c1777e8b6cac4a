//! A pair of images through the whole flow: misregistration of one spacing of footprints, its cure, the products,
//! and what a change touches.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly"
)]

use crate::common;

use std::{collections::BTreeSet, fmt::Write as _, fs, fs::File, path::Path};

use areograph::pds::ties::read_ties;
use arrow_array::RecordBatch;
use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use common::{
    case::Case,
    json,
    mission::{mission, products},
};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use serde_json::Value;

fn table(path: &Path) -> RecordBatch {
    let builder = ParquetRecordBatchReaderBuilder::try_new(File::open(path).unwrap()).unwrap();
    builder.build().unwrap().next().unwrap().unwrap()
}

fn number(value: &Value, pointer: &str) -> f64 {
    let found = value.pointer(pointer);
    found
        .unwrap_or_else(|| panic!("no {pointer}"))
        .as_f64()
        .unwrap()
}

fn keeps_schema(document: &Value, name: &str) {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/config/schema");
    let path = Path::new(folder).join(format!("{name}.schema.json"));
    let schema = jsonschema::validator_for(&json(&path)).unwrap();
    let errors: Vec<String> = schema
        .iter_errors(document)
        .map(|e| e.to_string())
        .collect();
    assert_eq!(errors, [""; 0], "{name}");
}

fn blunders() -> BTreeSet<String> {
    let truth = json(&mission().join("truth.json"));
    let sites = truth["ties"].as_array().unwrap();
    let site = sites.iter().find(|site| site["site"] == "isidis").unwrap();
    let ties = site["ties"].as_array().unwrap().iter();
    ties.filter(|tie| !tie["blunder"].is_null())
        .map(|tie| tie["id"].as_str().unwrap().to_owned())
        .collect()
}

#[test]
fn the_adjustment_cures_the_misregistration() {
    let case = Case::pair();
    case.stages_run();
    let site = case.path("out/isidis");
    let found = json(&site.join("adjustment.json"));
    keeps_schema(&found, "adjustment");
    keeps_schema(&json(&site.join("manifest.json")), "manifest");

    // 34.5 and 25.5 lines of 3.26 and 4.40 m and position biases of tens of metres, along the flight.
    let before_m = number(&found, "/before/pairs/0/along_track_parallax_m");
    assert!((190.0..330.0).contains(&before_m), "{before_m} m");
    let spacings: Vec<f64> = found["before"]["pairs"][0]["footprints"]["profiles"]
        .as_array()
        .unwrap()
        .iter()
        .map(|profile| number(profile, "/along_spacings").abs())
        .collect();
    assert_eq!(spacings.len(), 2);
    assert!(
        spacings
            .iter()
            .all(|spacings| (0.5..1.2).contains(spacings)),
        "{spacings:?}"
    );
    // 146 ties of a line's noise tell the mean to 0.1 lines of 4 m; the image-to-image transformation adds what
    // relief does to it.
    let after_m = number(&found, "/after/pairs/0/along_track_parallax_m");
    assert!(after_m < 1.0, "{after_m} m");
    for profile in found["after"]["pairs"][0]["footprints"]["profiles"]
        .as_array()
        .unwrap()
    {
        assert!(number(profile, "/along_spacings").abs() < 0.05, "{profile}");
    }

    // Who is left out is a blunder; two of eight lie across the track, where a pair controls nothing.
    let rejected: BTreeSet<String> = found["adjustment"]["rejected"]
        .as_array()
        .unwrap()
        .iter()
        .map(|point| point["id"].as_str().unwrap().to_owned())
        .collect();
    assert!(
        rejected.is_subset(&blunders()) && rejected.len() >= 6,
        "{rejected:?}"
    );
    let manifest = json(&site.join("manifest.json"));
    assert!((number(&manifest, "/figures/along_track_parallax_m") - before_m).abs() < 1e-9); // the same number
    assert!((number(&manifest, "/figures/adjusted_along_track_parallax_m") - after_m).abs() < 1e-9);
    assert_eq!(
        manifest["figures"]["adjustment_sigma0"],
        found["adjustment"]["summary"]["sigma0"]
    );
}

/// The files for users of jigsaw, `named` tie points being rejected.
fn jigsaw_finds_its_files(site: &Path, named: usize) {
    let network = read_ties(&site.join("exchange/adjusted.pvl")).unwrap();
    assert_eq!((network.ties.len(), network.ignored), (154, 0));
    let flag = "JigsawRejected = True\n";
    let written = fs::read_to_string(site.join("exchange/adjusted.pvl")).unwrap();
    assert_eq!(written.matches(flag).count(), 3 * named); // of the point and of both measures
    assert_eq!(network.complaints, []);
    // The binary form has the same points and measures.
    let binary = read_ties(&site.join("exchange/adjusted.net")).unwrap();
    assert_eq!(binary, network);
    let text = |path: &str| fs::read_to_string(site.join("exchange").join(path)).unwrap();
    let rows = |text: &str, heads: usize| {
        let rows = text.lines().skip(heads);
        rows.map(|row| row.split(',').map(str::to_owned).collect())
            .collect::<Vec<Vec<String>>>()
    };
    let residuals = rows(&text("residuals.csv"), 3);
    assert_eq!(residuals.len(), 2 * 154);
    let starred = residuals.iter().filter(|row| row[10] == "*").count();
    assert_eq!(starred, 2 * named);
    let points = rows(&text("bundleout_points.csv"), 3);
    assert_eq!(points.len(), 154 - named);
    let images = rows(&text("bundleout_images.csv"), 2);
    // Lines of the residuals are those of the image: their root mean square, and that of the image's row.
    let lines: Vec<f64> = residuals
        .iter()
        .filter(|row| row[1] == "E02-01301.cub" && row[10].is_empty())
        .map(|row| row[8].parse().unwrap())
        .collect();
    let squares: f64 = lines.iter().map(|line| line * line).sum();
    let rms = (squares / lines.len() as f64).sqrt();
    let told: f64 = images[0][2].parse().unwrap();
    assert!((rms - told).abs() < 1e-7, "{rms} {told}"); // eight decimals
    // Noise of a line in both images, half of which the height of the point takes up.
    assert!((0.5..1.1).contains(&rms), "{rms}");
    // Of each image 15 unknowns: all but the quadratic positions.
    assert_eq!(
        table(&site.join("correlations.parquet")).num_rows(),
        2 * 15 * 14 / 2
    );
}

#[test]
fn the_products_of_the_adjustment_agree_with_each_other() {
    let case = Case::pair();
    case.stages_run();
    let site = case.path("out/isidis");
    let found = json(&site.join("adjustment.json"));
    let ties = table(&site.join("ties.parquet"));
    assert_eq!(ties.num_rows(), 2 * 154);
    let column = |name: &str| {
        ties.column_by_name(name)
            .unwrap()
            .as_primitive::<Float64Type>()
            .clone()
    };
    let rejected = ties
        .column_by_name("rejected")
        .unwrap()
        .as_string::<i32>()
        .clone();
    let out = rejected.iter().filter(|reason| *reason != Some("")).count();
    let named = found["adjustment"]["rejected"].as_array().unwrap().len();
    assert_eq!(out, 2 * named);
    assert_eq!(
        column("adjusted_x_m").iter().flatten().count(),
        2 * (154 - named)
    );
    // What the table and the statistics say of the residuals is one thing.
    let images = ties
        .column_by_name("image")
        .unwrap()
        .as_string::<i32>()
        .clone();
    let residuals: Vec<f64> = column("residual_along_px")
        .iter()
        .zip(images.iter())
        .filter(|(_, image)| *image == Some("E02-01301"))
        .filter_map(|(residual, _)| residual)
        .collect();
    let mean = residuals.iter().sum::<f64>() / residuals.len() as f64;
    let told = number(
        &found,
        "/adjustment/summary/images/0/tie_residuals_px/0/mean",
    );
    assert!((mean - told).abs() < 1e-9, "{mean} {told}"); // rounding of a sum

    let control = fs::read_to_string(site.join("exchange/adjusted.gcp")).unwrap();
    let points = control
        .lines()
        .filter(|line| !line.starts_with('#'))
        .count();
    assert_eq!(points, 154 - named);
    jigsaw_finds_its_files(&site, named);
    let lidar = json(&site.join("exchange/lidar.json"));
    let shots = table(&site.join("adjusted_footprints.parquet"));
    let ranges = shots.column_by_name("range_m").unwrap();
    let with_range = ranges.len() - ranges.null_count();
    let points = lidar["points"].as_array().unwrap();
    // Of the shots fired during the 13 s of an image some lie before its first line: the camera looks ahead.
    assert!((with_range * 8 / 10..=with_range).contains(&points.len()));
    for point in points {
        assert!(!point["measures"].as_array().unwrap().is_empty());
        let serial_number = point["simultaneousImages"][0].as_str().unwrap();
        assert!(serial_number.starts_with("MGS/"), "{serial_number}");
    }
    // The images start where this run ended when the adjusted kernels are loaded; shots are none of these.
    let site = String::from_utf8(case.read("site.toml")).unwrap();
    let cut = |site: String, from: &str, to: &str| {
        let (from, to) = (site.find(from).unwrap(), site.find(to).unwrap());
        format!("{}{}", &site[..from], &site[to..])
    };
    let images = cut(cut(site, "[pedr]", "[ties]"), "[[windows]]", "[[images]]");
    case.write("site.toml", images);
    case.replace("site.toml", "kernels/nav.tm", "out/isidis/adjusted.tm");
    case.replace("site.toml", "site = \"isidis\"", "site = \"again\"");
    case.stages_run();
    let again = json(&case.path("out/again/adjustment.json"));
    let starts_m = number(&again, "/before/pairs/0/along_track_parallax_m");
    assert!(starts_m < 1.0, "{starts_m} m"); // as the_adjustment_cures_the_misregistration
    let orientation = |path: &str| table(&case.path(path));
    for id in ["E02-01301", "E02-02016"] {
        let adjusted = orientation(&format!(
            "out/isidis/images/{id}/adjusted_orientation.parquet"
        ));
        let sampled = orientation(&format!("out/again/images/{id}/orientation.parquet"));
        for axis in ["x_m", "y_m", "z_m"] {
            let values = |of: &RecordBatch| {
                of.column_by_name(axis)
                    .unwrap()
                    .as_primitive::<Float64Type>()
                    .values()
                    .to_vec()
            };
            for (adjusted, sampled) in values(&adjusted).iter().zip(values(&sampled)) {
                // Metres: ET is rounded to 7e-9 s, in which MGS flies 3e-5 m.
                assert!((adjusted - sampled).abs() < 1e-3, "{id} {axis}");
            }
        }
    }
}

#[test]
fn a_tie_point_file_touches_what_comes_after_it() {
    let case = Case::pair();
    assert!(
        case.stages_run()
            .contains(&"compare_pairs/adjusted".to_owned())
    );
    assert_eq!(case.stages_run(), [""; 0]);
    let text = String::from_utf8(case.read("ties/isidis.csv")).unwrap();
    let without_last: Vec<&str> = text.lines().collect();
    case.write(
        "ties/isidis.csv",
        without_last[..without_last.len() - 2].join("\n"),
    );
    let stages = [
        "read_ties",
        "intersect",
        "compare_pairs",
        "check_heights",
        "adjust",
        "reorient/E02-01301",
        "reorient/E02-02016",
        "fit_sensor_model/E02-01301/adjusted",
        "register/E02-01301/adjusted",
        "fit_sensor_model/E02-02016/adjusted",
        "register/E02-02016/adjusted",
        "intersect/adjusted",
        "compare_pairs/adjusted",
        "check_heights/adjusted",
        "tabulate_kernels/E02-01301",
        "tabulate_kernels/E02-02016",
        "publish",
    ];
    assert_eq!(case.stages_run(), stages);
    case.replace(
        "site.toml",
        "tie_sigma_px = [1.6, 1.0]",
        "tie_sigma_px = [1.7, 1.0]",
    );
    assert_eq!(case.stages_run(), stages[4..]);
    // A site whose tie points are gone has no product of them left.
    let site = String::from_utf8(case.read("site.toml")).unwrap();
    let (before, after) = (
        site.find("[ties]").unwrap(),
        site.find("[adjustment]").unwrap(),
    );
    case.write(
        "site.toml",
        format!("{}{}", &site[..before], &site[after..]),
    );
    assert_eq!(case.stages_run(), ["publish"]);
    let left: Vec<_> = products(&case.path("out/isidis")).into_keys().collect();
    let of_ties = |path: &&std::path::PathBuf| {
        let path = path.to_string_lossy();
        path.contains("adjust") || path.contains("ties") || path.contains("lidar")
    };
    assert_eq!(left.iter().find(of_ties), None);
}

#[test]
fn threads_change_no_byte() {
    let case = Case::pair();
    let with = |threads: &str| {
        let mut command = case.run();
        command.args(["--threads", threads, "--force"]);
        common::mission::succeed(&mut command);
        products(&case.path("out"))
    };
    let (one, eight) = (with("1"), with("8"));
    assert!(one.keys().eq(eight.keys()));
    for (path, bytes) in one {
        assert!(eight[&path] == bytes, "{}", path.display());
    }
}

/// The ties with three of five of them measured wrongly by 150 lines to either side.
fn spoiled(table: &str) -> String {
    let mut lines = table.lines();
    let mut spoiled = lines.next().unwrap().to_owned();
    for (index, row) in lines.enumerate() {
        let (before, line) = row.rsplit_once(',').unwrap();
        let line: f64 = line.parse().unwrap();
        let tie = index / 2;
        let wrong = match (row.contains("E02-02016"), tie % 5) {
            (true, 0) => 150.0,
            (true, 1) => -150.0,
            (true, 2) => {
                if tie % 2 == 0 {
                    100.0
                } else {
                    -100.0
                }
            }
            _ => 0.0,
        };
        write!(spoiled, "\n{before},{}", line + wrong).unwrap();
    }
    spoiled
}

#[test]
fn ties_that_are_none_make_the_site_invalid() {
    let case = Case::pair();
    let table = String::from_utf8(case.read("ties/isidis.csv")).unwrap();
    case.write("ties/isidis.csv", spoiled(&table));
    let outcome = case.outcome(case.run());
    assert!(outcome.starts_with("exit 5\nisidis: INVALID"), "{outcome}");
    assert!(
        outcome.contains("of 154 tie points were rejected"),
        "{outcome}"
    );
    let page = fs::read_to_string(case.path("out/isidis/report/index.html")).unwrap();
    assert!(!page.contains("Relative registration is healed"));
}

#[test]
fn a_failed_adjustment_keeps_no_other_product_from_its_readers() {
    let case = Case::pair();
    let free = "model = \"published\"\nposition_sigma_nadir_m = inf\nposition_sigma_off_nadir_m = inf\nfootprint_image_coordinates = \"off\"\ntie_sigma_px";
    case.replace("site.toml", "tie_sigma_px", free);
    let mut table = String::from_utf8(case.read("ties/isidis.csv")).unwrap();
    table += "bad,E02-01301,elsewhere,1.0\n";
    table += "foreign,M04-00001,1.0,1.0\n";
    case.write("ties/isidis.csv", table);
    let outcome = case.outcome(case.run());
    let invalid = "exit 5\nisidis: INVALID; products in out/isidis, see report/index.html\n";
    assert!(outcome.starts_with(invalid), "{outcome}");
    let reason =
        "\n  no adjustment: the network is singular: the observations do not separate the ";
    assert!(outcome.contains(reason), "{outcome}");
    assert!(
        outcome.contains("finite or smaller standard deviations in [adjustment]"),
        "{outcome}"
    );
    let made: Vec<_> = products(&case.path("out/isidis")).into_keys().collect();
    let named = |name: &str| made.iter().any(|path| path.ends_with(name));
    assert!(named("footprints.parquet") && named("registration.parquet"));
    assert!(!named("adjustment.json") && !named("registration_adjusted.parquet"));
    // What is known of the tie points is told.
    assert!(named("ties.parquet") && !named("adjusted_footprints.parquet"));
    let manifest: serde_json::Value =
        serde_json::from_slice(&case.read("out/isidis/manifest.json")).unwrap();
    assert_eq!(manifest["complaints"]["count"], 1);
    let complaint = "isidis.csv: record 310: ";
    let note = "tie points: 1 measurements in 1 images";
    let told = manifest["complaints"]["texts"][0].as_str().unwrap();
    assert!(told.starts_with(complaint), "{told}");
    assert!(manifest["notes"].to_string().contains(note));
    let apart_m = manifest["figures"]["along_track_parallax_m"].as_f64();
    assert!(apart_m.is_some_and(|apart_m| apart_m > 0.0), "{apart_m:?}");
    let page = String::from_utf8(case.read("out/isidis/report/index.html")).unwrap();
    for told in [
        complaint,
        note,
        "Pairs of images",
        "Residual vectors on E02-01301",
        "the adjustment failed",
    ] {
        assert!(page.contains(told), "{told}");
    }
    for absent in [
        "Combined adjustment</h2>",
        "before the adjustment a ",
        "after it",
    ] {
        assert!(!page.contains(absent), "{absent}");
    }
    // The adjustment is tried again, and what stands is kept.
    let again = case.outcome(case.run());
    assert!(
        again.starts_with("exit 5\nisidis: INVALID; nothing changed"),
        "{again}"
    );
}
