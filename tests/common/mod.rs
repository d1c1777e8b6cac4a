//! What several tests share: the real data, and the synthetic mission.
#![allow(dead_code, reason = "each test program uses a part of this module")]
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

pub(crate) mod case;
pub(crate) mod daf;
pub(crate) mod golden;
pub(crate) mod mission;
pub(crate) mod moc_file;
pub(crate) mod outside;
pub(crate) mod search;

use std::path::{Path, PathBuf};

use areograph::{line_times::LineTimes, time::Et};

/// Makes sure that `answer` keeps the shipped schema `config/schema/<name>.schema.json`.
pub(crate) fn assert_keeps_schema(answer: &serde_json::Value, name: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("config/schema")
        .join(format!("{name}.schema.json"));
    let validator = jsonschema::validator_for(&json(&path)).unwrap();
    let errors: Vec<String> = validator
        .iter_errors(answer)
        .map(|error| format!("{}: {error}", error.instance_path()))
        .collect();
    assert!(errors.is_empty(), "{name}: {errors:#?}");
}

/// A path below `AREOGRAPH_DATA` or `../shared/data`; without the data the test is counted as skipped, and under `CI`
/// it fails.
#[allow(
    clippy::disallowed_methods,
    reason = "tests find their data by an environment variable"
)]
pub(crate) fn real_data(relative: &str, test: &str) -> Option<PathBuf> {
    let root = std::env::var("AREOGRAPH_DATA").map_or_else(
        |_| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data"),
        PathBuf::from,
    );
    let path = root.join(relative);
    if path.exists() {
        outside::found(test);
        return Some(path);
    }
    let lack = format!("no {} (set AREOGRAPH_DATA)", path.display());
    assert!(std::env::var_os("CI").is_none(), "{test}: {lack}");
    outside::skipped(test, &lack);
    None
}

/// Whether this is the long run, `scripts/test --long`: tests then take as many cases as they can.
#[allow(
    clippy::disallowed_methods,
    reason = "how long tests may take is said by an environment variable"
)]
pub(crate) fn long() -> bool {
    std::env::var_os("AREOGRAPH_LONG").is_some()
}

/// Whether `test` runs: one of more than 20 s is left to the long run, and notes it.
#[allow(clippy::print_stderr, reason = "tests say what they leave out")]
pub(crate) fn long_test(test: &str) -> bool {
    let runs = long();
    if !runs {
        eprintln!("left to scripts/test --long: {test}");
    }
    runs
}

/// A JSON file.
pub(crate) fn json(path: &Path) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// A number of a JSON document.
pub(crate) fn number(value: &serde_json::Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("no number: {value}"))
}

/// Files of [`M0402852_KERNELS`] in their folder.
pub(crate) fn m0402852_files(folder: &Path) -> Vec<PathBuf> {
    M0402852_KERNELS.map(|name| folder.join(name)).to_vec()
}

/// Kernels of image M04/02852 in `ale_mgs/m0402852`, in load order.
pub(crate) const M0402852_KERNELS: [&str; 9] = [
    "naif0012.tls",
    "pck00009.tpc",
    "MGS_SCLKSCET.00061.tsc",
    "moc20.ti",
    "mocAddendum004.ti",
    "m0402852.ale_0.bsp",
    "m0402852.ale_1.bsp",
    "mgs_sc_map2_0_sliced_-94000.bc",
    "mgs_sc_map2_1_sliced_-94000.bc",
];

/// Line times of an image whose start does not matter: whole `lines` of `period_s` seconds.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "tests make images of a few thousand lines"
)]
pub(crate) fn line_times(lines: f64, period_s: f64) -> LineTimes {
    LineTimes::even(Et::from_seconds(0.0), lines as u32, period_s).unwrap()
}
