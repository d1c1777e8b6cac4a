//! The manifest of an archive's products.

use std::collections::BTreeMap;

use crate::{
    geom::statistics::largest,
    stage::Inputs,
    stages::check_archive::{ArchiveRanges, NAME},
    store::manifest::{
        BiasEntry, Complaints, ConfigurationEntry, KernelEntry, Manifest, StageEntry, figures,
    },
};

/// Complaints that the manifest quotes; all are counted.
const COMPLAINTS_QUOTED: usize = 100;

/// The manifest of an archive without its products.
pub(super) fn manifest(ranges: &ArchiveRanges, inputs: &Inputs) -> Manifest {
    let [without, partly] = ranges.not_covered();
    let beyond = ranges.profiles();
    let beyond = beyond.filter(|profile| !profile.invalid_because.is_empty());
    let counts = [
        ("files", ranges.files.len() as u64),
        ("files_copied", ranges.copies.len() as u64),
        ("files_failed", ranges.failures.len() as u64),
        ("records", ranges.sum(|file| file.records)),
        ("profiles", ranges.profiles().count() as u64),
        ("profiles_not_judged", ranges.too_short() as u64),
        ("profiles_beyond_limits", beyond.count() as u64),
        ("profiles_not_covered", without as u64),
        ("profiles_partly_covered", partly as u64),
        ("shots", ranges.sum(|file| file.shots)),
        ("shots_not_covered", ranges.sum(|file| file.not_covered)),
    ];
    let means = ranges.profiles().filter(|profile| profile.is_judged());
    let largest_m = means.map(|profile| profile.mean_without_outliers_m.abs());
    let mut rejected: BTreeMap<String, u64> = BTreeMap::new();
    for (reason, count) in ranges.files.iter().flat_map(|file| &file.found.rejected) {
        *rejected.entry(reason.to_string()).or_default() += count;
    }
    let texts = ranges.files.iter().flat_map(|file| &file.found.complaints);
    let kernels = ranges.kernels.iter().map(|kernel| KernelEntry {
        name: kernel.name.clone(),
        role: kernel.role.clone(),
        bytes: kernel.bytes,
        blake3: kernel.blake3.clone(),
        coverage_used: Vec::new(),
    });
    let clock = &ranges.clock;
    Manifest {
        tool: "areograph".to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        site: "archive".to_owned(),
        verdict: ranges.verdict(),
        configuration: ConfigurationEntry {
            file_name: String::new(),
            blake3: blake3::hash(b"").to_hex().to_string(),
            keys: BTreeMap::new(),
        },
        biases: vec![BiasEntry {
            name: "mola_clock".to_owned(),
            correction_s: clock.correction_s(),
            scope: "spk_lookup".to_owned(),
            source: clock.source.clone(),
        }],
        kernels: kernels.collect(),
        kernel_choice: Vec::new(),
        stages: vec![StageEntry {
            name: NAME.to_owned(),
            fingerprint: inputs.fingerprint(),
        }],
        products: Vec::new(),
        counts: counts.map(|(name, count)| (name.to_owned(), count)).into(),
        figures: largest(largest_m)
            .map(|metres| (figures::RANGE_MEAN_M.to_owned(), metres))
            .into_iter()
            .collect(),
        rejected,
        complaints: Complaints {
            count: ranges.sum(|file| file.complaint_count),
            texts: texts.take(COMPLAINTS_QUOTED).cloned().collect(),
        },
        notes: notes(ranges),
        finished_utc: chrono::Utc::now().format("%Y-%m-%dT%H:%M:%SZ").to_string(),
    }
}

fn notes(ranges: &ArchiveRanges) -> Vec<String> {
    let failures = ranges.failures.iter();
    let failures = failures.map(|failure| format!("{}: not read: {}", failure.file, failure.why));
    let copies = ranges.copies.iter();
    let copies = copies.map(|copy| format!("{} is a copy of {}: used once", copy.file, copy.of));
    failures.chain(copies).collect()
}
