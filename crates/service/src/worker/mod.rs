//! Worker processes: the same program, one task each, JSON lines between it and the service.
//!
//! CSPICE, memory and crashes stay in there.

mod fork;
mod lines;
mod log;
pub mod parent;
pub mod process;
pub mod protocol;
pub mod run_folder;
