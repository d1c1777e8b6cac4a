//! Problems of a segment.

use areograph_base::error::Error;

/// Reasons why a segment is invalid.
pub(super) enum Problem {
    /// Its words contradict each other.
    Damaged(String),
    /// They cannot be read.
    Unreadable(Error),
}

impl Problem {
    /// The error, with its segment.
    pub(super) fn of(self, segment: &str) -> Error {
        match self {
            Self::Damaged(problem) => super::damaged(format!("{segment}: {problem}")),
            Self::Unreadable(error) => error,
        }
    }
}

impl From<String> for Problem {
    fn from(problem: String) -> Self {
        Self::Damaged(problem)
    }
}

impl From<Error> for Problem {
    fn from(error: Error) -> Self {
        Self::Unreadable(error)
    }
}
