//! Every configuration in `tests/config/bad` is refused with exactly the message beside it.

#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    reason = "helpers of tests may panic, and files in a temporary folder need no atomic writer"
)]

use crate::common;

use std::{
    fs,
    path::{Path, PathBuf},
};

use areograph::{
    config::{Document as _, ServiceConfig, SiteConfig},
    error::{Error, Kind},
};
use common::golden::{Golden, assert_messages};

const OPEN_RING: &str = r#"{"type": "Polygon", "coordinates": [[[0, 0], [1, 0], [1, 1], [0, 1]]]}"#;
const WIDE_RING: &str =
    r#"{"type": "Polygon", "coordinates": [[[0, -5], [200, -5], [200, 5], [0, 5], [0, -5]]]}"#;

/// The files that the bad configurations point to.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("there.txt"), "some text\n").unwrap();
    fs::write(folder.path().join("a.b"), "").unwrap();
    fs::write(folder.path().join("open.geojson"), OPEN_RING).unwrap();
    fs::write(folder.path().join("wide.geojson"), WIDE_RING).unwrap();
    folder
}

fn bad_files() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/config/bad");
    let mut files: Vec<PathBuf> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| {
            path.extension()
                .is_some_and(|extension| extension == "toml")
        })
        .collect();
    files.sort();
    files
}

#[test]
fn every_bad_file_has_its_exact_message() {
    let folder = folder();
    let prefix = format!("{}/", folder.path().display());
    let files = bad_files();
    assert!(files.len() >= 40, "only {} cases", files.len());
    let mut golden = Golden::folder("config/bad");
    for path in files {
        let text = fs::read_to_string(&path).unwrap();
        let copy = folder.path().join(path.file_name().unwrap());
        let found = match SiteConfig::parse(&text, &copy) {
            Ok(_) => "accepted".to_owned(),
            Err(problems) => problems.to_string().replace(&prefix, ""),
        };
        golden.compare(path.file_stem().unwrap().to_str().unwrap(), &found);
    }
    golden.finish();
}

/// A file that does not exist is missing input wherever it is named; beside another fault it is not the kind of the failure.
#[test]
fn files_that_do_not_exist_are_missing_input() {
    let folder = folder();
    let kind = |entries: &str| {
        let text = format!("site = \"s\"\n{entries}\npedr.files = [\"none.b\"]\n");
        let window = "[[windows]]\nid = \"w\"\nlongitude_deg = [1, 2]\nlatitude_deg = [1, 2]\n";
        let file = folder.path().join("s.toml");
        let problems = SiteConfig::parse(&(text + window), &file).unwrap_err();
        Error::from(problems).kind()
    };
    assert_eq!(kind("kernels.metakernel = \"none.tm\""), Kind::Input);
    assert_eq!(kind("kernels.metakernel = 1"), Kind::Configuration);
}

#[test]
fn files_that_are_no_text_are_refused_before_they_are_parsed() {
    let folder = folder();
    let prefix = format!("{}/", folder.path().display());
    let load = |name: &str, bytes: Option<&[u8]>| {
        let path = folder.path().join(name);
        if let Some(bytes) = bytes {
            fs::write(&path, bytes).unwrap();
        }
        let failure = SiteConfig::load(&path).unwrap_err();
        let message = failure.to_string().replace(&prefix, "");
        (failure.kind(), (name.to_owned(), message))
    };
    let long = vec![b'#'; (1 << 20) + 1];
    fs::create_dir(folder.path().join("folder.toml")).unwrap();
    let (kinds, told): (Vec<Kind>, Vec<_>) = [
        load("long.toml", Some(&long)),
        load("binary.toml", Some(b"DAF/SPK \xff\x00")),
        load("folder.toml", None),
        load("absent.toml", None),
    ]
    .into_iter()
    .unzip();
    assert_eq!(kinds[..2], [Kind::Configuration; 2]);
    assert_eq!(kinds[3], Kind::Input);
    assert_messages("config_no_text", &told);
}

#[test]
fn a_folder_of_the_service_is_one_or_is_away() {
    let folder = folder();
    let told = |sites: &str| {
        let text = format!(
            "[inputs]\nsites = [{sites:?}]\nkernels = [\"not_mounted\"]\ndata = [\"not_there\"]\n"
        );
        let found = ServiceConfig::parse(&text, &folder.path().join("areograph.toml"));
        found.err().map(|problems| problems.to_string())
    };
    assert_eq!(told("."), None);
    assert_eq!(told("away"), None);
    for (sites, expected) in [
        ("there.txt", "there.txt is a file"),
        ("", "a folder; an empty string is not a path"),
    ] {
        let message = told(sites).unwrap();
        assert!(message.contains(expected), "{message}");
    }
}
