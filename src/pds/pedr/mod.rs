//! MOLA Precision Experiment Data Records (PEDR): `AP#####v.B`, a label of ten records and then one
//! 776-byte record per frame of 20 shots.
//!
//! # Source
//! PEDR SIS 2.8 as far as its format files are public, and the MOLA team's reader `pedr2tab`.

mod check;
mod complaint;
mod encode;
mod file;
mod frame;
mod frame_values;
mod label;
mod mid_point;
mod reader;
mod record;
mod writer;

pub use check::{Reason, RecordError};
pub use complaint::Complaint;
pub use file::File;
pub use frame::{FieldGuard, Frame};
pub use frame_values::{EncodeError, FrameValues};
pub use label::{FileName, PedrLabel, decide_datum};
pub use mid_point::MidPoint;
pub use reader::{Reader, Stretch};
pub use record::{RECORD_BYTES, Record};
pub use writer::{LabelInfo, PedrWriter};

use crate::units::RADIANS_PER_DEGREE;

/// Number of the rules by which records are judged and their places told: raised when a record is complained of otherwise
/// than before, so that an index made by other rules is made anew.
pub const RULES: u32 = 1;
/// Shots in a frame.
pub const SHOTS: usize = 20;
/// Records that the attached label takes.
pub const LABEL_RECORDS: usize = 10;
/// Bytes that the attached label takes.
pub const LABEL_BYTES: usize = LABEL_RECORDS * RECORD_BYTES;
/// Unit of the parallax fields, radians per metre.
const PARALLAX_UNIT_RAD_PER_M: f64 = RADIANS_PER_DEGREE * 1e-9;
