//! What several tests share: the real data, and the synthetic mission.
#![allow(dead_code, reason = "each test program uses a part of this module")]
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

pub(crate) mod case;
pub(crate) mod golden;
pub(crate) mod mission;

use std::path::{Path, PathBuf};

/// Makes sure that `answer` keeps the shipped schema `config/schema/<name>.schema.json`.
pub(crate) fn assert_keeps_schema(answer: &serde_json::Value, name: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("config/schema")
        .join(format!("{name}.schema.json"));
    let schema: serde_json::Value = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
    let validator = jsonschema::validator_for(&schema).unwrap();
    let errors: Vec<String> = validator
        .iter_errors(answer)
        .map(|error| format!("{}: {error}", error.instance_path()))
        .collect();
    assert!(errors.is_empty(), "{name}: {errors:#?}");
}

/// A path below `AREOGRAPH_DATA` or `../shared/data`; without the data one line says what is skipped.
#[allow(
    clippy::disallowed_methods,
    clippy::print_stderr,
    reason = "tests find their data by an environment variable and say what they skip"
)]
pub(crate) fn real_data(relative: &str, test: &str) -> Option<PathBuf> {
    let root = std::env::var("AREOGRAPH_DATA").map_or_else(
        |_| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data"),
        PathBuf::from,
    );
    let path = root.join(relative);
    if path.exists() {
        return Some(path);
    }
    eprintln!("skipped {test}: no {} (set AREOGRAPH_DATA)", path.display());
    None
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
