//! Archived images: a real one compared with three other decoders, small ones of every coding, and damaged ones.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::disallowed_methods,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "helpers of tests work in temporary folders, may fail loudly, and make pixels of sines"
)]

use areograph_testing as common;

mod contradictions;
mod damage;
mod files;
mod vectors;

use std::path::Path;

use areograph_config::built_in_instruments;
use areograph_pds::image_file::{Coding, ImageFile, PixelStatistics, Predictor, Statistics};
use sha2::{Digest as _, Sha256};

use common::real_data;

/// All pixels, with the statistics and complaints of reading them.
fn read(path: &Path) -> (Vec<u8>, PixelStatistics, Vec<String>) {
    let image = ImageFile::open(path, built_in_instruments()).unwrap();
    let mut strips = image.strips().unwrap();
    let (mut pixels, mut statistics) = (Vec::new(), Statistics::default());
    while let Some(strip) = strips.next_strip().unwrap() {
        statistics.add(&strip);
        pixels.extend(strip.pixels);
    }
    let complaints = image
        .complaints()
        .kept()
        .iter()
        .chain(strips.complaints().kept());
    let complaints = complaints.map(ToString::to_string).collect();
    (pixels, statistics.finish(), complaints)
}

fn sha256(bytes: &[u8]) -> String {
    let hash = Sha256::digest(bytes);
    let digits: Vec<String> = hash.iter().map(|byte| format!("{byte:02x}")).collect();
    digits.concat()
}

/// Pixels of M01/00115 at samples 0, 167, 335, 503 and 671, by line.
const PIXELS: [(usize, [u8; 5]); 8] = [
    (0, [168, 173, 100, 149, 139]),
    (127, [154, 156, 146, 131, 146]),
    (128, [154, 151, 144, 129, 142]),
    (1216, [163, 203, 200, 157, 151]),
    (2432, [189, 146, 182, 175, 172]),
    (3071, [160, 157, 194, 172, 166]),
    (4095, [168, 171, 153, 147, 141]),
    (4863, [172, 149, 160, 148, 143]),
];

/// Sum of the pixels of each 128 lines of M01/00115.
const BANDS: [u64; 38] = [
    12_481_980, 12_856_745, 13_496_233, 13_114_744, 12_632_154, 12_924_077, 13_045_189, 13_344_650,
    13_698_102, 13_870_084, 13_851_128, 13_929_810, 13_752_738, 13_128_267, 12_724_863, 12_743_612,
    13_374_703, 13_951_422, 14_185_747, 14_220_615, 14_097_277, 13_808_853, 13_970_245, 14_338_823,
    13_872_021, 13_075_855, 12_999_555, 12_956_175, 13_034_894, 13_241_584, 13_009_183, 12_988_636,
    13_252_609, 13_351_017, 13_299_905, 13_365_447, 13_356_200, 13_148_018,
];

#[test]
fn the_real_image_is_what_three_other_decoders_made_of_it() {
    let test = "the_real_image_is_what_three_other_decoders_made_of_it";
    let Some(path) = real_data("asp_moc/M0100115.imq", test) else {
        return;
    };
    let image = ImageFile::open(&path, built_in_instruments()).unwrap();
    let layout = image.layout();
    assert_eq!(
        (layout.lines, layout.samples, layout.fragments),
        (4864, 672, 8)
    );
    let coding = Coding::Predictive {
        predictor: Predictor::X,
        table: 5,
    };
    assert_eq!(layout.coding, Some(coding));
    assert_eq!(image.value("GAIN_MODE_ID"), Some("6A"));
    let (pixels, statistics, complaints) = read(&path);
    assert!(complaints.is_empty(), "{complaints:?}");
    assert_eq!(
        sha256(&pixels),
        "3f1c5dddbe36907b8aa21bcbb5eca5d010867c4f4db123373fc42e545b34c8da"
    );
    for (line, values) in PIXELS {
        for (sample, value) in [0, 167, 335, 503, 671].into_iter().zip(values) {
            assert_eq!(
                pixels[line * 672 + sample],
                value,
                "line {line}, sample {sample}"
            );
        }
    }
    let bands = pixels
        .chunks(128 * 672)
        .map(|band| band.iter().map(|pixel| u64::from(*pixel)).sum());
    assert_eq!(bands.collect::<Vec<u64>>(), BANDS);
    let expected = PixelStatistics {
        lines_good: 4864,
        lines_suspect: 0,
        lines_missing: 0,
        minimum: Some(0),
        maximum: Some(238),
        mean: Some(508_493_160.0 / 3_268_608.0),
        standard_deviation: statistics.standard_deviation,
        median: Some(155),
        sum: 508_493_160,
        distinct: 237,
        zeros: 655,
        blake3: "ea648275c119c0c4789edeac35c6926802303a88a9f5da4421d8f4f5b6f1f0aa".to_owned(),
    };
    assert_eq!(statistics, expected);
    // Printed to five digits.
    assert!((statistics.standard_deviation.unwrap() - 20.611_34).abs() < 5e-6);
}

#[test]
fn a_plain_raster_is_read_from_where_its_label_points() {
    let folder = tempfile::tempdir().unwrap();
    let pixels: Vec<u8> = (0..48 * 20)
        .map(|number: u32| number.to_le_bytes()[0])
        .collect();
    for (pointer, start) in [("3", 1200), ("1201 <BYTES>", 1200)] {
        let path = files::write_raster(folder.path(), pointer, start, 48, &pixels);
        let (found, statistics, complaints) = read(&path);
        assert_eq!((found, complaints), (pixels.clone(), Vec::new()));
        assert_eq!((statistics.lines_good, statistics.zeros), (20, 4));
    }
    // An incomplete line is missing.
    let path = files::write_raster(folder.path(), "3", 1200, 48, &pixels[..48 * 7 + 24]);
    let (found, _, complaints) = read(&path);
    assert_eq!(found, pixels[..48 * 7]);
    assert_eq!(
        complaints,
        ["byte 1560, line 7: 7 lines found; the header states 20"]
    );
}

#[test]
fn what_is_no_image_is_refused_with_what_was_expected() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |label: &str, pixels: usize| {
        let path = folder.path().join("refused.imq");
        let mut bytes = label.as_bytes().to_vec();
        bytes.resize(2048 + pixels, b' ');
        std::fs::write(&path, bytes).unwrap();
        let failure = ImageFile::open(&path, built_in_instruments()).unwrap_err();
        assert_eq!(failure.kind().exit_code(), 3);
        failure.cause.to_string()
    };
    let head = "INSTRUMENT_ID = MOC-NA\nRECORD_BYTES = 2048\n";
    let image = "OBJECT = IMAGE\nLINES = 16\nLINE_SAMPLES = 16\nEND_OBJECT\nEND\n";
    for (label, pixels, message) in [
        (
            format!("{head}{image}"),
            10,
            "the label describes no image in this file: ^IMAGE is missing",
        ),
        (
            format!("{head}^IMAGE = 3\n{image}"),
            10,
            "^IMAGE is \"3\"; expected a record or byte of this file, which has 2058 bytes",
        ),
        (
            format!("{head}^IMAGE = 2\nENCODING_TYPE = X\n{image}"),
            300,
            "no fragment of this image at byte 2048 or later",
        ),
        (
            format!("{head}^IMAGE = 2\nSAMPLE_BITS = 16\n{image}"),
            300,
            "SAMPLE_BITS is \"16\"; expected 8",
        ),
        (
            format!("{head}^IMAGE = 2\n"),
            0,
            "the label has no END; expected this statement after the last line",
        ),
    ] {
        assert_eq!(refused(&label, pixels), message);
    }
}
