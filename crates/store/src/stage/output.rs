//! The output of a stage with its origin, or a placeholder for one that is not known yet.

use std::{
    path::{Path, PathBuf},
    sync::{
        Arc, OnceLock,
        atomic::{AtomicBool, Ordering},
    },
};

use super::inputs::{InOrder, Input, Inputs, Pending};
use areograph_base::error::{Cause, Result};

/// Origin of an output.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Provenance {
    /// BLAKE3 of the stored output.
    pub blake3: String,
    /// BLAKE3 over its inputs.
    pub fingerprint: String,
}

/// The output of a stage; pending in a plan or a check, where the stage did not run.
///
/// A large stored output may be read when its value is used for the first time: a site without changes reads few.
#[derive(Debug)]
pub struct Output<T> {
    label: String,
    known: Option<Arc<Known<T>>>,
}

#[derive(Debug)]
struct Known<T> {
    /// `None` within if the stored output could not be read.
    value: OnceLock<Option<T>>,
    stored: Option<Stored<T>>,
    provenance: Provenance,
}

/// A stored output that is read on demand.
#[derive(Debug)]
struct Stored<T> {
    path: PathBuf,
    /// Reads the output with this hash from the file.
    read: fn(&Path, &str) -> Option<T>,
    /// Set when it cannot be read.
    lost: Arc<AtomicBool>,
    /// Removes rows that are no longer used.
    drop_rows: Option<fn(&mut T)>,
}

/// A stored output that was expected to be intact. A run that meets it begins again, and reads all outputs at once.
#[derive(Debug, thiserror::Error, Cause)]
#[error("the stored output of {0} is damaged or cannot be read")]
#[cause(Io: "run with --force, which recomputes all outputs")]
struct Lost(String);

/// A clone shares the value.
impl<T> Clone for Output<T> {
    fn clone(&self) -> Self {
        Self {
            label: self.label.clone(),
            known: self.known.clone(),
        }
    }
}

impl<T> Output<T> {
    /// The output of the stage with this label.
    #[must_use]
    pub fn known(label: String, value: T, provenance: Provenance) -> Self {
        Self::of(label, OnceLock::from(Some(value)), None, provenance)
    }

    /// An output that `read` reads from `path`, given the hash of `provenance`, when it is needed; `lost` is set if that fails.
    pub(crate) fn stored(
        label: String,
        path: PathBuf,
        read: fn(&Path, &str) -> Option<T>,
        lost: &Arc<AtomicBool>,
        provenance: Provenance,
    ) -> Self {
        let stored = Stored {
            path,
            read,
            lost: Arc::clone(lost),
            drop_rows: None,
        };
        Self::of(label, OnceLock::new(), Some(stored), provenance)
    }

    fn of(
        label: String,
        value: OnceLock<Option<T>>,
        stored: Option<Stored<T>>,
        provenance: Provenance,
    ) -> Self {
        let known = Known {
            value,
            stored,
            provenance,
        };
        Self {
            label,
            known: Some(Arc::new(known)),
        }
    }

    /// An output that a run would make.
    #[must_use]
    pub const fn pending(label: String) -> Self {
        Self { label, known: None }
    }

    /// The output, by its origin, without the rows that `drop_rows` removes; unchanged if it is shared.
    #[must_use]
    pub fn without_rows(mut self, drop_rows: fn(&mut T)) -> Self {
        if let Some(known) = self.known.as_mut().and_then(Arc::get_mut) {
            match (known.value.get_mut(), &mut known.stored) {
                (Some(Some(value)), _) => drop_rows(value),
                (None, Some(stored)) => stored.drop_rows = Some(drop_rows),
                _ => {}
            }
        }
        self
    }

    /// Label of the stage, for example `register/E02-00665`.
    #[must_use]
    pub fn label(&self) -> &str {
        &self.label
    }

    /// The value.
    ///
    /// # Errors
    /// A stored output that is damaged or cannot be read. A pending output: a bug in areograph that stages do not
    /// encounter, since the flow runs a stage only when all its inputs are known.
    pub fn value(&self) -> Result<&T> {
        match &self.known {
            None => Err(Pending(self.label.clone()).into()),
            Some(known) => known.value().ok_or_else(|| Lost(self.label.clone()).into()),
        }
    }

    /// The value, if it is known; also `None` for a stored output that cannot be read, after which a run begins again.
    #[must_use]
    pub fn get(&self) -> Option<&T> {
        self.known.as_ref()?.value()
    }

    /// Its origin, if it is known.
    #[must_use]
    pub fn provenance(&self) -> Option<&Provenance> {
        self.known.as_ref().map(|known| &known.provenance)
    }
}

impl<T> Known<T> {
    fn value(&self) -> Option<&T> {
        let read = || {
            let stored = self.stored.as_ref()?;
            let value = (stored.read)(&stored.path, &self.provenance.blake3);
            let Some(mut value) = value else {
                stored.lost.store(true, Ordering::Relaxed);
                return None;
            };
            if let Some(drop_rows) = stored.drop_rows {
                drop_rows(&mut value);
            }
            Some(value)
        };
        self.value.get_or_init(read).as_ref()
    }
}

/// Enters by content: an earlier stage that runs again and gives the same bytes changes nothing.
impl<T> Input for &Output<T> {
    fn add_to(&self, _field: &str, inputs: &mut Inputs) {
        inputs.output(
            &self.label,
            self.provenance().map(|provenance| &*provenance.blake3),
        );
    }
}

/// Several outputs, whose order matters.
impl<T> Input for InOrder<'_, Output<T>> {
    fn add_to(&self, field: &str, inputs: &mut Inputs) {
        let labels: Vec<&str> = self.0.iter().map(|output| &*output.label).collect();
        inputs.setting(&format!("{field} (order)"), &labels);
        for output in self.0 {
            output.add_to(field, inputs);
        }
    }
}
