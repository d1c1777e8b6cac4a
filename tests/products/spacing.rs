//! Missing shots by the times of the shots that remain, against the records that the reader of the PEDR rejected.
#![allow(clippy::unwrap_used, reason = "helpers of tests may fail loudly")]

use crate::common::{json, mission::site_run};

/// Every pulse of these files has a record, so that a missing shot is a rejected one. Of the shots rejected in a window,
/// those before the first and after the last shot of a profile are not missing between its shots; two sites have none.
#[test]
fn missing_shots_are_those_that_the_reader_rejected() {
    for (site, has_rejected_ends) in [
        ("gusev_crater", false),
        ("isidis", false),
        ("eos_chasma", true),
        ("gusev_context", true),
    ] {
        let folder = site_run(site);
        let profiles = &json(&folder.join("spacing.json"))["profiles"];
        let profiles = profiles.as_array().unwrap().iter();
        let missing: u64 = profiles.map(|of| of["missing"].as_u64().unwrap()).sum();
        let rejected = &json(&folder.join("manifest.json"))["rejected"];
        let rejected = rejected.as_object().unwrap().values();
        let rejected: u64 = rejected.map(|count| count.as_u64().unwrap()).sum();
        assert!(0 < missing && missing <= rejected, "{site}");
        assert_eq!(missing < rejected, has_rejected_ends, "{site}");
    }
}
