//! CSPICE behind one fence: kernels in, times, states, attitudes and tabulated trajectories out.
//!
//! | to | use |
//! |---|---|
//! | choose and check kernels | [`KernelSet`] |
//! | show a stage some of them | [`KernelView`] |
//! | ask CSPICE | [`Session`], one at a time in a process |
//! | know where the gaps are | [`Session::coverage`], [`Session::require_position`], [`Session::require_attitude`] |
//! | leave CSPICE behind, for parallel work | [`Session::trajectory`] |
//! | write kernels: of an invented mission, of adjusted orientations | [`write_spk`], [`write_ck`], [`write_encoded_ck`] |
//!
//! Kilometres become metres here, and nowhere else.

mod coverage;
mod daf;
mod error;
mod ffi;
mod gaps;
mod kernels;
mod metakernel;
mod needs;
mod origin;
mod role;
mod select;
mod session;
mod text_kernel;
mod trajectory;
mod view;
mod write;

pub use coverage::{Coverage, RequiredCoverage};
pub use error::SpiceError;
pub use ffi::PATH_LENGTH_MAX;
pub use kernels::{Kernel, KernelSet};
pub use role::KernelRole;
pub use select::quality_of;
pub use session::{Attitude, Session, State};
pub use trajectory::Trajectory;
pub use view::{KernelView, position_kernels};
pub use write::{CkSegment, EncodedCkSegment, SpkSegment, write_ck, write_encoded_ck, write_spk};
