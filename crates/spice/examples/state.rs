//! Prints the state of Mars Global Surveyor: position and velocity relative to Mars in J2000.
//!
//! `cargo run --package areograph-spice --example state -- 2001-02-03T04:05:06 naif0012.tls mgs.bsp de430.bsp`
#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "an example prints"
)]

use std::{env, path::PathBuf, process::ExitCode};

use areograph_base::error::Error;
use areograph_spice::{KernelSet, Session};

fn main() -> ExitCode {
    let mut arguments = env::args().skip(1);
    let Some(utc) = arguments.next() else {
        eprintln!("usage: state UTC KERNEL…");
        return ExitCode::from(2);
    };
    let kernels: Vec<PathBuf> = arguments.map(PathBuf::from).collect();
    match print(&utc, &kernels) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn print(utc: &str, kernels: &[PathBuf]) -> Result<(), Error> {
    let session = Session::open(&KernelSet::from_files(kernels)?)?;
    let et = session.utc_to_et(utc)?;
    let state = session.state(et)?;
    let [x, y, z] = state.position.xyz_m.into();
    let [vx, vy, vz]: [f64; 3] = state.velocity_m_s.into();
    println!("ET {:.6} s", et.seconds());
    println!("position {x:.3} {y:.3} {z:.3} m");
    println!("velocity {vx:.6} {vy:.6} {vz:.6} m/s");
    Ok(())
}
