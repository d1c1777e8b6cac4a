//! Bytes to typed records and back: MOLA PEDR files, images of MOC and HRSC and their labels, image support data, tie points,
//! terrain models.

pub mod archive;
pub mod calibration_tables;
mod hrsc;
pub mod image_file;
pub mod image_index;
mod image_label;
pub mod isd;
pub mod label;
pub mod moc;
pub mod pedr;
pub mod pedr_table;
pub mod pixel_file;
pub mod plane_tables;
mod read_label;
pub mod shot_table;
pub mod table_rows;
pub mod terrain_model;
pub mod ties;

pub use image_label::{ImageLabel, RowTimes};
pub use read_label::{product_named, read_label};
