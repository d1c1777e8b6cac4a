//! Images at the end of the C-kernel, through the command line: what is asked of it is the exposure
//! shifted by the pointing bias, and attitudes that are held beyond its end are told.
//!
//! The scene's attitude of this arc goes from 03:18:01.257 to 05:17:37.257 (time of the C-kernel), its
//! position from 03:18:02.407 to 05:18:02.407; the site's padding is 1 s.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

use crate::common;

use common::case::Case;

/// Runs the case with an image of `lines` lines of 10 ms from `start`; gives what it printed.
fn outcome(case: &Case, start: &str, lines: u32, kernels: &str, pointing: &str) -> String {
    let text = String::from_utf8(case.read("site.toml")).unwrap();
    let text = text.replace("nav.tm\"\n", &format!("nav.tm\"\n{kernels}\n"));
    let (site, _) = text.split_once("[[images]]").unwrap();
    let image = format!(
        "[[images]]\nid = \"edge\"\nutc_start = \"2001-03-23T{start}\"\nline_period_ms = 10.0\n\
         downtrack_summing = 1\nlines_header = {lines}\nsamples = 672\n"
    );
    case.write(
        "edge.toml",
        format!("{site}[pointing]\n{pointing}\n{image}"),
    );
    let mut command = case.areograph();
    command.args(["--quiet", "run", "edge.toml", "--out", "out"]);
    case.outcome(command)
}

/// What `check` says of the case that was run last.
fn checked(case: &Case) -> String {
    let mut command = case.areograph();
    command.args(["--quiet", "check", "--full", "edge.toml"]);
    case.outcome(command)
}

fn errors(outcome: &str) -> Vec<&str> {
    let lines = outcome.lines();
    lines.filter(|line| line.starts_with("error: ")).collect()
}

fn manifest(case: &Case) -> serde_json::Value {
    serde_json::from_slice(&case.read("out/case/manifest.json")).unwrap()
}

#[test]
fn coverage_is_asked_at_the_shifted_instants_with_their_padding() {
    let case = Case::new();
    // Exposures to 05:17:37.0: with padding beyond the C-kernel, shifted by -1.15 s inside it.
    let good = outcome(&case, "05:17:30.0", 700, "", "ck_bias_s = -1.15");
    assert!(good.starts_with("exit 0"), "{good}");
    // 05:17:30 UTC is ET 38596714.186; the flow required the exposures of 7 s, shifted, with 1 s around.
    let kernels = manifest(&case)["kernels"].clone();
    let mut kernels = kernels.as_array().unwrap().iter();
    let used = &kernels.find(|kernel| kernel["role"] == "CK").unwrap()["coverage_used"][0];
    for (end, expected_s) in [("start", 38_596_712.036), ("stop", 38_596_721.036)] {
        let end_s = used[end].as_f64().unwrap();
        assert!((end_s - expected_s).abs() < 0.001, "{end}: {end_s} s"); // ET above has milliseconds
    }
    // The same image, covered as it stands, but not at the instants that this bias asks for.
    for (start, bias) in [("05:17:30.0", "2.0"), ("03:18:04.0", "-5.0")] {
        let refused = outcome(&case, start, 700, "", &format!("ck_bias_s = {bias}"));
        assert!(refused.starts_with("exit 4"), "{bias}: {refused}");
        assert!(refused.contains("no attitude of MGS for ET"), "{refused}");
        assert!(refused.contains("mgs_sc_scene.bc"), "{refused}");
    }
    // Padding counts: half a second later the last padded look-up leaves the C-kernel.
    let refused = outcome(&case, "05:17:30.5", 700, "", "ck_bias_s = -1.15");
    assert!(refused.starts_with("exit 4"), "{refused}");
}

#[test]
fn held_attitudes_are_noted_and_beyond_their_spacing_invalid() {
    let case = Case::new();
    // Exposures to 05:17:38.0: only the padding needs attitude beyond the end, up to 0.593 s.
    let refused = outcome(&case, "05:17:31.0", 700, "ck_tolerance_s = 0.5", "");
    assert!(refused.starts_with("exit 4"), "{refused}");
    let noted = outcome(&case, "05:17:31.0", 700, "ck_tolerance_s = 1.0", "");
    assert!(noted.starts_with("exit 0"), "{noted}");
    let remarks = manifest(&case)["verdict"]["remarks"].to_string();
    assert!(remarks.contains("image edge: "), "{remarks}");
    assert!(
        remarks.contains("lie outside the C-kernels' intervals"),
        "{remarks}"
    );
    // Exposures to 05:17:47: nine seconds without attitude are no matter of spacing.
    let invalid = outcome(&case, "05:17:35.0", 1_200, "ck_tolerance_s = 60.0", "");
    assert!(invalid.starts_with("exit 5"), "{invalid}");
    assert!(
        invalid.contains("image edge: attitude extrapolated for up to "),
        "{invalid}"
    );
    // A short image wholly beyond the end has constant attitude, which polynomials fit perfectly.
    let held = outcome(&case, "05:17:41.0", 200, "ck_tolerance_s = 60.0", "");
    assert!(held.starts_with("exit 5"), "{held}");
    let orientation = case.read("out/case/images/edge/orientation.json");
    let orientation: serde_json::Value = serde_json::from_slice(&orientation).unwrap();
    assert_eq!(orientation["valid"], false);
    let reasons = orientation["invalid_because"].to_string();
    assert!(
        reasons.contains("attitude extrapolated for up to "),
        "{reasons}"
    );
    // Inside the intervals a tolerance changes nothing and says nothing.
    let inside = outcome(&case, "05:17:20.0", 700, "ck_tolerance_s = 60.0", "");
    assert!(inside.starts_with("exit 0"), "{inside}");
    assert!(
        !manifest(&case)["verdict"]["remarks"]
            .to_string()
            .contains("outside the C-kernels")
    );
}

#[test]
fn a_check_finds_what_a_run_finds() {
    let case = Case::new();
    for (start, kernels, pointing) in [
        ("05:17:30.0", "", "ck_bias_s = 2.0"),
        ("05:17:31.0", "ck_tolerance_s = 0.5", ""),
        ("05:18:00.0", "ck_tolerance_s = 60.0", ""),
    ] {
        let refused = outcome(&case, start, 700, kernels, pointing);
        let told = checked(&case);
        assert!(refused.starts_with("exit 4"), "{refused}");
        assert!(told.starts_with("exit 4"), "{told}");
        assert_eq!(errors(&told), errors(&refused));
    }
    let noted = outcome(&case, "05:17:31.0", 700, "ck_tolerance_s = 1.0", "");
    let told = checked(&case);
    assert!(noted.starts_with("exit 0"), "{noted}");
    assert!(told.starts_with("exit 0"), "{told}");
    let remark = "4 of 118 attitudes lie outside the C-kernels' intervals";
    assert!(told.contains(remark), "{told}");
    let remarks = manifest(&case)["verdict"]["remarks"].to_string();
    assert!(remarks.contains(remark), "{remarks}");
    let invalid = outcome(&case, "05:17:35.0", 1_200, "ck_tolerance_s = 60.0", "");
    let told = checked(&case);
    assert!(told.starts_with("exit 5"), "{told}");
    let lines = told.lines();
    let mut reasons = lines.filter_map(|line| line.split_once("products would be invalid: "));
    let (_, expected) = reasons.next().unwrap();
    assert!(
        invalid.contains(expected),
        "{expected}\nis not in\n{invalid}"
    );
}
