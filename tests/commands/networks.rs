//! Control networks of ISIS as tie points: images are recognised by their serial numbers, and the binary and the text form
//! give the same adjustment.
#![allow(
    clippy::unwrap_used,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

use crate::common;

use std::{collections::BTreeMap, fs, path::PathBuf};

use common::{
    case::Case,
    mission::{products, site_run, succeed},
};

/// Products of Isidis with the network `name` of an earlier adjustment as tie points, but for those
/// that state the hash of the configuration or of the file.
fn adjusted_with(name: &str) -> BTreeMap<PathBuf, Vec<u8>> {
    let case = Case::pair();
    let network = site_run("isidis").join("exchange").join(name);
    case.write(&format!("ties/{name}"), fs::read(network).unwrap());
    case.replace("site.toml", "ties/isidis.csv", &format!("ties/{name}"));
    succeed(&mut case.run());
    let mut products = products(&case.path("out/isidis"));
    let states_file = |path: &PathBuf| {
        let name = path.file_name().unwrap().to_string_lossy();
        path.starts_with("report")
            || ["manifest.json", "stac_item.json"].contains(&&*name)
            || name.ends_with("isd.json")
    };
    products.retain(|path, _| !states_file(path));
    products
}

#[test]
fn a_binary_network_is_adjusted_as_its_text_form() {
    let [binary, text] = ["adjusted.net", "adjusted.pvl"].map(adjusted_with);
    assert!(binary.contains_key(&PathBuf::from("exchange/adjusted.net")));
    let differ: Vec<&PathBuf> = binary
        .iter()
        .filter(|(path, bytes)| text.get(*path) != Some(bytes))
        .map(|(path, _)| path)
        .collect();
    assert_eq!(differ, Vec::<&PathBuf>::new());
    assert_eq!(binary.len(), text.len());
}
