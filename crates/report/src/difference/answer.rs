//! Answer of `report diff --json`.

use schemars::JsonSchema;
use serde::Serialize;

use super::RunDifference;
use areograph_base::schema::DocumentSchema;

/// Differences between two outputs, site by site.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(
    title = "Differences between two runs",
    description = "Answer of `areograph report diff --json`: differences (B - A) of every site that is in both \
                   outputs. Units are metres, arcseconds and seconds; unknown values are omitted."
)]
pub struct Answer<'a> {
    /// Sites of both.
    pub sites: Vec<SiteAnswer<'a>>,
    /// Sites only in A.
    pub only_in_a: &'a [String],
    /// Sites only in B.
    pub only_in_b: &'a [String],
}

/// Result of the comparison of a site in both outputs.
#[derive(Debug, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum SiteAnswer<'a> {
    /// The differences.
    Difference(&'a RunDifference),
    /// A site that could not be compared.
    Failed {
        /// Its name.
        site: &'a str,
        /// Why.
        error: String,
        /// Exit code of the failure.
        #[schemars(range(min = 1))]
        exit_code: u8,
    },
}

/// Schema of the answer.
#[must_use]
pub fn schema() -> DocumentSchema {
    DocumentSchema::of::<Answer>("difference")
}
