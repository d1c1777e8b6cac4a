//! One declaration: a form, whether the key may be absent, examples, a former name.

use std::marker::PhantomData;

use super::{
    Declare, Form, Table,
    described::{DescribedKey, Example, Many},
    reader::Keys,
};

/// A key that takes `form`; it may be absent.
pub(crate) fn key<F: Form>(form: F) -> Key<F, Optional> {
    Key {
        form,
        presence: Optional,
        examples: Vec::new(),
        was: None,
    }
}

/// The declaration of one key.
pub(crate) struct Key<F, P> {
    form: F,
    presence: P,
    examples: Vec<Example>,
    was: Option<&'static str>,
}

impl<F: Form> Key<F, Optional> {
    /// The value that an absent key has.
    pub(crate) fn or(self, default: F::Value) -> Key<F, Default<F::Value>> {
        self.with(Default(default))
    }

    /// The key is required.
    pub(crate) fn required(self) -> Key<F, Required> {
        let expected = self.form.kind().to_string();
        self.with(Required { expected })
    }

    /// The key is required; `expected` states its purpose.
    pub(crate) fn required_as(self, expected: &str) -> Key<F, Required> {
        let expected = expected.to_owned();
        self.with(Required { expected })
    }

    fn with<P>(self, presence: P) -> Key<F, P> {
        Key {
            form: self.form,
            presence,
            examples: self.examples,
            was: self.was,
        }
    }
}

impl<F, P> Key<F, P> {
    /// The value in the example file, as TOML, if it is not the default.
    pub(crate) fn example(self, toml: &'static str) -> Self {
        self.example_in(0, toml)
    }

    /// The value in entry `entry`, counted from 0, of a list of tables in the example file.
    pub(crate) fn example_in(mut self, entry: usize, toml: &'static str) -> Self {
        self.examples.push(Example {
            entry,
            toml,
            used: true,
        });
        self
    }

    /// The commented-out value in the example file: one of several alternatives, or a rarely needed key.
    pub(crate) fn unused(self, toml: &'static str) -> Self {
        self.unused_in(0, toml)
    }

    /// The commented-out value for entry `entry` of a list of tables.
    pub(crate) fn unused_in(mut self, entry: usize, toml: &'static str) -> Self {
        self.examples.push(Example {
            entry,
            toml,
            used: false,
        });
        self
    }

    /// The former name of the key, which is still understood.
    pub(crate) const fn was(mut self, name: &'static str) -> Self {
        self.was = Some(name);
        self
    }
}

impl<F: Form, P: Presence<F::Value>> Declare for Key<F, P> {
    type Value = P::Value;

    fn declare(
        self,
        name: &'static str,
        about: &'static [&'static str],
        keys: &mut Keys<'_, '_>,
    ) -> P::Value {
        let default = self.presence.default();
        keys.describe(|| DescribedKey {
            name,
            about,
            kind: self.form.kind(),
            default: default.map(|value| self.form.written(value)),
            required: self.presence.required(),
            examples: self.examples.clone(),
            was: self.was,
        });
        let found = keys.find(name, self.was);
        if let (None, Some(expected)) = (&found, self.presence.required_text()) {
            keys.missing(name, expected);
        }
        let value = found.and_then(|found| self.form.read(&found, keys.review()));
        self.presence.settle(value)
    }
}

/// Whether a key may be absent, and its value then.
pub(crate) trait Presence<V> {
    /// The type of the field.
    type Value;

    fn settle(self, value: Option<V>) -> Self::Value;

    fn default(&self) -> Option<&V> {
        None
    }

    fn required_text(&self) -> Option<&str> {
        None
    }

    fn required(&self) -> bool {
        self.required_text().is_some()
    }
}

/// The key may be absent.
pub(crate) struct Optional;
/// The key may be absent; this is then its value.
pub(crate) struct Default<V>(V);
/// The key is required.
pub(crate) struct Required {
    expected: String,
}

impl<V> Presence<V> for Optional {
    type Value = Option<V>;

    fn settle(self, value: Option<V>) -> Option<V> {
        value
    }
}

impl<V> Presence<V> for Default<V> {
    type Value = V;

    fn settle(self, value: Option<V>) -> V {
        value.unwrap_or(self.0)
    }

    fn default(&self) -> Option<&V> {
        Some(&self.0)
    }
}

impl<V: std::default::Default> Presence<V> for Required {
    type Value = V;

    fn settle(self, value: Option<V>) -> V {
        value.unwrap_or_default()
    }

    fn required_text(&self) -> Option<&str> {
        Some(&self.expected)
    }
}

/// A table below this one.
pub(crate) const fn table<T: Table>() -> Below<T> {
    Below {
        was: None,
        read_as: PhantomData,
    }
}

/// The declaration of one table.
pub(crate) struct Below<T> {
    was: Option<&'static str>,
    read_as: PhantomData<T>,
}

impl<T> Below<T> {
    /// The former name of the table, which is still understood.
    pub(crate) const fn was(mut self, name: &'static str) -> Self {
        self.was = Some(name);
        self
    }
}

impl<T: Table> Declare for Below<T> {
    type Value = T;

    fn declare(self, name: &'static str, _: &'static [&'static str], keys: &mut Keys<'_, '_>) -> T {
        keys.table(name, self.was)
    }
}

/// A list of tables below this one.
pub(crate) fn tables<T: Table>(many: Many) -> impl Declare<Value = Vec<T>> {
    List(many, PhantomData)
}

struct List<T>(Many, PhantomData<T>);

impl<T: Table> Declare for List<T> {
    type Value = Vec<T>;

    fn declare(
        self,
        name: &'static str,
        _: &'static [&'static str],
        keys: &mut Keys<'_, '_>,
    ) -> Vec<T> {
        keys.tables(name, self.0)
    }
}

/// Several keys of this table that make one field.
pub(crate) fn group<T: Table>() -> impl Declare<Value = T> {
    Group(PhantomData)
}

struct Group<T>(PhantomData<T>);

impl<T: Table> Declare for Group<T> {
    type Value = T;

    fn declare(self, _: &'static str, _: &'static [&'static str], keys: &mut Keys<'_, '_>) -> T {
        T::read(keys)
    }
}

/// A field that is filled when a file is read, not by a key.
pub(crate) fn of_the_file<V: std::default::Default>() -> impl Declare<Value = V> {
    OfTheFile(PhantomData)
}

struct OfTheFile<V>(PhantomData<V>);

impl<V: std::default::Default> Declare for OfTheFile<V> {
    type Value = V;

    fn declare(self, _: &'static str, _: &'static [&'static str], _: &mut Keys<'_, '_>) -> V {
        V::default()
    }
}
