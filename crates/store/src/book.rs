//! The outputs of the stages of one run, by type and round.
//!
//! The flow enters an output once, when it is final. Whoever reads outputs asks for them by their type: a new stage
//! changes no list of outputs. Alternative stages with one type of output, such as those that search files or read
//! tables, have one place.

use std::{
    any::{Any, TypeId, type_name},
    collections::BTreeMap,
    fmt,
};

use super::stage::{Output, Round};
use areograph_base::error::{Cause, Result};

/// Outputs by type and round; outputs of a stage that runs once per image are a list in the order of the site.
#[derive(Default)]
pub struct Book {
    entries: BTreeMap<(TypeId, Round), Entry>,
}

/// A list of outputs of one type, `Vec<Output<T>>`.
struct Entry {
    labels: Vec<String>,
    outputs: Box<dyn Any + Send + Sync>,
}

/// An output that the book does not have, or has twice.
#[derive(Debug, thiserror::Error, Cause)]
enum Misuse {
    #[error("no {0} was entered in the book of outputs")]
    #[cause(Bug: "this is a bug in areograph; please report it with the configuration")]
    Missing(&'static str),
    #[error("{0} was entered twice in the book of outputs: as {1:?} and as {2:?}")]
    #[cause(Bug: "this is a bug in areograph; please report it with the configuration")]
    Twice(&'static str, Vec<String>, Vec<String>),
}

impl Book {
    /// Enters the output of a stage.
    ///
    /// # Errors
    /// A bug in areograph: an output of this type and round exists.
    pub fn enter<T: Send + Sync + 'static>(
        &mut self,
        round: Round,
        output: Output<T>,
    ) -> Result<()> {
        self.enter_parts(round, vec![output])
    }

    /// Enters the outputs of a stage that runs once per image, in the order of the site.
    ///
    /// # Errors
    /// As [`Book::enter`].
    pub fn enter_parts<T: Send + Sync + 'static>(
        &mut self,
        round: Round,
        outputs: Vec<Output<T>>,
    ) -> Result<()> {
        let labels = outputs.iter().map(|output| output.label().to_owned());
        let entry = Entry {
            labels: labels.collect(),
            outputs: Box::new(outputs),
        };
        let key = (TypeId::of::<T>(), round);
        if let Some(earlier) = self.entries.get(&key) {
            let labels = earlier.labels.clone();
            return Err(Misuse::Twice(type_name::<T>(), labels, entry.labels).into());
        }
        self.entries.insert(key, entry);
        Ok(())
    }

    /// The output of this type, as the input of a stage; `None` if the site does not have it.
    #[must_use]
    pub fn output<T: 'static>(&self, round: Round) -> Option<&Output<T>> {
        self.outputs(round).and_then(<[_]>::first)
    }

    /// An output that every site has, as the input of a stage.
    ///
    /// # Errors
    /// A bug in areograph: it was not entered.
    pub fn require<T: 'static>(&self, round: Round) -> Result<&Output<T>> {
        let found = self.output(round);
        found.ok_or_else(|| Misuse::Missing(type_name::<T>()).into())
    }

    /// The value of the output of this type; `None` if the site does not have it.
    ///
    /// # Errors
    /// A bug in areograph: the value is not known yet.
    pub fn find<T: 'static>(&self, round: Round) -> Result<Option<&T>> {
        self.output(round).map(Output::value).transpose()
    }

    /// The value of an output that every site has, in the round of the kernels.
    ///
    /// # Errors
    /// A bug in areograph: it was not entered, or its value is not known yet.
    pub fn of<T: 'static>(&self) -> Result<&T> {
        self.require(Round::Initial)?.value()
    }

    /// The values of the outputs of this type, in the order of the site; empty if it has none.
    ///
    /// # Errors
    /// A bug in areograph: a value is not known yet.
    pub fn parts<T: 'static>(&self, round: Round) -> Result<Vec<&T>> {
        let outputs = self.outputs(round).unwrap_or_default();
        outputs.iter().map(Output::value).collect()
    }

    fn outputs<T: 'static>(&self, round: Round) -> Option<&[Output<T>]> {
        let entry = self.entries.get(&(TypeId::of::<T>(), round))?;
        let outputs: &Vec<Output<T>> = entry.outputs.downcast_ref()?;
        Some(outputs)
    }
}

impl fmt::Debug for Book {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        let labels = self.entries.values().flat_map(|entry| &entry.labels);
        to.debug_list().entries(labels).finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stage::Provenance;

    fn known(label: &str, value: u32) -> Output<u32> {
        let provenance = Provenance {
            blake3: String::new(),
            fingerprint: String::new(),
        };
        Output::known(label.to_owned(), value, provenance)
    }

    #[test]
    fn outputs_are_found_by_type_and_round() {
        let mut book = Book::default();
        book.enter(Round::Initial, known("count", 1)).unwrap();
        let adjusted = vec![known("count/a/adjusted", 2), known("count/b/adjusted", 3)];
        book.enter_parts(Round::Adjusted, adjusted).unwrap();
        assert_eq!(book.of::<u32>().unwrap(), &1);
        assert_eq!(book.parts::<u32>(Round::Adjusted).unwrap(), [&2, &3]);
        assert_eq!(book.find::<u32>(Round::Matching).unwrap(), None);
        assert_eq!(book.find::<u64>(Round::Initial).unwrap(), None);
    }

    #[test]
    fn a_missing_a_second_and_a_pending_output_are_errors() {
        let mut book = Book::default();
        let missing = book.of::<u32>().unwrap_err().to_string();
        assert!(missing.contains("no u32 was entered"), "{missing}");
        book.enter::<u32>(Round::Initial, Output::pending("count".to_owned()))
            .unwrap();
        let pending = book.of::<u32>().unwrap_err().to_string();
        assert!(pending.contains("count"), "{pending}");
        let twice = book.enter(Round::Initial, known("sum", 1)).unwrap_err();
        let twice = twice.to_string();
        assert!(twice.contains("count") && twice.contains("sum"), "{twice}");
    }
}
