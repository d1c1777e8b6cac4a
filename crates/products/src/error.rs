//! Errors of writing products; each is a bug in areograph.

use areograph_base::error::Cause;

/// A product that would be wrong, or is wrong.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Bug: "report this with the site's configuration and the log")]
pub enum ProductError {
    /// A value that no reader of the product could use.
    #[error("{what} is not a finite number")]
    NotFinite {
        /// The number.
        what: String,
    },
    /// Inputs that do not belong together.
    #[error("{what}: {found}; expected {expected}")]
    Inconsistent {
        /// The counted items.
        what: String,
        /// Their number.
        found: usize,
        /// The number of items to which they belong.
        expected: usize,
    },
    /// The file differs from what was written.
    #[error("read back differently: {what}")]
    #[cause(
        "check the disk and run again; if the error persists, report it with the site's configuration"
    )]
    ReadBack {
        /// The difference.
        what: String,
    },
    /// A library refused to encode or draw.
    #[error("cannot {action}: {reason}")]
    Refused {
        /// The attempted action.
        action: &'static str,
        /// The library's own words.
        reason: String,
    },
}

impl ProductError {
    /// For `map_err` on errors of encoding libraries.
    pub fn refused<E: std::fmt::Display>(action: &'static str) -> impl Fn(E) -> Self {
        move |error| Self::Refused {
            action,
            reason: error.to_string(),
        }
    }

    /// For `map_err` on errors of decoding libraries.
    pub(super) fn unreadable<E: std::fmt::Display>(error: E) -> Self {
        Self::ReadBack {
            what: error.to_string(),
        }
    }
}
