//! What another reading of images that do not meet along the flight says.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What the other reading says.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct OtherReading {
    /// Whether it is the one with an offset of the attitude's clock.
    pub attitude_clock: bool,
    /// Its tie points minus those of the adjustment towards east, north and up, mean, metres.
    pub moved_m: [f64; 3],
    /// Tie points that both have.
    pub ties: usize,
}
