//! Resources shared by tests of several crates: real data, expected texts, recipes of published simulations.
//!
//! Real data are in `AREOGRAPH_DATA`, or beside the checkout in `shared/data`. A test whose external input is missing
//! records that it was skipped; `scripts/test` counts these records.
#![allow(
    missing_docs,
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::missing_panics_doc,
    clippy::must_use_candidate,
    clippy::return_self_not_must_use,
    clippy::should_implement_trait,
    reason = "helpers of tests may fail loudly"
)]

pub mod brute_force;
pub mod csm_state;
pub mod cube;
pub mod eos_2002;
pub mod golden;
pub mod kept;
pub mod level_2;
pub mod lunar_pair;
pub mod moc_file;
pub mod orbits;
pub mod outside;
pub mod recipe;
pub mod scene;
pub mod shot_cases;
pub mod track;

use std::path::{Path, PathBuf};

use areograph_base::{column::Column, line_times::LineTimes, packed::Packed, time::Et};
use proptest::test_runner::{Config, FileFailurePersistence};

/// Replaces the value in a row of a column.
pub fn replace<T: Packed>(column: &mut Column<T>, row: usize, value: T) {
    assert!(row < column.len());
    *column = column.changed(|at, before| if at == row { value } else { before });
}

/// The folder of the checkout.
pub fn checkout() -> &'static Path {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.ancestors().nth(2).unwrap()
}

/// Ensures that `answer` conforms to the shipped schema `config/schema/<name>.schema.json`.
pub fn assert_keeps_schema(answer: &serde_json::Value, name: &str) {
    let path = checkout()
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
pub fn real_data(relative: &str, test: &str) -> Option<PathBuf> {
    let root = std::env::var("AREOGRAPH_DATA")
        .map_or_else(|_| checkout().join("../shared/data"), PathBuf::from);
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

/// Whether this is the long run, `scripts/test --long`: tests then take as many cases as possible.
pub fn long() -> bool {
    std::env::var_os("AREOGRAPH_LONG").is_some()
}

/// Whether `test` runs: a test of more than 20 s is left to the long run, and recorded.
pub fn long_test(test: &str) -> bool {
    let runs = long();
    if !runs {
        outside::left(test);
    }
    runs
}

/// Whether this process runs only this test; if not, a separate process has run it, and it has passed there. For
/// measurements of a whole process.
pub fn alone() -> bool {
    const ALONE: &str = "AREOGRAPH_TEST_ALONE";
    let thread = std::thread::current();
    let test = thread.name().unwrap();
    if std::env::var(ALONE).is_ok_and(|of| of == test) {
        return true;
    }
    let output = std::process::Command::new(std::env::current_exe().unwrap())
        .args([test, "--exact", "--nocapture", "--test-threads=2"])
        .env(ALONE, test)
        .output()
        .unwrap();
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        output.status.success() && printed.contains("1 passed"),
        "{test} alone:\n{printed}{}",
        String::from_utf8_lossy(&output.stderr)
    );
    false
}

/// Settings of tests with arbitrary input, whose failures are kept in `tests/fuzz_seeds/<name>.txt`.
pub fn seeds_kept(name: &str) -> Config {
    let path = checkout().join(format!("tests/fuzz_seeds/{name}.txt"));
    let path: &'static str = Box::leak(path.to_string_lossy().into_owned().into_boxed_str());
    Config {
        failure_persistence: Some(Box::new(FileFailurePersistence::Direct(path))),
        ..Config::default()
    }
}

/// A JSON file.
pub fn json(path: &Path) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// A number of a JSON document.
pub fn number(value: &serde_json::Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("no number: {value}"))
}

/// Files of [`M0402852_KERNELS`] in their folder.
pub fn m0402852_files(folder: &Path) -> Vec<PathBuf> {
    M0402852_KERNELS.map(|name| folder.join(name)).to_vec()
}

/// Kernels of image M04/02852 in `ale_mgs/m0402852`, in load order.
pub const M0402852_KERNELS: [&str; 9] = [
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

/// Line times of an image with an arbitrary start: whole `lines` of `period_s` seconds.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "tests make images of a few thousand lines"
)]
pub fn line_times(lines: f64, period_s: f64) -> LineTimes {
    LineTimes::even(Et::from_seconds(0.0), lines as u32, period_s).unwrap()
}
