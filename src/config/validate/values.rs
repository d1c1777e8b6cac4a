//! Single values: numbers in range, one of several words, identifiers, existing files.

use std::{
    fmt,
    path::{Path, PathBuf},
};

use toml::Spanned;

use super::super::{problems::Review, raw::Entry, shape::suggestion};

/// Longest identifier; folders are named after them.
const IDENTIFIER_MAX: usize = 64;

/// Accepted numbers. Comparisons are written so that NaN is refused too.
#[derive(Debug, Clone, Copy)]
pub(super) enum Accept {
    /// Both ends belong to it.
    FromTo(f64, f64),
    /// Above the first, at most the second.
    AboveTo(f64, f64),
    /// 0 and both ends belong to it.
    ZeroOr(f64, f64),
}

impl Accept {
    fn takes(self, value: f64) -> bool {
        match self {
            Self::FromTo(low, high) => low <= value && value <= high,
            Self::AboveTo(low, high) => low < value && value <= high,
            Self::ZeroOr(low, high) => value.abs() <= 0.0 || low <= value && value <= high,
        }
    }
}

impl fmt::Display for Accept {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ZeroOr(low, f64::INFINITY) => {
                write!(formatter, "0, or a number not below {low}; inf is one")
            }
            Self::ZeroOr(low, high) => {
                write!(formatter, "0, or a number from {low} to {high}")
            }
            Self::FromTo(low, high) => write!(formatter, "a number from {low} to {high}"),
            Self::AboveTo(low, high) => write!(formatter, "a number above {low}, at most {high}"),
        }
    }
}

/// What a path must lead to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Target {
    File,
    Folder,
}

#[allow(
    clippy::ref_option,
    reason = "entries are passed as the raw structs hold them"
)]
impl Review<'_> {
    /// The number of `key`, or nothing when it is absent or refused.
    pub(super) fn optional_number(
        &mut self,
        key: &str,
        raw: Option<&Spanned<f64>>,
        accept: Accept,
    ) -> Option<f64> {
        let raw = raw?;
        if accept.takes(*raw.get_ref()) {
            return Some(*raw.get_ref());
        }
        self.refuse(raw.span(), key, accept);
        None
    }

    /// The number of `key`, or its default.
    pub(super) fn number(
        &mut self,
        key: &str,
        raw: &Entry<f64>,
        accept: Accept,
        default: f64,
    ) -> f64 {
        self.optional_number(key, raw.as_ref(), accept)
            .unwrap_or(default)
    }

    /// The whole number of `key` from `low` to `high`, or nothing when it is absent or refused.
    pub(super) fn whole<T: TryFrom<i64> + Into<i64> + fmt::Display>(
        &mut self,
        key: &str,
        raw: Option<&Spanned<i64>>,
        low: T,
        high: T,
    ) -> Option<T> {
        let raw = raw?;
        let limits = format!("a whole number from {low} to {high}");
        let inside = (low.into()..=high.into()).contains(raw.get_ref());
        match T::try_from(*raw.get_ref()) {
            Ok(value) if inside => Some(value),
            _ => {
                self.refuse(raw.span(), key, limits);
                None
            }
        }
    }

    /// The list of `key` without repeats, or its default; an empty list is a problem.
    pub(super) fn whole_list<T>(
        &mut self,
        key: &str,
        raw: Option<&Spanned<Vec<Spanned<i64>>>>,
        (low, high): (T, T),
        default: &[T],
    ) -> Vec<T>
    where
        T: TryFrom<i64> + Into<i64> + fmt::Display + Copy + Ord,
    {
        let Some(raw) = raw else {
            return default.to_vec();
        };
        self.not_empty(key, raw);
        let mut values: Vec<T> = raw
            .get_ref()
            .iter()
            .filter_map(|item| self.whole(key, Some(item), low, high))
            .collect();
        values.sort_unstable();
        values.dedup();
        values
    }

    /// An empty list says nothing, so it is a problem.
    pub(super) fn not_empty<T>(&mut self, key: &str, raw: &Spanned<Vec<T>>) {
        if raw.get_ref().is_empty() {
            self.refuse(raw.span(), key, "at least one entry");
        }
    }

    /// The meaning of the word of `key`; nothing when it is absent or not one of `choices`.
    pub(super) fn word<T: Copy>(
        &mut self,
        key: &str,
        raw: Option<&Spanned<String>>,
        choices: &[(&str, T)],
    ) -> Option<T> {
        let raw = raw?;
        let found = choices.iter().find(|(word, _)| word == raw.get_ref());
        if found.is_none() {
            let words: Vec<&str> = choices.iter().map(|(word, _)| *word).collect();
            let expected = suggestion(raw.get_ref(), &words);
            self.refuse(raw.span(), key, expected);
        }
        found.map(|(_, meaning)| *meaning)
    }

    /// Text that products repeat, or its default.
    pub(super) fn text(&mut self, key: &str, raw: &Entry<String>, default: &str) -> String {
        let Some(raw) = raw else {
            return default.to_owned();
        };
        if raw.get_ref().trim().is_empty() {
            self.refuse(raw.span(), key, "some text");
        }
        raw.get_ref().clone()
    }

    /// The identifier of `key` in the table at `table`: it names folders, so paths are no identifiers.
    pub(super) fn identifier(
        &mut self,
        key: &str,
        raw: &Entry<String>,
        table: Option<std::ops::Range<usize>>,
        capitals: bool,
    ) -> String {
        let letters = if capitals {
            "letters"
        } else {
            "lower-case letters"
        };
        let expected = format!(
            "1 to {IDENTIFIER_MAX} {letters}, digits, `_` or `-`, beginning with a letter or digit"
        );
        let Some(raw) = raw else {
            self.missing(table, key, expected);
            return String::new();
        };
        let id = raw.get_ref();
        let accepted = id.len() <= IDENTIFIER_MAX
            && id.starts_with(|first: char| first.is_ascii_alphanumeric())
            && id.chars().all(|character| {
                character.is_ascii_lowercase()
                    || (capitals && character.is_ascii_uppercase())
                    || character.is_ascii_digit()
                    || character == '_'
                    || character == '-'
            });
        if !accepted {
            self.refuse(raw.span(), key, expected);
        }
        id.clone()
    }

    /// The path of `key`, counted from the configuration's folder; it must lead to a `target`.
    pub(super) fn existing(&mut self, key: &str, raw: &Spanned<String>, target: Target) -> PathBuf {
        let path = self.resolve(raw.get_ref());
        let (there, wanted) = match target {
            Target::File => (path.is_file(), "an existing file"),
            Target::Folder => (path.is_dir(), "an existing folder"),
        };
        if raw.get_ref().is_empty() || !there {
            let expected = format!("{wanted}; {} is {}", path.display(), what_is_at(&path));
            self.refuse(raw.span(), key, expected);
        }
        path
    }
}

/// What a path leads to, for messages.
fn what_is_at(path: &Path) -> &'static str {
    match path.metadata() {
        Ok(found) if found.is_dir() => "a folder",
        Ok(found) if found.is_file() => "a file",
        Ok(_) => "neither file nor folder",
        Err(error) if error.kind() == std::io::ErrorKind::PermissionDenied => "not to be read",
        Err(_) => "not there",
    }
}
