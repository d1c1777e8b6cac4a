//! Findings on the records and shots that a search left out.

use std::collections::BTreeMap;

use areograph_pds::pedr::{Complaint, Reason};

/// Numbers of records and shots that were left out, with the first example.
pub(super) fn findings(
    complaints: &[Complaint],
    counts: &BTreeMap<Reason, u64>,
    spoiled_shots: u64,
) -> Vec<String> {
    let said = counts.values().sum::<u64>();
    let first = complaints.first().map(|complaint| {
        format!("complaints about records of shots: {said}, the first: {complaint}")
    });
    let spoiled = (spoiled_shots > 0).then(|| {
        format!("shots in the windows rejected because of invalid values: {spoiled_shots}")
    });
    first.into_iter().chain(spoiled).collect()
}
