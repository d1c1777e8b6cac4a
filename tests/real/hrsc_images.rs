//! Level-2 files of HRSC as labels and pixels: cropped real ones, and whole ones put together of the label and the published line
//! times of `h5270_0000_ir2`, since no whole file of the archive is at hand.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::panic,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "helpers of tests work in temporary folders, may fail loudly, and make samples of small numbers"
)]

use crate::common;

use std::{fs, path::Path, process::Command};

use areograph::{
    config::{ExposurePiece, ImageConfig, all_instruments, line_times_of},
    image::ImageFields,
    line_times::LineTimes,
    pds::read_label,
    spice::{KernelSet, Session},
    stages::tag_times::{StartFrom, tag_times},
};
use common::{case::Case, json, mission::succeed, real_data};
use serde_json::Value;

const FOLDER: &str = "ale_mex/h5270_0000_ir2";
const LABEL: &str = "h5270_0000_ir2_pds3.lbl";
const KERNELS: [&str; 7] = [
    "naif0012.tls",
    "pck00009.tpc",
    "MEX_190911_STEP.TSC",
    "MEX_V14.TF",
    // Light that reaches the image left the Sun in the pass before.
    "h5270_0000_ir2_0.bsp",
    "h5270_0000_ir2_1.bsp",
    "ATNM_MEASURED_080101_090101_V03_1_sliced_-41001.bc",
];
/// Lines of the whole image, and of a part that is enough for what a label says.
const LINES: [u32; 2] = [15_088, 400];
const SAMPLES: u32 = 1288;
const RECORD_BYTES: usize = 2644;
/// Records of the label, and of the VICAR label behind it.
const LABEL_RECORDS: [usize; 2] = [4, 3];

/// The published table of the image.
fn published() -> [ExposurePiece; 3] {
    [
        (0, 255_744_599.027_481_65, 12.800_790_786_743_165),
        (6664, 255_744_684.331_978_14, 12.907_449_722_290_039),
        (6665, 255_744_684.345_045_57, 13.227_428_436_279_297),
    ]
    .map(|(first_line, start_et_s, period_ms)| ExposurePiece {
        first_line,
        start_et_s,
        line_period_s: period_ms * 1e-3,
    })
}

fn published_times(lines: u32) -> LineTimes {
    let pieces = published();
    let known = pieces.iter().filter(|piece| piece.first_line < lines);
    line_times_of(&known.copied().collect::<Vec<_>>(), lines).unwrap()
}

/// A number of 16 bits within MINIMUM and MAXIMUM of the label; nothing in ten lines.
fn sample(line: u32, sample: u32) -> u16 {
    let wave = f64::from(line * 3 + sample * 2).mul_add(0.01, f64::from(line).sin());
    match line {
        20..30 => 0,
        _ => (80.0 + 40.0 * wave.sin()) as u16,
    }
}

/// How samples are stored.
#[derive(Clone, Copy, PartialEq)]
enum Samples {
    Msb,
    Lsb,
}

/// The image as the archive has it, `later_s` seconds after it was.
fn image(folder: &Path, lines: u32, samples: Samples, later_s: f64) -> Vec<u8> {
    let mut label = fs::read_to_string(folder.join(LABEL)).unwrap();
    let records = LABEL_RECORDS[0] + LABEL_RECORDS[1] + lines as usize;
    let end = published_times(lines).duration_s();
    let stop = format!(
        "2008-02-08T12:{:02}:{:06.3}Z",
        8 + ((53.843 + end) / 60.0) as u32,
        (53.843 + end) % 60.0
    );
    for (from, to) in [
        ("= 15088\n", format!("= {lines}\n")),
        ("= 15095\n", format!("= {records}\n")),
        ("2008-02-08T12:12:10.561Z", stop),
    ] {
        assert!(label.contains(from), "{from}");
        label = label.replace(from, &to);
    }
    if samples == Samples::Lsb {
        label = label.replace("MSB_INTEGER", "LSB_INTEGER");
    }
    let mut bytes = label.into_bytes();
    bytes.resize(LABEL_RECORDS[0] * RECORD_BYTES, b' ');
    let vicar = format!(
        "LBLSIZE={}            FORMAT='HALF'  TYPE='IMAGE'  BUFSIZ={RECORD_BYTES}  DIM=3  EOL=0  RECSIZE={RECORD_BYTES}  ORG='BSQ'  \
         NL={lines}  NS={SAMPLES}  NB=1  N1={SAMPLES}  N2={lines}  NBB=68  NLB=0",
        LABEL_RECORDS[1] * RECORD_BYTES
    );
    bytes.extend(vicar.into_bytes());
    bytes.resize((LABEL_RECORDS[0] + LABEL_RECORDS[1]) * RECORD_BYTES, 0);
    let pieces = published();
    for line in 0..lines {
        let piece = pieces
            .iter()
            .rfind(|piece| piece.first_line <= line)
            .unwrap();
        let rows = f64::from(line - piece.first_line);
        let start_s = piece.start_et_s + rows * piece.line_period_s + later_s;
        bytes.extend(start_s.to_le_bytes());
        bytes.extend(((piece.line_period_s * 1e3) as f32).to_le_bytes());
        bytes.extend([7; 56]);
        for at in 0..SAMPLES {
            let sample = sample(line, at);
            bytes.extend(match samples {
                Samples::Msb => sample.to_be_bytes(),
                Samples::Lsb => sample.to_le_bytes(),
            });
        }
    }
    bytes
}

/// First byte of a row.
const fn row(line: usize) -> usize {
    (LABEL_RECORDS[0] + LABEL_RECORDS[1] + line) * RECORD_BYTES
}

/// A folder with the kernels, the image in so many lines, and a site file of it.
fn case(folder: &Path, lines: u32) -> Case {
    let case = Case::empty();
    for name in KERNELS {
        case.write(name, fs::read(folder.join(name)).unwrap());
    }
    case.write(
        "h5270_0000_ir2.img",
        image(folder, lines, Samples::Msb, 0.0),
    );
    let kernels = KERNELS.map(|name| format!("'{name}'")).join(", ");
    case.write(
        "site.toml",
        format!(
            "site = 'hrsc'\n[kernels]\nfiles = [{kernels}]\n[[images]]\nid = 'h5270_0000_ir2'\ninstrument = 'hrsc_ir'\n\
             label = 'h5270_0000_ir2.img'\npixels = 'h5270_0000_ir2.img'\nfirst_detector = 0\n"
        ),
    );
    case
}

fn info(path: &Path) -> Result<Value, String> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_areograph"));
    let output = command
        .args(["--quiet", "image", "info", "--json"])
        .arg(path)
        .output()
        .unwrap();
    if output.status.success() {
        let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
        Ok(answer[0].clone())
    } else {
        Err(String::from_utf8(output.stderr).unwrap())
    }
}

/// The rows that ISIS cropped stand 8 bytes behind where the label has them, and the label counts the records of a whole file.
#[test]
fn cropped_files_of_isis_are_refused_as_they_are() {
    for (file, expected) in [
        (
            "default/h0279_0000_re2_cropped.img",
            "the file has 17616 bytes; expected 31728, according to FILE_RECORDS and RECORD_BYTES",
        ),
        (
            "phobos/h7926_0009_s22_cropped.img",
            "TARGET_NAME is \"PHOBOS\"; expected MARS",
        ),
        (
            "projection/h6541_0000_ir4_cropped.img",
            "PROCESSING_LEVEL_ID is \"4\"; expected 2",
        ),
        (
            "srcImage/h2862_0006_sr2_cropped.img",
            "DETECTOR_ID is \"MEX_HRSC_SRC\"; expected one of the nine detector lines",
        ),
    ] {
        let Some(path) = real_data(&format!("isis_hrsc/{file}"), "cropped files of HRSC") else {
            return;
        };
        let told = info(&path).unwrap_err();
        assert!(told.contains(expected), "{file}: {told}");
    }
}

#[test]
fn rows_of_real_files_have_regular_times_and_samples_in_the_order_of_the_label() {
    let folder = tempfile::tempdir().unwrap();
    // First byte of the label's rows, records before them, size of a row; what the prefixes hold.
    for (file, [skipped, before, record], start_s, period_s) in [
        (
            "default/h0279_0000_re2_cropped.img",
            [4396, 7, 2644],
            134_593_775.811_068_6,
            10.240_967_75e-3,
        ),
        (
            "phobos/h7926_0009_s22_cropped.img",
            [4308, 3, 10_436],
            321_472_778.770_514_3,
            4.053_476_8e-3,
        ),
    ] {
        let Some(path) = real_data(&format!("isis_hrsc/{file}"), "rows of real files of HRSC")
        else {
            return;
        };
        // As they were before they were cropped, and of Mars.
        let cropped = fs::read(path).unwrap();
        let text = String::from_utf8_lossy(&cropped[..skipped - 4]);
        let pointer = text
            .lines()
            .find(|line| line.starts_with("^IMAGE "))
            .unwrap();
        let records = text
            .lines()
            .find(|line| line.starts_with("FILE_RECORDS"))
            .unwrap();
        let text = text
            .replace(pointer, &format!("^IMAGE = {}", before + 1))
            .replace(records, &format!("FILE_RECORDS = {}", before + 5))
            .replace("= PHOBOS", "= MARS");
        let mut bytes = format!("{}\r\nEND\r\n", text.trim_end()).into_bytes();
        bytes.resize(before * record, b' ');
        bytes.extend(&cropped[skipped..]);
        let path = folder.path().join("whole.img");
        fs::write(&path, &bytes).unwrap();
        let label = read_label(&path, all_instruments()).unwrap();
        let rows = label.lines.unwrap();
        assert_eq!(
            (rows.lines, rows.pieces.len(), rows.remarks.len()),
            (5, 1, 0)
        );
        let piece = rows.pieces[0];
        assert!((piece.start.seconds() - start_s).abs() < 1e-7); // seconds, printed digits
        assert!(
            (piece.period_s - period_s).abs() < 5e-8,
            "{}",
            piece.period_s
        ); // rounding of ET over four lines
        // By the least and the largest sample of the label, and by neighbours.
        let swapped = String::from_utf8_lossy(&bytes[..before * record])
            .replace("MSB_INTEGER", "LSB_INTEGER");
        for drop in ["", "IMUM"] {
            let swapped = if drop.is_empty() {
                swapped.clone()
            } else {
                swapped.replace(drop, "IMUN")
            };
            fs::write(&path, [swapped.as_bytes(), &cropped[skipped..]].concat()).unwrap();
            let told = read_label(&path, all_instruments())
                .unwrap_err()
                .to_string();
            assert!(
                told.contains("SAMPLE_TYPE is \"LSB_INTEGER\", but "),
                "{told}"
            );
        }
    }
}

#[test]
fn line_times_of_rows_are_the_published_ones() {
    let Some(folder) = real_data(FOLDER, "HRSC's line times of rows") else {
        return;
    };
    let case = case(&folder, LINES[0]);
    let kernels = KERNELS.map(|name| case.path(name));
    let session = Session::open(&KernelSet::from_files(&kernels).unwrap()).unwrap();
    let mut cameras = all_instruments().iter();
    let config = ImageConfig {
        id: "h5270_0000_ir2".to_owned(),
        instrument: cameras.find(|camera| camera.id == "hrsc_ir").cloned(),
        label: Some(case.path("h5270_0000_ir2.img")),
        fields: ImageFields {
            first_detector: Some(0),
            ..ImageFields::default()
        },
        ..ImageConfig::default()
    };
    let times = tag_times(&[config], &session).unwrap().remove(0);
    assert_eq!(times.start_from, StartFrom::Lines);
    assert_eq!(
        (times.remarks.len(), times.notes.len()),
        (0, 0),
        "{:?}",
        times.remarks
    );
    assert_eq!(
        (
            times.downtrack_summing,
            times.crosstrack_summing,
            times.samples
        ),
        (4, 4, SAMPLES)
    );
    let first: Vec<u32> = times
        .line_times
        .pieces()
        .map(|piece| piece.first_line)
        .collect();
    assert_eq!(first, [0, 6664, 6665]);
    let truth = published_times(LINES[0]);
    for line in 0..LINES[0] {
        let line = f64::from(line);
        let apart_s = times.line_times.et(line).since(truth.et(line));
        // Seconds: what the published pieces leave between the first and the second, which the times of the rows do not.
        assert!(apart_s.abs() < 2.8e-5, "{line}: {apart_s} s");
    }
}

#[test]
fn a_site_of_one_file_runs_and_a_long_image_follows_its_samples() {
    let Some(folder) = real_data(FOLDER, "HRSC's site by files of the archive") else {
        return;
    };
    let case = case(&folder, LINES[0]);
    let site = String::from_utf8(case.read("site.toml")).unwrap();
    let with_model = |model: &str| site.replace("[[images]]", &format!("{model}\n[[images]]"));
    case.write(
        "site.toml",
        with_model("[registration]\nmodel = 'rotation_vector'"),
    );
    let refused = case.outcome(case.run());
    let advice =
        "over 197 s an orbit departs from any second-order polynomial: remove registration.model";
    assert!(
        !refused.starts_with("exit 0") && refused.contains(advice),
        "{refused}"
    );
    // Which helps: the image follows its samples.
    case.write("site.toml", &site);
    let accepted = case.outcome(case.run());
    assert!(
        accepted.starts_with("exit 0")
            && accepted.contains("this image is interpolated between its samples"),
        "{accepted}"
    );
    let registration = json(&case.path("out/hrsc/registration.json"));
    assert_eq!(registration["images"][0]["model"], "samples");
    let manifest = json(&case.path("out/hrsc/manifest.json"));
    let checks = manifest["verdict"]["checks"].as_array().unwrap();
    let position = checks
        .iter()
        .find(|check| check["kind"] == "position_rmse")
        .unwrap();
    // Metres: an interpolation over 6.6 s of an orbit whose acceleration changes by 3 mm/s² a second.
    assert!(position["value"].as_f64().unwrap() < 0.1, "{position}");
    // Too few samples are noticed.
    case.write(
        "site.toml",
        with_model("[orientation]\nintervals = 3\nposition_rmse_max_m = 0.01"),
    );
    let coarse = case.outcome(case.run());
    assert!(
        !coarse.starts_with("exit 0") && coarse.contains("raise orientation.intervals"),
        "{coarse}"
    );
    case.write("site.toml", &site);
    succeed(&mut case.run());
    let orientation = json(&case.path("out/hrsc/images/h5270_0000_ir2/orientation.json"));
    assert_eq!(orientation["times"]["start_from"], "lines");
    let image = info(&case.path("h5270_0000_ir2.img")).unwrap();
    for (key, expected) in [
        ("product_id", Value::from("H5270_0000_IR2.IMG")),
        ("instrument", "hrsc_ir".into()),
        ("lines", 15_088.into()),
        ("samples", 1288.into()),
        ("lines_missing", 10.into()),
        ("complaint_count", 0.into()),
    ] {
        assert_eq!(image[key], expected, "{key}");
    }
    assert_eq!(image["exposures"].as_array().unwrap().len(), 3);
}

#[test]
fn samples_are_the_same_in_either_order_of_bytes() {
    let Some(folder) = real_data(FOLDER, "samples of HRSC's rows") else {
        return;
    };
    let case = case(&folder, LINES[1]);
    case.write("lsb.img", image(&folder, LINES[1], Samples::Lsb, 0.0));
    let [msb, lsb] = ["h5270_0000_ir2.img", "lsb.img"].map(|name| info(&case.path(name)).unwrap());
    assert_eq!(msb["pixels_blake3"], lsb["pixels_blake3"]);
    let numbers = |sample: fn(u32, u32) -> u16| -> Vec<u16> {
        (0..LINES[1])
            .flat_map(|line| (0..SAMPLES).map(move |at| sample(line, at)))
            .filter(|number| *number > 0)
            .collect()
    };
    let numbers = numbers(sample);
    let ends = [
        *numbers.iter().min().unwrap(),
        *numbers.iter().max().unwrap(),
    ];
    assert_eq!(
        msb["numbers_of_1_and_255"],
        serde_json::json!(ends.map(f64::from))
    );
    let mut extract = case.areograph();
    extract.args([
        "image",
        "extract",
        "h5270_0000_ir2.img",
        "--out",
        "picture.png",
        "--mask",
        "mask.png",
    ]);
    succeed(&mut extract);
    assert!(case.path("mask.png").exists());
}

/// What is said of a site after an edit of its files.
fn told_of(folder: &Path, edit: impl Fn(&Case)) -> String {
    let case = case(folder, LINES[1]);
    edit(&case);
    case.outcome(case.check())
}

/// The same words in the label, in as many bytes.
fn edit_label(case: &Case, from: &str, to: &str) {
    let mut bytes = case.read("h5270_0000_ir2.img");
    let end = row(0);
    let label = String::from_utf8(bytes[..end].to_vec()).unwrap();
    assert!(label.contains(from), "{from}");
    let mut label = label.replacen(from, to, 1);
    // The blanks behind the label take up the difference.
    let blanks = label.find("\nEnd\n").unwrap() + 5;
    while label.len() < end {
        label.insert(blanks, ' ');
    }
    while label.len() > end {
        assert_eq!(label.remove(blanks), ' ');
    }
    bytes.splice(..end, label.into_bytes());
    case.write("h5270_0000_ir2.img", bytes);
}

#[test]
fn a_part_of_the_image_is_valid_by_label_and_pixels() {
    let Some(folder) = real_data(FOLDER, "HRSC's file in a site") else {
        return;
    };
    let told = told_of(&folder, |_| {});
    assert!(told.starts_with("exit 0"), "{told}");
    // A label alone, with the pieces that nothing else tells.
    let told = told_of(&folder, |case| {
        let bytes = case.read("h5270_0000_ir2.img");
        case.write("alone.lbl", &bytes[..7_000]);
        case.replace(
            "site.toml",
            "label = 'h5270_0000_ir2.img'",
            "label = 'alone.lbl'\nexposures = [[0, 255744599.02748165, 12.800790786743165]]",
        );
    });
    assert!(told.starts_with("exit 0"), "{told}");
}

#[test]
fn labels_that_contradict_the_file_are_refused() {
    let Some(folder) = real_data(FOLDER, "contradicting labels of HRSC") else {
        return;
    };
    for (from, to, expected) in [
        (
            "_ID                  = MEX_HRSC_IR",
            "_ID = MEX_HRSC_S1",
            "instrument is \"HRSC MEX_HRSC_S1\"; expected HRSC MEX_HRSC_IR",
        ),
        (
            "PRODUCT_ID                   = H5270",
            "PRODUCT_ID = H5271",
            "but FILE_NAME is \"H5270_0000_IR2.IMG\"",
        ),
        (
            "MACROPIXEL_SIZE              = 4",
            "MACROPIXEL_SIZE = 3",
            "expected 1, 2, 4 or 8",
        ),
        (
            "MACROPIXEL_SIZE              = 4",
            "MACROPIXEL_SIZE = UNK",
            "downtrack_summing is neither in the label nor in the configuration",
        ),
        (
            "PROCESSING_LEVEL_ID          = 2",
            "PROCESSING_LEVEL_ID = 3",
            "PROCESSING_LEVEL_ID is \"3\"; expected 2",
        ),
        (
            "MSB_INTEGER",
            "LSB_INTEGER",
            "SAMPLE_TYPE is \"LSB_INTEGER\", but only the other byte order gives samples from 29 to 136",
        ),
        (
            "12:08:53.843Z",
            "12:08:55.843Z",
            "begins 2.000 s away from its utc_start",
        ),
        (
            "12:08:53.843Z",
            "12:08:53.853Z",
            "begins 0.010 s away from utc_start",
        ),
        (
            "= 407",
            "= 408",
            "expected 1078752, according to FILE_RECORDS",
        ),
        (
            "LINES              = 400",
            "LINES = 399",
            "399 rows of 2644 bytes, beginning at byte 18508, end at byte 1073464",
        ),
        (
            "LINE_PREFIX_BYTES  = 68",
            "LINE_PREFIX_BYTES = 0",
            "LINE_PREFIX_BYTES is \"0\"; expected 68",
        ),
        (
            "NL=400",
            "NL=401",
            "NL in the VICAR label is 401; expected 400",
        ),
        (
            "TARGET_NAME                  = MARS",
            "TARGET_NAME = PHOBOS",
            "expected MARS",
        ),
    ] {
        let told = told_of(&folder, |case| edit_label(case, from, to));
        assert!(told.contains(expected), "{to}: {told}");
    }
}

#[test]
fn keys_that_contradict_the_file_are_refused() {
    let Some(folder) = real_data(FOLDER, "contradicting keys of HRSC") else {
        return;
    };
    for (from, to, expected) in [
        (
            "'hrsc_ir'",
            "'hrsc_nd'",
            "instrument is \"HRSC MEX_HRSC_IR\"; expected HRSC MEX_HRSC_NADIR",
        ),
        (
            "instrument = 'hrsc_ir'\n",
            "",
            "instrument is \"HRSC MEX_HRSC_IR\"; expected MOC-NA",
        ),
        (
            "id = 'h5270",
            "id = 'h5271",
            "expected H5271_0000_IR2, which the image identifier names",
        ),
        (
            "first_detector = 0\n",
            "",
            "1288 samples of 4 pixels cover only part of the 5184 pixels of HRSC infrared line",
        ),
        (
            "first_detector = 0\n",
            "first_detector = 0\nlines_header = 300\n",
            "lines_header is 300, but the file of its label has 400 lines",
        ),
    ] {
        let told = told_of(&folder, |case| case.replace("site.toml", from, to));
        assert!(
            !told.starts_with("exit 0") && told.contains(expected),
            "{to}: {told}"
        );
    }
}

#[test]
fn damaged_and_exchanged_files_are_told() {
    let Some(folder) = real_data(FOLDER, "damaged files of HRSC") else {
        return;
    };
    let changed = |change: &dyn Fn(&mut Vec<u8>)| {
        told_of(&folder, |case| {
            let mut bytes = case.read("h5270_0000_ir2.img");
            change(&mut bytes);
            case.write("h5270_0000_ir2.img", bytes);
        })
    };
    let size = "according to FILE_RECORDS and RECORD_BYTES in its label";
    for (change, expected) in [
        (&|bytes: &mut Vec<u8>| bytes.truncate(row(399)) as _, size),
        (&|bytes: &mut Vec<u8>| bytes.truncate(row(399) + 7), size),
        (&|bytes: &mut Vec<u8>| bytes.resize(row(401), 0), size),
        // The time and the exposure of a line.
        (
            &|bytes: &mut Vec<u8>| bytes[row(100) + 4] ^= 0x10,
            "line 100: the time in its prefix differs",
        ),
        (
            &|bytes: &mut Vec<u8>| bytes[row(100) + 10] ^= 0x10,
            "line 100: the exposure in its prefix",
        ),
        (
            &|bytes: &mut Vec<u8>| bytes[row(100)..row(100) + 8].fill(0),
            "lines 100 to 100: no times in their prefixes",
        ),
        // Rows that do not begin where the label has them.
        (
            &|bytes: &mut Vec<u8>| {
                bytes.drain(row(0)..row(0) + 2);
                bytes.extend([0; 2]);
            },
            "0 of 400 rows have a time and an exposure",
        ),
    ] as [(&dyn Fn(&mut Vec<u8>), &str); 7]
    {
        let told = changed(change);
        assert!(told.contains(expected), "{expected}: {told}");
    }
    for (from, to, expected) in [
        (
            "pixels = 'h5270_0000_ir2.img'",
            "pixels = 'other.img'",
            "the exposure of its pixels begins at ET",
        ),
        (
            "label = 'h5270_0000_ir2.img'",
            "label = 'alone.lbl'",
            "the label states no line times",
        ),
        (
            "pixels = 'h5270_0000_ir2.img'",
            "pixels = 'alone.lbl'",
            "the file contains only a label",
        ),
        (
            "label = 'h5270_0000_ir2.img'",
            "label = 'h5271_0000_ir2.img'",
            "but the file name is \"h5271_0000_ir2.img\"",
        ),
    ] {
        let told = told_of(&folder, |case| {
            let bytes = case.read("h5270_0000_ir2.img");
            case.write("alone.lbl", &bytes[..7_000]);
            case.write("h5271_0000_ir2.img", &bytes);
            case.write("other.img", image(&folder, LINES[1], Samples::Msb, 100.0));
            case.replace("site.toml", from, to);
        });
        assert!(
            !told.starts_with("exit 0") && told.contains(expected),
            "{to}: {told}"
        );
    }
}
