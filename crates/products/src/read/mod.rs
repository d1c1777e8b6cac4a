//! Reads published products into typed values, without the configuration or the run that made them.
//!
//! Only data needed for comparisons are read. Lengths are metres, times ET seconds, as in the files.

mod columns;
mod documents;
mod footprints;
mod orientation;
mod shots;
mod ties;

pub use documents::{
    AngleModel, ImageDocument, LengthModel, OrientationModel, ProfileDocument, RangesDocument,
    read_image, read_ranges,
};
pub use footprints::{FootprintRows, read_footprints};
pub use orientation::{SampleRow, read_samples};
pub(crate) use shots::{read_points, read_residuals};
pub use ties::read_adjusted_ties;

use areograph_base::error::Cause;

/// A complete product, but not in the form that this version writes.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Input: "if another version of areograph wrote the products, regenerate them with this version")]
pub(super) enum ReadError {
    /// Not Parquet, or not the document.
    #[error("cannot be read as {what}: {reason}")]
    Unreadable { what: &'static str, reason: String },
    /// A path of the camera needs at least two samples.
    #[error("has {found} samples; expected 2 or more")]
    TooFew { found: usize },
    /// A column is missing or of another type.
    #[error("column {name} is {found}; expected {expected}")]
    Column {
        name: &'static str,
        found: String,
        expected: &'static str,
    },
}

impl ReadError {
    /// For `map_err` on errors of decoding libraries.
    pub(super) fn unreadable<E: std::fmt::Display>(what: &'static str) -> impl Fn(E) -> Self {
        move |error| Self::Unreadable {
            what,
            reason: error.to_string(),
        }
    }
}
