//! The outputs of the stages of one run, by type and round.
//!
//! The flow enters an output once, when it is final. Whoever reads outputs asks for them by their type: a new stage
//! changes no list of outputs. Alternative stages with one type of output, such as those that search files or read
//! tables, have one place. A book can be written to a file ([`Book::write`]) and opened again ([`Book::open`]); the
//! data of a page are such a file.

mod file;

use std::{
    any::{Any, type_name},
    collections::BTreeMap,
    fmt,
    io::Write,
    path::PathBuf,
    sync::{Arc, OnceLock},
};

use serde::{Serialize, de::DeserializeOwned};

use self::file::Written;
use super::stage::{Output, Provenance, Round};
use areograph_base::error::{Cause, Result};

/// A value that can be entered in a book.
pub trait Entered: Serialize + DeserializeOwned + Send + Sync + 'static {}

impl<T: Serialize + DeserializeOwned + Send + Sync + 'static> Entered for T {}

/// Outputs by type and round; outputs of a stage that runs once per image are a list in the order of the site.
///
/// A clone shares the outputs.
#[derive(Clone, Default)]
pub struct Book {
    entries: BTreeMap<Key, Entry>,
    /// The file from which the book was opened.
    opened: Option<PathBuf>,
}

/// Type and round of an output. Type names must be unique.
type Key = (String, Round);

/// A list of outputs of one type.
#[derive(Clone)]
struct Entry {
    labels: Vec<String>,
    /// `Vec<Output<T>>`; an entry of an opened file is read when it is first used.
    outputs: OnceLock<Arc<dyn Any + Send + Sync>>,
    /// Where a file has it.
    written: Option<Written>,
    /// Writes one output of the list; unknown for an entry of an opened file.
    write: Option<WritePart>,
    /// Makes the list without the parts that no page shows.
    lighten: Option<Arc<Lighten>>,
}

type Lighten = dyn Fn(&Entry) -> Result<Entry> + Send + Sync;

/// Writes the output with this index of the list; `None` for an index beyond it.
type WritePart = fn(&dyn Any, usize, &mut dyn Write) -> Result<Option<()>>;

/// An output that the book does not have, or has twice.
#[derive(Debug, thiserror::Error, Cause)]
enum Misuse {
    #[error("the outputs contain no {0}")]
    #[cause(Bug: "this is a bug in areograph; please report it with the configuration")]
    Missing(&'static str),
    #[error("the outputs contain {0} twice: as {1:?} and as {2:?}")]
    #[cause(Bug: "this is a bug in areograph; please report it with the configuration")]
    Twice(&'static str, Vec<String>, Vec<String>),
}

impl Book {
    /// Enters the output of a stage.
    ///
    /// # Errors
    /// A bug in areograph: an output of this type and round exists.
    pub fn enter<T: Entered>(&mut self, round: Round, output: Output<T>) -> Result<()> {
        self.enter_parts(round, vec![output])
    }

    /// Enters the output of a stage, of which pages show only what `shown` returns: see [`Book::lightened`].
    ///
    /// # Errors
    /// As [`Book::enter`].
    pub fn enter_heavy<T: Entered>(
        &mut self,
        round: Round,
        output: Output<T>,
        shown: fn(&T) -> T,
    ) -> Result<()> {
        self.enter(round, output)?;
        let lighten = move |entry: &Entry| entry.changed(|_, value| Some(shown(value)));
        if let Some(entry) = self.entries.get_mut(&key::<T>(round)) {
            entry.lighten = Some(Arc::new(lighten));
        }
        Ok(())
    }

    /// The book without the parts that no page shows.
    ///
    /// # Errors
    /// An output whose value is not known or cannot be read.
    pub fn lightened(&self) -> Result<Self> {
        let entries = self.entries.iter().map(|(key, entry)| {
            let lighten = entry.lighten.as_ref();
            let light = lighten.map_or_else(|| Ok(entry.clone()), |lighten| lighten(entry))?;
            Ok((key.clone(), light))
        });
        Ok(Self {
            entries: entries.collect::<Result<_>>()?,
            opened: None,
        })
    }

    /// Enters a value that is not an output of a stage, under this label.
    ///
    /// # Errors
    /// As [`Book::enter`].
    pub fn enter_value<T: Entered>(&mut self, label: &str, value: T) -> Result<()> {
        self.enter(Round::Initial, valued(label.to_owned(), value))
    }

    /// Enters the outputs of a stage that runs once per image, in the order of the site.
    ///
    /// # Errors
    /// As [`Book::enter`].
    pub fn enter_parts<T: Entered>(&mut self, round: Round, outputs: Vec<Output<T>>) -> Result<()> {
        let entry = Entry::of(outputs);
        let key = key::<T>(round);
        if let Some(earlier) = self.entries.get(&key) {
            let labels = earlier.labels.clone();
            return Err(Misuse::Twice(type_name::<T>(), labels, entry.labels).into());
        }
        self.entries.insert(key, entry);
        Ok(())
    }

    /// Replaces each output of this type and round with what `change` returns for its index and value; `None` keeps the
    /// output.
    ///
    /// # Errors
    /// An output whose value is not known or cannot be read.
    pub fn change<T: Entered>(
        &mut self,
        round: Round,
        change: impl FnMut(usize, &T) -> Option<T>,
    ) -> Result<()> {
        if let Some(entry) = self.entries.get_mut(&key::<T>(round)) {
            *entry = entry.changed(change)?;
        }
        Ok(())
    }

    /// Leaves the outputs of this type out.
    pub fn leave_out<T: Entered>(&mut self) {
        self.entries.retain(|(name, _), _| name != type_name::<T>());
    }

    /// The output of this type, as the input of a stage; `None` if the site does not have it.
    ///
    /// # Errors
    /// An output of an opened file that cannot be read.
    pub fn output<T: Entered>(&self, round: Round) -> Result<Option<&Output<T>>> {
        Ok(self.outputs(round)?.and_then(<[_]>::first))
    }

    /// An output that every site has, as the input of a stage.
    ///
    /// # Errors
    /// As [`Book::output`]; a bug in areograph: it was not entered.
    pub fn require<T: Entered>(&self, round: Round) -> Result<&Output<T>> {
        let missing = || match &self.opened {
            Some(path) => Self::is_without(path, type_name::<T>()),
            None => Misuse::Missing(type_name::<T>()).into(),
        };
        self.output(round)?.ok_or_else(missing)
    }

    /// The value of the output of this type; `None` if the site does not have it.
    ///
    /// # Errors
    /// As [`Book::output`]; a bug in areograph: the value is not known yet.
    pub fn find<T: Entered>(&self, round: Round) -> Result<Option<&T>> {
        self.output(round)?.map(Output::value).transpose()
    }

    /// The value with the best orientation: of the adjusted round if it was entered there, else of the round of the kernels.
    ///
    /// # Errors
    /// As [`Book::find`].
    pub fn find_best<T: Entered>(&self) -> Result<Option<&T>> {
        self.find(if self.has::<T>(Round::Adjusted) {
            Round::Adjusted
        } else {
            Round::Initial
        })
    }

    /// The value with the orientation from the kernels, if there is also one with the adjusted orientation.
    ///
    /// # Errors
    /// As [`Book::find`].
    pub fn find_before<T: Entered>(&self) -> Result<Option<&T>> {
        let is_before = self.has::<T>(Round::Adjusted);
        Ok(is_before
            .then(|| self.find(Round::Initial))
            .transpose()?
            .flatten())
    }

    /// The value of an output that every site has, in the round of the kernels.
    ///
    /// # Errors
    /// As [`Book::require`]; a bug in areograph: its value is not known yet.
    pub fn of<T: Entered>(&self) -> Result<&T> {
        self.require(Round::Initial)?.value()
    }

    /// The values of the outputs of this type, in the order of the site; empty if it has none.
    ///
    /// # Errors
    /// As [`Book::find`].
    pub fn parts<T: Entered>(&self, round: Round) -> Result<Vec<&T>> {
        let outputs = self.outputs(round)?.unwrap_or_default();
        outputs.iter().map(Output::value).collect()
    }

    /// Whether outputs of this type were entered, of which there is at least one.
    #[must_use]
    pub fn has<T: Entered>(&self, round: Round) -> bool {
        let entry = self.entries.get(&key::<T>(round));
        entry.is_some_and(|entry| !entry.labels.is_empty())
    }

    /// The outputs of this type, in the order of the site, as inputs of a stage; `None` if none was entered.
    ///
    /// # Errors
    /// As [`Book::output`].
    pub fn outputs<T: Entered>(&self, round: Round) -> Result<Option<&[Output<T>]>> {
        let Some(entry) = self.entries.get(&key::<T>(round)) else {
            return Ok(None);
        };
        let outputs: Option<&Vec<Output<T>>> = entry.outputs::<T>()?.downcast_ref();
        Ok(outputs.map(Vec::as_slice))
    }
}

impl Entry {
    fn of<T: Entered>(outputs: Vec<Output<T>>) -> Self {
        let labels = outputs.iter().map(|output| output.label().to_owned());
        let labels = labels.collect();
        let outputs: Arc<dyn Any + Send + Sync> = Arc::new(outputs);
        Self {
            labels,
            outputs: OnceLock::from(outputs),
            written: None,
            write: Some(file::write_part::<T>),
            lighten: None,
        }
    }

    /// See [`Book::change`].
    fn changed<T: Entered>(&self, mut change: impl FnMut(usize, &T) -> Option<T>) -> Result<Self> {
        let outputs: Option<&Vec<Output<T>>> = self.outputs::<T>()?.downcast_ref();
        let outputs = outputs.into_iter().flatten().enumerate();
        let changed = outputs.map(|(index, output)| {
            let value = change(index, output.value()?);
            Ok(value.map_or_else(
                || output.clone(),
                |value| valued(output.label().to_owned(), value),
            ))
        });
        Ok(Self::of(changed.collect::<Result<Vec<_>>>()?))
    }

    /// The list, read from the file if need be.
    fn outputs<T: Entered>(&self) -> Result<&(dyn Any + Send + Sync)> {
        if let Some(outputs) = self.outputs.get() {
            return Ok(&**outputs);
        }
        let mut outputs: Vec<Output<T>> = Vec::new();
        for (part, label) in self.labels.iter().enumerate() {
            if let Some(written) = &self.written {
                outputs.push(valued(label.clone(), written.read(part)?));
            }
        }
        Ok(&**self.outputs.get_or_init(|| Arc::new(outputs)))
    }
}

fn key<T>(round: Round) -> Key {
    (type_name::<T>().to_owned(), round)
}

/// A value as an output, without origin.
fn valued<T>(label: String, value: T) -> Output<T> {
    let nowhere = Provenance {
        blake3: String::new(),
        fingerprint: String::new(),
    };
    Output::known(label, value, nowhere)
}

impl fmt::Debug for Book {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        let labels = self.entries.values().flat_map(|entry| &entry.labels);
        to.debug_list().entries(labels).finish()
    }
}

#[cfg(test)]
#[allow(clippy::disallowed_methods, reason = "tests write files of their own")]
mod tests {
    use std::fs;

    use super::*;
    use areograph_base::error::Kind;

    fn known(label: &str, value: u32) -> Output<u32> {
        valued(label.to_owned(), value)
    }

    fn book() -> Book {
        let mut book = Book::default();
        book.enter(Round::Initial, known("count", 1)).unwrap();
        let adjusted = vec![known("count/a/adjusted", 2), known("count/b/adjusted", 3)];
        book.enter_parts(Round::Adjusted, adjusted).unwrap();
        book.enter_value("name", "gusev".to_owned()).unwrap();
        book
    }

    fn assert_whole(book: &Book) {
        assert_eq!(book.of::<u32>().unwrap(), &1);
        assert_eq!(book.parts::<u32>(Round::Adjusted).unwrap(), [&2, &3]);
        assert_eq!(book.find::<u32>(Round::Matching).unwrap(), None);
        assert_eq!(book.find::<u64>(Round::Initial).unwrap(), None);
        assert_eq!(book.of::<String>().unwrap(), "gusev");
    }

    #[test]
    fn outputs_are_found_by_type_and_round() {
        assert_whole(&book());
    }

    #[test]
    fn a_written_book_is_opened_again_and_its_labels_remain() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("book");
        let file = fs::File::create(&path).unwrap();
        let hash = book().write("layout 1", file).unwrap();
        assert_eq!(hash, blake3::hash(&fs::read(&path).unwrap()));
        let opened = Book::open(&path, "layout 1").unwrap();
        let unread = opened.write("layout 1", Vec::new()).unwrap_err();
        assert_eq!(unread.kind(), Kind::Bug);
        assert_whole(&opened);
        assert_eq!(format!("{opened:?}"), format!("{:?}", book()));
    }

    #[test]
    fn a_damaged_file_is_an_error_of_the_input() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("book");
        let file = fs::File::create(&path).unwrap();
        book().write("layout 1", file).unwrap();
        let other = Book::open(&path, "layout 2").unwrap_err();
        assert_eq!(other.kind(), Kind::Input);
        let bytes = fs::read(&path).unwrap();
        for length in [0, 7, 8, bytes.len() - 1] {
            fs::write(&path, &bytes[..length]).unwrap();
            let error = Book::open(&path, "layout 1").unwrap_err();
            assert_eq!(error.kind(), Kind::Input, "{length}");
        }
        // The text is longer than its place.
        let text = bytes.windows(6).position(|of| of == b"\x05gusev").unwrap();
        let mut damaged = bytes;
        damaged[text] = 90;
        fs::write(&path, damaged).unwrap();
        let opened = Book::open(&path, "layout 1").unwrap();
        assert_eq!(opened.of::<u32>().unwrap(), &1);
        for error in [
            opened.of::<String>().unwrap_err(),
            opened.of::<u64>().unwrap_err(),
        ] {
            assert_eq!(error.kind(), Kind::Input);
            assert_eq!(error.file.as_deref(), Some(&*path));
        }
    }

    #[test]
    fn outputs_are_changed_in_a_round_and_left_out_in_all() {
        let whole = book();
        let mut page = whole.clone();
        for round in [Round::Adjusted, Round::Matching] {
            page.change(round, |index, value: &u32| {
                (index == 1).then_some(value + 10)
            })
            .unwrap();
        }
        page.leave_out::<String>();
        assert_eq!(page.parts::<u32>(Round::Adjusted).unwrap(), [&2, &13]);
        assert_eq!(page.find::<String>(Round::Initial).unwrap(), None);
        assert_whole(&whole);
    }

    #[test]
    fn a_lightened_book_has_the_shown_part_of_a_heavy_output() {
        let mut book = Book::default();
        let rows = Output::<Vec<u8>>::known(
            "rows".to_owned(),
            vec![1, 2, 3],
            known("", 0).provenance().unwrap().clone(),
        );
        book.enter_heavy(Round::Initial, rows, |rows| rows[..1].to_vec())
            .unwrap();
        book.enter_value("count", 1_u32).unwrap();
        let light = book.lightened().unwrap();
        assert_eq!(light.of::<Vec<u8>>().unwrap(), &[1]);
        assert_eq!(light.of::<u32>().unwrap(), &1);
        assert_eq!(book.of::<Vec<u8>>().unwrap(), &[1, 2, 3]);
    }

    #[test]
    fn a_missing_a_second_and_a_pending_output_are_errors() {
        let mut book = Book::default();
        let missing = book.of::<u32>().unwrap_err().to_string();
        assert!(missing.contains("no u32"), "{missing}");
        book.enter::<u32>(Round::Initial, Output::pending("count".to_owned()))
            .unwrap();
        let pending = book.of::<u32>().unwrap_err().to_string();
        assert!(pending.contains("count"), "{pending}");
        let twice = book.enter(Round::Initial, known("sum", 1)).unwrap_err();
        let twice = twice.to_string();
        assert!(twice.contains("count") && twice.contains("sum"), "{twice}");
    }
}
