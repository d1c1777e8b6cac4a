//! Plans, last stages and signals of nets, calibrations and archives, as of sites.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly"
)]

use crate::common::{case::Case, mission::succeed};

/// A net and a calibration from tables.
fn written() -> Case {
    let case = Case::empty();
    for scene in [["net", "net"], ["calibration", "lines"]] {
        succeed(case.areograph().args(["--quiet", "scene"]).args(scene));
    }
    case
}

/// Exit code and everything that a command prints.
fn told(case: &Case, arguments: &[&str]) -> String {
    let mut command = case.areograph();
    command.arg("--quiet").args(arguments);
    case.outcome(command)
}

const NET: &str = "net/net.toml";
const LINES: &str = "lines/calibration.toml";

/// The lines of a plan without their spaces: a sentence, then what happens to each stage, and why.
fn plan(case: &Case, arguments: &[&str]) -> Vec<String> {
    let printed = succeed(case.areograph().arg("-v").args(arguments)).stdout;
    let words = |line: &str| line.split_whitespace().collect::<Vec<_>>().join(" ");
    let printed = String::from_utf8(printed).unwrap();
    printed.lines().map(words).collect()
}

#[test]
fn a_plan_of_a_net_and_of_a_calibration_says_what_a_run_does() {
    let case = written();
    let both = ["plan", NET, LINES];
    let first = [
        "synthetic_net: 3 of 3 stages would run: no earlier output",
        "run triangulate no earlier output",
        "run map_pictures no earlier output",
        "run publish no earlier output",
        "synthetic_lines: 2 of 2 stages would run: no earlier output",
        "run calibrate no earlier output",
        "run publish no earlier output",
    ];
    assert_eq!(plan(&case, &both), first);
    assert!(!case.path("out").exists());
    succeed(case.areograph().args(["--quiet", "triangulate", NET]));
    succeed(case.areograph().args(["--quiet", "calibrate", LINES]));
    let standing = plan(&case, &both);
    assert!(
        standing.iter().all(|line| !line.starts_with("run")),
        "{standing:#?}"
    );
    // One key of each.
    let text = String::from_utf8(case.read(LINES)).unwrap();
    case.write(LINES, text + "\n[a_priori]\nlook_px = 40.0\n");
    let dry = plan(&case, &["calibrate", LINES, "--plan"]);
    assert_eq!(
        dry[0],
        "synthetic_lines: 2 of 2 stages would run: key a_priori.look_px changed, key a_priori.look_px is new"
    );
    assert_eq!(dry[1], "run calibrate key a_priori.look_px changed");
    assert!(dry[2].starts_with("run publish"), "{dry:#?}");
    // The command runs what its plan names, and the other one stands.
    let answer = told(&case, &["calibrate", LINES]);
    assert!(!answer.contains("nothing changed"), "{answer}");
    let answer = told(&case, &["triangulate", NET]);
    assert!(answer.contains("nothing changed"), "{answer}");
}

#[test]
fn commands_of_sites_name_a_net_as_such() {
    let case = written();
    succeed(case.areograph().args(["--quiet", "triangulate", NET]));
    succeed(
        std::process::Command::new("cp")
            .args(["-r", "out", "before"])
            .current_dir(case.path("")),
    );
    for command in ["check", "run"] {
        let refused = told(&case, &[command, NET]);
        assert!(refused.starts_with("exit 2\n"), "{refused}");
        assert!(
            refused.contains("describes a net; expected a site"),
            "{refused}"
        );
    }
    let both = [
        ["before", "out"],
        ["before/synthetic_net", "out/synthetic_net"],
    ];
    for [before, after] in both {
        let refused = told(&case, &["report", "diff", before, after]);
        assert!(refused.starts_with("exit 2\n"), "{refused}");
        assert!(refused.contains("those of another flow"), "{refused}");
    }
}

#[test]
fn a_flow_stops_after_the_stage_that_is_named() {
    let case = written();
    let stopped = told(&case, &["triangulate", NET, "--until", "triangulate"]);
    assert_eq!(
        stopped,
        "exit 0\nsynthetic_net: stopped after triangulate, no products\n"
    );
    assert!(!case.path("out/synthetic_net/manifest.json").exists());
    let rest = plan(&case, &["triangulate", NET, "--plan"]);
    assert_eq!(rest[1], "keep triangulate nothing changed");
    assert_eq!(rest[2], "run map_pictures no earlier output");
    assert_eq!(rest[3], "run publish no earlier output");
    let unknown = told(&case, &["calibrate", LINES, "--until", "map_surface"]);
    assert!(unknown.starts_with("exit 2"), "{unknown}");
    let expected = "--until is \"map_surface\"; expected a stage of this flow: calibrate, publish";
    assert!(unknown.contains(expected), "{unknown}");
}
