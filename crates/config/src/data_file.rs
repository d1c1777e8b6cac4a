//! Files of numbers with their sources: every table states the source of its values.

use std::{fmt, ops::Range, path::Path};

use toml::{
    Spanned,
    de::{DeTable, DeValue},
};

use super::{
    declare::{Found, suggestion},
    document,
    problems::{Problems, Review},
};

/// One table of a file; keys that are not read are problems when it is closed.
pub(super) struct DataTable<'i> {
    path: String,
    span: Option<Range<usize>>,
    keys: DeTable<'i>,
    known: Vec<&'static str>,
}

/// Reads the file `text` with `valid`, which takes every key.
///
/// # Errors
/// All problems, each with its place.
pub(super) fn read<T>(
    text: &str,
    file: &Path,
    valid: impl FnOnce(&mut DataTable<'_>, &mut Review<'_>) -> T,
) -> Result<T, Problems> {
    let mut review = Review::new(file, text);
    let (document, syntax_errors) = DeTable::parse_recoverable(text);
    for error in &syntax_errors {
        let message = format!("this is not TOML: {}", error.message());
        review.problem(error.span(), message);
    }
    let value = syntax_errors.is_empty().then(|| {
        let mut table = DataTable {
            path: String::new(),
            span: None,
            keys: document.into_inner(),
            known: Vec::new(),
        };
        let value = valid(&mut table, &mut review);
        table.close(&mut review);
        value
    });
    review.finish(value).map(|(value, _)| value)
}

/// The content of the file `path`, which the key `found` names, through `read`; `None` after problems were reported.
pub(super) fn named<T>(
    path: &Path,
    found: &Found<'_>,
    review: &mut Review<'_>,
    read: impl FnOnce(&str, &Path) -> Result<T, Problems>,
) -> Option<T> {
    if !review.admit(path, found.value.span(), &found.key) {
        return None;
    }
    let text = document::read(path).map_err(|failure| failure.cause.to_string());
    let read = text.and_then(|text| read(&text, path).map_err(|all| all.to_string()));
    read.map_err(|problems| {
        let text = format!("{} names a file with problems:\n{problems}", found.key);
        review.problem(Some(found.value.span()), text);
    })
    .ok()
}

impl<'i> DataTable<'i> {
    fn name(&self, key: &str) -> String {
        match &*self.path {
            "" => key.to_owned(),
            path => format!("{path}.{key}"),
        }
    }

    fn take(&mut self, key: &'static str) -> Option<Spanned<DeValue<'i>>> {
        self.known.push(key);
        self.keys.remove(key)
    }

    /// The value of `key` as `accept` converts it, or its default after a problem was reported.
    fn required<T: Default>(
        &mut self,
        review: &mut Review<'_>,
        key: &'static str,
        expected: impl fmt::Display,
        accept: impl FnOnce(&DeValue<'i>) -> Option<T>,
    ) -> T {
        let name = self.name(key);
        let Some(written) = self.take(key) else {
            review.missing(self.span.clone(), &name, expected);
            return T::default();
        };
        accept(written.get_ref()).unwrap_or_else(|| {
            review.refuse(written.span(), &name, expected);
            T::default()
        })
    }

    /// Whether `key` is written.
    pub(super) fn has(&self, key: &str) -> bool {
        self.keys.contains_key(key)
    }

    /// The table `key` through `read`; it must name its source, which `read` is given.
    pub(super) fn table<T>(
        &mut self,
        review: &mut Review<'_>,
        key: &'static str,
        read: impl FnOnce(&mut Self, String, &mut Review<'_>) -> T,
    ) -> T {
        let path = self.name(key);
        let mut table = Self {
            path: path.clone(),
            span: None,
            keys: DeTable::new(),
            known: Vec::new(),
        };
        match self.take(key) {
            None => {
                review.missing(None, &path, "a table");
                // Its keys are not reported as missing one by one.
                let mut unheard = Review::new(Path::new(""), "");
                return read(&mut table, String::new(), &mut unheard);
            }
            Some(written) => {
                let span = written.span();
                match written.into_inner() {
                    DeValue::Table(keys) => table.keys = keys,
                    _ => review.refuse(span.clone(), &path, "a table"),
                }
                table.span = Some(span);
            }
        }
        let source = table.text(review, "source");
        let value = read(&mut table, source, review);
        table.close(review);
        value
    }

    /// The text of `key`, not empty.
    pub(super) fn text(&mut self, review: &mut Review<'_>, key: &'static str) -> String {
        self.required(review, key, "some text", |value| {
            let text = value.as_str().filter(|text| !text.trim().is_empty())?;
            Some(text.to_owned())
        })
    }

    /// The meaning of the word of `key`.
    pub(super) fn word<T: Copy>(
        &mut self,
        review: &mut Review<'_>,
        key: &'static str,
        choices: &[(&str, T)],
    ) -> Option<T> {
        let words: Vec<&str> = choices.iter().map(|(word, _)| *word).collect();
        let expected = format!("one of {}", words.join(", "));
        self.required(review, key, expected, |value| {
            let found = choices
                .iter()
                .find(|(word, _)| Some(*word) == value.as_str());
            found.map(|(_, meaning)| Some(*meaning))
        })
    }

    /// The meaning of the word of `key`, where it is written.
    pub(super) fn optional_word<T: Copy>(
        &mut self,
        review: &mut Review<'_>,
        key: &'static str,
        choices: &[(&str, T)],
    ) -> Option<T> {
        if self.has(key) {
            return self.word(review, key, choices);
        }
        self.known.push(key);
        None
    }

    /// The number of `key` from `low` to `high`, where it is written.
    pub(super) fn optional_number(
        &mut self,
        review: &mut Review<'_>,
        key: &'static str,
        limits: [f64; 2],
    ) -> Option<f64> {
        if self.has(key) {
            return Some(self.number(review, key, limits));
        }
        self.known.push(key);
        None
    }

    /// The whole number of `key` from `low` to `high`, where it is written.
    pub(super) fn optional_whole(
        &mut self,
        review: &mut Review<'_>,
        key: &'static str,
        limits: [i32; 2],
    ) -> Option<i32> {
        if self.has(key) {
            return Some(self.whole(review, key, limits));
        }
        self.known.push(key);
        None
    }

    /// The number of `key` from `low` to `high`.
    pub(super) fn number(
        &mut self,
        review: &mut Review<'_>,
        key: &'static str,
        [low, high]: [f64; 2],
    ) -> f64 {
        let expected = format!("a number from {low} to {high}");
        self.required(review, key, expected, |value| {
            number(value).filter(|value| (low..=high).contains(value))
        })
    }

    /// The numbers of `key`, finite, one to `count_max` of them.
    pub(super) fn numbers(
        &mut self,
        review: &mut Review<'_>,
        key: &'static str,
        count_max: usize,
    ) -> Vec<f64> {
        let expected = format!("a list of 1 to {count_max} numbers");
        self.required(review, key, expected, |value| {
            let items = value.as_array()?;
            let numbers: Option<Vec<f64>> =
                items.iter().map(|item| number(item.get_ref())).collect();
            numbers.filter(|numbers| (1..=count_max).contains(&numbers.len()))
        })
    }

    /// The direction of `key`: three numbers, not all of them 0.
    pub(super) fn direction(&mut self, review: &mut Review<'_>, key: &'static str) -> [f64; 3] {
        self.required(review, key, "3 numbers, not all of them 0", |value| {
            let items = value.as_array()?.iter();
            let numbers: Option<Vec<f64>> = items.map(|item| number(item.get_ref())).collect();
            let direction: [f64; 3] = numbers?.try_into().ok()?;
            let length = direction.iter().fold(0.0_f64, |length, x| length.hypot(*x));
            (length > 1e-6).then_some(direction)
        })
    }

    /// The whole number of `key` from `low` to `high`.
    pub(super) fn whole(
        &mut self,
        review: &mut Review<'_>,
        key: &'static str,
        [low, high]: [i32; 2],
    ) -> i32 {
        let expected = format!("a whole number from {low} to {high}");
        self.required(review, key, expected, |value| {
            whole(value).filter(|value| (low..=high).contains(value))
        })
    }

    /// The whole numbers of `key` from 1 to `high`; empty without the key.
    pub(super) fn optional_counts(
        &mut self,
        review: &mut Review<'_>,
        key: &'static str,
        high: u32,
    ) -> Vec<u32> {
        if !self.has(key) {
            self.known.push(key);
            return Vec::new();
        }
        let expected = format!("a list of whole numbers from 1 to {high}");
        self.required(review, key, expected, |value| {
            let items = value.as_array()?.iter();
            let count = |item: &Spanned<DeValue<'_>>| {
                let count = u32::try_from(whole(item.get_ref())?).ok()?;
                (1..=high).contains(&count).then_some(count)
            };
            items.map(count).collect()
        })
    }

    /// The text of `key`, not empty where it is written.
    pub(super) fn optional_text(
        &mut self,
        review: &mut Review<'_>,
        key: &'static str,
    ) -> Option<String> {
        if self.has(key) {
            return Some(self.text(review, key));
        }
        self.known.push(key);
        None
    }

    fn close(self, review: &mut Review<'_>) {
        for key in self.keys.keys() {
            let name = self.name(key.get_ref());
            let expected = suggestion(key.get_ref(), &self.known);
            review.problem(
                Some(key.span()),
                format!("{name} is an unknown key; expected {expected}"),
            );
        }
    }
}

fn number(value: &DeValue<'_>) -> Option<f64> {
    let written = match value {
        DeValue::Float(float) => float.as_str(),
        DeValue::Integer(integer) => integer.as_str(),
        _ => return None,
    };
    written.parse().ok().filter(|value: &f64| value.is_finite())
}

fn whole(value: &DeValue<'_>) -> Option<i32> {
    match value {
        DeValue::Integer(integer) => i32::from_str_radix(integer.as_str(), integer.radix()).ok(),
        _ => None,
    }
}
