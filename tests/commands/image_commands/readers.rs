//! Cubes and pictures in the place of images of the archive.

use std::{fs, path::Path};

use serde_json::Value;

use super::{areograph, stdout, text, write_image};

/// Size of the cubes: neither is a multiple of the edge of a tile.
const LINES: usize = 300;
const SAMPLES: usize = 200;
const TILE: usize = 128;

fn info(path: &Path) -> Value {
    let answer: Value =
        serde_json::from_str(&stdout(&areograph(&["info", "--json", text(path)]))).unwrap();
    answer[0].clone()
}

/// A cube of ISIS with these numbers, in tiles or line by line.
fn cube(kind: &str, order: &str, is_tiled: bool, numbers: &[Vec<u8>]) -> Vec<u8> {
    let format = if is_tiled {
        format!("Tile\n    TileSamples = {TILE}\n    TileLines = {TILE}")
    } else {
        "BandSequential".to_owned()
    };
    let label = format!(
        "Object = IsisCube\n  Object = Core\n    StartByte = 4097\n    Format = {format}\n\
         Group = Dimensions\n Samples = {SAMPLES}\n Lines = {LINES}\n Bands = 1\n End_Group\n\
         Group = Pixels\n Type = {kind}\n ByteOrder = {order}\n Base = 0.0\n Multiplier = 1.0\n End_Group\n\
         End_Object\nEnd_Object\nEnd\n"
    );
    let mut file = label.into_bytes();
    file.resize(4096, b' ');
    if !is_tiled {
        file.extend(numbers.concat());
        return file;
    }
    let bytes = numbers[0].len();
    for top in (0..LINES).step_by(TILE) {
        for left in (0..SAMPLES).step_by(TILE) {
            for line in top..top + TILE {
                for sample in left..left + TILE {
                    let is_inside = line < LINES && sample < SAMPLES;
                    let filler = vec![0xEE; bytes];
                    file.extend(if is_inside {
                        &numbers[line * SAMPLES + sample]
                    } else {
                        &filler
                    });
                }
            }
        }
    }
    file
}

fn pixel(place: usize) -> u8 {
    (1 + (place / SAMPLES / 2 + place % SAMPLES) % 250) as u8
}

#[test]
fn cubes_of_bytes_have_the_same_pixels_in_tiles_and_line_by_line() {
    let folder = tempfile::tempdir().unwrap();
    let pixels: Vec<u8> = (0..LINES * SAMPLES).map(pixel).collect();
    let expected = blake3::hash(&pixels).to_hex().to_string();
    let numbers: Vec<Vec<u8>> = pixels.iter().map(|pixel| vec![*pixel]).collect();
    for is_tiled in [true, false] {
        let path = folder.path().join("image.cub");
        fs::write(&path, cube("UnsignedByte", "Lsb", is_tiled, &numbers)).unwrap();
        let answer = info(&path);
        assert_eq!(answer["pixels_blake3"], expected, "{is_tiled}");
        assert_eq!(
            (&answer["lines"], &answer["samples"]),
            (&LINES.into(), &SAMPLES.into())
        );
        assert_eq!(answer["numbers_of_1_and_255"], Value::Null);
        // As a picture, and that as a file of pixels again.
        for ending in ["png", "tif"] {
            let out = folder.path().join(format!("out.{ending}"));
            stdout(&areograph(&["extract", text(&path), "--out", text(&out)]));
            assert_eq!(info(&out)["pixels_blake3"], expected, "{ending}");
        }
    }
}

#[test]
fn numbers_of_two_and_four_bytes_are_spread_and_special_ones_are_none() {
    let folder = tempfile::tempdir().unwrap();
    let values = |place: usize| match place {
        0 => f64::NAN,
        1 => -1_000.0,
        2 => 4_080.0,
        place => 20.0 * f64::from(pixel(place)) - 1_000.0,
    };
    let shown = |place: usize| {
        let share = (values(place) + 1_000.0) / 5_080.0;
        if place == 0 {
            0
        } else {
            (1.0 + 254.0 * share).round() as u8
        }
    };
    let pixels: Vec<u8> = (0..LINES * SAMPLES).map(shown).collect();
    let expected = blake3::hash(&pixels).to_hex().to_string();
    for (kind, order) in [
        ("SignedWord", "Lsb"),
        ("SignedWord", "Msb"),
        ("Real", "Lsb"),
        ("Real", "Msb"),
    ] {
        let number = |place: usize| {
            let value = values(place);
            let mut bytes = match kind {
                "Real" if value.is_nan() => 0xFF7F_FFFB_u32.to_le_bytes().to_vec(),
                "Real" => (value as f32).to_le_bytes().to_vec(),
                _ if value.is_nan() => (-32_768_i16).to_le_bytes().to_vec(),
                _ => (value as i16).to_le_bytes().to_vec(),
            };
            if order == "Msb" {
                bytes.reverse();
            }
            bytes
        };
        let numbers: Vec<Vec<u8>> = (0..LINES * SAMPLES).map(number).collect();
        let path = folder.path().join("image.cub");
        fs::write(&path, cube(kind, order, true, &numbers)).unwrap();
        let answer = info(&path);
        assert_eq!(answer["pixels_blake3"], expected, "{kind} {order}");
        assert_eq!(
            answer["numbers_of_1_and_255"],
            serde_json::json!([-1_000.0, 4_080.0])
        );
    }
}

#[test]
fn what_stands_in_for_an_image_is_refused_with_its_reason() {
    let folder = tempfile::tempdir().unwrap();
    let numbers = vec![vec![1]; LINES * SAMPLES];
    let whole = cube("UnsignedByte", "Lsb", true, &numbers);
    let replaced = |from: &str, to: &str| {
        let at = whole
            .windows(from.len())
            .position(|part| part == from.as_bytes())
            .unwrap();
        let mut bytes = whole.clone();
        bytes.splice(at..at + from.len(), to.bytes());
        bytes
    };
    let cases = [
        (
            whole[..whole.len() - 1].to_vec(),
            "the file has 102399 bytes; expected 102400, as its label states",
        ),
        (
            replaced("Bands = 1", "Bands = 3"),
            "BANDS is \"3\"; expected 1",
        ),
        (
            replaced("UnsignedByte", "Complex     "),
            "TYPE is \"complex\"; expected UnsignedByte, SignedWord",
        ),
        (
            replaced("Lines = 300", "Lines = -30"),
            "LINES is \"-30\"; expected a count from 1",
        ),
        (
            replaced("TileLines = 128", "TileLines = 0  "),
            "TILELINES is \"0\"; expected a count",
        ),
        (
            replaced("4097", "0000"),
            "STARTBYTE is \"0000\"; expected a byte of the file",
        ),
        (b"\x89PNG\r\n\x1a\nno picture".to_vec(), "PNG: "),
        (b"II*\0no picture".to_vec(), "TIFF: "),
    ];
    for (bytes, message) in cases {
        let path = folder.path().join("image.cub");
        fs::write(&path, bytes).unwrap();
        let output = areograph(&["info", text(&path)]);
        let told = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(3), "{told}");
        assert!(told.contains(message), "{message}: {told}");
    }
    // A picture in colour has no pixels of one band; the marks on an image are colour.
    let (image, _) = write_image(folder.path());
    let out = folder.path().join("out.png");
    stdout(&areograph(&["extract", text(&image), "--out", text(&out)]));
    let again = folder.path().join("again.tif");
    let output = areograph(&["extract", text(&out), "--out", text(&again), "--calibrate"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        String::from_utf8(output.stderr)
            .unwrap()
            .contains("--calibrate requires an image file of the archive")
    );
}
