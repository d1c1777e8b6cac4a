//! A site on real kernels, from the command line: M04/02852, its PEDR flown along the real trajectory.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly"
)]

use crate::common;

use std::{
    fs,
    path::{Path, PathBuf},
};

use common::{
    json,
    mission::{areograph, products, succeed},
};

/// A metakernel over the real kernels, its strings cut to the 80 characters that NAIF allows.
#[allow(
    clippy::disallowed_methods,
    reason = "a file in a temporary folder needs no atomic writer"
)]
fn metakernel(folder: &Path, data: &Path) -> PathBuf {
    let quoted = |text: &str| {
        let pieces: Vec<String> = text
            .as_bytes()
            .chunks(60)
            .map(|piece| format!("'{}'", String::from_utf8_lossy(piece)))
            .collect();
        let (last, front) = pieces.split_last().unwrap();
        let mut lines: Vec<String> = front
            .iter()
            .map(|piece| format!("{}+'", piece.trim_end_matches('\'')))
            .collect();
        lines.push(last.clone());
        lines.join("\n  ")
    };
    let list: Vec<String> = common::M0402852_KERNELS
        .iter()
        .map(|name| quoted(&data.join(name).to_string_lossy()))
        .collect();
    let text = format!(
        "KPL/MK\n\\begindata\nKERNELS_TO_LOAD = (\n  {}\n)\n\\begintext\n",
        list.join("\n  ")
    );
    let path = folder.join("m0402852.tm");
    fs::write(&path, text).unwrap();
    path
}

#[test]
fn a_site_on_real_kernels_ends_valid_and_stays() {
    let Some(data) = common::real_data("ale_mgs/m0402852", "site on real kernels") else {
        return;
    };
    let data = data.canonicalize().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let kernels = metakernel(folder.path(), &data);
    let scene = folder.path().join("scene");
    let mut along = areograph();
    along.args(["scene", "along"]).arg(&kernels).arg(&scene);
    succeed(along.arg("--label").arg(data.join("m0402852_isis.lbl")));
    let site = scene.join("sites/m04-02852.toml");
    let out = folder.path().join("out");
    let run = || {
        let output = succeed(
            areograph()
                .args(["--quiet", "run"])
                .arg(&site)
                .arg("--out")
                .arg(&out),
        );
        String::from_utf8(output.stdout).unwrap()
    };
    assert!(run().starts_with("m04-02852: valid; products in "));

    let manifest = json(&out.join("m04-02852/manifest.json"));
    assert_eq!(manifest["verdict"]["valid"], true);
    assert_eq!(manifest["counts"]["images"], 1);
    assert!(manifest["counts"]["footprints"].as_u64().unwrap() > 1000);
    assert_eq!(
        manifest["kernels"].as_array().unwrap().len(),
        common::M0402852_KERNELS.len()
    );
    assert_eq!(manifest["complaints"]["count"], 0);
    for product in manifest["products"].as_array().unwrap() {
        let path = out
            .join("m04-02852")
            .join(product["path"].as_str().unwrap());
        let bytes = fs::read(&path).unwrap();
        assert_eq!(blake3::hash(&bytes).to_hex().as_str(), product["blake3"]);
    }

    let before = products(&out);
    assert!(run().starts_with("m04-02852: valid; nothing changed; products are up to date in "));
    assert!(products(&out) == before);
    // The kernels.tm of the products reproduces the run.
    let again =
        areograph::spice::KernelSet::from_metakernel(&out.join("m04-02852/kernels.tm")).unwrap();
    let hashes: Vec<&str> = again
        .kernels()
        .iter()
        .map(|kernel| &*kernel.blake3)
        .collect();
    let listed: Vec<&str> = manifest["kernels"]
        .as_array()
        .unwrap()
        .iter()
        .map(|kernel| kernel["blake3"].as_str().unwrap())
        .collect();
    assert_eq!(hashes, listed);
}
