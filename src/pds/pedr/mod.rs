//! MOLA Precision Experiment Data Records (PEDR): `AP#####v.B`, a label of ten records and then one
//! 776-byte record per frame of 20 shots.
//!
//! # Source
//! PEDR SIS 2.8 as far as its format files are public, and the MOLA team's reader `pedr2tab`.

mod encode;
mod record;
mod writer;

pub use encode::{EncodeFault, FrameValues};
pub use record::{RECORD_BYTES, Record};
pub use writer::{LabelInfo, PedrWriter};

/// Shots in a frame.
pub const SHOTS: usize = 20;
/// Records that the attached label takes.
pub const LABEL_RECORDS: usize = 10;
/// Bytes that the attached label takes.
pub const LABEL_BYTES: usize = LABEL_RECORDS * RECORD_BYTES;
