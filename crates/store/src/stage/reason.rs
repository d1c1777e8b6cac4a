//! Reasons why a stage runs.

use std::fmt;

/// Reason why a stage runs, or the statement that it does not.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Reason {
    /// Nothing changed: the stored output is used.
    Unchanged,
    /// No stored output.
    First,
    /// The user requested it.
    Forced,
    /// The stored output cannot be read or is not what was stored.
    Damaged,
    /// These inputs changed.
    Changed(Vec<String>),
}

impl Reason {
    /// Whether the stage has to run.
    #[must_use]
    pub fn runs(&self) -> bool {
        *self != Self::Unchanged
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unchanged => formatter.write_str("nothing changed"),
            Self::First => formatter.write_str("no earlier output"),
            Self::Forced => formatter.write_str("forced"),
            Self::Damaged => formatter.write_str("the stored output is damaged"),
            Self::Changed(inputs) => formatter.write_str(&inputs.join(", ")),
        }
    }
}
