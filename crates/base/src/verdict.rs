//! A verdict: reasons, remarks and checks. `judge` and the verdicts of nets, calibrations and matches produce it.

mod check;
mod kind;

pub use check::{Check, CheckOutcome};
pub use kind::CheckKind;

#[cfg(feature = "schema")]
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Heading of [`Verdict::untested`] on pages and in messages.
pub const NOT_TESTED: &str = "Not tested by the data:";

/// Whether the products are within the limits of the configuration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
pub struct Verdict {
    /// No limit is exceeded.
    pub valid: bool,
    /// Exceeded limits, each with the profile or image.
    pub reasons: Vec<String>,
    /// Remarks for the reader that concern no exceeded limit.
    pub remarks: Vec<String>,
    /// Errors that the data of the run cannot detect, one phrase per reason.
    #[serde(default, skip_serializing_if = "crate::stored::is_list_left_out")]
    pub untested: Vec<String>,
    /// Every limit with the item that uses the largest share of it, worst first.
    #[serde(default)]
    pub checks: Vec<Check>,
}

impl Verdict {
    /// Sentences and checks are two accounts of the same evidence: findings of both are reported.
    #[must_use]
    pub fn of(mut reasons: Vec<String>, mut remarks: Vec<String>, mut checks: Vec<Check>) -> Self {
        let failed = in_words(&checks, CheckOutcome::Fail);
        if reasons.is_empty() {
            reasons = failed;
        } else if failed.is_empty() {
            let failed_check =
                Check::without_number(CheckKind::Contradiction, "", CheckOutcome::Fail);
            checks.push(failed_check);
        }
        if remarks.is_empty() {
            remarks = in_words(&checks, CheckOutcome::Warning);
        }
        // The worst first; of equal ones the most independent.
        checks.sort_by_key(|check| (check.outcome, check.kind));
        Self {
            valid: reasons.is_empty(),
            reasons,
            remarks,
            untested: Vec::new(),
            checks,
        }
    }

    /// The verdict in one or three words, as in every message and page.
    #[must_use]
    pub const fn word(&self) -> &'static str {
        match (self.valid, self.remarks.as_slice()) {
            (false, _) => "INVALID",
            (true, []) => "valid",
            (true, _) => "valid with remarks",
        }
    }

    /// The three checks that are most informative on the quality of the products: heights of tie points and MOLA,
    /// agreement of images, ranges; then orbits and pointing without tie points.
    pub fn key_checks(&self) -> impl Iterator<Item = &Check> {
        let kinds = [
            CheckKind::HeightAfter,
            CheckKind::ParallaxAfter,
            CheckKind::RangeMean,
            CheckKind::OrbitsApart,
            CheckKind::PointingRmse,
        ];
        let checks = kinds.into_iter().filter_map(|kind| {
            let mut checks = self.checks.iter();
            checks.find(|check| check.kind == kind && check.value.is_some())
        });
        checks.take(3)
    }
}

/// The checks with this outcome, one sentence each.
fn in_words(checks: &[Check], outcome: CheckOutcome) -> Vec<String> {
    let such = checks.iter().filter(|check| check.outcome == outcome);
    such.map(ToString::to_string).collect()
}
