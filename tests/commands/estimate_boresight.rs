//! `areograph estimate-boresight`: answers, refusals, and a site that uses the file.
#![allow(
    clippy::unwrap_used,
    clippy::disallowed_methods,
    reason = "helpers of tests may fail loudly, and write site files"
)]

use std::{
    fs,
    path::{Path, PathBuf},
    process::Output,
};

use serde_json::Value;

use super::compare_readings::{refused, text};
use crate::common::{
    json,
    mission::{areograph, mission, once, site_run, succeed},
};

const SITES: [&str; 3] = ["eos_chasma", "gusev_crater", "isidis"];
const KEYS: &str = "common_bus = \"yes\"\nrelief_for_plan = \"no\"\n";

/// Writes the file of a site of the mission with these keys of the adjustment.
fn site_file(folder: &Path, site: &str, keys: &str) -> PathBuf {
    let text = fs::read_to_string(mission().join(format!("sites/{site}.toml"))).unwrap();
    let text = text.replace("\"../", &format!("\"{}/", mission().display()));
    assert!(text.contains("[adjustment]\n"), "{text}");
    let path = folder.join(format!("{site}.toml"));
    let text = text.replacen("[adjustment]\n", &format!("[adjustment]\n{keys}"), 1);
    fs::write(&path, text).unwrap();
    path
}

/// Products of all sites with the laser on the common bus.
fn sites() -> PathBuf {
    once("sites-with-bus", |folder| {
        let files = tempfile::tempdir().unwrap();
        let mut run = areograph();
        run.args(["--quiet", "run"]);
        for site in SITES {
            run.arg(site_file(files.path(), site, KEYS));
        }
        succeed(run.arg("--out").arg(folder));
    })
}

fn estimate(arguments: &[&str]) -> Output {
    let mut command = areograph();
    command.arg("estimate-boresight").arg(sites());
    command.args(arguments).output().unwrap()
}

#[test]
fn three_sites_state_the_boresight_and_the_prior_enters_once() {
    let printed = text(&estimate(&[]).stdout);
    assert!(
        printed.starts_with("Boresight of the laser by 3 sites: "),
        "{printed}"
    );
    let answer: Value = serde_json::from_slice(&estimate(&["--json"]).stdout).unwrap();
    let number = |of: &Value| of.as_f64().unwrap();
    // Normal equations of the answer: those of the sites and one a priori value.
    let sigma_rad = number(&answer["prior_sigma_rad"]);
    let mut matrix = [sigma_rad.powi(-2), 0.0, sigma_rad.powi(-2)];
    let mut vector = [0.0; 2];
    for site in SITES {
        let stated = json(&sites().join(site).join("adjustment.json"));
        let stated = &stated["adjustment"]["boresight"]["information"];
        for (sum, of) in matrix.iter_mut().zip(stated["matrix"].as_array().unwrap()) {
            *sum += number(of);
        }
        for (sum, of) in vector.iter_mut().zip(stated["vector"].as_array().unwrap()) {
            *sum += number(of);
        }
    }
    // The sites scatter less than they state: the mission has no errors of the laser.
    assert!(number(&answer["scatter"]) < 1.0, "{answer}");
    let [first, both, second] = matrix;
    let determinant = first * second - both * both;
    let expected = [
        (second * vector[0] - both * vector[1]) / determinant,
        (first * vector[1] - both * vector[0]) / determinant,
    ];
    let variances = [second / determinant, first / determinant];
    for axis in 0..2 {
        let (found, sigma) = (
            number(&answer["angles_rad"][axis]),
            number(&answer["sigma_rad"][axis]),
        );
        // Rounding of sums.
        assert!((found - expected[axis]).abs() < 1e-6 * sigma, "{axis}");
        assert!(
            (sigma / variances[axis].sqrt() - 1.0).abs() < 1e-6,
            "{axis}"
        );
        // The mission has none.
        assert!(found.abs() < 3.0 * sigma, "{axis}: {found} {sigma}");
    }
    assert_eq!(answer["sites"].as_array().unwrap().len(), 3);
    assert_eq!(answer["mountings"].as_array().unwrap().len(), 1);
    // A smaller a priori standard deviation remains.
    let answer: Value =
        serde_json::from_slice(&estimate(&["--json", "--prior-sigma-arcsec", "0.5"]).stdout)
            .unwrap();
    assert!(number(&answer["sigma_rad"][1]) < 2.5e-6, "{answer}");
}

#[test]
fn a_site_uses_the_statements_of_others_alone() {
    let folder = tempfile::tempdir().unwrap();
    let printed = text(&estimate(&["--toml"]).stdout);
    let file = folder.path().join("boresight.toml");
    fs::write(&file, &printed).unwrap();
    let keys = format!("boresight = \"boresight.toml\"\n{KEYS}");
    let site = site_file(folder.path(), "isidis", &keys);
    let out = folder.path().join("out");
    let mut run = areograph();
    succeed(run.arg("run").arg(&site).arg("--out").arg(&out));
    let document = json(&out.join("isidis/adjustment.json"));
    let found = &document["adjustment"]["boresight"];
    assert_eq!(
        found["prior"]["sites"],
        serde_json::json!(["eos_chasma", "gusev_crater"])
    );
    assert_eq!(found["prior"]["left_out"], serde_json::json!(["isidis"]));
    // Without the a priori values, the statement is the same.
    let before = json(&sites().join("isidis/adjustment.json"));
    let before = &before["adjustment"]["boresight"]["information"]["matrix"];
    let [now, then] = [&found["information"]["matrix"], before].map(|of| of[2].as_f64().unwrap());
    // A share; another boresight moves the images and so the surface under the tie points.
    assert!((now / then - 1.0).abs() < 0.05, "{now} {then}");
    let manifest = fs::read_to_string(out.join("isidis/manifest.json")).unwrap();
    assert!(
        manifest.contains(
            "adjustment.boresight: 2 sites state the boresight of the laser; isidis left out, because of a common image or orbit"
        ),
        "{manifest}"
    );
    // Its products state the same to a pool of all.
    let mut again = areograph();
    again.arg("estimate-boresight").arg(out.join("isidis"));
    let printed_again = text(&succeed(again.arg(sites())).stdout);
    assert!(
        printed_again.contains("by 3 sites")
            && printed_again.contains("not used: isidis: shares an image or an orbit with isidis"),
        "{printed_again}"
    );

    // Of a laser that is mounted differently.
    fs::write(
        &file,
        printed.replacen("beam = [", "beam = [0.6, 0.0, 0.8] #", 1),
    )
    .unwrap();
    let output = areograph()
        .arg("run")
        .arg(&site)
        .arg("--out")
        .arg(folder.path().join("other"))
        .output()
        .unwrap();
    let printed = text(&output.stderr) + &text(&output.stdout);
    assert!(
        printed.contains("adjustment.boresight does not apply to image E"),
        "{printed}"
    );
    fs::write(&file, "{\"sites\": []}").unwrap();
    let check = |site: &Path| areograph().arg("check").arg(site).output().unwrap();
    refused(&check(&site), 2, "boresight");
    fs::remove_file(&file).unwrap();
    refused(
        &check(&site),
        2,
        "the path of a file with the output of `areograph estimate-boresight --toml`",
    );
}

#[test]
fn sites_that_state_nothing_are_refused() {
    let without = site_run("isidis");
    let output = areograph()
        .arg("estimate-boresight")
        .arg(&without)
        .output()
        .unwrap();
    refused(
        &output,
        3,
        "no site determines the boresight of the laser; isidis: adjustment.common_bus is not used",
    );
    // One that was never finished does not prevent the use of others.
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("manifest.json"), "{").unwrap();
    let output = areograph()
        .arg("estimate-boresight")
        .args([folder.path(), &sites()])
        .output()
        .unwrap();
    let printed = text(&output.stdout);
    assert!(
        printed.contains("by 3 sites") && printed.contains("not used: "),
        "{printed} {}",
        text(&output.stderr)
    );
    let output = estimate(&["--prior-sigma-arcsec", "0"]);
    refused(&output, 2, "1e-3 to 1e5");
    let empty = tempfile::tempdir().unwrap();
    let output = areograph()
        .arg("estimate-boresight")
        .arg(empty.path())
        .output()
        .unwrap();
    refused(&output, 3, "no manifest.json in this folder or below it");
}
