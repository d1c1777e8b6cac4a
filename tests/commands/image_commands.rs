//! `areograph image` as its users call it: what it says of images, the pictures it writes, and what it finds in an index.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::disallowed_methods,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "helpers of tests work in temporary folders, may fail loudly, and make pixels of sines"
)]

use crate::common;

mod control;
mod index;
mod kernels;
mod readers;

use std::{
    fs::{self, File},
    path::{Path, PathBuf},
    process::{Command, Output},
};

use areograph::pds::image_file::{Coding, Predictor, encode};
use serde_json::Value;
use tiff::{decoder::Decoder, tags::Tag};

use common::{moc_file::new_image, real_data};

fn areograph(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_areograph"))
        .args(["--quiet", "image"])
        .args(arguments)
        .output()
        .unwrap()
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn stdout(output: &Output) -> String {
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8(output.stdout.clone()).unwrap()
}

/// An unsummed image of 640 × 320 pixels whose even samples (counted from 1) are 6 higher than the odd ones.
fn write_image(folder: &Path) -> (PathBuf, Vec<u8>) {
    let pixel =
        |line: usize, sample: usize| (60 + (line / 3 + sample / 7) % 90 + 6 * (sample % 2)) as u8;
    let pixels: Vec<u8> = (0..320)
        .flat_map(|line| (0..640).map(move |sample| pixel(line, sample)))
        .collect();
    let coding = Coding::Predictive {
        predictor: Predictor::X,
        table: 3,
    };
    let image = new_image(640, 1, &pixels, coding);
    let path = folder.join("m0100123.imq");
    fs::write(&path, encode(&image).unwrap()).unwrap();
    (path, pixels)
}

#[test]
fn info_of_the_real_image_has_the_figures_of_its_truth() {
    let test = "info_of_the_real_image_has_the_figures_of_its_truth";
    let Some(path) = real_data("asp_moc/M0100115.imq", test) else {
        return;
    };
    let answer: Value =
        serde_json::from_str(&stdout(&areograph(&["info", "--json", text(&path)]))).unwrap();
    let image = &answer[0];
    let expected = [
        ("lines", Value::from(4864)),
        ("samples", 672.into()),
        ("minimum", 0.into()),
        ("maximum", 238.into()),
        ("lines_missing", 0.into()),
        ("complaint_count", 0.into()),
        ("product_id", "M01/00115".into()),
        ("instrument", "moc_na".into()),
        ("coding", "predictive, X, table 5".into()),
        (
            "pixels_blake3",
            "ea648275c119c0c4789edeac35c6926802303a88a9f5da4421d8f4f5b6f1f0aa".into(),
        ),
    ];
    for (key, value) in expected {
        assert_eq!(image[key], value, "{key}");
    }
    // Printed to nine digits.
    assert!((image["mean"].as_f64().unwrap() - 155.568_719_161).abs() < 5e-10);
    let told = stdout(&areograph(&["info", text(&path)]));
    assert!(
        told.contains("Valley and streamlined landforms--Galaxias"),
        "{told}"
    );
}

#[test]
fn a_damaged_image_is_told_with_its_place_and_a_file_that_is_none_fails() {
    let folder = tempfile::tempdir().unwrap();
    let (path, _) = write_image(folder.path());
    let mut bytes = fs::read(&path).unwrap();
    bytes[40_000] ^= 8;
    fs::write(&path, &bytes).unwrap();
    let none = folder.path().join("none.imq");
    fs::write(&none, "no label").unwrap();
    let output = areograph(&["info", text(&none), text(&path)]);
    assert_eq!(output.status.code(), Some(3));
    let told = String::from_utf8_lossy(&output.stdout);
    assert!(
        told.contains("fragment 0, byte 2048: the checksum byte is wrong"),
        "{told}"
    );
    assert!(told.contains("lines_suspect"), "{told}");
    let refused = String::from_utf8_lossy(&output.stderr);
    assert!(refused.contains("none.imq: no label found"), "{refused}");
}

/// Pixels of a PNG.
fn read_png(path: &Path) -> (u32, u32, png::BitDepth, Vec<u8>) {
    let file = std::io::BufReader::new(File::open(path).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let frame = reader.next_frame(&mut pixels).unwrap();
    (frame.width, frame.height, frame.bit_depth, pixels)
}

#[test]
fn extracted_pictures_hold_the_pixels_and_overviews_their_means() {
    let folder = tempfile::tempdir().unwrap();
    let (path, pixels) = write_image(folder.path());
    let [png_path, tiff_path, mask] =
        ["image.png", "image.tif", "mask.png"].map(|name| folder.path().join(name));
    stdout(&areograph(&[
        "extract",
        text(&path),
        "--out",
        text(&png_path),
        "--mask",
        text(&mask),
    ]));
    assert_eq!(
        read_png(&png_path),
        (640, 320, png::BitDepth::Eight, pixels.clone())
    );
    assert!(read_png(&mask).3.iter().all(|value| *value == 255));
    stdout(&areograph(&[
        "extract",
        text(&path),
        "--out",
        text(&tiff_path),
    ]));
    let mut tiff = Decoder::new(File::open(&tiff_path).unwrap()).unwrap();
    let mut sizes = Vec::new();
    loop {
        let (width, height) = tiff.dimensions().unwrap();
        let tiff::decoder::DecodingResult::U8(level) = tiff.read_image().unwrap() else {
            panic!("8 bits");
        };
        assert_eq!(level.len(), (width * height) as usize);
        if sizes.is_empty() {
            assert_eq!(level, pixels);
        } else {
            // Rounding, twice at most.
            let [mean, expected] = [&level, &pixels]
                .map(|all| all.iter().map(|p| f64::from(*p)).sum::<f64>() / all.len() as f64);
            assert!((mean - expected).abs() < 1.0, "{mean} for {expected}");
        }
        assert_eq!(tiff.get_tag_u32(Tag::TileWidth).unwrap(), 256);
        sizes.push((width, height));
        if !tiff.more_images() {
            break;
        }
        tiff.next_image().unwrap();
    }
    assert_eq!(sizes, [(640, 320), (320, 160), (160, 80)]);
}

#[test]
fn calibrated_pictures_have_no_offset_between_odd_and_even_samples() {
    let folder = tempfile::tempdir().unwrap();
    let (path, _) = write_image(folder.path());
    let out = folder.path().join("calibrated.png");
    stdout(&areograph(&[
        "extract",
        text(&path),
        "--out",
        text(&out),
        "--calibrate",
    ]));
    let (width, _, depth, bytes) = read_png(&out);
    assert_eq!((width, depth), (640, png::BitDepth::Sixteen));
    let values: Vec<f64> = bytes
        .chunks_exact(2)
        .map(|pair| f64::from(u16::from_be_bytes([pair[0], pair[1]])))
        .collect();
    let mean = |odd: usize| {
        let all = values.iter().skip(odd).step_by(2);
        all.sum::<f64>() / (values.len() / 2) as f64
    };
    // 287 numbers make 65535 steps: a number is 228 of them. Odd and even samples differed by 6 of them.
    assert!(
        (mean(0) - mean(1)).abs() < 0.05 * 228.0,
        "{} {}",
        mean(0),
        mean(1)
    );
    let file = std::io::BufReader::new(File::open(&out).unwrap());
    let reader = png::Decoder::new(file).read_info().unwrap();
    let notes: Vec<&str> = reader
        .info()
        .uncompressed_latin1_text
        .iter()
        .map(|note| &*note.text)
        .collect();
    assert!(
        notes
            .iter()
            .any(|note| note.contains("an unknown constant") && note.contains(" 3.00")),
        "{notes:?}"
    );
}

#[test]
fn an_image_whose_gain_changes_is_not_calibrated() {
    let folder = tempfile::tempdir().unwrap();
    let (path, _) = write_image(folder.path());
    let mut bytes = fs::read(&path).unwrap();
    // Bytes 38 and 39 of the header: further pairs of gain and offset. The checksum byte is damage of its own.
    bytes[2048 + 38] = 3;
    fs::write(&path, bytes).unwrap();
    let told = stdout(&areograph(&["info", "--json", text(&path)]));
    let answer: Value = serde_json::from_str(&told).unwrap();
    assert_eq!(answer[0]["gain_changes"], 3);
    let out = folder.path().join("out.png");
    let output = areograph(&["extract", text(&path), "--out", text(&out), "--calibrate"]);
    assert_eq!(output.status.code(), Some(3));
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(told.contains("gain and offset change 3 times"), "{told}");
    stdout(&areograph(&["extract", text(&path), "--out", text(&out)]));
}

#[test]
fn pictures_of_other_formats_are_refused_before_anything_is_read() {
    let output = areograph(&["extract", "nothing.imq", "--out", "image.jpg"]);
    assert_eq!(output.status.code(), Some(2));
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(
        told,
        "error: image.jpg; expected the extension .png, .tif or .tiff\n  what to do: name the file with one of these extensions\n"
    );
}

#[test]
fn a_picture_takes_the_place_of_nothing_that_is_read_or_written() {
    let folder = tempfile::tempdir().unwrap();
    let (path, _) = write_image(folder.path());
    let place = |name: &str| folder.path().join(name);
    let image = place("image.png");
    stdout(&areograph(&["extract", text(&path), "--out", text(&image)]));
    let before = fs::read(&image).unwrap();
    let other = place("other.png");
    fs::create_dir(place("in")).unwrap();
    let around = place("in/../other.png");
    for [out, mask] in [[&image, &other], [&other, &image], [&other, &around]] {
        let pictures = ["--out", text(out), "--mask", text(mask)];
        let output = areograph(&[&["extract", text(&image)], &pictures[..]].concat());
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains("would be written "), "{said}");
        assert!(fs::read(&image).unwrap() == before && !other.exists());
    }
}
