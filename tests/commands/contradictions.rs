//! Inputs that contradict each other: mistakes made on the synthetic mission, none of which may pass as valid.
//!
//! The exact message of each that ends in an error stands in `tests/contradictions/<mistake>.txt`, exit code first
//! (`SNAPSHOTS=overwrite` writes them anew); of a verdict only the part that tells the mistake is looked at.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

use crate::common;

use std::fs;

use serde_json::Value;

use common::{
    case::Case,
    daf::{change_packets, without_rates},
    golden::Golden,
    json,
};

/// How a run with a mistake may end.
enum End {
    /// In an error, with this exit code.
    Error(i32),
    /// With products that are marked invalid.
    Invalid,
    /// With a remark: other evidence may make it invalid besides.
    Remark,
}

/// A mistake: its name, what is done to the pair of images over Isidis, how that ends and what must be said.
type Mistake = (&'static str, fn(&Case), End, &'static str);

const LABEL: &str = "labels/E02-02016.lbl";
const CLOCK: &str = "669788295:103";

fn label(case: &Case, from: &str, to: &str) {
    case.replace(LABEL, from, to);
}

fn site(case: &Case, from: &str, to: &str) {
    case.replace("site.toml", from, to);
}

/// Moves the spacecraft of the kernels by so many metres along its velocity, along its position and along their
/// vector product.
fn move_orbit(case: &Case, [along_m, up_m, cross_m]: [f64; 3]) {
    change_packets(case, "kernels/mgs_ipng_scene.bsp", 6, |state| {
        let vector = |at: usize| nalgebra::Vector3::new(state[at], state[at + 1], state[at + 2]);
        let [up, along] = [vector(0).normalize(), vector(3).normalize()];
        let moved_m = along * along_m + up * up_m + up.cross(&along) * cross_m;
        for (word, metres) in moved_m.iter().enumerate() {
            state[word] += metres / 1_000.0;
        }
    });
    site(case, "nav.tm", "ipng.tm");
}

/// The site's tie points from every table of the folder.
fn all_tables(case: &Case) {
    site(case, "ties/isidis.csv", "ties/*.csv");
}

/// The tie points with every row as `change` makes it from identifier, image, sample and line.
fn ties(case: &Case, change: impl Fn([&str; 4]) -> String) {
    let text = String::from_utf8(case.read("ties/isidis.csv")).unwrap();
    let mut lines = text.lines();
    let mut changed = vec![lines.next().unwrap().to_owned()];
    changed.extend(lines.map(|line| {
        let row: Vec<&str> = line.split(',').collect();
        change(row.try_into().unwrap())
    }));
    case.write("ties/isidis.csv", changed.join("\n"));
}

const MISTAKES: &[Mistake] = &[
    (
        "clock_0_9_s_off",
        |case| label(case, CLOCK, "669788296:077"),
        End::Invalid,
        "\n  image E02-02016: clock 669788296:077 is 0.895 s away from UTC 2001-03-23T04:17:44.58, 2.7 km on the ground",
    ),
    (
        "leap_second_missing",
        |case| case.replace("kernels/leapseconds.tls", "32,   @1999-JAN-1", ""),
        End::Error(3),
        "leapseconds.tls: the start of 1999-01-01 UTC is -1.000 s away from the published time scale",
    ),
    (
        "leap_second_missing_and_no_clock",
        |case| {
            case.replace("kernels/leapseconds.tls", "32,   @1999-JAN-1", "");
            label(
                case,
                &format!("SPACECRAFT_CLOCK_START_COUNT = \"{CLOCK}\""),
                "",
            );
        },
        End::Error(3),
        "leapseconds.tls: the start of 1999-01-01 UTC is -1.000 s away from the published time scale",
    ),
    (
        "amplitude_of_relativity_times_100",
        |case| case.replace("kernels/leapseconds.tls", "1.657D-3", "1.657D-1"),
        End::Error(3),
        "away from the published time scale",
    ),
    (
        "mounting_of_a_withdrawn_kernel",
        |case| {
            let (flight, withdrawn) = ("( -0.11463   0.07162", "(  0.06700  -0.01200");
            case.replace("kernels/moc.ti", flight, withdrawn);
        },
        End::Invalid,
        "the mounting of MOC narrow angle in the kernels differs by 0.2000° from its instrument file, 1.3 km on the ground",
    ),
    (
        "clock_2_s_off",
        |case| label(case, CLOCK, "669788297:103"),
        End::Error(3),
        "away from UTC 2001-03-23T04:17:44.58; expected at most 1 s",
    ),
    (
        "clock_with_256_ticks",
        |case| label(case, CLOCK, "669788295:256"),
        End::Error(3),
        "expected a spacecraft clock `seconds:ticks` with ticks below 256",
    ),
    (
        "clock_without_ticks",
        |case| label(case, CLOCK, "669788295"),
        End::Error(3),
        "expected a spacecraft clock `seconds:ticks`",
    ),
    (
        "clock_of_another_partition",
        |case| label(case, CLOCK, "3/669788295:103"),
        End::Error(3),
        "expected a spacecraft clock `seconds:ticks`",
    ),
    (
        "spacecraft_of_another_mission",
        |case| label(case, "MARS_GLOBAL_SURVEYOR", "MARS_OBSERVER"),
        End::Error(3),
        "expected MARS GLOBAL SURVEYOR",
    ),
    (
        "target_is_a_moon",
        |case| label(case, "TARGET_NAME = MARS", "TARGET_NAME = PHOBOS"),
        End::Error(3),
        "TARGET_NAME is \"PHOBOS\"; expected MARS",
    ),
    (
        "instrument_of_another_spacecraft",
        |case| label(case, "\"MOC-NA\"", "\"CTX\""),
        End::Error(3),
        "expected MOC-NA",
    ),
    (
        "image_is_a_map",
        |case| {
            let map = "OBJECT = IMAGE_MAP_PROJECTION\nMAP_SCALE = 5\nEND_OBJECT\nRATIONALE_DESC";
            label(case, "RATIONALE_DESC", map);
        },
        End::Error(3),
        "without a map projection",
    ),
    (
        "labels_exchanged",
        |case| {
            let other = case.read("labels/E02-01301.lbl");
            case.write("labels/E02-01301.lbl", case.read(LABEL));
            case.write(LABEL, other);
        },
        End::Error(3),
        "the label belongs to product E02/02016; expected E0201301",
    ),
    (
        "labels_exchanged_under_free_names",
        |case| {
            site(
                case,
                "id = \"E02-01301\"",
                "id = \"left\"\nserial_number = \"MGS/669788295:103/MOC-NA\"",
            );
            site(case, "id = \"E02-02016\"", "id = \"right\"");
        },
        End::Error(3),
        "the clock in serial number",
    ),
    (
        "one_label_for_both_images",
        |case| {
            case.write(LABEL, case.read("labels/E02-01301.lbl"));
            for (id, free) in [("E02-01301", "left"), ("E02-02016", "right")] {
                let renamed = format!("id = \"{free}\"\nserial_number = \"{id}\"");
                site(case, &format!("id = \"{id}\""), &renamed);
            }
        },
        End::Invalid,
        "images left and right were exposed at the same time by the same pixels",
    ),
    (
        "first_pixel_not_told",
        |case| {
            label(case, "EDIT_MODE_ID", "OTHER_MODE_ID");
            label(case, "LINE_SAMPLES = 1024", "LINE_SAMPLES = 1008");
        },
        End::Remark,
        "the first pixel of its 1008 samples on the 2048 pixels of the detector is not stated",
    ),
    (
        "first_pixel_beyond_the_detector",
        |case| label(case, "EDIT_MODE_ID = \"0\"", "EDIT_MODE_ID = \"1024\""),
        End::Error(3),
        "end at pixel 3072; expected at most 2048",
    ),
    (
        "samples_beyond_the_detector",
        |case| label(case, "LINE_SAMPLES = 1024", "LINE_SAMPLES = 1040"),
        End::Error(3),
        "end at pixel 2080; expected at most 2048",
    ),
    (
        "summing_beyond_the_camera",
        |case| label(case, "DOWNTRACK_SUMMING = 2", "DOWNTRACK_SUMMING = 9"),
        End::Error(3),
        "expected 1 to 8",
    ),
    (
        "summing_of_another_image",
        |case| label(case, "DOWNTRACK_SUMMING = 2", "DOWNTRACK_SUMMING = 8"),
        End::Error(3),
        "after the start, but its lines take 46.649 s",
    ),
    (
        "stop_an_hour_off",
        |case| {
            label(
                case,
                "STOP_TIME = 2001-03-23T04",
                "STOP_TIME = 2001-03-23T05",
            );
        },
        End::Error(3),
        "is 3611.658 s after the start",
    ),
    (
        "stop_two_seconds_off",
        |case| label(case, "04:17:56.238", "04:17:58.238"),
        End::Remark,
        "\n  image E02-02016: STOP_TIME 2001-03-23T04:17:58.238 is 13.658 s after the start",
    ),
    (
        "lines_twice",
        |case| label(case, "LINES = 8064", "LINES = 8064\nLINES = 7680"),
        End::Error(3),
        "LINES appears in the label as \"8064\" and as \"7680\"",
    ),
    (
        "label_cut_off",
        |case| label(case, "END_OBJECT = IMAGE\r\nEND\r\n", ""),
        End::Error(3),
        "the label has no END",
    ),
    (
        "one_tie_under_all_names",
        |case| {
            ties(case, |[id, image, ..]| match image {
                "E02-01301" => format!("{id},{image},837.9184,801.4420"),
                _ => format!("{id},{image},630.3337,1591.1327"),
            });
        },
        End::Remark,
        "duplicate the measurements of another point",
    ),
    (
        "ties_saved_again_under_other_names",
        |case| {
            let text = String::from_utf8(case.read("ties/isidis.csv")).unwrap();
            case.write("ties/again.csv", text.replace("tie-", "point "));
            all_tables(case);
        },
        End::Remark,
        "tie points: 154 duplicate the measurements of another point and are omitted",
    ),
    (
        "all_ties_on_one_pixel",
        |case| {
            ties(case, |[id, image, sample, line]| match image {
                "E02-01301" => format!("{id},{image},837.9184,801.4420"),
                _ => format!("{id},{image},{sample},{line}"),
            });
        },
        End::Error(3),
        "are measured at the position of another point",
    ),
    (
        "ties_beyond_the_delivered_lines",
        |case| {
            ties(case, |[id, image, sample, line]| {
                let line: f64 = line.parse().unwrap();
                format!("{id},{image},{sample},{}", line + 384.0)
            });
        },
        End::Error(3),
        "measurements lie outside the delivered image",
    ),
    (
        "ties_before_the_first_sample",
        |case| {
            ties(case, |[id, image, sample, line]| {
                let sample: f64 = sample.parse().unwrap();
                format!("{id},{image},{},{line}", sample - 300.0)
            });
        },
        End::Error(3),
        "measurements lie outside the delivered image",
    ),
    (
        "fewer_lines_delivered_than_measured",
        |case| site(case, "lines_delivered = 7680", "lines_delivered = 3000"),
        End::Error(3),
        "expected lines 0 to 3000",
    ),
    (
        "ties_without_numbers",
        |case| {
            ties(case, |[id, image, sample, _]| {
                format!("{id},{image},{sample},")
            });
        },
        End::Error(3),
        "line \"\": expected two names and two numbers",
    ),
    (
        "attitude_without_rates",
        |case| {
            let kernel = "kernels/mgs_sc_scene.bc";
            let bytes = without_rates(case.read(kernel));
            case.write(kernel, bytes);
        },
        End::Error(4),
        "mgs_sc_scene.bc contains attitude without angular rates",
    ),
    (
        "pointing_bias_with_the_wrong_sign",
        |case| site(case, "ck_bias_s = -1.15", "ck_bias_s = 1.15"),
        End::Error(2),
        "pointing.ck_bias_s is 1.15; expected -1.15, the known bias of MOC narrow angle with its sign",
    ),
    (
        "pointing_bias_left_out",
        |case| site(case, "ck_bias_s = -1.15", "ck_bias_s = 0.0"),
        End::Remark,
        "up to 379 m on the ground",
    ),
    (
        "clock_bias_with_the_wrong_sign",
        |case| site(case, "sign = \"late\"", "sign = \"early\""),
        End::Invalid,
        "the positions agree if time tags are corrected by −0.11",
    ),
    (
        "orbit_300_m_ahead",
        |case| move_orbit(case, [300.0, 0.0, 0.0]),
        End::Invalid,
        "otherwise the kernels contain a different orbit",
    ),
    (
        "orbit_300_m_up",
        |case| move_orbit(case, [0.0, 300.0, 0.0]),
        End::Invalid,
        "the orbit in the kernels differs from the orbit in the file",
    ),
    (
        "orbit_300_m_aside",
        |case| move_orbit(case, [0.0, 0.0, 300.0]),
        End::Invalid,
        "the orbit in the kernels differs from the orbit in the file",
    ),
    (
        "datum_against_the_label",
        |case| {
            site(case, ", \"pedr/ap19117l.b\"", "");
            site(case, "datum = \"auto\"", "datum = \"iau1994\"");
        },
        End::Error(3),
        "the label implies iau1991, but pedr.datum in the configuration implies iau1994",
    ),
    (
        "datum_that_no_label_tells",
        |case| {
            site(
                case,
                "\"pedr/ap19019k.b\", \"pedr/ap19117l.b\"",
                "\"pedr/shots.b\"",
            );
            site(case, "datum = \"auto\"", "datum = \"iau1994\"");
            let mut bytes = case.read("pedr/ap19019k.b");
            let text = String::from_utf8_lossy(&bytes[..7_760]).replace("1991", "    ");
            bytes[..7_760].copy_from_slice(text.as_bytes());
            case.write("pedr/shots.b", bytes);
        },
        End::Invalid,
        "the positions agree if the coordinates of the file refer to iau1991 instead of iau1994 (pedr.datum)",
    ),
];

/// Exit code and answer of `areograph check`.
fn check(case: &Case) -> (Option<i32>, Value) {
    let output = case.check().arg("--json").output().unwrap();
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap_or_default();
    (output.status.code(), answer[0].clone())
}

/// The table in parts, which run side by side.
const PARTS: usize = 4;

#[test]
fn no_mistake_of_the_first_quarter_passes_as_valid() {
    no_mistake_passes_as_valid(0);
}

#[test]
fn no_mistake_of_the_second_quarter_passes_as_valid() {
    no_mistake_passes_as_valid(1);
}

#[test]
fn no_mistake_of_the_third_quarter_passes_as_valid() {
    no_mistake_passes_as_valid(2);
}

#[test]
fn no_mistake_of_the_last_quarter_passes_as_valid() {
    no_mistake_passes_as_valid(3);
}

fn no_mistake_passes_as_valid(quarter: usize) {
    let mut golden = Golden::folder("contradictions");
    for (number, (mistake, make, end, part)) in MISTAKES.iter().enumerate() {
        if number % PARTS != quarter {
            golden.leave(mistake);
            continue;
        }
        // In the short run a run of the sound pair comes first: what it stored must not hide the mistake.
        let case = if common::long() {
            Case::pair()
        } else {
            Case::pair_after_a_run()
        };
        make(&case);
        let said = case.outcome(case.run());
        let starts = |start: &str| said.starts_with(start);
        let ends = match end {
            End::Error(code) => starts(&format!("exit {code}\nerror: ")),
            End::Invalid => starts("exit 5\nisidis: INVALID; "),
            End::Remark => {
                starts("exit 0\nisidis: valid with remarks; ")
                    || starts("exit 5\nisidis: INVALID; ")
            }
        };
        assert!(ends, "{mistake}: {said}");
        assert!(
            said.contains(part),
            "{mistake} does not say {part:?}: {said}"
        );
        // A check runs the same stages: of every third mistake, and of all in the long run.
        let checked = (number % 3 == 0 || common::long()).then(|| check(&case));
        if let End::Error(code) = end {
            if let Some((found, _)) = checked {
                assert_eq!(found, Some(*code), "{mistake}: check and run differ");
            }
            golden.compare(mistake, &said);
            continue;
        }
        // The table of checks says the same as the reasons, and a check as the run.
        let verdict = &json(&case.path("out/isidis/manifest.json"))["verdict"];
        if let Some((found, answer)) = checked {
            assert_eq!(
                &answer["verdict"], verdict,
                "{mistake}: check and run differ"
            );
            assert_eq!(answer["ready"], verdict["valid"], "{mistake}");
            assert_eq!(found == Some(0), verdict["valid"] == true, "{mistake}");
        }
        let checks = verdict["checks"].as_array().unwrap();
        let fails = checks.iter().any(|check| check["outcome"] == "fail");
        assert_eq!(verdict["valid"], !fails, "{mistake}: {checks:?}");
        let warns = checks.iter().any(|check| check["outcome"] == "warning");
        let remarks = verdict["remarks"].as_array().unwrap();
        assert!(!warns || !remarks.is_empty(), "{mistake}: {checks:?}");
    }
    golden.finish();
}

#[test]
fn a_copy_of_a_tie_file_is_read_once_and_noted() {
    let case = Case::pair();
    fs::copy(
        case.path("ties/isidis.csv"),
        case.path("ties/isidis (1).csv"),
    )
    .unwrap();
    all_tables(&case);
    let said = case.outcome(case.run());
    assert!(said.starts_with("exit 0\n"), "{said}");
    let manifest = json(&case.path("out/isidis/manifest.json"));
    let notes = manifest["notes"].to_string();
    assert!(
        notes.contains("tie points: isidis.csv: a copy of isidis (1).csv, read once"),
        "{notes}"
    );
    let products = manifest["products"].as_array().unwrap();
    let ties = products
        .iter()
        .find(|product| product["path"] == "ties.parquet");
    // Two measurements of each of the 154 points.
    assert_eq!(ties.unwrap()["rows"], 308);
}

#[test]
fn damaged_pixels_are_told_in_verdict_manifest_and_log() {
    let case = Case::pair();
    let mut raster = b"PDS_VERSION_ID = PDS3\r\nRECORD_BYTES = 1024\r\n^IMAGE = 2\r\nINSTRUMENT_ID = \"MOC-NA\"\r\n\
        OBJECT = IMAGE\r\nLINES = 160\r\nLINE_SAMPLES = 1024\r\nSAMPLE_BITS = 8\r\nCHECKSUM = 16#00000007#\r\n\
        END_OBJECT = IMAGE\r\nEND\r\n"
        .to_vec();
    raster.resize(1024, b' ');
    // The last 32 lines are not there.
    raster.extend(vec![80; 128 * 1024]);
    case.write("damaged.img", raster);
    let label = format!("label = \"{LABEL}\"\n");
    site(&case, &label, &format!("{label}pixels = \"damaged.img\"\n"));
    let mut command = case.areograph();
    command.args(["--verbose", "run", "site.toml", "--out", "out"]);
    let log = String::from_utf8(common::mission::succeed(&mut command).stderr).unwrap();
    let manifest = json(&case.path("out/isidis/manifest.json"));
    let remarks = manifest["verdict"]["remarks"].as_array().unwrap();
    let mut remarks = remarks.iter().map(|remark| remark.as_str().unwrap());
    let remark = remarks.find(|remark| remark.starts_with("pixels of E02-02016: "));
    let remark = remark.unwrap();
    let expected = "32 of 160 lines are missing and 0 may be damaged; 2 complaints, first: byte 1024: the label's CHECKSUM";
    assert!(remark.contains(expected), "{remark}");
    let warned = log.lines().find(|line| line.contains(expected)).unwrap();
    assert!(warned.contains("WARN"), "{warned}");
    let complaints = &manifest["complaints"];
    let texts = complaints["texts"].as_array().unwrap().iter();
    let texts = texts.filter(|text| {
        text.as_str()
            .unwrap()
            .starts_with("pixels of E02-02016: byte ")
    });
    assert_eq!(texts.count(), 2, "{complaints}");
    assert_eq!(complaints["count"], 2);
}
