//! The forms of values: numbers, words, text, lists; paths are in `paths`.

use std::collections::BTreeSet;

use toml::{Value, de::DeValue};

use super::{
    declare::{Accept, Form, Found, ValueKind, Word, suggestion},
    problems::Review,
};

/// Longest identifier; folders are named after them.
const IDENTIFIER_MAX: usize = 64;

/// A number.
pub(super) struct Number(Accept);

/// A number from `low` to `high`.
pub(super) const fn from_to(low: f64, high: f64) -> Number {
    Number(Accept::FromTo(low, high))
}

/// A number above `low`, at most `high`.
pub(super) const fn above_to(low: f64, high: f64) -> Number {
    Number(Accept::AboveTo(low, high))
}

/// 0, or a number from `low` to `high`.
pub(super) const fn zero_or(low: f64, high: f64) -> Number {
    Number(Accept::ZeroOr(low, high))
}

impl Form for Number {
    type Value = f64;

    fn kind(&self) -> ValueKind {
        ValueKind::Number(self.0)
    }

    fn read(&self, found: &Found<'_>, review: &mut Review<'_>) -> Option<f64> {
        let value =
            match found.value.get_ref() {
                // A number too large for a float reads as infinite.
                DeValue::Float(float) => float.as_str().parse().ok().filter(|value: &f64| {
                    value.is_finite() || !float.as_str().contains(['e', 'E'])
                }),
                DeValue::Integer(_) => whole(found.value.get_ref()).map(|value| value as f64),
                _ => None,
            };
        let value = value.filter(|value| self.0.takes(*value));
        if value.is_none() {
            found.refuse(review, self.0);
        }
        value
    }

    fn written(&self, value: &f64) -> Value {
        Value::Float(*value)
    }
}

fn whole(value: &DeValue<'_>) -> Option<i64> {
    let integer = value.as_integer()?;
    i64::from_str_radix(integer.as_str(), integer.radix()).ok()
}

/// A whole number from `low` to `high`.
pub(super) struct Whole<T> {
    low: T,
    high: T,
}

/// A whole number from `low` to `high`.
pub(super) const fn whole_from_to<T>(low: T, high: T) -> Whole<T> {
    Whole { low, high }
}

impl<T: TryFrom<i64> + Into<i64> + Copy> Form for Whole<T> {
    type Value = T;

    fn kind(&self) -> ValueKind {
        ValueKind::Whole {
            low: self.low.into(),
            high: self.high.into(),
        }
    }

    fn read(&self, found: &Found<'_>, review: &mut Review<'_>) -> Option<T> {
        let accepted = self.low.into()..=self.high.into();
        let value = whole(found.value.get_ref())
            .filter(|value| accepted.contains(value))
            .and_then(|value| T::try_from(value).ok());
        if value.is_none() {
            found.refuse(review, self.kind());
        }
        value
    }

    fn written(&self, value: &T) -> Value {
        Value::Integer((*value).into())
    }
}

/// One of `N` words, each with its value and meaning.
pub(super) struct Words<T, const N: usize>([(&'static str, T, &'static str); N]);

/// One of these words: as written, as valid, and its meaning, empty if self-explanatory.
pub(super) const fn words<T, const N: usize>(
    words: [(&'static str, T, &'static str); N],
) -> Words<T, N> {
    Words(words)
}

/// `true` or `false`.
pub(super) struct Switch;

impl Form for Switch {
    type Value = bool;

    fn kind(&self) -> ValueKind {
        ValueKind::Switch
    }

    fn read(&self, found: &Found<'_>, review: &mut Review<'_>) -> Option<bool> {
        let value = found.value.get_ref().as_bool();
        if value.is_none() {
            found.refuse(review, self.kind());
        }
        value
    }

    fn written(&self, value: &bool) -> Value {
        Value::Boolean(*value)
    }
}

/// "no" or "yes", and what each means.
pub(super) const fn yes_or_no(no: &'static str, yes: &'static str) -> Words<bool, 2> {
    words([("no", false, no), ("yes", true, yes)])
}

/// Words that are defined elsewhere.
pub(super) fn words_of<T: Copy, const N: usize>(
    words: [(&'static str, T); N],
    meanings: [&'static str; N],
) -> Words<T, N> {
    Words(std::array::from_fn(|i| {
        (words[i].0, words[i].1, meanings[i])
    }))
}

impl<T: Copy + PartialEq, const N: usize> Form for Words<T, N> {
    type Value = T;

    fn kind(&self) -> ValueKind {
        let words = self.0.iter();
        ValueKind::Word(
            words
                .map(|(word, _, meaning)| Word { word, meaning })
                .collect(),
        )
    }

    fn read(&self, found: &Found<'_>, review: &mut Review<'_>) -> Option<T> {
        let written = found.value.get_ref().as_str();
        let value = self.0.iter().find(|(word, ..)| Some(*word) == written);
        if value.is_none() {
            let known = self.0.each_ref().map(|(word, ..)| *word);
            found.refuse(review, suggestion(written.unwrap_or_default(), &known));
        }
        value.map(|(_, value, _)| *value)
    }

    fn written(&self, value: &T) -> Value {
        let word = self.0.iter().find(|(_, known, _)| known == value);
        Value::from(word.map_or("", |(word, ..)| word))
    }
}

/// Free text.
pub(super) struct Text {
    empty: bool,
}

/// Any text, including empty text.
pub(super) const fn any_text() -> Text {
    Text { empty: true }
}

/// Non-empty text.
pub(super) const fn text() -> Text {
    Text { empty: false }
}

impl Form for Text {
    type Value = String;

    fn kind(&self) -> ValueKind {
        ValueKind::Text { empty: self.empty }
    }

    fn read(&self, found: &Found<'_>, review: &mut Review<'_>) -> Option<String> {
        let text = found.value.get_ref().as_str();
        let text = text.filter(|text| self.empty || !text.trim().is_empty());
        if text.is_none() {
            found.refuse(review, self.kind());
        }
        text.map(str::to_owned)
    }

    fn written(&self, value: &String) -> Value {
        Value::from(value.as_str())
    }
}

/// Text of a certain form.
pub(super) struct Matching {
    expected: String,
    pattern: &'static str,
    takes: fn(&str) -> bool,
}

/// Text that `takes` accepts; `pattern` is the same condition, or a weaker one, as a regular expression.
pub(super) fn matching(expected: &str, pattern: &'static str, takes: fn(&str) -> bool) -> Matching {
    Matching {
        expected: expected.to_owned(),
        pattern,
        takes,
    }
}

/// An identifier in lower-case letters: it names folders, so paths are no identifiers.
pub(super) fn lower_case_identifier() -> Matching {
    Matching {
        expected: SITE_IDENTIFIER.to_owned(),
        pattern: "^[a-z0-9][a-z0-9_-]{0,63}$",
        takes: is_site_identifier,
    }
}

/// An identifier in letters of both cases.
pub(super) fn identifier() -> Matching {
    Matching {
        expected: format!(
            "1 to {IDENTIFIER_MAX} letters, digits, `_` or `-`, beginning with a letter or digit"
        ),
        pattern: "^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$",
        takes: is_identifier,
    }
}

/// The form of the identifier of a site.
pub const SITE_IDENTIFIER: &str =
    "1 to 64 lower-case letters, digits, `_` or `-`, beginning with a letter or digit";
const _: () = assert!(IDENTIFIER_MAX == 64, "as stated in SITE_IDENTIFIER");

/// Whether a text may be the identifier of a site.
#[must_use]
pub fn is_site_identifier(text: &str) -> bool {
    is_identifier(text) && !text.contains(|c: char| c.is_ascii_uppercase())
}

fn is_identifier(text: &str) -> bool {
    text.len() <= IDENTIFIER_MAX
        && text.starts_with(|first: char| first.is_ascii_alphanumeric())
        && text
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-')
}

impl Form for Matching {
    type Value = String;

    fn kind(&self) -> ValueKind {
        ValueKind::Form {
            expected: self.expected.clone(),
            pattern: self.pattern,
        }
    }

    fn read(&self, found: &Found<'_>, review: &mut Review<'_>) -> Option<String> {
        let text = found.value.get_ref().as_str();
        let text = text.filter(|text| (self.takes)(text));
        if text.is_none() {
            found.refuse(review, &self.expected);
        }
        text.map(str::to_owned)
    }

    fn written(&self, value: &String) -> Value {
        Value::from(value.as_str())
    }
}

/// A list of any number of values.
pub(super) struct List<F> {
    form: F,
    expected: &'static str,
    empty: bool,
    each_once: Option<&'static str>,
}

/// At least one value.
pub(super) const fn list<F>(form: F) -> List<F> {
    List {
        form,
        expected: "at least one entry",
        empty: false,
        each_once: None,
    }
}

/// Any number of values.
pub(super) const fn list_or_none<F>(form: F) -> List<F> {
    List {
        form,
        expected: "a list",
        empty: true,
        each_once: None,
    }
}

impl<F> List<F> {
    /// Entries must be distinct; `expected` states this.
    pub(super) const fn each_once(mut self, expected: &'static str) -> Self {
        self.each_once = Some(expected);
        self
    }
}

impl<F: Form> Form for List<F>
where
    F::Value: Ord + Clone,
{
    type Value = Vec<F::Value>;

    fn kind(&self) -> ValueKind {
        ValueKind::List {
            expected: self.expected.to_owned(),
            of: Box::new(self.form.kind()),
            count: None,
            empty: self.empty,
            distinct: self.each_once.is_some(),
        }
    }

    fn read(&self, found: &Found<'_>, review: &mut Review<'_>) -> Option<Vec<F::Value>> {
        let entries = found.value.get_ref().as_array();
        let Some(entries) = entries.filter(|entries| self.empty || !entries.is_empty()) else {
            found.refuse(review, self.expected);
            return None;
        };
        let mut values: Vec<F::Value> = Vec::with_capacity(entries.len());
        let mut seen = BTreeSet::new();
        for entry in entries {
            let entry = Found {
                key: found.key.clone(),
                value: entry,
            };
            let Some(value) = self.form.read(&entry, review) else {
                continue;
            };
            match self.each_once {
                Some(expected) if !seen.insert(value.clone()) => entry.refuse(review, expected),
                _ => values.push(value),
            }
        }
        Some(values)
    }

    fn written(&self, values: &Vec<F::Value>) -> Value {
        let values = values.iter().map(|value| self.form.written(value));
        Value::Array(values.collect())
    }
}

/// `N` values.
pub(super) struct Several<F, const N: usize> {
    form: F,
    expected: &'static str,
}

/// `N` values; `expected` states how many.
pub(super) const fn several<F, const N: usize>(form: F, expected: &'static str) -> Several<F, N> {
    Several { form, expected }
}

impl<F: Form, const N: usize> Form for Several<F, N> {
    type Value = [F::Value; N];

    fn kind(&self) -> ValueKind {
        ValueKind::List {
            expected: self.expected.to_owned(),
            of: Box::new(self.form.kind()),
            count: Some(N),
            empty: false,
            distinct: false,
        }
    }

    fn read(&self, found: &Found<'_>, review: &mut Review<'_>) -> Option<[F::Value; N]> {
        let entries = found.value.get_ref().as_array();
        let Some(entries) = entries.filter(|entries| entries.len() == N) else {
            found.refuse(review, self.expected);
            return None;
        };
        let values = entries.iter().filter_map(|value| {
            let key = found.key.clone();
            self.form.read(&Found { key, value }, review)
        });
        let values: Vec<F::Value> = values.collect();
        values.try_into().ok()
    }

    fn written(&self, values: &[F::Value; N]) -> Value {
        let values = values.iter().map(|value| self.form.written(value));
        Value::Array(values.collect())
    }
}
