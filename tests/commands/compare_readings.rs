//! `areograph compare-readings`: answers, the page and refusals.
#![allow(
    clippy::unwrap_used,
    clippy::disallowed_methods,
    reason = "helpers of tests may fail loudly, and write site files"
)]

use std::{fs, path::PathBuf, process::Output};

use serde_json::Value;

use crate::common::{
    case::Case,
    mission::{areograph, mission, site_run, succeed},
};

fn sites() -> [PathBuf; 3] {
    ["eos_chasma", "gusev_crater", "isidis"].map(site_run)
}

pub(super) fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

pub(super) fn refused(output: &Output, code: i32, message: &str) {
    let printed = text(&output.stderr);
    assert!(
        output.status.code() == Some(code) && printed.contains(message),
        "{:?}: {printed}",
        output.status
    );
}

/// The built-in mission has the residuals of Shan et al. 2005, Table 5.
#[test]
fn three_pairs_do_not_decide_and_every_form_states_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("readings.html");
    let mut command = areograph();
    command.arg("compare-readings").args(sites());
    let printed = text(&succeed(command.arg("--page").arg(&page)).stdout);
    assert!(
        printed.starts_with("3 pairs of images do not decide"),
        "{printed}"
    );

    let mut command = areograph();
    command.arg("compare-readings").args(sites()).arg("--json");
    let answer: Value = serde_json::from_slice(&succeed(&mut command).stdout).unwrap();
    assert_eq!(answer["supported"], "undecided");
    for pair in answer["pairs"].as_array().unwrap() {
        let [apart_m, clock_m_s] =
            ["apart_m", "clock_m_s"].map(|name| pair[name].as_f64().unwrap());
        // Metres; the paper has 225 to 271 m, to the same side of the nadir images, which turn by 330 m/s.
        let to_one_side_m = -apart_m * clock_m_s.signum();
        assert!((215.0..280.0).contains(&to_one_side_m), "{pair}");
        assert!((320.0..345.0).contains(&clock_m_s.abs()), "{pair}");
    }
    let log_odds = answer["log_odds_of_clock"].as_f64().unwrap();
    assert!((0.0..5.0).contains(&log_odds), "{log_odds}");
    assert!(
        printed.contains(
            "One offset of the attitude clock is more probable than errors of single images alone, by a factor of 30.\n"
        ),
        "{printed}"
    );
    let page = fs::read_to_string(page).unwrap();
    assert!(page.contains("3 pairs of images do not decide") && page.contains("gusev_crater"));
}

#[test]
fn a_pair_counts_once_and_sizes_matter() {
    let [first, second, _] = sites();
    let mut command = areograph();
    command
        .arg("compare-readings")
        .args([&first, &second, &first]);
    let printed = text(&succeed(&mut command).stdout);
    assert!(
        printed.starts_with("2 pairs of images")
            && printed
                .contains("not used: eos_chasma, E02-02855 and E04-01275: also in an earlier site"),
        "{printed}"
    );
    // Smaller errors of single images explain 250 m less.
    let log_odds = |line_time_ms: &str| {
        let mut command = areograph();
        command.arg("compare-readings").args(sites());
        command.args(["--json", "--line-time-sigma-ms", line_time_ms]);
        let answer: Value = serde_json::from_slice(&succeed(&mut command).stdout).unwrap();
        answer["log_odds_of_clock"].as_f64().unwrap()
    };
    assert!(log_odds("20") > log_odds("45") + 1.0);
}

/// Ten pairs with such odds.
fn decision(supported: &str, log_odds: [f64; 2]) -> String {
    let [clock, images] = log_odds;
    format!(
        "supported = \"{supported}\"\npairs = 10\nlog_odds_of_clock = {clock:?}\nlog_odds_of_images = {images:?}\n\
         attitude_clock_s = -0.7\nattitude_clock_sigma_s = 0.05\n"
    )
}

#[test]
fn a_site_follows_the_result_and_states_it() {
    let folder = tempfile::tempdir().unwrap();
    let text = fs::read_to_string(mission().join("sites/isidis.toml")).unwrap();
    let text = text.replace("\"../", &format!("\"{}/", mission().display()));
    assert!(text.contains("[adjustment]\n"), "{text}");
    let site = folder.path().join("isidis.toml");
    let text = text.replacen(
        "[adjustment]\n",
        "[adjustment]\nreadings = \"readings.toml\"\n",
        1,
    );
    fs::write(&site, &text).unwrap();
    let readings = folder.path().join("readings.toml");
    let out = folder.path().join("out");
    let adjusted = |decision: &str| {
        fs::write(&readings, decision).unwrap();
        let mut run = areograph();
        succeed(run.arg("run").arg(&site).arg("--out").arg(&out));
        let read = |name: &str| -> Value {
            serde_json::from_slice(&fs::read(out.join("isidis").join(name)).unwrap()).unwrap()
        };
        let remarks = read("manifest.json")["verdict"]["remarks"].to_string();
        let by_clock = read("adjustment.json")["configured"]["adjustment"]["attitude_clock"]
            .as_bool()
            .unwrap();
        (by_clock, remarks)
    };
    let (by_clock, remarks) = adjusted(&decision("attitude_clock", [17.0, -20.0]));
    // e^17 is 10^7.4.
    assert!(
        by_clock
            && remarks.contains(
                "10 pairs of images support one offset of the attitude clock (odds 10^7.4 to 1)"
            ),
        "{by_clock} {remarks}"
    );
    let (by_clock, remarks) = adjusted(&decision("single_images", [-20.0, 17.0]));
    assert!(
        !by_clock
            && remarks.contains("support independent errors of single images (odds 10^7.4 to 1)"),
        "{by_clock} {remarks}"
    );
    let (by_clock, remarks) = adjusted(&decision("undecided", [3.0, -20.0]));
    assert!(
        !by_clock && remarks.contains("do not decide the cause"),
        "{by_clock} {remarks}"
    );

    let refused_with = |decision: &str, message: &str| {
        fs::write(&readings, decision).unwrap();
        refused(
            &areograph().arg("check").arg(&site).output().unwrap(),
            2,
            message,
        );
    };
    refused_with(
        &decision("single_images", [17.0, -20.0]),
        "which contradicts the odds",
    );
    refused_with("{\"supported\": \"attitude_clock\"}", "this is not TOML");
    fs::remove_file(&readings).unwrap();
    let output = areograph().arg("check").arg(&site).output().unwrap();
    refused(
        &output,
        2,
        "the path of a file with the output of `areograph compare-readings --toml`",
    );
    // Written by the user as well, the key has no effect.
    fs::write(&readings, decision("attitude_clock", [17.0, -20.0])).unwrap();
    fs::write(
        &site,
        text.replacen("readings =", "attitude_clock = \"no\"\nreadings =", 1),
    )
    .unwrap();
    let output = areograph().arg("check").arg(&site).output().unwrap();
    let printed = self::text(&output.stderr);
    assert!(printed.contains("adjustment.readings decides"), "{printed}");
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let compared = |arguments: &[&str]| {
        areograph()
            .arg("compare-readings")
            .args(arguments)
            .output()
            .unwrap()
    };
    let folder = tempfile::tempdir().unwrap();
    let empty = folder.path().to_str().unwrap();
    refused(
        &compared(&[empty]),
        3,
        "no manifest.json in this folder or below it",
    );
    refused(&compared(&["nowhere/at/all"]), 3, "nowhere/at/all");
    refused(
        &compared(&[empty, "--line-time-sigma-ms", "0"]),
        2,
        "1e-3 to 1e5",
    );
    let case = Case::new();
    succeed(&mut case.run());
    let mut command = case.areograph();
    command.args(["compare-readings", "out"]);
    refused(
        &command.output().unwrap(),
        3,
        "no pair of images in 1 site shows a cause",
    );
    let own = site_run("isidis");
    let mut command = areograph();
    command.arg("compare-readings").arg(&own).arg("--page");
    let output = command.arg(own.join("manifest.json")).output().unwrap();
    assert!(!output.status.success(), "{}", text(&output.stdout));
}
