//! Bytes to typed records and back: MOLA PEDR files and the labels of MOC images.

pub mod label;
pub mod moc;
pub mod pedr;
