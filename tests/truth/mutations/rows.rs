//! The rows and their files.

use std::fs;

use serde::Deserialize;

use super::{change::Change, common, start::Start};

/// The kind of rows without a change, for comparison.
const SOUND: &str = "sound";

/// Files of rows in the order of the page, with the heading of each.
pub(super) const KINDS: [(&str, &str); 12] = [
    (SOUND, "Sound inputs"),
    ("attitude", "Attitude and mounting"),
    ("clocks", "Clocks and time scales"),
    ("orbit", "Orbits"),
    ("labels", "Labels of images"),
    ("ties", "Tie points"),
    ("shots", "Laser shots"),
    ("sites", "Keys of the site file"),
    ("kernels", "Other kernels, cameras"),
    ("support", "Support data of images"),
    ("nets", "Nets of pictures in the plane"),
    ("calibration", "Calibration of cameras"),
];

/// The expected answer to a wrong input.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Answer {
    /// An error, with the exit code of the row.
    Refused,
    /// Products that are marked invalid, for a reason with the phrase.
    Invalid,
    /// Valid, with a remark that has the phrase.
    Named,
    /// Valid, and the result errs by no more than is stated.
    Inside,
    /// Valid, and the verdict lists this error as not tested.
    NotTested,
    /// Valid without a remark, and the result errs by more than is stated: a fault of the program.
    Silent,
}

impl Answer {
    /// Its words on the page.
    pub(super) fn words(self) -> &'static str {
        match self {
            Self::Refused => "refused",
            Self::Invalid => "invalid",
            Self::Named => "remark",
            Self::Inside => "valid, inside",
            Self::NotTested => "stated as not tested",
            Self::Silent => "**not noticed**",
        }
    }
}

/// A wrong input and its answer.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Row {
    pub(super) name: String,
    /// The mistake in words for a reader of the page.
    pub(super) mistake: String,
    /// The sound inputs.
    #[serde(default)]
    pub(super) start: Start,
    #[serde(default)]
    pub(super) changes: Vec<Change>,
    pub(super) answer: Answer,
    /// Exit code of what is refused.
    #[serde(default = "input_data")]
    pub(super) exit: i32,
    /// What message, reason, remark or the list of what is not tested must contain.
    #[serde(default)]
    pub(super) phrase: String,
    /// Why an error is not noticed.
    #[serde(default)]
    pub(super) because: String,
    /// In every run.
    #[serde(default)]
    pub(super) short: bool,
    #[serde(skip)]
    pub(super) kind: &'static str,
}

const fn input_data() -> i32 {
    3
}

impl Row {
    pub(super) fn assert_is_complete(&self) {
        let is_sound = self.kind == SOUND;
        assert_eq!(is_sound, self.changes.is_empty(), "{}: changes", self.name);
        assert!(
            self.mistake.ends_with('.') && !self.mistake.contains('|'),
            "{}: {:?} is no sentence for a table",
            self.name,
            self.mistake
        );
        assert_eq!(
            self.answer == Answer::Silent,
            !self.because.is_empty(),
            "{}: a reason belongs to each row that is not noticed, and to no other",
            self.name
        );
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    row: Vec<Row>,
}

/// All rows in the order of the page.
pub(super) fn all() -> Vec<Row> {
    let folder = common::checkout().join("tests/truth/mutations");
    let mut rows = Vec::new();
    for (kind, _) in KINDS {
        let path = folder.join(kind).with_extension("toml");
        let text = fs::read_to_string(&path).unwrap();
        let file: File =
            toml::from_str(&text).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        rows.extend(file.row.into_iter().map(|row| Row { kind, ..row }));
    }
    let files = fs::read_dir(&folder).unwrap().filter(|entry| {
        let path = entry.as_ref().unwrap().path();
        path.extension()
            .is_some_and(|extension| extension == "toml")
    });
    assert_eq!(files.count(), KINDS.len(), "a file of rows is not in KINDS");
    rows
}
