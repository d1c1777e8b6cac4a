//! Sound inputs are not called invalid: sites of realistic missions without any mistake.
#![allow(clippy::unwrap_used, reason = "helpers of tests may fail loudly")]

use std::{fs, path::Path};

use crate::{
    common::{json, long, mission::areograph},
    truth::scene,
};

const ROUGHNESSES: [&str; 4] = ["plains", "medium", "rough", "varied"];

/// The sites of a mission that are invalid, with the reasons.
fn invalid(seed: u32, roughness: &str) -> (usize, Vec<String>) {
    let folder = tempfile::tempdir().unwrap();
    let options = ["--realistic", "--roughness", roughness];
    let (mission, out) = (
        scene(folder.path(), seed, &options),
        folder.path().join("out"),
    );
    let mut sites: Vec<_> = fs::read_dir(mission.join("sites"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    sites.sort();
    let mut run = areograph();
    // Invalid sites end with exit code 5, which is what is counted.
    run.args(["--quiet", "run"])
        .args(&sites)
        .arg("--out")
        .arg(&out);
    run.output().unwrap();
    let verdict = |site: &Path| {
        let name = site.file_stem().unwrap().to_owned();
        let verdict = json(&out.join(&name).join("manifest.json"))["verdict"].clone();
        let is_valid = verdict["valid"].as_bool().unwrap();
        (!is_valid).then(|| {
            format!(
                "seed {seed}, {roughness}, {}: {}",
                name.display(),
                verdict["reasons"]
            )
        })
    };
    let found = sites.iter().filter_map(|site| verdict(site)).collect();
    (sites.len(), found)
}

/// Sixty site-missions in the long run, with at most one false alarm; four otherwise, without any.
#[test]
fn sound_realistic_sites_are_valid() {
    let (missions, allowed) = if long() { (15, 1) } else { (1, 0) };
    let (mut sites, mut alarms) = (0, Vec::new());
    for (seed, roughness) in (23_000..).zip(ROUGHNESSES.iter().cycle()).take(missions) {
        let (count, found) = invalid(seed, roughness);
        sites += count;
        alarms.extend(found);
    }
    assert_eq!(sites, 4 * missions);
    assert!(alarms.len() <= allowed, "{alarms:#?}");
}
