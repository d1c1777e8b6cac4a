//! Kernels by type, as SpiceQL reports them, with hashes and coverage.

use std::{collections::BTreeMap, path::Path};

use serde::Serialize;
use serde_json::{Map, Value, json};

use super::site::{KernelLine, SiteProducts};
use crate::{kernel_source::CkQuality, spice::quality_of, time::Intervals};

/// Kernel names by SpiceQL's types, in load order: `ck`, `spk`, `tspk` (ephemerides of other bodies), `pck`,
/// `fk`, `ik`, `iak` (ISIS addenda), `lsk`, `sclk`.
pub(super) fn names_by_type<'a>(site: &SiteProducts<'a>) -> BTreeMap<String, Vec<&'a str>> {
    let mut names: BTreeMap<String, Vec<&str>> = BTreeMap::new();
    for kernel in site.kernels {
        names.entry(type_of(kernel)).or_default().push(&kernel.name);
    }
    names
}

fn type_of(kernel: &KernelLine) -> String {
    let name = kernel.name.to_lowercase();
    let holds_mgs = kernel
        .held
        .as_ref()
        .is_some_and(|held| !held.as_slice().is_empty());
    match kernel.role.as_str() {
        "SPK" if !holds_mgs => "tspk".to_owned(),
        "IK" if name.contains("addendum") => "iak".to_owned(),
        role => role.to_lowercase(),
    }
}

/// The least of the qualities of the spacecraft's kernels of one type, in SpiceQL's words: commanded attitude
/// is `predicted`, archived kernels are `reconstructed`, names that tell nothing give `noquality`.
pub(super) fn qualities(site: &SiteProducts) -> BTreeMap<&'static str, &'static str> {
    let quality = |kernel: &&KernelLine| {
        let name = kernel.name.to_lowercase();
        if quality_of(Path::new(&name)) == CkQuality::Nominal {
            "predicted"
        } else if name.starts_with("mgs_") {
            "reconstructed"
        } else {
            "noquality"
        }
    };
    // Alphabetic order is that of quality, the least first.
    let least = |wanted: &str| {
        let of_type = site.kernels.iter().filter(|line| type_of(line) == wanted);
        of_type.map(|kernel| quality(&kernel)).min()
    };
    [("mgs_ck_quality", "ck"), ("mgs_spk_quality", "spk")]
        .into_iter()
        .filter_map(|(key, kind)| Some((key, least(kind)?)))
        .collect()
}

/// A kernel's identity and coverage.
#[derive(Serialize)]
struct Entry<'a> {
    name: &'a str,
    r#type: String,
    bytes: u64,
    blake3: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    coverage_et_s: Option<Vec<[f64; 2]>>,
}

/// The report: SpiceQL's members, and `areograph` with a kernel per entry.
pub(super) fn report(site: &SiteProducts) -> Value {
    let mut report = Map::new();
    for (kind, names) in names_by_type(site) {
        report.insert(kind, json!(names));
    }
    for (key, quality) in qualities(site) {
        report.insert(key.to_owned(), json!(quality));
    }
    let entries: Vec<Entry> = site
        .kernels
        .iter()
        .map(|kernel| Entry {
            name: &kernel.name,
            r#type: type_of(kernel),
            bytes: kernel.bytes,
            blake3: &kernel.blake3,
            coverage_et_s: kernel.held.as_ref().map(ends),
        })
        .collect();
    let extension = json!({
        "coverage": "intervals of TDB seconds past J2000 in which the kernel holds Mars Global Surveyor: its position \
                     in an spk, its attitude in a ck, whose gaps lie between the intervals",
        "wanted_positions_et_s": ends(&site.wanted.positions),
        "wanted_attitudes_et_s": ends(&site.wanted.attitudes),
        "kernels": entries,
    });
    report.insert("areograph".to_owned(), extension);
    Value::Object(report)
}

fn ends(intervals: &Intervals) -> Vec<[f64; 2]> {
    intervals
        .as_slice()
        .iter()
        .map(|interval| [interval.start.seconds(), interval.stop.seconds()])
        .collect()
}
