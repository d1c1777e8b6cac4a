//! Files as plans name them.

use serde::{Deserialize, Serialize};

/// A file of the archive.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Named {
    /// Absolute path.
    pub(super) path: String,
    /// BLAKE3 of its bytes, hexadecimal.
    pub(super) blake3: String,
}
