//! The declarations, as data: for the example, the schema, and tests that walk all keys.

use std::fmt;

use serde_json::Value as Json;
use toml::Value;

/// Accepted numbers. Comparisons are written so that NaN is refused too.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Accept {
    /// Both ends included.
    FromTo(f64, f64),
    /// Above the first, at most the second.
    AboveTo(f64, f64),
    /// 0, and an interval with both ends.
    ZeroOr(f64, f64),
}

impl Accept {
    /// Whether `value` is accepted.
    #[must_use]
    pub fn takes(self, value: f64) -> bool {
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
                write!(formatter, "0, a number of at least {low}, or inf")
            }
            Self::ZeroOr(low, high) => {
                write!(formatter, "0, or a number from {low} to {high}")
            }
            Self::FromTo(low, high) => write!(formatter, "a number from {low} to {high}"),
            Self::AboveTo(low, high) => write!(formatter, "a number above {low}, at most {high}"),
        }
    }
}

/// One of the words that a key accepts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Word {
    /// As written in the file.
    pub word: &'static str,
    /// Its meaning; empty if the word is self-explanatory.
    pub meaning: &'static str,
}

/// The values that a key takes.
#[derive(Debug, Clone, PartialEq)]
pub enum ValueKind {
    /// Free text.
    Text {
        /// Whether it may be empty.
        empty: bool,
    },
    /// Text of a certain form.
    Form {
        /// In words.
        expected: String,
        /// The expected form, or part of it, as a regular expression (ECMA 262).
        pattern: &'static str,
    },
    /// The path of an existing file.
    File,
    /// The path of an existing folder.
    Folder,
    /// The path of a folder, which may be temporarily absent.
    Mirror,
    /// A path or glob that matches a file.
    Glob,
    /// A number.
    Number(Accept),
    /// A whole number, both ends included.
    Whole {
        /// Smallest.
        low: i64,
        /// Largest.
        high: i64,
    },
    /// One of several words.
    Word(Vec<Word>),
    /// `true` or `false`.
    Switch,
    /// A list.
    List {
        /// In words.
        expected: String,
        /// Its entries.
        of: Box<ValueKind>,
        /// Required number of entries, `None` for any number.
        count: Option<usize>,
        /// Whether it may be empty.
        empty: bool,
        /// Whether entries must be distinct.
        distinct: bool,
    },
}

impl fmt::Display for ValueKind {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Text { empty: true } => formatter.write_str("text"),
            Self::Text { empty: false } => formatter.write_str("some text"),
            Self::Form { expected, .. } | Self::List { expected, .. } => {
                formatter.write_str(expected)
            }
            Self::File => formatter.write_str("an existing file"),
            Self::Folder => formatter.write_str("an existing folder"),
            Self::Mirror => formatter.write_str("a folder"),
            Self::Glob => formatter.write_str("a file, a folder or a matching glob"),
            Self::Number(accept) => accept.fmt(formatter),
            Self::Whole { low, high } => {
                write!(formatter, "a whole number from {low} to {high}")
            }
            Self::Switch => formatter.write_str("true or false"),
            Self::Word(words) => {
                let words: Vec<&str> = words.iter().map(|word| word.word).collect();
                write!(formatter, "one of {}", words.join(", "))
            }
        }
    }
}

/// A key of the configuration, as it was declared.
#[derive(Debug, Clone, PartialEq)]
pub struct DeclaredKey {
    /// Its tables and its name with dots between them; the same for every entry of a list of tables.
    pub path: String,
    /// Documentation, line by line.
    pub about: Vec<&'static str>,
    /// The values it takes.
    pub kind: ValueKind,
    /// The unit that its name ends in.
    pub unit: Option<&'static str>,
    /// Its default; `None` when there is no single one.
    pub default: Option<Value>,
    /// Whether its table must have it.
    pub required: bool,
    /// Values of the example file, as TOML.
    pub examples: Vec<String>,
    /// A former name that is still understood.
    pub was: Option<&'static str>,
}

/// A value of the example file.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Example {
    /// Index of its entry in a list of tables, from 0.
    pub(crate) entry: usize,
    pub(crate) toml: &'static str,
    /// Whether it is active, not commented out.
    pub(crate) used: bool,
}

/// A key in its table.
#[derive(Debug, Clone)]
pub(crate) struct DescribedKey {
    pub(crate) name: &'static str,
    pub(crate) about: &'static [&'static str],
    pub(crate) kind: ValueKind,
    pub(crate) default: Option<Value>,
    pub(crate) required: bool,
    pub(crate) examples: Vec<Example>,
    pub(crate) was: Option<&'static str>,
}

impl DescribedKey {
    /// The unit that the name of the key ends in.
    pub(crate) fn unit(&self) -> Option<&'static str> {
        const UNITS: [(&str, &str); 8] = [
            ("_m", "metres"),
            ("_km", "kilometres"),
            ("_s", "seconds"),
            ("_ms", "milliseconds"),
            ("_deg", "degrees"),
            ("_arcsec", "arcseconds"),
            ("_px", "pixels"),
            ("_lines", "lines"),
        ];
        let unit = UNITS.iter().find(|(end, _)| self.name.ends_with(end));
        unit.map(|(_, unit)| *unit)
    }
}

/// Permitted number of tables in a list, and their documentation in the example file.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Many {
    /// Minimum and maximum number of entries; `None` for any number.
    pub(crate) count: Option<(usize, usize)>,
    /// Their purpose, which follows the expected number in messages.
    pub(crate) purpose: &'static str,
    /// Documentation before each entry of the example file after the first.
    pub(crate) further: &'static [&'static [&'static str]],
}

impl Many {
    /// Any number of entries.
    pub(crate) const ANY: Self = Self {
        count: None,
        purpose: "",
        further: &[],
    };
}

/// A table with its keys and the tables below it.
#[derive(Debug, Clone)]
pub(crate) struct DescribedTable {
    /// Names with dots between them, empty for the file itself.
    pub(crate) path: String,
    pub(crate) about: &'static [&'static str],
    /// A former name that is still understood.
    pub(crate) was: Option<&'static str>,
    /// Whether it is a list of tables.
    pub(crate) many: Option<Many>,
    pub(crate) keys: Vec<DescribedKey>,
    pub(crate) tables: Vec<DescribedTable>,
    /// Rules of the schema beyond single keys.
    pub(crate) rules: Vec<Json>,
}

impl DescribedTable {
    /// The last part of its path.
    pub(crate) fn name(&self) -> &str {
        self.path.rsplit('.').next().unwrap_or_default()
    }

    /// All keys; those of subtables follow those of their table.
    pub(crate) fn walk(&self, into: &mut Vec<DeclaredKey>) {
        let dot = if self.path.is_empty() { "" } else { "." };
        into.extend(self.keys.iter().map(|key| {
            DeclaredKey {
                path: format!("{}{dot}{}", self.path, key.name),
                about: key.about.to_vec(),
                kind: key.kind.clone(),
                unit: key.unit(),
                default: key.default.clone(),
                required: key.required,
                examples: key
                    .examples
                    .iter()
                    .map(|example| example.toml.to_owned())
                    .collect(),
                was: key.was,
            }
        }));
        for table in &self.tables {
            table.walk(into);
        }
    }
}
