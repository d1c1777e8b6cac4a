//! What a search left out, for those who check a site.

use std::collections::BTreeMap;

use crate::pds::pedr::{Complaint, Reason};

/// What was left out, in numbers and with the first example.
pub(super) fn findings(
    complaints: &[Complaint],
    counts: &BTreeMap<Reason, u64>,
    spoiled_shots: u64,
) -> Vec<String> {
    let said = counts.values().sum::<u64>();
    let first = complaints
        .first()
        .map(|complaint| format!("complaints of PEDR files: {said}, the first: {complaint}"));
    let spoiled = (spoiled_shots > 0)
        .then(|| format!("shots in the windows left out for spoiled values: {spoiled_shots}"));
    first.into_iter().chain(spoiled).collect()
}
