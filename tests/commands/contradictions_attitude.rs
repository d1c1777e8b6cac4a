//! Wrong attitudes, times and cameras of the pair over Isidis, with tie points and without: none may pass as valid, and
//! errors that no datum of the site can show are stated as not tested.
#![allow(clippy::unwrap_used, reason = "helpers of tests may fail loudly")]

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::common::{
    case::Case,
    daf::{change_packets, segment_words, set_word, word},
    json,
};

const ATTITUDE: &str = "kernels/mgs_sc_scene.bc";
const LABEL: &str = "labels/E02-02016.lbl";
/// The label of the other image.
const LABEL_OF_FIRST: &str = "labels/E02-01301.lbl";
/// Words of a record of a C-kernel of type 3: quaternion and angular rates.
const WORDS: usize = 7;

/// How a run with a mistake ends.
enum End {
    /// Valid without a remark.
    Valid,
    /// In an error or with products that are marked invalid.
    Refused,
    /// Valid with this remark.
    Remark,
    /// Valid, and this error is stated as not tested.
    Untested,
}

/// A mistake: its name, how it is made, how the run ends and what must be stated.
type Mistake = (&'static str, fn(&Case), End, &'static str);

/// Changes the quaternions of the C-kernel.
fn change_attitudes(case: &Case, change: impl Fn(UnitQuaternion<f64>) -> UnitQuaternion<f64>) {
    change_packets(case, ATTITUDE, WORDS, |record| {
        let [w, x, y, z] = [record[0], record[1], record[2], record[3]];
        let changed = change(UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)));
        record[0] = changed.w;
        record[1..4].copy_from_slice(&[changed.i, changed.j, changed.k]);
    });
}

/// Turns the bus of all images about one of its axes.
fn turn(case: &Case, axis: Vector3<f64>, angle_rad: f64) {
    let turn = UnitQuaternion::new(angle_rad * axis);
    change_attitudes(case, |of| turn * of);
}

/// Gives the second half of the segments of the C-kernel, each of one day, to the first half, and the other way round.
fn exchange_days(case: &Case) {
    let mut bytes = case.read(ATTITUDE);
    let original = bytes.clone();
    let segments = segment_words(&original);
    let half = segments.len() / 2;
    for (index, (first, last)) in segments.iter().enumerate() {
        let (other, other_last) = segments[(index + half) % segments.len()];
        // The last word of a segment is the number of its records.
        let records = word(&original, *last).min(word(&original, other_last));
        let mut record = 0.0;
        while record < records {
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a small whole number"
            )]
            let at = WORDS * record as usize;
            for part in 0..4 {
                set_word(
                    &mut bytes,
                    first + at + part,
                    word(&original, other + at + part),
                );
            }
            record += 1.0;
        }
    }
    case.write(ATTITUDE, bytes);
}

/// Removes a line of the label that begins with `key`.
fn drop_line(case: &Case, key: &str) {
    let text = String::from_utf8(case.read(LABEL)).unwrap();
    let kept: Vec<&str> = text
        .lines()
        .filter(|line| !line.trim_start().starts_with(key))
        .collect();
    assert!(kept.len() < text.lines().count(), "the label has no {key}");
    case.write(LABEL, kept.join("\r\n") + "\r\n");
}

/// Shifts clock, start and stop of a label by whole seconds, within the same day.
fn shift_times(case: &Case, label: &str, late_s: u32) {
    let text = String::from_utf8(case.read(label)).unwrap();
    let mut shifted = 0;
    let lines = text.lines().map(|line| {
        let late = match line.split('=').next().unwrap().trim() {
            "SPACECRAFT_CLOCK_START_COUNT" => {
                let (key, count) = line.split_once('"').unwrap();
                let (seconds, ticks) = count.split_once(':').unwrap();
                let late = seconds.parse::<u32>().unwrap() + late_s;
                format!("{key}\"{late}:{ticks}")
            }
            "START_TIME" | "STOP_TIME" | "IMAGE_TIME" => {
                let (day, time) = line.rsplit_once('T').unwrap();
                let parts: Vec<u32> = time[..8]
                    .split(':')
                    .map(|part| part.parse().unwrap())
                    .collect();
                let late = 3_600 * parts[0] + 60 * parts[1] + parts[2] + late_s;
                assert!(late < 86_400, "{line}");
                let (hours, minutes, seconds) = (late / 3_600, late / 60 % 60, late % 60);
                format!("{day}T{hours:02}:{minutes:02}:{seconds:02}{}", &time[8..])
            }
            _ => return line.to_owned(),
        };
        shifted += 1;
        late
    });
    let lines: Vec<String> = lines.collect();
    assert!(shifted >= 3, "{label} has {shifted} times");
    case.write(label, lines.join("\r\n") + "\r\n");
}

/// Lines 20 % longer than they were.
fn slow_lines(case: &Case) {
    let text = String::from_utf8(case.read(LABEL)).unwrap();
    let line = text
        .lines()
        .find(|line| line.contains("LINE_EXPOSURE_DURATION"))
        .unwrap();
    let value = line
        .split('=')
        .nth(1)
        .unwrap()
        .split_whitespace()
        .next()
        .unwrap();
    let slow = 1.2 * value.parse::<f64>().unwrap();
    case.replace(LABEL, line, &line.replace(value, &format!("{slow:.6}")));
}

/// Tie points left out of the site.
fn without_ties(case: &Case) {
    case.replace("site.toml", "[ties]\nfiles = [\"ties/isidis.csv\"]\n", "");
}

const WITH_TIES: &[Mistake] = &[
    (
        "bus_10_mrad_about_x",
        |case| turn(case, Vector3::x(), 0.010),
        End::Refused,
        "2 images, on average: according to",
    ),
    (
        "bus_10_mrad_about_y",
        |case| turn(case, Vector3::y(), 0.010),
        End::Refused,
        "2 images, on average: according to",
    ),
    (
        "bus_2_mrad_about_x",
        |case| turn(case, Vector3::x(), 0.002),
        End::Refused,
        "mrad across the track from its mounting",
    ),
    (
        "bus_2_mrad_about_y",
        |case| turn(case, Vector3::y(), 0.002),
        End::Refused,
        "mrad along the track from its mounting",
    ),
    (
        "all_times_2_s_late",
        |case| {
            for label in [LABEL_OF_FIRST, LABEL] {
                shift_times(case, label, 2);
            }
        },
        End::Untested,
        "an error common to the start times of all images or to the lines of all tie points",
    ),
];

const WITHOUT_TIES: &[Mistake] = &[
    ("sound", |_| {}, End::Valid, "isidis: valid; "),
    (
        "bus_28_degrees",
        |case| turn(case, Vector3::new(1.0, 1.0, 0.0).normalize(), 0.489),
        End::Refused,
        "image E02-02016: according to",
    ),
    (
        "bus_28_degrees_and_no_footprint_inside",
        |case| turn(case, Vector3::new(1.0, 1.0, 0.0).normalize(), 0.489),
        End::Refused,
        "simultaneous footprints inside, whereas the mountings",
    ),
    (
        // Beam and camera look along this axis.
        "bus_28_degrees_about_its_view",
        |case| turn(case, Vector3::z(), 0.489),
        End::Untested,
        "rotation about the line of sight; focal length, distortion and sample direction of the camera",
    ),
    (
        "attitude_conjugated",
        |case| change_attitudes(case, |of| of.inverse()),
        End::Refused,
        "image E02-02016: ",
    ),
    (
        "attitude_of_another_day",
        exchange_days,
        End::Refused,
        "image E02-02016: according to",
    ),
    (
        "detector_mirrored",
        |case| {
            let camera = include_str!("../../config/instruments/moc_na.toml");
            case.write(
                "camera.toml",
                camera.replace("samples_along = \"+y\"", "samples_along = \"-y\""),
            );
            let label = format!("label = \"{LABEL}\"\n");
            case.replace(
                "site.toml",
                &label,
                &format!("{label}instrument = \"camera.toml\"\n"),
            );
        },
        End::Remark,
        "image E02-02016: its camera differs in detector.samples_along from the built-in file of MOC narrow angle",
    ),
    (
        "lines_20_percent_slow",
        slow_lines,
        End::Refused,
        "\n  image E02-02016: STOP_TIME 2001-03-23T04:17:56.238 is 11.658 s after the start",
    ),
    (
        "lines_20_percent_slow_without_stop_time",
        |case| {
            slow_lines(case);
            drop_line(case, "STOP_TIME");
        },
        End::Untested,
        "line period of E02-02016 without STOP_TIME",
    ),
    (
        "all_times_2_s_late",
        |case| shift_times(case, LABEL, 2),
        End::Untested,
        "an error common to clock and UTC in the label of E02-01301 and E02-02016",
    ),
];

fn none_passes(mistakes: &[Mistake], prepare: fn(&Case)) {
    for (mistake, make, end, part) in mistakes {
        let case = Case::pair_after_a_run();
        prepare(&case);
        make(&case);
        let printed = case.outcome(case.run());
        let is_valid = printed.starts_with("exit 0\n");
        match end {
            End::Valid => assert!(
                printed.starts_with("exit 0\nisidis: valid; "),
                "{mistake}: {printed}"
            ),
            End::Refused => assert!(!is_valid && printed.contains(part), "{mistake}: {printed}"),
            End::Remark => assert!(is_valid && printed.contains(part), "{mistake}: {printed}"),
            End::Untested => {
                let verdict = &json(&case.path("out/isidis/manifest.json"))["verdict"];
                let phrases = verdict["untested"].as_array().unwrap();
                let mut phrases = phrases.iter().map(|phrase| phrase.as_str().unwrap());
                let is_stated = phrases.any(|phrase| phrase.contains(part));
                assert!(is_valid && is_stated, "{mistake}: {verdict}, {printed}");
                // The terminal and the first screen of the page state the same.
                let (_, list) = printed.split_once("Not tested by the data:").unwrap();
                assert!(list.contains(part), "{mistake}: {list}");
                let page = String::from_utf8(case.read("out/isidis/report/index.html")).unwrap();
                let (_, list) = page.split_once("Not tested by the data:").unwrap();
                let (list, _) = list.split_once("</ul>").unwrap();
                assert!(list.contains(part), "{mistake}: {list}");
            }
        }
    }
}

#[test]
fn no_attitude_common_to_both_images_passes() {
    none_passes(WITH_TIES, |_| {});
}

#[test]
fn no_attitude_passes_without_tie_points() {
    none_passes(WITHOUT_TIES, without_ties);
}
