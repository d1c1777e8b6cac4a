//! Decodes images of the camera on one core: pixels per second, and peak memory.
//!
//! `cargo bench --bench image [FILE…]`: without files, a synthetic image in every coding, written to the temporary folder.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::disallowed_methods,
    reason = "a benchmark may fail loudly, and makes pixels of sines"
)]

use areograph_testing::moc_file;
use std::{
    fs,
    hint::black_box,
    path::{Path, PathBuf},
    time::Instant,
};

use areograph::{
    config::built_in_instruments,
    pds::image_file::{Coding, ImageFile, Predictor, Transform, encode},
};

use moc_file::{new_image, peak_memory};

const SAMPLES: usize = 1024;
const LINES: usize = 10_240;
const ROUNDS: usize = 5;

/// Decodes an image; returns its number of pixels.
fn decode(path: &Path) -> usize {
    let image = ImageFile::open(path, built_in_instruments()).unwrap();
    let mut strips = image.strips().unwrap();
    let mut pixels = 0;
    while let Some(strip) = strips.next_strip().unwrap() {
        pixels += black_box(strip).pixels.len();
    }
    pixels
}

fn measure(name: &str, path: &Path) {
    let best_s = (0..ROUNDS)
        .map(|_| {
            let began = Instant::now();
            let pixels = decode(path);
            began.elapsed().as_secs_f64() / pixels as f64
        })
        .fold(f64::INFINITY, f64::min);
    println!(
        "{name}: {:.0} MB/s of pixels, {} KiB at most",
        1e-6 / best_s,
        peak_memory() >> 10
    );
}

fn write_synthetic(folder: &Path, coding: Coding) -> PathBuf {
    let pixel = |place: usize| {
        let (line, sample) = ((place / SAMPLES) as f64, (place % SAMPLES) as f64);
        // Relief of several sizes, and three bits of noise.
        let relief = (line / 41.0).sin() * 40.0 + (sample / 17.0 + line / 29.0).cos() * 30.0;
        let noise = (place as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 61;
        (120.0 + relief) as u8 + noise as u8
    };
    let pixels: Vec<u8> = (0..LINES * SAMPLES).map(pixel).collect();
    let image = new_image(SAMPLES as u32, 2, &pixels, coding);
    let path = folder.join("synthetic.imq");
    fs::write(&path, encode(&image).unwrap()).unwrap();
    path
}

fn main() {
    let files: Vec<PathBuf> = std::env::args_os()
        .skip(1)
        .map(PathBuf::from)
        .filter(|path| path.is_file())
        .collect();
    for path in &files {
        measure(&path.display().to_string(), path);
    }
    if files.is_empty() {
        let folder = std::env::temp_dir().join(format!("areograph-bench-{}", std::process::id()));
        fs::create_dir(&folder).unwrap();
        let predictor = Predictor::X;
        for (name, coding) in [
            ("raw", Coding::Raw),
            (
                "predictive, table 3",
                Coding::Predictive {
                    predictor,
                    table: 3,
                },
            ),
            (
                "predictive, table 5",
                Coding::Predictive {
                    predictor,
                    table: 5,
                },
            ),
            (
                "cosines",
                Coding::Transform {
                    transform: Transform::Cosine,
                    groups: 4,
                    spacing: 64,
                },
            ),
        ] {
            measure(name, &write_synthetic(&folder, coding));
        }
        fs::remove_dir_all(&folder).unwrap();
    }
}
