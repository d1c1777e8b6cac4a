//! The output of a stage with its origin, or a placeholder for one that is not known yet.

use std::sync::Arc;

use super::inputs::{InOrder, Input, Inputs, Pending};
use areograph_base::error::Result;

/// Origin of an output.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Provenance {
    /// BLAKE3 of the stored output.
    pub blake3: String,
    /// BLAKE3 over its inputs.
    pub fingerprint: String,
}

/// The output of a stage; pending in a plan or a check, where the stage did not run.
#[derive(Debug)]
pub struct Output<T> {
    label: String,
    known: Option<Arc<(T, Provenance)>>,
}

/// The same output; the value is shared.
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
        Self {
            label,
            known: Some(Arc::new((value, provenance))),
        }
    }

    /// An output that a run would make.
    #[must_use]
    pub const fn pending(label: String) -> Self {
        Self { label, known: None }
    }

    /// The same output, by its origin, without the rows that `drop_rows` removes; unchanged if it is shared.
    #[must_use]
    pub fn without_rows(mut self, drop_rows: impl FnOnce(&mut T)) -> Self {
        if let Some((value, _)) = self.known.as_mut().and_then(Arc::get_mut) {
            drop_rows(value);
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
    /// A bug in areograph that stages do not encounter: the flow runs a stage only when all its inputs are known.
    pub fn value(&self) -> Result<&T> {
        let pending = || Pending(self.label.clone()).into();
        self.get().ok_or_else(pending)
    }

    /// The value, if it is known.
    #[must_use]
    pub fn get(&self) -> Option<&T> {
        self.known.as_ref().map(|known| &known.0)
    }

    /// Its origin, if it is known.
    #[must_use]
    pub fn provenance(&self) -> Option<&Provenance> {
        self.known.as_ref().map(|known| &known.1)
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
