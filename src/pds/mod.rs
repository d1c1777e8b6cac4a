//! Bytes to typed records and back: MOLA PEDR files, MOC images and their labels, image support data, tie points, terrain models.

pub mod archive;
pub mod calibration_tables;
pub mod image_file;
pub mod image_index;
pub mod isd;
pub mod label;
pub mod moc;
pub mod pedr;
pub mod pedr_table;
pub mod pixel_file;
pub mod plane_tables;
pub mod shot_table;
pub mod table_rows;
pub mod terrain_model;
pub mod ties;

pub use moc::{ImageLabel, product_named, read_label};
