//! A key is declared once, where its table is: documentation, form, unit, range, default and example.
//!
//! ```text
//! declare_table! {
//!     /// Limits that make a profile valid or invalid.
//!     pub struct RangeCheckConfig {
//!         /// Fewest shots. The default is one PEDR frame.
//!         shots_min: u32 = key(whole_from_to(2, 1_000_000)).or(20),
//!     }
//! }
//! ```
//!
//! From the declaration follow the field of the valid configuration, the reading of a file with its
//! messages, `config/sites/example.toml`, `config/schema/site.schema.json` and [`keys`](super::keys).
//! Reading and describing share their code: [`Table::read`] declares key after key to [`Keys`], which takes each from
//! the file, or without a file records the declaration.
//!
//! A former name is accepted with a warning and does not change fingerprints.

mod described;
mod example;
mod key;
mod reader;
mod schema;

use toml::{Spanned, Value, de::DeValue};

use super::problems::Review;

pub(super) use described::Many;
pub use described::{Accept, DeclaredKey, ValueKind, Word};
pub(super) use example::example;
pub(super) use key::{group, key, of_the_file, table, tables};
pub(super) use reader::{Keys, described, no_repeats, suggestion};
pub(super) use schema::schema;

/// The content of one table of the configuration.
pub(super) trait Table: Sized {
    /// Documentation of the table, line by line.
    const ABOUT: &'static [&'static str];

    /// Declares the keys of the table one by one and makes the valid form of them.
    ///
    /// Returns a value even after a problem, so that all problems are found in one pass; it is used only
    /// when there was none.
    fn read(keys: &mut Keys<'_, '_>) -> Self;
}

/// A value of the file and the name of its key for messages.
pub(super) struct Found<'a> {
    pub(super) key: String,
    pub(super) value: &'a Spanned<DeValue<'a>>,
}

impl Found<'_> {
    /// Reports that the key does not accept the value.
    pub(super) fn refuse(&self, review: &mut Review<'_>, expected: impl std::fmt::Display) {
        review.refuse(self.value.span(), &self.key, expected);
    }
}

/// The values that a key accepts, and their valid form.
pub(super) trait Form {
    /// The valid form of a value.
    type Value;

    /// The accepted values in words that example, schema and tests understand.
    fn kind(&self) -> ValueKind;

    /// The valid form of the written value, or `None` after a problem was reported.
    fn read(&self, found: &Found<'_>, review: &mut Review<'_>) -> Option<Self::Value>;

    /// Form of `value` in a file; for defaults.
    fn written(&self, value: &Self::Value) -> Value;
}

/// Something that takes one or several keys from a table.
pub(super) trait Declare: Sized {
    /// The resulting value.
    type Value;

    /// Declares the keys to `keys`; `name` and `about` belong to the field in the valid form.
    fn declare(
        self,
        name: &'static str,
        about: &'static [&'static str],
        keys: &mut Keys<'_, '_>,
    ) -> Self::Value;

    /// The declaration with its value changed, for example from degrees to radians.
    fn map<V>(self, change: fn(Self::Value) -> V) -> impl Declare<Value = V> {
        self.then(move |value, _: &mut Keys<'_, '_>| change(value))
    }

    /// The declaration with its value changed by a function that may find more problems.
    fn then<V, F>(self, change: F) -> impl Declare<Value = V>
    where
        F: FnOnce(Self::Value, &mut Keys<'_, '_>) -> V,
    {
        Then {
            declared: self,
            change,
        }
    }
}

struct Then<D, F> {
    declared: D,
    change: F,
}

impl<D, F, V> Declare for Then<D, F>
where
    D: Declare,
    F: FnOnce(D::Value, &mut Keys<'_, '_>) -> V,
{
    type Value = V;

    fn declare(
        self,
        name: &'static str,
        about: &'static [&'static str],
        keys: &mut Keys<'_, '_>,
    ) -> V {
        let value = self.declared.declare(name, about, keys);
        (self.change)(value, keys)
    }
}

/// Declares a table: a struct of the valid form (`struct Name`) or the fields of one that is defined
/// elsewhere (`fill Name`).
///
/// Each entry is `field: Type = declaration`; a key that is named differently from its field, for its
/// unit, is given by `field as "key"`. The documentation of an entry applies to the field and to the key.
/// `#[serde(skip)]` keeps a path out of the inputs that distinguish stages: files enter by their content.
/// `struct Name: Trait` derives `Trait`. `settle function` completes defaults that follow from other keys:
/// `fn(Name, &Keys) -> Name`; `check function` names conditions between keys: `fn(&Name, &mut Keys)`.
macro_rules! declare_table {
    (
        $(#[doc = $about:literal])+
        $vis:vis struct $name:ident $(: $($derive:ident),+)? {
            $(
                $(#[doc = $doc:literal])+
                $(#[serde($skip:ident)])?
                $field:ident $(as $key:literal)? : $type:ty = $declared:expr,
            )+
        }
        $(settle $settle:ident)?
        $(check $check:path)?
    ) => {
        $(#[doc = $about])+
        #[derive(Debug, Clone, PartialEq, serde::Serialize $(, $($derive),+)?)]
        $vis struct $name { $($(#[doc = $doc])+ $(#[serde($skip)])? $vis $field: $type,)+ }

        impl Default for $name {
            /// Every key at its default; keys without a default are empty.
            fn default() -> Self {
                $crate::declare::Keys::default_of()
            }
        }

        $crate::declare::declare_table! {
            $(#[doc = $about])+
            fill $name { $($(#[doc = $doc])+ $field $(as $key)? = $declared,)+ }
            $(settle $settle)?
            $(check $check)?
        }
    };
    (
        $(#[doc = $about:literal])+
        fill $name:ident {
            $($(#[doc = $doc:literal])+ $field:ident $(as $key:literal)? = $declared:expr,)+
        }
        $(settle $settle:ident)?
        $(check $check:path)?
    ) => {
        impl $crate::declare::Table for $name {
            const ABOUT: &'static [&'static str] = &[$($about),+];

            fn read(keys: &mut $crate::declare::Keys<'_, '_>) -> Self {
                let read = Self {
                    $($field: $crate::declare::Declare::declare(
                        $declared,
                        $crate::declare::declare_table!(@name $field $($key)?),
                        &[$($doc),+],
                        keys,
                    ),)+
                };
                $(let read = $settle(read, keys);)?
                $($check(&read, keys);)?
                read
            }
        }
    };
    (@name $field:ident) => { stringify!($field) };
    (@name $field:ident $key:literal) => { $key };
}
pub(super) use declare_table;
