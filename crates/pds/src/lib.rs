//! Bytes to typed records and back: MOLA PEDR files, images of MOC and HRSC and their labels, image support data, tie points,
//! terrain models.
//!
//! | to read | use |
//! |---|---|
//! | a PEDR file | [`pedr::File`] |
//! | an archive of them, by windows | [`archive`] |
//! | the label of an image | [`read_label()`] |
//! | the pixels of a MOC image; of any image | [`image_file::ImageFile`]; [`pixel_file::PixelFile`] |
//! | image support data (ISD); an oriented cube of ISIS | [`isd`]; [`oriented_cube`] |
//! | tables of shots, tie points, control points | [`shot_table`], [`ties`], [`calibration_tables`] |
//!
//! ```
//! use std::{fs, path::Path};
//!
//! use areograph_pds::pedr::{FieldGuard, File};
//!
//! let name = Path::new("../../tests/pedr_table/AP00002L.B");
//! let file = File::from_bytes(fs::read(name).unwrap(), name);
//! let guard = FieldGuard::new(file.label().software_version);
//! // The records of this invented file contradict themselves: each is refused with its reason, none is lost in silence.
//! for (row, frame) in file.frames(file.rows(), guard) {
//!     let error = frame.unwrap_err();
//!     let complaint = file.record_complaint(row, &error).to_string();
//!     assert!(complaint.starts_with("AP00002L.B record 1"));
//!     assert!(complaint.contains("expected"));
//! }
//! ```
//!
//! A sound frame has up to 20 shots: `examples/shots.rs` lists the shots of a file, `examples/decode.rs` decodes an
//! image.

pub mod archive;
pub mod calibration_tables;
pub mod control_table;
mod file_size;
mod hrsc;
pub mod image_file;
pub mod image_index;
mod image_label;
pub mod index_columns;
pub mod isd;
pub mod label;
pub mod moc;
pub mod oriented_cube;
pub mod pedr;
pub mod pedr_table;
pub mod pixel_file;
pub mod plane_tables;
mod read_label;
pub mod shot_table;
pub mod table_rows;
pub mod terrain_model;
pub mod ties;

pub use file_size::SizedFile;
pub use image_label::{ImageLabel, RowTimes};
pub use read_label::{product_named, read_label};
