//! Paths of files that a command printed; their content belongs to the configuration.

use std::path::Path;

use toml::Value;

use super::{
    data_file,
    declare::{Form, Found, ValueKind},
    problems::{Problems, Review},
};

/// The path of a file that a command printed.
pub(super) struct PrintedFile<T> {
    /// What the path must lead to, for messages.
    pub(super) expected: &'static str,
    /// Usual path.
    pub(super) usual: &'static str,
    /// Reads the content of the file at a path.
    pub(super) parse: fn(&str, &Path) -> Result<T, Problems>,
}

impl<T> Form for PrintedFile<T> {
    type Value = T;

    fn kind(&self) -> ValueKind {
        ValueKind::File
    }

    fn read(&self, found: &Found<'_>, review: &mut Review<'_>) -> Option<T> {
        let path = found
            .value
            .get_ref()
            .as_str()
            .map(|written| review.resolve(written));
        let Some(path) = path.filter(|path| path.is_file()) else {
            found.refuse(review, self.expected);
            return None;
        };
        data_file::named(&path, found, review, self.parse)
    }

    fn written(&self, _value: &T) -> Value {
        Value::from(self.usual)
    }
}
