//! Keys of one table, taken one by one.

use std::{collections::BTreeSet, ops::Range, path::Path};

use serde_json::Value as Json;
use toml::{
    Spanned,
    de::{DeTable, DeValue},
};

use super::{
    super::problems::{Rename, Review},
    Found, Table,
    described::{DescribedKey, DescribedTable, Many},
};

/// The keys of one table: as a file has them, or only described.
pub(crate) struct Keys<'a, 'r> {
    /// Names with dots between them, empty for the file itself.
    path: String,
    /// The table, when there is one.
    table: Option<&'a DeTable<'a>>,
    /// Position of the table; `None` for the file itself and for an absent table.
    span: Option<Range<usize>>,
    /// Keys and tables declared so far.
    declared: Vec<&'static str>,
    /// Former names found, and the current names.
    former: Vec<(&'static str, &'static str)>,
    /// The declarations, if requested.
    description: Option<Description>,
    review: &'a mut Review<'r>,
}

/// The declarations of `T`, as the file.
pub(crate) fn described<T: Table>() -> DescribedTable {
    let mut review = Review::new(Path::new(""), "");
    let mut keys = Keys {
        description: Some(Description::default()),
        ..Keys::absent(&mut review)
    };
    T::read(&mut keys);
    keys.finish_described(T::ABOUT, None, None)
}

#[derive(Default)]
struct Description {
    keys: Vec<DescribedKey>,
    tables: Vec<DescribedTable>,
    rules: Vec<Json>,
}

impl<'a, 'r> Keys<'a, 'r> {
    /// The keys of a file.
    pub(crate) fn of_file(table: &'a DeTable<'a>, review: &'a mut Review<'r>) -> Self {
        Self {
            table: Some(table),
            ..Self::absent(review)
        }
    }

    /// No file at all: every key has its default.
    fn absent(review: &'a mut Review<'r>) -> Self {
        Self {
            path: String::new(),
            table: None,
            span: None,
            declared: Vec::new(),
            former: Vec::new(),
            description: None,
            review,
        }
    }

    /// `T` with every key at its default.
    pub(crate) fn default_of<T: Table>() -> T {
        let mut review = Review::new(Path::new(""), "");
        T::read(&mut Keys::absent(&mut review))
    }

    pub(super) fn describe(&mut self, key: impl FnOnce() -> DescribedKey) {
        if let Some(description) = &mut self.description {
            description.keys.push(key());
        }
    }

    /// Adds a schema rule for this table beyond single keys.
    pub(crate) fn rule(&mut self, rule: impl FnOnce() -> Json) {
        if let Some(description) = &mut self.description {
            description.rules.push(rule());
        }
    }

    pub(crate) fn review(&mut self) -> &mut Review<'r> {
        self.review
    }

    /// The key `name` of this table as messages name it.
    pub(crate) fn path_of(&self, name: &str) -> String {
        match &*self.path {
            "" => name.to_owned(),
            path => format!("{path}.{name}"),
        }
    }

    /// The value of the key `name`, or of `was`, its former name.
    pub(super) fn find(
        &mut self,
        name: &'static str,
        was: Option<&'static str>,
    ) -> Option<Found<'a>> {
        self.declared.push(name);
        let table = self.table?;
        let (key, value) = match was.and_then(|was| Some((was, table.get_key_value(was)?))) {
            None => (name, table.get(name)?),
            Some((was, (written, value))) => {
                self.former.push((was, name));
                if table.contains_key(name) {
                    let (old, new) = (self.path_of(was), self.path_of(name));
                    let text = format!("{old} is now called {new}; expected only {new}");
                    self.review.problem(Some(written.span()), text);
                } else {
                    let table = self.path.clone();
                    self.review
                        .renamed(written.span(), Rename { table, was, name });
                }
                (was, value)
            }
        };
        Some(Found {
            key: self.path_of(key),
            value,
        })
    }

    /// Whether an unknown key resembles one of `names`; then that key is reported instead of the missing one.
    pub(crate) fn misspelt(&self, names: &[&str]) -> bool {
        let keys = self.table.into_iter().flat_map(|table| table.keys());
        let mut unknown = keys
            .map(|key| key.get_ref().as_ref())
            .filter(|key| !self.is_known(key));
        unknown.any(|key| nearest(key, names).is_some())
    }

    fn is_known(&self, key: &str) -> bool {
        self.declared.contains(&key) || self.former.iter().any(|(was, _)| *was == key)
    }

    /// Reports that the key `name` is missing, if its table exists.
    pub(crate) fn missing(&mut self, name: &str, expected: &str) {
        if self.table.is_some() && !self.misspelt(&[name]) {
            let key = self.path_of(name);
            self.review.missing(self.span.clone(), &key, expected);
        }
    }

    /// The value of the key `name`, and the name it has in the file.
    fn written<'n>(&self, name: &'n str) -> Option<(&'n str, &'a Spanned<DeValue<'a>>)> {
        let table = self.table?;
        let former = self.former.iter().find(|(_, present)| *present == name);
        let key = former.map_or(name, |(was, _)| was);
        Some((key, table.get(key)?))
    }

    /// Position of the value of the key `name`, if it exists.
    pub(crate) fn span_of(&self, name: &str) -> Option<Range<usize>> {
        self.written(name).map(|(_, value)| value.span())
    }

    fn value_below(&self, table: &str, name: &str) -> Option<&'a Spanned<DeValue<'a>>> {
        let (_, below) = self.written(table)?;
        below.get_ref().as_table()?.get(name)
    }

    /// Whether the key `name` of the table `table` below this one is written.
    pub(crate) fn writes(&self, table: &str, name: &str) -> bool {
        self.value_below(table, name).is_some()
    }

    /// Whether there is something in the table's place that is not a table.
    pub(crate) const fn is_no_table(&self) -> bool {
        self.table.is_none() && self.span.is_some()
    }

    /// Reports that the value of the key `name`, if it exists, is not `expected`.
    pub(crate) fn refuse(&mut self, name: &str, expected: impl std::fmt::Display) {
        if let Some((key, value)) = self.written(name) {
            let (key, span) = (self.path_of(key), value.span());
            self.review.refuse(span, &key, expected);
        }
    }

    /// Refuses a key of the table `table` below this one.
    pub(crate) fn refuse_below(
        &mut self,
        table: &str,
        name: &str,
        expected: impl std::fmt::Display,
    ) {
        if let Some(value) = self.value_below(table, name) {
            let table = self.written(table).map_or(table, |(written, _)| written);
            let key = format!("{}.{name}", self.path_of(table));
            self.review.refuse(value.span(), &key, expected);
        }
    }

    /// Reports that the key `name`, if it exists, is never used.
    pub(crate) fn unused(&mut self, name: &str, why: &str) {
        if let Some((key, value)) = self.written(name) {
            let text = format!("{} is never used: {why}", self.path_of(key));
            self.review.warn(value.span(), text);
        }
    }

    /// A problem of the table as a whole.
    pub(crate) fn problem(&mut self, text: String) {
        self.review.problem(self.span.clone(), text);
    }

    /// The tables of the list `path` below this table, if they exist.
    pub(crate) fn entries(&self, path: &[&str]) -> Vec<&'a DeTable<'a>> {
        let list = path.split_last().and_then(|(name, tables)| {
            let mut table = self.table?;
            for name in tables {
                table = table.get(*name)?.get_ref().as_table()?;
            }
            table.get(*name)?.get_ref().as_array()
        });
        let entries = list.into_iter().flat_map(|list| list.iter());
        entries
            .filter_map(|entry| entry.get_ref().as_table())
            .collect()
    }

    /// The table `name` below this one, or `was`, its former name; without it, its defaults.
    pub(crate) fn table<T: Table>(&mut self, name: &'static str, was: Option<&'static str>) -> T {
        let found = self.find(name, was);
        let path = match &found {
            Some(found) => found.key.clone(),
            None => self.path_of(name),
        };
        let span = found.as_ref().map(|found| found.value.span());
        let table = found.and_then(|found| {
            let table = found.value.get_ref().as_table();
            if table.is_none() {
                found.refuse(self.review, "a table");
            }
            table
        });
        self.below(path, was, table, span, None)
    }

    /// The list of tables `name` below this one; without it, none.
    pub(crate) fn tables<T: Table>(&mut self, name: &'static str, many: Many) -> Vec<T> {
        if self.description.is_some() {
            self.below::<T>(self.path_of(name), None, None, None, Some(many));
        }
        let Some(found) = self.find(name, None) else {
            return Vec::new();
        };
        let DeValue::Array(entries) = found.value.get_ref() else {
            found.refuse(self.review, format!("tables [[{}]]", found.key));
            return Vec::new();
        };
        if let Some((fewest, most)) = many.count
            && !(fewest..=most).contains(&entries.len())
        {
            let Many { purpose, .. } = many;
            let text = format!(
                "{} has {} entries; expected {fewest} to {most}{purpose}",
                found.key,
                entries.len()
            );
            self.review.problem(Some(found.value.span()), text);
        }
        let tables = entries
            .iter()
            .filter_map(|entry| entry.get_ref().as_table());
        let ids = tables.filter_map(|table| table.get("id"));
        no_repeats(&format!("{}.id", found.key), ids, self.review);
        let read = entries.iter().map(|entry| {
            let table = entry.get_ref().as_table();
            if table.is_none() {
                self.review.refuse(entry.span(), &found.key, "a table");
            }
            self.below(
                self.path_of(name),
                None,
                table,
                Some(entry.span()),
                Some(many),
            )
        });
        read.collect()
    }

    fn below<T: Table>(
        &mut self,
        path: String,
        was: Option<&'static str>,
        table: Option<&DeTable<'_>>,
        span: Option<Range<usize>>,
        many: Option<Many>,
    ) -> T {
        let mut keys = Keys {
            path,
            table,
            span,
            declared: Vec::new(),
            former: Vec::new(),
            description: self.description.as_ref().map(|_| Description::default()),
            review: self.review,
        };
        let read = T::read(&mut keys);
        if let Some(description) = &mut self.description {
            description
                .tables
                .push(keys.finish_described(T::ABOUT, was, many));
        } else {
            keys.finish();
        }
        read
    }

    /// Reports keys that were not declared.
    pub(crate) fn finish(self) {
        for key in self.table.into_iter().flat_map(|table| table.keys()) {
            let name: &str = key.get_ref();
            if !self.is_known(name) {
                let text = format!(
                    "{} is an unknown key; expected {}",
                    self.path_of(name),
                    suggestion(name, &self.declared)
                );
                self.review.problem(Some(key.span()), text);
            }
        }
    }

    fn finish_described(
        self,
        about: &'static [&'static str],
        was: Option<&'static str>,
        many: Option<Many>,
    ) -> DescribedTable {
        let Description {
            keys,
            tables,
            rules,
        } = self.description.unwrap_or_default();
        DescribedTable {
            path: self.path,
            about,
            was,
            many,
            keys,
            tables,
            rules,
        }
    }
}

/// Identifiers name folders and columns: they must be distinct, ignoring case.
pub(crate) fn no_repeats<'a>(
    key: &str,
    ids: impl Iterator<Item = &'a Spanned<DeValue<'a>>>,
    review: &mut Review<'_>,
) {
    let mut seen = BTreeSet::new();
    for id in ids {
        if let Some(text) = id.get_ref().as_str()
            && !seen.insert(text.to_ascii_lowercase())
        {
            review.refuse(id.span(), key, "an identifier that no other entry has");
        }
    }
}

/// `one of a, b, c`, with the nearest of them first when one is near.
pub(crate) fn suggestion(written: &str, known: &[&str]) -> String {
    let all = known.join(", ");
    match nearest(written, known) {
        Some(name) => format!("{name} (one of {all})"),
        None => format!("one of {all}"),
    }
}

/// The name nearest to the written one, if they differ by at most two typing errors.
fn nearest<'n>(written: &str, known: &[&'n str]) -> Option<&'n str> {
    let written = start(written);
    let distances = known
        .iter()
        .map(|name| (strsim::damerau_levenshtein(&written, name), *name));
    let (distance, name) = distances.min_by_key(|(distance, _)| *distance)?;
    (distance <= 2).then_some(name)
}

/// The first characters of a name: enough to compare, and of bounded length.
fn start(name: &str) -> String {
    name.chars().take(40).collect()
}

#[cfg(test)]
mod tests {
    use super::suggestion;

    #[test]
    fn only_near_names_are_suggested() {
        let known = ["metakernel", "files", "root"];
        assert_eq!(
            suggestion("metakernl", &known),
            "metakernel (one of metakernel, files, root)"
        );
        assert_eq!(suggestion("zzz", &known), "one of metakernel, files, root");
    }
}
