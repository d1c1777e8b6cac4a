//! Bytes to typed records and back: MOLA PEDR files, the labels of MOC images, tie points.

pub mod archive;
pub mod label;
pub mod moc;
pub mod pedr;
pub mod pedr_table;
pub mod plane_tables;
pub mod ties;

pub use moc::{ImageLabel, product_named, read_label};
