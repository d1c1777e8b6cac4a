//! Bad input through the command line: exit code and exact message of every case.
//!
//! Expected messages stand in `tests/bad_input/<case>.txt`: exit code, then what the program printed,
//! with the case's folder cut out (`SNAPSHOTS=overwrite` writes them anew). Cases of the configuration
//! alone are in `tests/config/bad`.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

use crate::common;

use std::{fs, process::Command};

use common::{
    case::Case,
    daf::{change_packets, summaries},
    golden::Golden,
    outside,
};

type Spoil = fn(&Case) -> Command;

/// The case with two rival sets of kernels.
fn rivals(case: &Case) {
    let sets = "sets = [{ id = \"nav\", metakernel = \"kernels/nav.tm\" }, \
                { id = \"ipng\", metakernel = \"kernels/ipng.tm\" }]";
    case.replace("site.toml", "metakernel = \"kernels/nav.tm\"", sets);
}

fn compare(case: &Case, arguments: &[&str]) -> Command {
    let mut command = case.areograph();
    command
        .args(["--quiet", "kernels", "compare"])
        .args(arguments);
    command
}

fn export(case: &Case, format: &str, to: &str) -> Command {
    let mut command = case.areograph();
    command.args(["export", "out/case", format, "--to", to]);
    command
}

fn run_into(case: &Case, out: &str) -> Command {
    let mut command = case.areograph();
    command.args(["--quiet", "run", "site.toml", "--out", out]);
    command
}

/// Spoils one thing of a good case and says what to run.
const CASES: &[(&str, Spoil)] = &[
    ("good", Case::run),
    ("export_without_products", |case| {
        fs::create_dir_all(case.path("out/case")).unwrap();
        export(case, "gpkg", "gis")
    }),
    ("export_in_an_unknown_format", |case| {
        export(case, "geopackage", "gis")
    }),
    ("export_among_the_products", |case| {
        assert!(case.outcome(case.run()).starts_with("exit 0"));
        export(case, "gpkg", "out/case/exchange/more")
    }),
    ("export_into_another_site", |case| {
        assert!(case.outcome(case.run()).starts_with("exit 0"));
        case.replace("site.toml", "site = \"case\"", "site = \"other\"");
        assert!(case.outcome(case.run()).starts_with("exit 0"));
        export(case, "gpkg", "out/new/../other/more")
    }),
    ("export_without_footprints", |case| {
        case.replace("site.toml", "[4.0, 5.0]", "[44.0, 45.0]");
        assert!(case.outcome(case.run()).starts_with("exit 5"));
        export(case, "gpkg", "gis")
    }),
    ("export_over_a_file", |case| {
        assert!(case.outcome(case.run()).starts_with("exit 0"));
        fs::create_dir(case.path("gis")).unwrap();
        case.write("gis/footprints.gpkg", "not ours");
        export(case, "gpkg", "gis")
    }),
    ("export_of_damaged_products", |case| {
        assert!(case.outcome(case.run()).starts_with("exit 0"));
        case.truncate("out/case/report/page.postcard", 1_000);
        export(case, "gpkg", "gis")
    }),
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
        case.replace("image.lbl", "STOP_TIME", "OTHER_STOP");
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
    ("summing_beyond_the_camera", |case| {
        case.replace("site.toml", "label", "crosstrack_summing = 9\nlabel");
        case.run()
    }),
    ("samples_beyond_the_detector", |case| {
        case.replace("site.toml", "label", "first_detector = 100\nlabel");
        case.run()
    }),
    ("instrument_file_is_bad", |case| {
        let file = include_str!("../../config/instruments/moc_na.toml")
            .replace("pixels = 2048", "pixel = 2048")
            .replace("samples_along = \"+y\"", "samples_along = \"y\"")
            .replace("focal_length_mm = 3500.0", "focal_length_mm = 0.0");
        case.write("camera.toml", file);
        case.replace("site.toml", "label", "instrument = \"camera.toml\"\nlabel");
        case.run()
    }),
    ("altimeter_file_is_bad", |case| {
        let file = include_str!("../../config/altimeters/mola.toml")
            .replace("bias_s = 0.117", "bias_s = -0.117")
            .replace("full_name", "fullname");
        case.write("laser.toml", file);
        case.replace(
            "site.toml",
            "site = ",
            "altimeter = \"laser.toml\"\nsite = ",
        );
        case.run()
    }),
    ("altimeter_is_unknown", |case| {
        case.replace("site.toml", "site = ", "altimeter = \"moly\"\nsite = ");
        case.run()
    }),
    ("instrument_is_unknown", |case| {
        case.replace("site.toml", "label", "instrument = \"moc_wa\"\nlabel");
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
    ("pedr_in_two_versions", |case| {
        let mut bytes = case.read("pedr/ap19117l.b");
        let label = String::from_utf8_lossy(&bytes[..7_760]).replace("2000", "1991");
        bytes[..7_760].copy_from_slice(label.as_bytes());
        case.write("pedr/ap19117k.b", bytes);
        case.run()
    }),
    ("check_pedr_is_empty", |case| {
        case.truncate("pedr/ap19117l.b", 0);
        case.check()
    }),
    ("check_pedr_in_two_versions", |case| {
        let mut bytes = case.read("pedr/ap19117l.b");
        let label = String::from_utf8_lossy(&bytes[..7_760]).replace("2000", "1991");
        bytes[..7_760].copy_from_slice(label.as_bytes());
        case.write("pedr/ap19117k.b", bytes);
        case.check()
    }),
    ("check_no_position_at_the_shots", |case| {
        let site = String::from_utf8(case.read("site.toml")).unwrap();
        case.write("site.toml", &site[..site.find("[[images]]").unwrap()]);
        case.replace("kernels/nav.tm", "'mgs_nav_scene.bsp'", "");
        case.check()
    }),
    ("info_of_a_file_of_zeros", |case| {
        case.write("pedr/ap19117l.b", [0; 20_000]);
        let mut command = case.areograph();
        command.args(["--quiet", "pedr", "info", "pedr/ap19117l.b"]);
        command
    }),
    ("info_with_something_else_for_leap_seconds", |case| {
        let mut command = case.areograph();
        command.args(["--quiet", "pedr", "info", "pedr/ap19117l.b"]);
        command.args(["--leap-seconds", "kernels/moc.ti"]);
        command
    }),
    ("no_shot_in_the_window", |case| {
        case.replace("site.toml", "[87.5, 88.5]", "[10.0, 10.1]");
        case.run()
    }),
    ("check_no_shot_in_the_window", |case| {
        case.replace("site.toml", "[87.5, 88.5]", "[10.0, 10.1]");
        case.check()
    }),
    ("check_spoiled_records", |case| {
        let mut bytes = case.read("pedr/ap19117l.b");
        for (record, byte) in [(100, 556), (200, 332), (300, 772)] {
            bytes[7_760 + record * 776 + byte] ^= 0x40;
        }
        case.write("pedr/ap19117l.b", bytes);
        case.check()
    }),
    ("a_link_of_the_glob_leads_nowhere", |case| {
        std::os::unix::fs::symlink("gone.b", case.path("pedr/ap19999l.b")).unwrap();
        case.run()
    }),
    ("pedr_is_compressed", |case| {
        let mut bytes: Vec<u8> = case
            .read("pedr/ap19117l.b")
            .iter()
            .map(|byte| byte ^ 0x5a)
            .collect();
        bytes[..4].copy_from_slice(&[0x1f, 0x8b, 8, 0]);
        case.write("pedr/ap19117l.b", bytes);
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
    ("spk_state_is_not_finite", |case| {
        change_packets(case, "kernels/mgs_nav_scene.bsp", 6, |state| {
            state[2] = f64::NAN;
        });
        case.run()
    }),
    ("ck_rate_is_not_finite", |case| {
        change_packets(case, "kernels/mgs_sc_scene.bc", 7, |attitude| {
            attitude[5] = f64::INFINITY;
        });
        case.run()
    }),
    // Numbers themselves, but no longer when they have been interpolated.
    ("spk_state_overflows", |case| {
        change_packets(case, "kernels/mgs_nav_scene.bsp", 6, |state| {
            state[2] = 1e308;
        });
        case.run()
    }),
    ("check_spk_state_is_not_finite", |case| {
        change_packets(case, "kernels/mgs_nav_scene.bsp", 6, |state| {
            state[2] = f64::NAN;
        });
        case.check()
    }),
    ("check_ck_rate_is_not_finite", |case| {
        change_packets(case, "kernels/mgs_sc_scene.bc", 7, |attitude| {
            attitude[5] = f64::INFINITY;
        });
        case.check()
    }),
    ("check_no_camera_frame", |case| {
        case.replace("kernels/nav.tm", "'moc.ti'", "");
        case.check()
    }),
    ("spk_segment_begins_at_minus_infinity", |case| {
        let kernel = "kernels/mgs_nav_scene.bsp";
        let mut bytes = case.read(kernel);
        let first = summaries(&bytes)[0];
        bytes[first..first + 8].copy_from_slice(&f64::NEG_INFINITY.to_le_bytes());
        case.write(kernel, bytes);
        case.run()
    }),
    ("out_is_a_file", |case| {
        case.write("out", "a file");
        case.run()
    }),
    ("out_cannot_be_made", |case| {
        run_into(case, "/proc/areograph")
    }),
    ("out_holds_a_newline", |case| run_into(case, "new\nline")),
    ("out_has_a_long_part", |case| {
        run_into(case, &"a".repeat(256))
    }),
    ("two_sites_with_one_id", |case| {
        fs::copy(case.path("site.toml"), case.path("other.toml")).unwrap();
        let mut command = case.run();
        command.arg("other.toml");
        command
    }),
    ("stage_unknown", |case| {
        let mut command = case.run();
        command.args(["--until", "triangulate"]);
        command
    }),
    ("rival_sets_without_common_time", |case| {
        rivals(case);
        case.replace("kernels/ipng.tm", "'mgs_ipng_scene.bsp'", "");
        case.run()
    }),
    ("rival_clocks_differ", |case| {
        rivals(case);
        // The clock of another set reads the same a second later.
        fs::copy(
            case.path("kernels/mgs_clock.tsc"),
            case.path("kernels/other.tsc"),
        )
        .unwrap();
        case.replace(
            "kernels/other.tsc",
            "2.210370652298117E+07",
            "2.210370752298117E+07",
        );
        case.replace("kernels/ipng.tm", "mgs_clock.tsc", "other.tsc");
        case.run()
    }),
    ("rival_set_without_leap_seconds", |case| {
        rivals(case);
        case.replace("kernels/ipng.tm", "'leapseconds.tls'", "");
        case.run()
    }),
    ("compare_one_set", |case| compare(case, &["kernels/nav.tm"])),
    ("compare_a_set_with_itself", |case| {
        compare(case, &["kernels/nav.tm", "kernels/../kernels/nav.tm"])
    }),
    ("compare_a_site_without_sets", |case| {
        compare(case, &["--site", "site.toml"])
    }),
    ("compare_time_reversed", |case| {
        compare(
            case,
            &[
                "kernels/nav.tm",
                "kernels/ipng.tm",
                "--time",
                "2001-03-23T05:00..2001-03-23T04:00",
            ],
        )
    }),
    ("compare_something_else", |case| {
        compare(case, &["kernels/nav.tm", "site.toml"])
    }),
    ("scene_over_a_foreign_folder", |case| {
        let mut command = case.areograph();
        command.args(["--quiet", "scene", "mission", "kernels"]);
        command
    }),
    ("scene_along_kernels_without_attitude", |case| {
        case.replace("kernels/nav.tm", "'mgs_sc_scene.bc'", "");
        let mut command = case.areograph();
        command.args(["--quiet", "scene", "along", "kernels/nav.tm", "flown"]);
        command
    }),
];

/// The same for a pair of images with tie points.
const PAIR_CASES: &[(&str, Spoil)] = &[
    ("ties_of_other_images", |case| {
        case.replace("ties/isidis.csv", "E02-", "M02-");
        case.run()
    }),
    ("ties_of_one_image", |case| {
        case.replace("ties/isidis.csv", "E02-01301", "E02-02016");
        case.run()
    }),
    ("ties_without_a_column", |case| {
        case.replace("ties/isidis.csv", "serial_number", "serial");
        case.run()
    }),
    ("ties_are_empty", |case| {
        case.write("ties/isidis.csv", "");
        case.run()
    }),
    ("ties_without_a_readable_row", |case| {
        case.write(
            "ties/isidis.csv",
            "point_id,serial_number,sample,line\ntie-001,E02-01301,,804.7\ntie-001,E02-02016,398.4\n",
        );
        case.run()
    }),
    ("ties_are_a_binary_network", |case| {
        let label = "Object = ProtoBuffer\n Object = Core\n HeaderStartByte = 65536\n End_Object\nEnd_Object\nEnd\n";
        case.write(
            "ties/isidis.net",
            [label.as_bytes(), &[0, 1, 2, 255]].concat(),
        );
        case.replace("site.toml", "isidis.csv", "isidis.net");
        case.run()
    }),
    ("ties_of_parallel_rays", |case| {
        // Both images are the same one.
        case.write("labels/E02-02016.lbl", case.read("labels/E02-01301.lbl"));
        case.replace("labels/E02-02016.lbl", "E02/01301", "E02/02016");
        case.run()
    }),
    ("adjustment_held_against_its_ties", |case| {
        case.replace(
            "site.toml",
            "tie_sigma_px",
            "model = \"published\"\nposition_sigma_nadir_m = 0.01\nposition_sigma_off_nadir_m = 0.01\nblunder_limit = 0\ntie_sigma_px",
        );
        case.run()
    }),
    ("out_is_too_long_for_kernels", |case| {
        run_into(case, &["b".repeat(200), "c".repeat(40)].join("/"))
    }),
    ("check_ties_of_other_images", |case| {
        case.replace("ties/isidis.csv", "E02-", "M02-");
        case.check()
    }),
];

#[test]
fn every_case_has_its_exit_code_and_exact_message() {
    let mut golden = Golden::folder("bad_input");
    let cases = CASES.iter().map(|(name, spoil)| (name, Case::new(), spoil));
    let pairs = PAIR_CASES
        .iter()
        .map(|(name, spoil)| (name, Case::pair(), spoil));
    for (name, case, spoil) in cases.chain(pairs) {
        golden.compare(name, &case.outcome(spoil(&case)));
    }
    golden.finish();
}

#[test]
fn pedr_info_tells_utc_when_it_is_given_leap_seconds() {
    let case = Case::new();
    let mut command = case.areograph();
    command.args(["--quiet", "pedr", "info", "pedr/ap19117l.b"]);
    command.args(["--leap-seconds", "kernels/leapseconds.tls"]);
    let found = case.outcome(command);
    assert!(found.starts_with("exit 0\n"), "{found}");
    // The revolution of the image of 04:17:44 UTC.
    assert!(
        found.contains("utc_first               2001-03-23T03:19:"),
        "{found}"
    );
    assert!(
        found.contains("utc_last                2001-03-23T05:16:"),
        "{found}"
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
        found.contains("another run is using this folder"),
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
        texts.contains("100 bytes after the last whole record of 776 bytes are ignored"),
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
    case.write("out/case/footprints.parquet", b"edited");
    fs::remove_file(case.path("out/case/ranges.json")).unwrap();
    assert!(
        case.outcome(case.run())
            .contains("case: valid; products in")
    );
    assert!(common::mission::products(&case.path("out")) == before);
}

#[test]
fn a_contradicting_pck_is_said_on_the_terminal() {
    let case = Case::new();
    case.replace("kernels/nav.tm", "mars_iau2000.tpc", "mars_iau1991.tpc");
    let mut command = case.areograph();
    command.args(["run", "site.toml", "--out", "out"]);
    let found = case.outcome(command);
    assert!(found.starts_with("exit 0"), "{found}");
    let warning = found.lines().find(|line| line.contains("WARN")).unwrap();
    assert!(
        warning.contains("the PCK rotates IAU_MARS by 0.2"),
        "{warning}"
    );
}

/// A manifest and a journal that someone else wrote must not make the next run remove foreign files.
#[test]
fn products_named_outside_the_folder_are_left_alone() {
    let case = Case::new();
    assert!(case.outcome(case.run()).starts_with("exit 0"));
    let foreign = [case.path("foreign.txt"), case.path("out/foreign.txt")];
    for path in &foreign {
        fs::write(path, "not ours").unwrap();
    }
    let inside = case.path("out/case/once_made.txt");
    fs::write(&inside, "ours").unwrap();
    let listed = |path: &str| {
        format!("{{ \"path\": {path:?}, \"bytes\": 8, \"blake3\": \"00\", \"rows\": 1 }}, ")
    };
    let absolute = foreign[0].display().to_string();
    let paths = [
        "../foreign.txt",
        "images/../../../foreign.txt",
        &absolute,
        "once_made.txt",
    ];
    let entries: String = paths.iter().map(|path| listed(path)).collect();
    let manifest = "out/case/manifest.json";
    case.replace(
        manifest,
        "\"products\": [",
        &format!("\"products\": [{entries}"),
    );
    case.write("out/case/.publishing", paths[..3].join("\n"));
    let found = case.outcome(case.run());
    assert!(found.starts_with("exit 0"), "{found}");
    for path in &foreign {
        assert_eq!(fs::read_to_string(path).unwrap(), "not ours");
    }
    // What the manifest names inside the folder is ours to remove: the list was believed.
    assert!(!inside.exists());
}

/// Runs a shell script in the case's folder, with a tmpfs of `size` mounted at `small` in it and the
/// program as `$0`; `None` for a user who cannot mount (only root, or who may make namespaces, can).
fn on_a_small_disk(case: &Case, size: &str, script: &str) -> Option<String> {
    fs::create_dir_all(case.path("small")).unwrap();
    let unshared = |script: String| {
        let mut command = Command::new("unshare");
        command
            .current_dir(case.path(""))
            .args(["--map-root-user", "--mount", "sh", "-c", &script])
            .arg(env!("CARGO_BIN_EXE_areograph"));
        command
    };
    let mount = format!("mount -t tmpfs -o size={size} tmpfs small");
    let possible = unshared(mount.clone()).output();
    if !possible.is_ok_and(|output| output.status.success()) {
        outside::skipped("full disk", "this user cannot mount a tmpfs");
        return None;
    }
    outside::found("full disk");
    Some(case.outcome(unshared(format!("{mount} && {script}"))))
}

#[test]
fn a_full_disk_leaves_nothing_half_made() {
    let script = "\"$0\" --quiet run site.toml --out small; code=$?; \
                  find small -type f ! -path '*/.*'; find small -name .staging; exit $code";
    let Some(found) = on_a_small_disk(&Case::new(), "300k", script) else {
        return;
    };
    assert!(found.starts_with("exit 6\n"), "{found}");
    assert!(found.contains("No space left on device"), "{found}");
    assert!(found.contains("free some space"), "{found}");
    assert!(!found.contains("small/case/manifest.json\n"), "{found}");
    assert!(!found.contains("/.staging\n"), "{found}");
}

#[test]
fn a_scene_on_a_full_disk_names_the_file_that_did_not_fit() {
    let script = "\"$0\" --quiet scene mission small/scene; code=$?; ls -A small; exit $code";
    // Full at a text kernel, at the start and in the middle of the C-kernel, and at a PEDR file.
    let sizes = [
        ("30k", "kernels/nav.tm"),
        ("100k", "kernels/mgs_sc_scene.bc"),
        ("2500k", "kernels/mgs_sc_scene.bc"),
        ("20000k", "pedr/"),
    ];
    for (size, file) in sizes {
        let Some(found) = on_a_small_disk(&Case::new(), size, script) else {
            return;
        };
        assert!(found.starts_with("exit 6\nerror: "), "{size}: {found}");
        assert!(found.contains("No space left on device"), "{size}: {found}");
        assert!(found.contains(file), "{size}: {found}");
        assert!(!found.contains("\n.partial"), "{size}: {found}");
    }
}
