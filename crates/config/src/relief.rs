//! Use of relief for the horizontal position.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Whether heights of tie points on slopes also determine the horizontal position of the images.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ReliefForPlan {
    /// Where this makes the position more precise.
    Auto,
    /// Always.
    Yes,
    /// Never.
    No,
}

impl ReliefForPlan {
    /// Every use, with its word in the configuration.
    pub(super) const WORDS: [(&'static str, Self); 3] =
        [("auto", Self::Auto), ("yes", Self::Yes), ("no", Self::No)];
}
