//! MOLA Precision Experiment Data Records (PEDR): `AP#####v.B`, a label of ten records and then one
//! 776-byte record per frame of 20 shots.
//!
//! # Source
//! PEDR SIS 2.8 as far as its format files are public, and the MOLA team's reader `pedr2tab`.

mod bounds;
mod check;
mod chronology;
mod complaint;
mod counts;
mod elsewhere;
mod encode;
mod fault;
mod file;
mod foreign;
mod frame;
mod frame_values;
mod judge;
mod label;
mod mid_point;
mod neighbours;
mod quantity;
mod reader;
mod record;
mod shots;
mod stretch;
mod writer;

pub use complaint::Complaint;
pub use counts::Counts;
pub use fault::{Reason, RecordError};
pub use file::File;
pub use frame::{FieldGuard, Frame};
pub use frame_values::{EncodeError, FrameValues};
pub use label::{FileName, PedrLabel, decide_datum};
pub use mid_point::MidPoint;
pub use quantity::Quantity;
pub use reader::Reader;
pub use record::{RECORD_BYTES, Record};
pub use shots::SpoiledShots;
pub use stretch::Stretch;
pub use writer::{LabelInfo, PedrWriter};

use areograph_base::units::RADIANS_PER_DEGREE;

/// Version of the rules by which records are checked and located. It increases when complaints change, so that indexes
/// made by other rules are rebuilt.
pub const RULES: u32 = 2;
/// Shots in a frame.
pub const SHOTS: usize = 20;
/// Records of the attached label.
pub const LABEL_RECORDS: usize = 10;
/// Bytes of the attached label.
pub const LABEL_BYTES: usize = LABEL_RECORDS * RECORD_BYTES;
/// Unit of the parallax fields, radians per metre.
const PARALLAX_UNIT_RAD_PER_M: f64 = RADIANS_PER_DEGREE * 1e-9;
