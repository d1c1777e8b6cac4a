//! Decodes an image of the Mars Orbiter Camera (`.imq`) into a portable grey map (PGM) on standard output. Lines that
//! are missing are black.
//!
//! `cargo run --package areograph-pds --example decode -- m0100115.imq >m0100115.pgm`
#![allow(clippy::print_stderr, reason = "an example prints")]

use std::{
    env,
    error::Error,
    io::{Write as _, stdout},
    path::Path,
    process::ExitCode,
};

use areograph_config::all_instruments;
use areograph_pds::image_file::ImageFile;

fn main() -> ExitCode {
    let Some(path) = env::args().nth(1) else {
        eprintln!("usage: decode FILE");
        return ExitCode::from(2);
    };
    match decode(Path::new(&path)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn decode(path: &Path) -> Result<(), Box<dyn Error>> {
    let image = ImageFile::open(path, all_instruments())?;
    let mut pixels = Vec::new();
    let mut strips = image.strips()?;
    while let Some(strip) = strips.next_strip()? {
        pixels.extend_from_slice(&strip.pixels);
    }
    let samples = image.samples();
    let lines = pixels.len() / samples.max(1) as usize;
    let mut out = stdout().lock();
    write!(out, "P5\n{samples} {lines}\n255\n")?;
    out.write_all(&pixels)?;
    Ok(())
}
