//! The other reading of the disagreement of images, in the document of an adjustment.

use schemars::JsonSchema;
use serde::Serialize;

use areograph_base::schema::{at, none_negative};
use areograph_stages::adjust::OtherReading;

/// Positions of the tie points in the other reading of the disagreement between images.
#[derive(Serialize, JsonSchema)]
pub(super) struct OtherReadingDocument {
    /// Offset of the attitude clock, with its standard deviation, if the other reading assumes this offset.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = at("/prefixItems/1", "minimum", 0))]
    attitude_clock_s: Option<(f64, f64)>,
    /// Mean position of the tie points in the other reading minus their adjusted mean position, east, north and up,
    /// metres.
    moved_m: [f64; 3],
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = none_negative)]
    mean_sigma_m: Option<[f64; 3]>,
}

impl From<&OtherReading> for OtherReadingDocument {
    fn from(other: &OtherReading) -> Self {
        Self {
            attitude_clock_s: other.attitude_clock_s,
            moved_m: other.moved_m,
            mean_sigma_m: other.mean_sigma_m,
        }
    }
}
