//! Numbers of the page against the products, read here by other means than those that wrote them.

use std::{collections::BTreeMap, fs, fs::File};

use arrow_array::RecordBatch;
use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use serde_json::Value;

use super::{
    common::json,
    gusev,
    page::{lead, table, text},
};

/// The page of the site.
fn page() -> String {
    fs::read_to_string(gusev().join("report/index.html")).unwrap()
}

fn document(name: &str) -> Value {
    json(&gusev().join(name))
}

fn rows(name: &str) -> RecordBatch {
    let file = File::open(gusev().join(name)).unwrap();
    let reader = ParquetRecordBatchReaderBuilder::try_new(file).unwrap();
    let batches: Vec<RecordBatch> = reader.build().unwrap().map(Result::unwrap).collect();
    arrow_select::concat::concat_batches(&batches[0].schema(), &batches).unwrap()
}

/// Values of a column, those that are unknown left out, of the rows whose `key` is `of`.
fn column(rows: &RecordBatch, name: &str, key: &str, of: &str) -> Vec<f64> {
    let keys = rows.column_by_name(key).unwrap().as_string::<i32>();
    let values = rows
        .column_by_name(name)
        .unwrap()
        .as_primitive::<Float64Type>();
    let both = keys.iter().zip(values);
    both.filter_map(|(key, value)| value.filter(|value| key == Some(of) && value.is_finite()))
        .collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn deviation(values: &[f64]) -> f64 {
    let mean = mean(values);
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (squares / (values.len() as f64 - 1.0)).sqrt()
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    if sorted.len() % 2 == 1 {
        sorted[middle]
    } else {
        f64::midpoint(sorted[middle - 1], sorted[middle])
    }
}

/// The numbers of a text with their decimals; those that are part of a word are none.
pub(crate) fn numbers(text: &str) -> Vec<(f64, i32)> {
    let text = text.replace('\u{202f}', "").replace('−', "-");
    let words = text.split(|letter: char| letter.is_whitespace() || "±()/;,".contains(letter));
    let numbers = words.filter_map(|word| {
        let word = word
            .trim_start_matches(['+', '≥', '≤'])
            .trim_end_matches(['.', '%', '″']);
        let value = word.parse().ok()?;
        let decimals = word.split_once('.').map_or(0, |(_, digits)| digits.len());
        Some((value, i32::try_from(decimals).unwrap()))
    });
    numbers.collect()
}

/// Holds the numbers of a text against what they should be.
fn agree(text: &str, expected: &[f64]) {
    let found = numbers(text);
    assert_eq!(found.len(), expected.len(), "{text}: {expected:?}");
    for ((found, decimals), expected) in found.iter().zip(expected) {
        // Half of the last digit, and what a double cannot hold of a half.
        let tolerance = 0.5 * 10_f64.powi(-decimals) + 1e-9 * expected.abs().max(1.0);
        assert!((found - expected).abs() <= tolerance, "{text}: {expected}");
    }
}

fn of(value: &Value, path: &str) -> f64 {
    let found = value.pointer(path).and_then(Value::as_f64);
    found.unwrap_or_else(|| panic!("{path} of {value:.200}"))
}

fn list<'a>(value: &'a Value, path: &str) -> &'a [Value] {
    value.pointer(path).unwrap().as_array().unwrap()
}

/// The value of a key number and its note, by the words above it.
fn key_number(page: &str, what: &str) -> (String, String) {
    let start = page
        .split(&format!("<dt>{what}</dt><dd><b>"))
        .nth(1)
        .unwrap();
    let (value, rest) = start.split_once("</b>").unwrap();
    (text(value), text(rest.split("</dd>").next().unwrap()))
}

#[test]
fn the_first_screen_says_what_the_products_hold() {
    let page = page();
    let (manifest, adjustment) = (document("manifest.json"), document("adjustment.json"));
    let about = lead(&page).split("<p class=\"about\">").nth(1).unwrap();
    let about = text(about.split("</p>").next().unwrap());
    for (words, count) in [
        ("images", "images"),
        ("footprints in", "footprints"),
        ("profiles", "profiles"),
    ] {
        let count = manifest["counts"][count].as_u64().unwrap();
        assert!(about.contains(&format!("{count} {words}")), "{about}");
    }
    let lines = fs::read_to_string(gusev().join("footprints.csv"))
        .unwrap()
        .lines()
        .count();
    assert!(about.contains(&format!("{} footprints", lines - 1)));
    // Heights from the table of every tie point: the two numbers of one judge.
    let heights = rows("height_check.parquet");
    let before = column(&heights, "above_surface_m", "kind", "tie");
    let after = column(&heights, "adjusted_above_surface_m", "kind", "tie");
    let (value, note) = key_number(&page, "Heights against MOLA");
    agree(&value, &[median(&after)]);
    agree(
        &note,
        &[after.len() as f64, median(&before), before.len() as f64],
    );
    assert!(
        note.contains("controlled by MOLA") && note.ends_with("independent of it"),
        "{note}"
    );
    let parallax_m = |round: &str| {
        let pairs = list(&adjustment, &format!("/{round}/pairs")).iter();
        pairs
            .map(|pair| of(pair, "/along_track_parallax_m").abs())
            .fold(0.0, f64::max)
    };
    let (value, note) = key_number(&page, "Between images, along track");
    agree(&value, &[parallax_m("after")]);
    // Footprints of the one pair, from its profiles.
    let footprints = |round: &str| {
        let found = &list(&adjustment, &format!("/{round}/pairs"))[0]["footprints"];
        let profiles = list(found, "/profiles").iter();
        let (sum, shots) = profiles.fold((0.0, 0.0), |(sum, shots), profile| {
            let n = of(profile, "/lines/n");
            (sum + n * of(profile, "/along_m").abs(), shots + n)
        });
        [sum / shots, of(found, "/apart_sigma_m")]
    };
    let expected = [
        &[parallax_m("before")][..],
        &footprints("after"),
        &footprints("before"),
    ];
    agree(note.rsplit(';').next().unwrap(), &expected.concat());
    let sigma_m = |axis| {
        of(
            &adjustment,
            &format!("/adjustment/heights/mean_sigma_m/{axis}"),
        )
    };
    let (value, _) = key_number(&page, "Absolute accuracy, 1 σ");
    agree(&value, &[sigma_m(0), sigma_m(1), sigma_m(2)]);
    let ranges = rows("ranges.parquet");
    let means = ["gusev_crater/8939", "gusev_crater/9044"].map(|profile| {
        mean(&column(
            &ranges,
            "range_minus_distance_m",
            "profile",
            profile,
        ))
    });
    let (value, note) = key_number(&page, "Range − distance");
    assert!(means[1].abs() > means[0].abs() && note.contains("gusev_crater/9044"));
    agree(&value, &[means[1]]);
}

#[test]
fn ranges_are_those_of_every_shot() {
    let (page, shots) = (page(), rows("ranges.parquet"));
    let (document, per_profile) = (
        document("ranges.json"),
        table(&page, "Range − distance per profile"),
    );
    let three_ways = table(&page, "The three ways to check a range");
    let scans = table(&page, "Correction of least spread");
    assert_eq!(per_profile.len(), 2);
    for (place, profile) in list(&document, "/profiles").iter().enumerate() {
        let id = profile["id"].as_str().unwrap();
        let values = |name: &str| column(&shots, name, "profile", id);
        let residuals_m = values("range_minus_distance_m");
        let (row, at) = (&per_profile[place], |path: &str| of(profile, path));
        assert_eq!(row[0], id);
        let low = residuals_m.iter().copied().fold(f64::INFINITY, f64::min);
        let high = residuals_m
            .iter()
            .copied()
            .fold(f64::NEG_INFINITY, f64::max);
        let expected = [
            residuals_m.len() as f64,
            mean(&residuals_m),
            deviation(&residuals_m),
            median(&residuals_m),
            at("/range_minus_distance_m/nmad"),
            low,
            high,
            at("/outliers"),
        ];
        for (cell, expected) in row[1..].iter().zip(expected) {
            agree(cell, &[expected]);
        }
        agree(
            &row[9],
            &[
                1e3 * at("/trend_m_s/slope"),
                1e3 * at("/trend_m_s/uncertainty"),
            ],
        );
        let row = &three_ways[place];
        let expected = [
            mean(&residuals_m),
            at("/mean_without_outliers_m"),
            mean(&values("range_minus_distance_crossover_m")),
            mean(&values("decoding_m")),
            at("/decoding_without_outliers_m"),
            mean(&values("spacecraft_radial_m")),
            mean(&values("spacecraft_along_m")),
            mean(&values("spacecraft_cross_m")),
        ];
        for (cell, expected) in row[1..].iter().zip(expected) {
            agree(cell, &[expected]);
        }
        let best_s = at("/bias_scan/best_s");
        let configured_s = of(&document, "/mola_clock/correction_s");
        let expected = [
            best_s,
            at("/bias_scan/uncertainty_s"),
            configured_s,
            best_s - configured_s,
        ];
        // Behind the profile stand the radii that are scanned.
        for (cell, expected) in scans[place][2..].iter().zip(expected) {
            agree(cell, &[expected]);
        }
    }
}

#[test]
fn heights_and_pairs_are_those_of_the_adjustment() {
    let (page, document) = (page(), document("adjustment.json"));
    let heights = rows("height_check.parquet");
    let told = table(&page, "Heights of tie points above the MOLA surface");
    let columns = [
        ("before", "above_surface_m"),
        ("after", "adjusted_above_surface_m"),
    ];
    for (row, (round, name)) in told.iter().zip(columns) {
        let above_m = column(&heights, name, "kind", "tie");
        let at = |path: &str| of(&document, &format!("/{round}/heights/{path}"));
        assert_eq!(row[0], round);
        let expected = [
            above_m.len() as f64,
            at("near_shots"),
            median(&above_m),
            at("above_surface_m/nmad"),
            mean(&above_m),
            deviation(&above_m),
            at("mean_sigma_m"),
        ];
        for (cell, expected) in row[1..].iter().zip(expected) {
            agree(cell, &[expected]);
        }
    }
    let pairs = table(&page, "Pairs of images");
    let residuals = table(&page, "Reprojection residuals of tie points");
    for (place, round) in ["before", "after"].into_iter().enumerate() {
        let pair = &list(&document, &format!("/{round}/pairs"))[0];
        let at = |path: &str| of(pair, path);
        let expected = [
            at("/ties"),
            at("/convergence_rad").to_degrees(),
            at("/height_over_base"),
            at("/line_spacing_m/0"),
            at("/line_spacing_m/1"),
            at("/along_track_parallax_m"),
        ];
        assert_eq!(pairs[place][1], round);
        for (cell, expected) in pairs[place][2..].iter().zip(expected) {
            agree(cell, &[expected.abs()]);
        }
        let names = ["mean_x", "deviation_x", "mean_y", "deviation_y"];
        let images = ["0", "1"].into_iter();
        let cells =
            images.flat_map(|image| names.map(|name| at(&format!("/residuals/{image}/{name}"))));
        for (cell, expected) in residuals[place][3..].iter().zip(cells) {
            agree(cell, &[expected]);
        }
    }
    let kinds = table(&page, "Observations by kind");
    let types = list(&document, "/adjustment/summary/types");
    assert_eq!(kinds.len(), types.len());
    for (row, kind) in kinds.iter().zip(types) {
        let (number, redundancy) = (of(kind, "/observations"), of(kind, "/redundancy"));
        agree(&row[1], &[number]);
        agree(&row[2], &[redundancy]);
        agree(&row[3], &[100.0 * redundancy / number.max(1.0)]);
        agree(&row[4], &[of(kind, "/weighted_squares")]);
        agree(&row[7], &[of(kind, "/beyond_limit")]);
    }
    let shifts = table(&page, "Shift of the camera at the middle of the image");
    for (row, image) in shifts.iter().zip(list(&document, "/adjustment/images")) {
        assert_eq!(row[0], image["image"]);
        for axis in 0..3 {
            let at = |name: &str| of(image, &format!("/{name}/{}", 3 * axis));
            agree(&row[1 + axis], &[at("correction"), at("sigmas")]);
        }
    }
}

#[test]
fn images_and_inputs_are_those_of_their_documents() {
    let (page, manifest) = (page(), document("manifest.json"));
    let images = table(&page, "Images (Table 2");
    let models = table(&page, "RMSE of the polynomials over all samples");
    let seen = table(&page, "Profiles in the images");
    let registration = document("registration.json");
    for (place, row) in images.iter().enumerate() {
        let document = document(&format!("images/{}/orientation.json", row[0]));
        let at = |path: &str| of(&document, path);
        assert_eq!(row[1], document["times"]["utc_start"]);
        let lines = at("/times/lines_header");
        let expected = [
            lines,
            at("/times/lines_delivered"),
            at("/times/samples_per_line"),
        ];
        for (cell, expected) in row[2..].iter().zip(expected) {
            agree(cell, &[expected]);
        }
        let period_s = at("/times/line_period_s");
        agree(&row[6], &[1e3 * period_s]);
        agree(&row[7], &[lines * period_s]);
        for (order, name) in [(0, "first_order"), (1, "second_order")] {
            let row = &models[2 * place + order];
            let at = |path: &str| of(&document, &format!("/{name}/{path}"));
            let expected = [
                at("x_m/rmse"),
                at("y_m/rmse"),
                at("z_m/rmse"),
                at("position_rmse_m"),
                at("omega_rad/rmse_arcsec"),
                at("phi_rad/rmse_arcsec"),
                at("kappa_rad/rmse_arcsec"),
            ];
            for (cell, expected) in row[2..].iter().zip(expected) {
                agree(cell, &[expected]);
            }
            agree(&row[10], &[at("pointing_ground_rmse_m")]);
        }
        let profiles = list(&registration, &format!("/images/{place}/profiles"));
        for (row, profile) in seen[profiles.len() * place..].iter().zip(profiles) {
            assert_eq!(row[1], profile["id"]);
            agree(&row[3], &[of(profile, "/inside")]);
            agree(&row[6], &[of(profile, "/shot_spacing_lines")]);
        }
    }
    let files = table(&page, "Files that were read");
    for (row, kernel) in files.iter().zip(list(&manifest, "/kernels")) {
        assert_eq!(
            [&*row[0], &row[1], &row[3]],
            [&kernel["name"], &kernel["role"], &kernel["blake3"]]
        );
        agree(&row[2], &[of(kernel, "/bytes")]);
    }
    let rejected: BTreeMap<String, f64> = table(&page, "Rejected shots inside a window")
        .into_iter()
        .map(|row| (row[0].clone(), numbers(&row[1])[0].0))
        .collect();
    let expected = manifest["rejected"].as_object().unwrap().iter();
    let expected = expected.map(|(reason, count)| (reason.clone(), count.as_f64().unwrap()));
    assert_eq!(rejected, expected.collect());
}

#[test]
fn a_number_that_is_not_that_of_the_product_is_found() {
    agree("−3.4 m", &[-3.432]);
    agree("1\u{202f}234 (2 shots)", &[1234.0, 2.0]);
    for (text, expected) in [
        ("−3.5 m", -3.432),
        ("3.4 m", -3.432),
        ("3 m", -3.432),
        ("12", 11.4),
    ] {
        assert!(
            std::panic::catch_unwind(|| agree(text, &[expected])).is_err(),
            "{text}"
        );
    }
}
