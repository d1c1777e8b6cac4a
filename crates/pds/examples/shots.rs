//! Prints the shots of a PEDR file: time, position in the datum of the file, and range.
//!
//! `cargo run --package areograph-pds --example shots -- ap19117l.b`
#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "an example prints"
)]

use std::{env, path::Path, process::ExitCode};

use areograph_base::{error::Error, units::RADIANS_PER_DEGREE};
use areograph_pds::pedr::{FieldGuard, File};

fn main() -> ExitCode {
    let Some(path) = env::args().nth(1) else {
        eprintln!("usage: shots FILE");
        return ExitCode::from(2);
    };
    match print(Path::new(&path)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn print(path: &Path) -> Result<(), Error> {
    let file = File::open(path)?;
    let guard = FieldGuard::new(file.label().software_version);
    println!("et_tag_s,longitude_deg,latitude_deg,range_m");
    for (row, frame) in file.frames(file.rows(), guard) {
        let frame = match frame {
            Ok(frame) => frame,
            Err(error) => {
                eprintln!("{}", file.record_complaint(row, &error));
                continue;
            }
        };
        for shot in (1..=20).filter_map(|shot| frame.shot(shot)) {
            println!(
                "{:.3},{:.5},{:.5},{:.2}",
                shot.et_tag_s,
                shot.longitude_rad / RADIANS_PER_DEGREE,
                shot.latitude_rad / RADIANS_PER_DEGREE,
                shot.range_m
            );
        }
    }
    Ok(())
}
