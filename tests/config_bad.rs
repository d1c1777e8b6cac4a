//! Every configuration in `tests/config/bad` is refused with exactly the message beside it.

#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    reason = "helpers of tests may panic, and files in a temporary folder need no atomic writer"
)]

use std::{
    fs,
    path::{Path, PathBuf},
};

use areograph::{config, error::Kind};

const OPEN_RING: &str = r#"{"type": "Polygon", "coordinates": [[[0, 0], [1, 0], [1, 1], [0, 1]]]}"#;

/// The files that the bad configurations point to.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("there.txt"), "some text\n").unwrap();
    fs::write(folder.path().join("a.b"), "").unwrap();
    fs::write(folder.path().join("open.geojson"), OPEN_RING).unwrap();
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
    let mut differing = Vec::new();
    for path in files {
        let text = fs::read_to_string(&path).unwrap();
        let copy = folder.path().join(path.file_name().unwrap());
        let found = match config::parse(&text, &copy) {
            Ok(_) => "accepted".to_owned(),
            Err(problems) => problems.to_string().replace(&prefix, ""),
        };
        let expected = fs::read_to_string(path.with_extension("txt")).unwrap_or_default();
        if found.trim_end() != expected.trim_end() {
            differing.push(format!("--- {}\n{found}", path.display()));
        }
    }
    assert!(
        differing.is_empty(),
        "{} messages differ from their .txt; found:\n{}",
        differing.len(),
        differing.join("\n")
    );
}

#[test]
fn files_that_are_no_text_are_refused_before_they_are_parsed() {
    let folder = folder();
    let message = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        let failure = config::load(&path).unwrap_err();
        assert_eq!(failure.kind(), Kind::Configuration);
        failure
            .to_string()
            .replace(&format!("{}/", folder.path().display()), "")
    };
    let advice = "\n  what to do: mend these entries; config/sites/example.toml documents every key \
                  with its unit and default";
    assert_eq!(
        message("long.toml", &vec![b'#'; (1 << 20) + 1]),
        format!(
            "long.toml: is longer than 1048576 bytes; expected the TOML file of one site{advice}"
        )
    );
    assert_eq!(
        message("binary.toml", b"DAF/SPK \xff\x00"),
        format!("binary.toml: is not UTF-8 from byte 9; expected text{advice}")
    );
    let no_file = config::load(folder.path()).unwrap_err();
    assert!(no_file.to_string().contains("is no regular file"));
    let absent = config::load(&folder.path().join("absent.toml")).unwrap_err();
    assert_eq!(absent.kind(), Kind::Io);
}
