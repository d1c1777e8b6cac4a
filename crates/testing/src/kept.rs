//! Files that are made from declarations and kept in the repository.

use std::{env, fs};

/// Fails if the file differs from the present declarations; with `SNAPSHOTS=overwrite` rewrites it.
pub fn is_up_to_date(relative: &str, expected: &str) {
    let path = crate::checkout().join(relative);
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
        "{relative}: line {} is {:?}; expected {:?} from the declarations; regenerate the file \
         with `SNAPSHOTS=overwrite` and the same test",
        line + 1,
        found.lines().nth(line),
        expected.lines().nth(line),
    );
}
