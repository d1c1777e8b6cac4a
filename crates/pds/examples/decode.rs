//! Decodes an image of the Mars Orbiter Camera (`.imq`) into a portable grey map (PGM) on standard output. Missing
//! lines are black.
//!
//! `cargo run --package areograph-pds --example decode -- m0100115.imq >m0100115.pgm`
#![allow(clippy::print_stderr, reason = "an example prints")]

use std::{
    env,
    io::{self, Write as _},
    path::Path,
    process::ExitCode,
};

use areograph_base::error::{Error, IoError, Locate as _};
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

fn decode(path: &Path) -> Result<(), Error> {
    let image = ImageFile::open(path, all_instruments())?;
    let (mut samples, mut lines, mut pixels) = (0, 0, Vec::new());
    let mut strips = image.strips()?;
    while let Some(strip) = strips
        .next_strip()
        .map_err(IoError::on("read"))
        .in_file(path)?
    {
        samples = strip.samples;
        lines += strip.states.len();
        pixels.extend_from_slice(&strip.pixels);
    }
    write_map(samples, lines, &pixels)
        .map_err(IoError::on("write"))
        .in_file("standard output")
}

fn write_map(samples: u32, lines: usize, pixels: &[u8]) -> io::Result<()> {
    let mut out = io::stdout().lock();
    write!(out, "P5\n{samples} {lines}\n255\n")?;
    out.write_all(pixels)
}
