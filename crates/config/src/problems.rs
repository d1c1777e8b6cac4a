//! All problems of one configuration file, each with its place.

use std::{
    collections::BTreeSet,
    fmt,
    ops::Range,
    path::{Path, PathBuf},
};

use areograph_base::error::{Cause, Kind};
use areograph_store::files::outside;

/// Problems reported one by one; for a file with more, the number of the others is reported.
const LISTED_MAX: usize = 100;
/// Words of a warning about a former name.
pub(super) const IS_NOW_CALLED: &str = "is now called";
/// Characters of a value that a message repeats.
const EXCERPT_MAX: usize = 60;

/// Documents every key of a site.
pub(super) const SITE_EXAMPLE: &str = "config/sites/example.toml";

/// Everything that is wrong with one configuration file, in order of place.
#[derive(Debug, Clone, PartialEq, Eq, Cause)]
#[cause(kind_of(*is_absence): "{}", advice_on(*is_absence, documentation))]
pub struct Problems {
    lines: Vec<String>,
    /// Whether every problem is a file that does not exist.
    is_absence: bool,
    unlisted: usize,
    /// The file that documents every key.
    documentation: &'static str,
}

/// A missing file has the same kind wherever it is named.
const fn kind_of(is_absence: bool) -> Kind {
    if is_absence {
        Kind::Input
    } else {
        Kind::Configuration
    }
}

fn advice_on(is_absence: bool, documentation: &str) -> String {
    if is_absence {
        "correct these paths, which are relative to the folder of the configuration file, or provide the files"
            .to_owned()
    } else {
        format!(
            "correct these entries; {documentation} documents every key with its unit and default"
        )
    }
}

impl Problems {
    /// One problem that concerns the file as a whole.
    pub(super) fn of_file(file: &Path, text: &str) -> Self {
        Self {
            lines: vec![format!("{}: {text}", file.display())],
            is_absence: false,
            unlisted: 0,
            documentation: SITE_EXAMPLE,
        }
    }
}

impl fmt::Display for Problems {
    /// One problem per line: `file:line:column: key is value; expected …`.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.lines.join("\n"))?;
        match self.unlisted {
            0 => Ok(()),
            more => write!(formatter, "\n… and {more} more problems"),
        }
    }
}

impl std::error::Error for Problems {}

/// Position of an entry: a byte range of the text, or the file as a whole.
type TextSpan = Option<Range<usize>>;

/// A key that the file gives under its former name.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Rename {
    /// Its tables, with dots between them.
    pub(super) table: String,
    /// Its former name.
    pub(super) was: &'static str,
    /// Its name.
    pub(super) name: &'static str,
}

/// The text under review, and what has been found in it so far.
pub(super) struct Review<'a> {
    file: &'a Path,
    text: &'a str,
    problems: Vec<(TextSpan, String)>,
    /// Number of problems that are files that do not exist.
    absences: usize,
    unlisted: usize,
    warnings: Vec<(TextSpan, String)>,
    renames: BTreeSet<Rename>,
    documentation: &'static str,
    /// Folders below which files must lie; none for no such rule.
    roots: &'a [PathBuf],
    /// Files that the text leads to.
    files: Vec<PathBuf>,
    /// Whether files may be missing, and which ones are.
    absent: Option<Vec<PathBuf>>,
}

impl<'a> Review<'a> {
    pub(super) const fn new(file: &'a Path, text: &'a str) -> Self {
        Self {
            file,
            text,
            problems: Vec::new(),
            absences: 0,
            unlisted: 0,
            warnings: Vec::new(),
            renames: BTreeSet::new(),
            documentation: SITE_EXAMPLE,
            roots: &[],
            files: Vec::new(),
            absent: None,
        }
    }

    /// The review of a file whose inputs may be missing.
    pub(super) fn unfilled(self) -> Self {
        Self {
            absent: Some(Vec::new()),
            ..self
        }
    }

    /// Whether nothing is at a path, or matches a glob, and that is permitted; it is then recorded.
    pub(super) fn may_lack(&mut self, path: &Path) -> bool {
        let Some(absent) = self.absent.as_mut().filter(|_| !path.exists()) else {
            return false;
        };
        absent.push(path.to_owned());
        true
    }

    /// Files, folders and globs that lead nowhere.
    pub(super) fn take_absent(&mut self) -> Vec<PathBuf> {
        self.absent.take().unwrap_or_default()
    }

    /// The review of a file that may lead only below these folders.
    pub(super) fn within(self, roots: &'a [PathBuf]) -> Self {
        Self { roots, ..self }
    }

    /// Records a file to which the value of `key` at `span` refers. A file outside the permitted folders is a problem
    /// and must not be read.
    pub(super) fn admit(&mut self, path: &Path, span: Range<usize>, key: &str) -> bool {
        match outside(path, self.roots) {
            None => {
                self.files.push(path.to_owned());
                true
            }
            Some(outside) => {
                self.refuse(span, key, outside);
                false
            }
        }
    }

    /// Files to which the text refers.
    pub(super) fn take_files(&mut self) -> Vec<PathBuf> {
        std::mem::take(&mut self.files)
    }

    /// The review of a file whose keys a different example documents.
    pub(super) fn documented_in(self, documentation: &'static str) -> Self {
        Self {
            documentation,
            ..self
        }
    }

    /// `path` as written in the file, relative to the file's folder unless absolute.
    pub(super) fn resolve(&self, path: &str) -> PathBuf {
        let folder = self.file.parent().unwrap_or(Path::new(""));
        let (folder, path) = shortened(folder, Path::new(path));
        folder.join(path)
    }

    /// A problem with a separate text.
    pub(super) fn problem(&mut self, place: TextSpan, text: String) {
        if self.problems.len() < LISTED_MAX {
            self.problems.push((place, text));
        } else {
            self.unlisted += 1;
        }
    }

    /// The value at `span` is not what `key` takes.
    pub(super) fn refuse(&mut self, span: Range<usize>, key: &str, expected: impl fmt::Display) {
        let value = self.excerpt(&span);
        self.problem(Some(span), format!("{key} is {value}; expected {expected}"));
    }

    /// The value at `span` names a file that does not exist.
    pub(super) fn refuse_absent(
        &mut self,
        span: Range<usize>,
        key: &str,
        expected: impl fmt::Display,
    ) {
        self.absences += 1;
        self.refuse(span, key, expected);
    }

    /// `key` is absent from the table at `place`.
    pub(super) fn missing(&mut self, place: TextSpan, key: &str, expected: impl fmt::Display) {
        self.problem(place, format!("{key} is missing; expected {expected}"));
    }

    /// The entry at `span` is accepted with a warning.
    pub(super) fn warn(&mut self, span: Range<usize>, text: String) {
        if self.warnings.len() < LISTED_MAX {
            self.warnings.push((Some(span), text));
        }
    }

    /// The key at `span` has its former name.
    pub(super) fn renamed(&mut self, span: Range<usize>, rename: Rename) {
        let Rename { table, was, name } = &rename;
        let dot = if table.is_empty() { "" } else { "." };
        self.warn(
            span,
            format!("{table}{dot}{was} {IS_NOW_CALLED} {table}{dot}{name}"),
        );
        self.renames.insert(rename);
    }

    pub(super) const fn has_problems(&self) -> bool {
        !self.problems.is_empty()
    }

    /// Keys that have their former names.
    pub(super) const fn renames(&self) -> &BTreeSet<Rename> {
        &self.renames
    }

    /// The value and the warnings, or the problems when there are any.
    pub(super) fn finish<T>(mut self, value: Option<T>) -> Result<(T, Vec<String>), Problems> {
        let problems = std::mem::take(&mut self.problems);
        let warnings = std::mem::take(&mut self.warnings);
        match value {
            Some(value) if problems.is_empty() => Ok((value, self.placed(warnings))),
            _ => Err(Problems {
                is_absence: self.absences == problems.len() + self.unlisted,
                lines: self.placed(problems),
                unlisted: self.unlisted,
                documentation: self.documentation,
            }),
        }
    }

    /// `file:line:column: text` for each entry, in order of place.
    fn placed(&self, mut entries: Vec<(TextSpan, String)>) -> Vec<String> {
        entries.sort_by_key(|(place, _)| place.as_ref().map(|span| span.start));
        let file = self.file.display();
        entries
            .into_iter()
            .map(|(place, text)| match place {
                None => format!("{file}: {text}"),
                Some(span) => {
                    let (line, column) = line_and_column(self.text, span.start);
                    format!("{file}:{line}:{column}: {text}")
                }
            })
            .collect()
    }

    /// The value as written, on one line and of bounded length.
    fn excerpt(&self, span: &Range<usize>) -> String {
        let written = self.text.get(span.clone()).unwrap_or_default();
        let mut excerpt = String::new();
        for (count, character) in written.chars().enumerate() {
            if count == EXCERPT_MAX {
                excerpt.push('…');
                break;
            }
            if character.is_control() {
                excerpt.extend(character.escape_default());
            } else {
                excerpt.push(character);
            }
        }
        excerpt
    }
}

/// A folder and a path from there, without steps into the folder and back: messages state short paths. A folder that is
/// a link stays, since its parent is not the one of its name.
pub(super) fn shortened<'a>(folder: &Path, path: &'a Path) -> (PathBuf, &'a Path) {
    let (mut folder, mut path) = (folder.to_owned(), path);
    while let Ok(rest) = path.strip_prefix("..") {
        let is_real = folder.file_name().is_some()
            && folder.symlink_metadata().is_ok_and(|found| found.is_dir());
        if !is_real || rest.as_os_str().is_empty() {
            break;
        }
        folder.pop();
        path = rest;
    }
    (folder, path)
}

/// Line and column of a byte, both counted from 1, the column in characters.
fn line_and_column(text: &str, offset: usize) -> (usize, usize) {
    let before = &text[..text.floor_char_boundary(offset)];
    let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
    let line = 1 + before.bytes().filter(|byte| *byte == b'\n').count();
    (line, 1 + before[line_start..].chars().count())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_lead_back_without_a_step_into_the_folder() {
        let folder = tempfile::tempdir().unwrap();
        let (real, link) = (folder.path().join("a/b"), folder.path().join("a/link"));
        std::fs::create_dir_all(&real).unwrap();
        std::os::unix::fs::symlink(folder.path(), &link).unwrap();
        let seen = |from: &Path, path: &str| {
            let (folder, path) = shortened(from, Path::new(path));
            folder.join(path)
        };
        assert_eq!(seen(&real, "../../x.tm"), folder.path().join("x.tm"));
        assert_eq!(seen(&link, "../x.tm"), link.join("../x.tm"));
        assert_eq!(seen(&real, ".."), real.join(".."));
        assert_eq!(seen(Path::new(""), "../x.tm"), Path::new("../x.tm"));
    }

    #[test]
    fn problems_come_in_order_of_place_and_long_lists_are_cut() {
        let text = "a = 1\nbé = 'x'\n";
        let file = Path::new("s.toml");
        let mut review = Review::new(file, text);
        review.refuse(12..15, "bé", "a number");
        review.refuse(4..5, "a", "a string");
        review.missing(None, "site", "an identifier");
        let found = review.finish(Some(())).unwrap_err();
        assert_eq!(
            found.to_string(),
            "s.toml: site is missing; expected an identifier\n\
             s.toml:1:5: a is 1; expected a string\n\
             s.toml:2:6: bé is 'x'; expected a number"
        );

        let mut review = Review::new(file, text);
        for _ in 0..LISTED_MAX + 7 {
            review.refuse(4..5, "a", "a string");
        }
        let found = review.finish(Some(())).unwrap_err().to_string();
        assert_eq!(found.lines().count(), LISTED_MAX + 1);
        assert!(found.ends_with("… and 7 more problems"));
    }
}
