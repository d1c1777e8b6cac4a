//! A verdict: reasons, remarks and checks. `judge` and the judges of nets, calibrations and matches make it.

mod check;
mod kind;

pub use check::{Check, CheckOutcome};
pub use kind::CheckKind;

#[cfg(feature = "schema")]
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Whether the products keep the limits of the configuration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
pub struct Verdict {
    /// No limit is broken.
    pub valid: bool,
    /// Every broken limit, with its profile or image.
    pub reasons: Vec<String>,
    /// What a reader must weigh although no limit is broken.
    pub remarks: Vec<String>,
    /// Every limit with what uses most of it, the worst first.
    #[serde(default)]
    pub checks: Vec<Check>,
}

impl Verdict {
    /// Sentences and checks are two accounts of the same evidence: what either finds is reported.
    #[must_use]
    pub fn of(mut reasons: Vec<String>, mut remarks: Vec<String>, mut checks: Vec<Check>) -> Self {
        let failed = in_words(&checks, CheckOutcome::Fail);
        if reasons.is_empty() {
            reasons = failed;
        } else if failed.is_empty() {
            let told = Check::told(CheckKind::Contradiction, "", CheckOutcome::Fail);
            checks.push(told);
        }
        if remarks.is_empty() {
            remarks = in_words(&checks, CheckOutcome::Warning);
        }
        // The worst first, and of equals the most independent.
        checks.sort_by_key(|check| (check.outcome, check.kind));
        Self {
            valid: reasons.is_empty(),
            reasons,
            remarks,
            checks,
        }
    }

    /// The verdict in one word or three, as every message and page has it.
    #[must_use]
    pub const fn word(&self) -> &'static str {
        match (self.valid, self.remarks.as_slice()) {
            (false, _) => "INVALID",
            (true, []) => "valid",
            (true, _) => "valid with remarks",
        }
    }

    /// The three checks that say most of how good the products are: heights of tie points and MOLA, images by each
    /// other, ranges; then orbits and pointing where there are no tie points.
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

/// The checks that came out so, a sentence each.
fn in_words(checks: &[Check], outcome: CheckOutcome) -> Vec<String> {
    let such = checks.iter().filter(|check| check.outcome == outcome);
    such.map(ToString::to_string).collect()
}
