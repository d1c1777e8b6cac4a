//! Golden texts: the expected output of the program in files beside the tests.
//!
//! `SNAPSHOTS=overwrite cargo test` rewrites them; the difference must then be reviewed.

use std::{collections::BTreeSet, fs, path::PathBuf};

use snapbox::{Assert, Data, IntoData, assert::DEFAULT_ACTION_ENV};

/// The files of one folder that a test compares with, reported together at the end.
pub struct Golden {
    folder: PathBuf,
    compared: BTreeSet<PathBuf>,
    differing: Vec<String>,
}

impl Golden {
    /// A folder below the tests.
    pub fn folder(relative: &str) -> Self {
        Self {
            folder: crate::checkout().join("tests").join(relative),
            compared: BTreeSet::new(),
            differing: Vec::new(),
        }
    }

    /// Compares with the text file of this name, letter by letter except for the end of the last line.
    pub fn compare(&mut self, name: &str, found: &str) {
        let path = self.folder.join(name).with_extension("txt");
        let found = format!("{}\n", found.trim_end()).into_data();
        let expected = Data::read_from(&path, None).raw();
        let assert = Assert::new().action_env(DEFAULT_ACTION_ENV);
        if let Err(difference) = assert.try_eq(Some(&name), found, expected) {
            self.differing.push(difference.to_string());
        }
        assert!(self.compared.insert(path), "{name} is compared twice");
    }

    /// Another test compares the text file of this name.
    pub fn leave(&mut self, name: &str) {
        self.compared
            .insert(self.folder.join(name).with_extension("txt"));
    }

    /// Fails with every difference, and with text files that were not compared.
    pub fn finish(mut self) {
        for entry in fs::read_dir(&self.folder).unwrap() {
            let path = entry.unwrap().path();
            let text = path.extension().is_some_and(|extension| extension == "txt");
            if text && !self.compared.contains(&path) {
                let left = format!("{}: no case produces this\n", path.display());
                self.differing.push(left);
            }
        }
        assert!(
            self.differing.is_empty(),
            "{} of {} texts differ:\n{}",
            self.differing.len(),
            self.compared.len(),
            self.differing.join("\n")
        );
    }
}

/// Compares the messages of a test, case by case, with `tests/messages/<name>.txt`.
pub fn assert_messages<What: AsRef<str>>(name: &str, told: &[(What, String)]) {
    let told: Vec<String> = told
        .iter()
        .map(|(what, message)| format!("== {}\n{}\n", what.as_ref(), message.trim_end()))
        .collect();
    let mut golden = Golden::folder("messages");
    golden.compare(name, &told.join("\n"));
    let differing = golden.differing;
    assert!(differing.is_empty(), "{}", differing.join("\n"));
}
