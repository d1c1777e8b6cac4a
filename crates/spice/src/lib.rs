//! The interface to CSPICE: kernels in, times, states, attitudes and tabulated trajectories out.
//!
//! | to | use |
//! |---|---|
//! | choose and check kernels | [`KernelSet`] |
//! | show a stage some of the kernels | [`KernelView`] |
//! | call CSPICE | [`Session`], one at a time in a process |
//! | find gaps in coverage | [`Session::coverage`], [`Session::require_position`], [`Session::require_attitude`] |
//! | compute positions in parallel without CSPICE | [`Session::trajectory`] |
//! | write kernels: synthetic missions, adjusted orientations | [`write_spk`], [`write_ck`], [`write_encoded_ck`] |
//!
//! Kilometres are converted to metres here, and nowhere else.
//!
//! No other crate links CSPICE.
//!
//! ```
//! use std::path::PathBuf;
//!
//! use areograph_spice::{KernelSet, Session};
//!
//! # fn main() -> Result<(), areograph_base::error::Error> {
//! let leapseconds = PathBuf::from("../../kernels.example/leapseconds.tls");
//! let session = Session::open(&KernelSet::from_files(&[leapseconds])?)?;
//! let et = session.utc_to_et("2000-01-01T12:00:00")?;
//! // TDB is 64.184 s ahead of UTC, and within 2 ms of TT.
//! assert!((et.seconds() - 64.184).abs() < 2e-3);
//! # Ok(())
//! # }
//! ```
//!
//! `examples/state.rs` shows the state of the spacecraft at an instant.

mod apparent;
mod coverage;
mod daf;
mod error;
mod ffi;
mod gaps;
mod kernels;
mod leap_seconds;
mod metakernel;
mod mounting;
mod needs;
mod origin;
mod role;
mod select;
mod session;
mod state;
mod tabulated;
mod text_kernel;
mod trajectory;
mod utc_clock;
mod view;
mod write;

pub use coverage::{Coverage, RequiredCoverage};
pub use error::SpiceError;
pub use ffi::PATH_LENGTH_MAX;
pub use kernels::{Kernel, KernelSet};
pub use role::KernelRole;
pub use session::{Attitude, Session};
pub use state::State;
pub use trajectory::Trajectory;
pub use utc_clock::UtcClock;
pub use view::{KernelView, position_kernels};
pub use write::{CkSegment, EncodedCkSegment, SpkSegment, write_ck, write_encoded_ck, write_spk};
