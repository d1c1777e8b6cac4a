//! Bad input through the command line: exit code and exact message of every case.
//!
//! Expected messages stand in `tests/bad_input/<case>.txt`: exit code, then what the program printed,
//! with the case's folder cut out. Cases of the configuration alone are in `tests/config/bad`.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

mod common;

use std::{fs, path::Path, process::Command};

use common::case::Case;

type Spoil = fn(&Case) -> Command;

/// Spoils one thing of a good case and says what to run.
const CASES: [(&str, Spoil); 36] = [
    ("good", Case::run),
    ("site_file_missing", |case| {
        fs::remove_file(case.path("site.toml")).unwrap();
        case.run()
    }),
    ("site_file_is_a_folder", |case| {
        fs::remove_file(case.path("site.toml")).unwrap();
        fs::create_dir(case.path("site.toml")).unwrap();
        case.run()
    }),
    ("kernel_listed_but_missing", |case| {
        fs::remove_file(case.path("kernels/mgs_nav_scene.bsp")).unwrap();
        case.run()
    }),
    ("metakernel_without_list", |case| {
        case.write(
            "kernels/nav.tm",
            "KPL/MK\n\\begindata\nA = 1\n\\begintext\n",
        );
        case.run()
    }),
    ("metakernel_with_unknown_symbol", |case| {
        let text = "KPL/MK\n\\begindata\nKERNELS_TO_LOAD = ( '$K/a.tls' )\n\\begintext\n";
        case.write("kernels/nav.tm", text);
        case.run()
    }),
    ("metakernel_is_binary", |case| {
        case.write("kernels/nav.tm", [0, 159, 146, 150, 255, 0, 1]);
        case.run()
    }),
    ("spk_truncated", |case| {
        case.truncate("kernels/mgs_nav_scene.bsp", 5_000);
        case.run()
    }),
    ("spk_is_empty", |case| {
        case.truncate("kernels/mgs_nav_scene.bsp", 0);
        case.run()
    }),
    ("ck_is_a_transfer_file", |case| {
        case.write(
            "kernels/mgs_sc_scene.bc",
            "DAFETF NAIF DAF ENCODED TRANSFER FILE\n'DAF/CK  '\n",
        );
        case.run()
    }),
    ("ck_is_a_web_page", |case| {
        case.write(
            "kernels/mgs_sc_scene.bc",
            "<!DOCTYPE html><html><body>404</body></html>",
        );
        case.run()
    }),
    ("no_spk_for_the_spacecraft", |case| {
        case.replace("kernels/nav.tm", "'mgs_nav_scene.bsp'", "");
        case.run()
    }),
    ("no_ck", |case| {
        case.replace("kernels/nav.tm", "'mgs_sc_scene.bc'", "");
        case.run()
    }),
    ("no_leap_seconds", |case| {
        case.replace("kernels/nav.tm", "'leapseconds.tls'", "");
        case.run()
    }),
    ("no_clock", |case| {
        case.replace("kernels/nav.tm", "'mgs_clock.tsc'", "");
        case.run()
    }),
    ("no_camera_frame", |case| {
        case.replace("kernels/nav.tm", "'moc.ti'", "");
        case.run()
    }),
    ("image_in_a_gap_of_the_kernels", |case| {
        case.replace(
            "site.toml",
            "label",
            "utc_start = \"2001-04-20T00:00:00\"\nlabel",
        );
        case.replace("image.lbl", "SPACECRAFT_CLOCK_START_COUNT", "OTHER_CLOCK");
        case.run()
    }),
    ("clock_string_is_no_clock", |case| {
        case.replace("site.toml", "label", "sclk_start = \"99:99\"\nlabel");
        case.run()
    }),
    ("clock_and_utc_disagree", |case| {
        case.replace(
            "site.toml",
            "label",
            "utc_start = \"2001-03-15T00:00:00\"\nlabel",
        );
        case.run()
    }),
    ("label_of_another_camera", |case| {
        case.replace("image.lbl", "\"MOC-NA\"", "\"MOC-WA\"");
        case.run()
    }),
    ("label_is_binary", |case| {
        case.write("image.lbl", [0xFF; 3_000]);
        case.run()
    }),
    ("label_without_lines", |case| {
        case.replace("image.lbl", "LINES =", "OTHER_LINES =");
        case.run()
    }),
    ("label_exposure_contradicts", |case| {
        case.replace("site.toml", "label", "line_period_ms = 9.0\nlabel");
        case.run()
    }),
    ("more_lines_than_the_header", |case| {
        case.replace("site.toml", "label", "lines_delivered = 99999\nlabel");
        case.run()
    }),
    ("pedr_shorter_than_its_label", |case| {
        case.truncate("pedr/ap19117l.b", 5_000);
        case.run()
    }),
    ("pedr_is_a_web_page", |case| {
        case.write(
            "pedr/ap19117l.b",
            "<!DOCTYPE html><html><body>404</body></html>",
        );
        case.run()
    }),
    ("pedr_without_version_letter", |case| {
        fs::rename(case.path("pedr/ap19117l.b"), case.path("pedr/shots.b")).unwrap();
        let mut bytes = case.read("pedr/shots.b");
        // Take the datum out of the label as well.
        let label = String::from_utf8_lossy(&bytes[..7_760]).replace("2000", "XXXX");
        bytes[..7_760].copy_from_slice(label.as_bytes());
        case.write("pedr/shots.b", bytes);
        case.run()
    }),
    ("pedr_datum_contradicts", |case| {
        case.replace(
            "site.toml",
            "[[windows]]",
            "datum = \"iau1991\"\n[[windows]]",
        );
        case.run()
    }),
    ("no_shot_in_the_window", |case| {
        case.replace("site.toml", "[87.5, 88.5]", "[10.0, 10.1]");
        case.run()
    }),
    ("limit_broken", |case| {
        case.replace(
            "site.toml",
            "[[images]]",
            "[range_check]\nmean_max_m = 0.001\n[[images]]",
        );
        case.run()
    }),
    ("out_is_a_file", |case| {
        case.write("out", "a file");
        case.run()
    }),
    ("out_cannot_be_made", |case| {
        let mut command = case.areograph();
        command.args(["--quiet", "run", "site.toml", "--out", "/proc/areograph"]);
        command
    }),
    ("two_sites_with_one_id", |case| {
        fs::copy(case.path("site.toml"), case.path("other.toml")).unwrap();
        let mut command = case.run();
        command.arg("other.toml");
        command
    }),
    ("stage_unknown", |case| {
        let mut command = case.run();
        command.args(["--until", "adjust"]);
        command
    }),
    ("scene_over_a_foreign_folder", |case| {
        let mut command = case.areograph();
        command.args(["--quiet", "scene", "kernels"]);
        command
    }),
    ("scene_along_kernels_without_attitude", |case| {
        case.replace("kernels/nav.tm", "'mgs_sc_scene.bc'", "");
        let mut command = case.areograph();
        command.args(["--quiet", "scene", "flown", "--along", "kernels/nav.tm"]);
        command
    }),
];

#[test]
fn every_case_has_its_exit_code_and_exact_message() {
    let expected = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/bad_input");
    let mut differing = Vec::new();
    for (name, spoil) in CASES {
        let case = Case::new();
        let found = case.outcome(spoil(&case));
        let wanted = fs::read_to_string(expected.join(format!("{name}.txt"))).unwrap_or_default();
        if found.trim_end() != wanted.trim_end() {
            differing.push(format!("=== {name}\n{found}"));
        }
    }
    assert!(
        differing.is_empty(),
        "{} of {} messages differ from tests/bad_input; found:\n{}",
        differing.len(),
        CASES.len(),
        differing.join("\n")
    );
}

#[test]
fn a_folder_in_use_is_left_alone() {
    let case = Case::new();
    fs::create_dir_all(case.path("out/case")).unwrap();
    let lock = fs::File::create(case.path("out/case/.lock")).unwrap();
    lock.lock().unwrap();
    let found = case.outcome(case.run());
    assert!(found.starts_with("exit 6\nerror: case: "), "{found}");
    assert!(
        found.contains("another run is at work in this folder"),
        "{found}"
    );
    // Closing would not do: a process that another test is starting may hold a copy of the file.
    lock.unlock().unwrap();
    let found = case.outcome(case.run());
    assert!(found.starts_with("exit 0"), "{found}");
}

#[test]
fn spoiled_records_are_complained_of_and_the_rest_is_kept() {
    let good = Case::new();
    assert!(good.outcome(good.run()).starts_with("exit 0"));
    let case = Case::new();
    let mut bytes = case.read("pedr/ap19117l.b");
    let record = 7_760 + 100 * 776;
    bytes[record + 552..record + 560].fill(0xFF); // the frame's time is no number
    bytes.extend([0; 100]);
    case.write("pedr/ap19117l.b", bytes);
    assert!(case.outcome(case.run()).starts_with("exit 0"));
    let manifest = |case: &Case| -> serde_json::Value {
        serde_json::from_slice(&case.read("out/case/manifest.json")).unwrap()
    };
    let complaints = &manifest(&case)["complaints"];
    assert_eq!(complaints["count"], 2, "{complaints}");
    let texts = complaints["texts"].to_string();
    assert!(texts.contains("ap19117l.b record 111: "), "{texts}");
    assert!(
        texts.contains("100 bytes after the last whole record of 776; left out"),
        "{texts}"
    );
    // The spoiled frame lies far from the window.
    assert_eq!(
        manifest(&case)["counts"]["footprints"],
        manifest(&good)["counts"]["footprints"]
    );
}

#[test]
fn damaged_stores_and_products_are_made_again() {
    let case = Case::new();
    assert!(case.outcome(case.run()).starts_with("exit 0"));
    let before = common::mission::products(&case.path("out"));
    case.write("out/case/.cache/convert_datum", b"damaged");
    case.write("out/case/footprints.csv", b"edited");
    fs::remove_file(case.path("out/case/ranges.json")).unwrap();
    assert!(case.outcome(case.run()).contains("remarks; products in"));
    assert!(common::mission::products(&case.path("out")) == before);
}

/// A full disk is a small tmpfs, which only root (or a user who may make namespaces) can mount.
#[test]
#[allow(clippy::print_stderr, reason = "says what is skipped")]
fn a_full_disk_leaves_nothing_half_made() {
    let case = Case::new();
    let script = "mount -t tmpfs -o size=300k tmpfs small && \"$0\" --quiet run site.toml --out small; code=$?; \
                  find small -type f ! -path '*/.*'; exit $code";
    fs::create_dir(case.path("small")).unwrap();
    let unshared = |program: &str, arguments: &[&str]| {
        let mut command = Command::new("unshare");
        command
            .current_dir(case.path(""))
            .args(["--map-root-user", "--mount"]);
        command.arg(program).args(arguments);
        command
    };
    let possible = unshared("sh", &["-c", "mount -t tmpfs tmpfs small"]).output();
    if !possible.is_ok_and(|output| output.status.success()) {
        eprintln!("skipped full disk: this user cannot mount a tmpfs");
        return;
    }
    let program = env!("CARGO_BIN_EXE_areograph");
    let found = case.outcome(unshared("sh", &["-c", script, program]));
    assert!(found.starts_with("exit 6\n"), "{found}");
    assert!(found.contains("No space left on device"), "{found}");
    assert!(found.contains("free some space"), "{found}");
    assert!(!found.contains("small/case/manifest.json\n"), "{found}");
}
