//! Measurements that err across the track: no residual of a pair shows them, and heights take up the error.

use std::fmt::Write as _;

use arrow_array::Array as _;
use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use nalgebra::Vector3;

use super::{
    Judged,
    common::{case::Case, json, mission::mission, number},
    table, texts, vector,
};

/// The tie points' table with each row's sample moved as `wrong` says, by the number of its tie point and its image.
fn moved(table: &str, wrong: impl Fn(usize, &str) -> f64) -> String {
    let mut lines = table.lines();
    let mut text = lines.next().unwrap().to_owned();
    for (index, row) in lines.enumerate() {
        let [tie, image, sample, line] = row.split(',').collect::<Vec<_>>()[..] else {
            panic!("{row}");
        };
        let sample: f64 = sample.parse().unwrap();
        let sample = sample + wrong(index / 2, image);
        write!(text, "\n{tie},{image},{sample},{line}").unwrap();
    }
    text
}

fn ties(case: &Case) -> String {
    String::from_utf8(case.read("ties/isidis.csv")).unwrap()
}

#[test]
fn many_errors_of_one_sign_are_found_or_make_the_site_invalid() {
    let cases = [
        (2, 20.0),
        (2, 10.0),
        (3, 10.0),
        (7, 10.0),
        (10, 10.0),
        (14, 10.0),
    ];
    for (one_in, wrong_px) in cases {
        let case = Case::pair();
        let wrong = |tie: usize, image: &str| {
            if image == "E02-02016" && tie.is_multiple_of(one_in) {
                wrong_px
            } else {
                0.0
            }
        };
        case.write("ties/isidis.csv", moved(&ties(&case), wrong));
        let outcome = case.outcome(case.run());
        let error_m = Judged::height_error_m(&mission(), &case.path("out"), "isidis");
        let stated = json(&case.path("out/isidis/adjustment.json"));
        let stated_m = number(&stated["adjustment"]["heights"]["mean_sigma_m"][2]);
        println!("one in {one_in} by {wrong_px} px: {error_m:.1} ± {stated_m:.1} m; {outcome}");
        let is_invalid = outcome.starts_with("exit 5\nisidis: INVALID");
        // What is not found is stated: three standard deviations of the mean height.
        let is_stated = error_m.abs() < 3.0 * stated_m;
        assert!(is_invalid || is_stated, "{error_m} ± {stated_m}: {outcome}");
    }
}

#[test]
fn blunders_of_height_are_found_among_more_ties_than_are_observed() {
    let case = Case::pair();
    let table = ties(&case);
    // Four times 154 tie points, each copy three lines further along so that none is a copy of another.
    let (head, rows) = table.split_once('\n').unwrap();
    let mut many = head.to_owned();
    for copy in 0..4 {
        for row in rows.lines() {
            let [tie, image, sample, line] = row.split(',').collect::<Vec<_>>()[..] else {
                panic!("{row}");
            };
            let line: f64 = line.parse::<f64>().unwrap() + f64::from(3 * copy);
            write!(many, "\n{tie}-{copy},{image},{sample},{line}").unwrap();
        }
    }
    let one_in_forty = |tie: usize, image: &str| {
        if image == "E02-02016" && tie % 40 == 7 {
            60.0
        } else {
            0.0
        }
    };
    case.write("ties/isidis.csv", moved(&many, one_in_forty));
    case.stages_run();
    let found = super::table(&case.path("out/isidis/ties.parquet"));
    let names = super::texts(&found, "tie");
    let reasons = super::texts(&found, "rejected");
    let wrong: Vec<&String> = names.iter().step_by(2).skip(7).step_by(40).collect();
    assert_eq!(wrong.len(), 16);
    for name in wrong {
        let row = names.iter().position(|other| other == name).unwrap();
        assert!(!reasons[row].is_empty(), "{name} was kept");
    }
}

#[test]
fn the_published_model_is_judged_by_mola() {
    let case = Case::pair();
    case.replace(
        "site.toml",
        "tie_sigma_px",
        "model = \"published\"\ntie_sigma_px",
    );
    let outcome = case.outcome(case.run());
    assert!(outcome.starts_with("exit 5\nisidis: INVALID"), "{outcome}");
    let truth_m = Judged::height_error_m(&mission(), &case.path("out"), "isidis");
    let words = outcome.split("tie points lie ").nth(1).unwrap();
    let stated_m: f64 = words
        .split(" m above")
        .next()
        .unwrap()
        .replace('−', "-")
        .parse()
        .unwrap();
    // MOLA states the error that truth knows, to the errors of its surface: 2 m, four times.
    assert!((stated_m - truth_m).abs() < 8.0, "{stated_m} {truth_m}");
    assert!(truth_m.abs() > 20.0, "{truth_m}");
}

#[test]
fn neighbours_that_vouch_for_each_other_are_stated_uncertain() {
    let case = Case::pair();
    let truth = json(&mission().join("truth.json"));
    let sites = truth["ties"].as_array().unwrap();
    let site = sites.iter().find(|site| site["site"] == "isidis").unwrap();
    let true_ties = site["ties"].as_array().unwrap();
    let ground_m: Vec<Vector3<f64>> = true_ties
        .iter()
        .map(|tie| vector(&tie["ground_iau2000_m"]))
        .collect();
    let is_good = |tie: usize| true_ties[tie]["blunder"].is_null();
    let pairs = (0..ground_m.len()).flat_map(|one| (0..one).map(move |other| [one, other]));
    let nearest = pairs
        .filter(|pair| pair.iter().all(|tie| is_good(*tie)))
        .min_by(|a, b| {
            let apart_m = |[one, other]: &[usize; 2]| (ground_m[*one] - ground_m[*other]).norm();
            apart_m(a).total_cmp(&apart_m(b))
        })
        .unwrap();
    // Eight pixels are some 130 m of height at this pair.
    let wrong = |tie: usize, image: &str| {
        let moves = image == "E02-02016" && nearest.contains(&tie);
        if moves { 8.0 } else { 0.0 }
    };
    case.write("ties/isidis.csv", moved(&ties(&case), wrong));
    case.stages_run();
    let found = table(&case.path("out/isidis/ties.parquet"));
    let names = texts(&found, "tie");
    let number = |name: &str, row: usize| {
        let column = found.column_by_name(name).unwrap();
        let column = column.as_primitive::<Float64Type>();
        (!column.is_null(row)).then(|| column.value(row))
    };
    for tie in nearest {
        let row = names
            .iter()
            .position(|name| true_ties[tie]["id"] == name.as_str());
        let row = row.unwrap();
        // A blunder that is found is as good.
        let Some(radius_m) = number("adjusted_radius_m", row) else {
            continue;
        };
        let error_m = radius_m - ground_m[tie].norm();
        let sigma_m = number("sigma_up_m", row).unwrap();
        println!("{}: {error_m:.0} m off, stated {sigma_m:.0} m", names[row]);
        assert!(error_m.abs() < 3.0 * sigma_m, "{error_m} {sigma_m}");
    }
}
