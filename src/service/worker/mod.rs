//! Worker processes: the same program, one task each, JSON lines between it and the service.
//!
//! CSPICE, memory and crashes stay in there.

pub mod protocol;
