//! Configuration files of all kinds: one table of declared keys is a whole file.

use std::{
    collections::BTreeMap,
    fs::File,
    io::Read as _,
    path::{Path, PathBuf},
};

use serde::Serialize;
use toml::de::DeTable;

use areograph_base::error::{Error, IoError, Locate as _};

use super::{
    declare::{self, Keys, Table, described},
    problems::{Problems, Review},
    written::Written,
};

/// Longest configuration file, bytes.
const BYTES_MAX: u64 = 1 << 20;

/// A kind of configuration file. It is implemented by the tables that this crate declares.
#[allow(private_bounds, reason = "keys can be declared only in this crate")]
pub trait Document: Table {
    /// The example, in which every key is documented.
    const EXAMPLE: &'static str;
    /// Beginning of the example.
    const HEADER: &'static str;
    /// Title and description of the schema.
    const SCHEMA: [&'static str; 2];

    /// The same, with the file that it was read from and its content as written.
    #[must_use]
    fn with_file(self, file: PathBuf, blake3: String, keys: BTreeMap<String, String>) -> Self;

    /// Reads and checks the file `path`; relative paths in it are relative to its folder.
    ///
    /// # Errors
    /// [`Problems`] with everything that is wrong, or [`IoError`] when the file cannot be read.
    fn load(path: &Path) -> Result<Loaded<Self>, Error> {
        Self::load_within(path, &[])
    }

    /// As [`Self::load`], for a file that may refer only to files below `roots`, links followed.
    ///
    /// # Errors
    /// As [`Self::load`].
    fn load_within(path: &Path, roots: &[PathBuf]) -> Result<Loaded<Self>, Error> {
        let text = read(path)?;
        Ok(parse_within(&text, path, roots)?)
    }

    /// Checks the `text` of `file`.
    /// Besides the text it examines only files that the text names: whether they exist, which files globs match, and the
    /// polygons of windows.
    ///
    /// # Errors
    /// [`Problems`] with all faults.
    fn parse(text: &str, file: &Path) -> Result<Loaded<Self>, Problems> {
        parse_within(text, file, &[])
    }

    /// The text of [`Self::EXAMPLE`].
    #[must_use]
    fn example() -> String {
        declare::example(Self::HEADER, &described::<Self>())
    }

    /// The JSON Schema of the file, in `config/schema`.
    #[must_use]
    fn schema() -> impl Serialize {
        let [title, description] = Self::SCHEMA;
        declare::schema(title, description, &described::<Self>())
    }
}

/// [`Document::with_file`] of a table with the fields `file`, `blake3` and `keys`.
macro_rules! with_file {
    () => {
        fn with_file(self, file: PathBuf, blake3: String, keys: BTreeMap<String, String>) -> Self {
            Self {
                file,
                blake3,
                keys,
                ..self
            }
        }
    };
}
pub(super) use with_file;

/// A configuration that passed every check.
#[derive(Debug, Clone, PartialEq)]
pub struct Loaded<T> {
    /// The valid form.
    pub config: T,
    /// Warnings, each with its place: entries that are never used.
    pub warnings: Vec<String>,
    /// Files, and folders of kernels, to which its keys refer.
    pub files: Vec<PathBuf>,
}

fn parse_within<T: Document>(
    text: &str,
    file: &Path,
    roots: &[PathBuf],
) -> Result<Loaded<T>, Problems> {
    let mut review = Review::new(file, text)
        .documented_in(T::EXAMPLE)
        .within(roots);
    let read = read_table::<T>(text, &mut review);
    let files = review.take_files();
    let ((table, written), warnings) = review.finish(read)?;
    Ok(Loaded {
        config: table.with_file(file.to_owned(), written.blake3, written.keys),
        warnings,
        files,
    })
}

/// The text of the file, of bounded length.
pub(super) fn read(path: &Path) -> Result<String, Error> {
    let size = path.metadata().map_err(IoError::on("read")).in_file(path)?;
    // Devices and pipes may never end.
    if !size.is_file() {
        return Err(Problems::of_file(path, "is not a regular file; expected a TOML file").into());
    }
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(BYTES_MAX + 1).read_to_end(&mut bytes))
        .map_err(IoError::on("read"))
        .in_file(path)?;
    if bytes.len() as u64 > BYTES_MAX {
        let text = format!("is longer than {BYTES_MAX} bytes; expected a configuration in TOML");
        return Err(Problems::of_file(path, &text).into());
    }
    String::from_utf8(bytes).map_err(|error| {
        let byte = error.utf8_error().valid_up_to() + 1;
        Problems::of_file(
            path,
            &format!("is not valid UTF-8 from byte {byte}; expected UTF-8 text"),
        )
        .into()
    })
}

/// The content of `text`, to be used only when `review` has found no problem.
pub(super) fn read_table<T: Table>(text: &str, review: &mut Review<'_>) -> Option<(T, Written)> {
    let (document, syntax_errors) = DeTable::parse_recoverable(text);
    if !syntax_errors.is_empty() {
        for error in syntax_errors {
            let text = format!("this is not TOML: {}", error.message());
            review.problem(error.span(), text);
        }
        return None;
    }
    let mut keys = Keys::of_file(document.get_ref(), review);
    let read = T::read(&mut keys);
    keys.finish();
    match toml::from_str(text) {
        Ok(table) => Some((read, Written::of(table, review.renames()))),
        // A value that TOML cannot hold, which its key has refused already.
        Err(error) => {
            if !review.has_problems() {
                review.problem(error.span(), error.message().to_owned());
            }
            None
        }
    }
}
