//! Files that are made from declarations and kept in the repository.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    reason = "tests may fail loudly, and write into the repository when asked"
)]

use std::{env, fs, path::Path};

/// Fails where the file is not what the declarations say now; with `SNAPSHOTS=overwrite` writes it anew.
pub(crate) fn is_up_to_date(relative: &str, expected: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(relative);
    if env::var("SNAPSHOTS").is_ok_and(|mode| mode == "overwrite") {
        fs::write(path, expected).unwrap();
        return;
    }
    let found = fs::read_to_string(path).unwrap_or_default();
    let differs = found
        .lines()
        .zip(expected.lines())
        .position(|(a, b)| a != b);
    let line = differs.unwrap_or_else(|| found.lines().count().min(expected.lines().count()));
    assert!(
        found == expected,
        "{relative}: line {} is {:?}, the declarations say {:?}; write it anew with \
         `SNAPSHOTS=overwrite` and the same test",
        line + 1,
        found.lines().nth(line),
        expected.lines().nth(line),
    );
}
