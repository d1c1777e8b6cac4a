//! Pages in the browser.

use std::{
    path::Path,
    process::{Command, Stdio},
};

use crate::error::{IoError, Locate, Result};

/// What opens a file with the program of the user's choice.
const OPENER: &str = if cfg!(target_os = "macos") {
    "open"
} else {
    "xdg-open"
};

/// Opens `page` in the browser, and does not wait for it.
///
/// # Errors
/// [`IoError`] where the system has nothing that opens pages.
pub(super) fn page(page: &Path) -> Result<()> {
    let mut opener = Command::new(OPENER);
    opener.arg(page).stdin(Stdio::null()).stdout(Stdio::null());
    let opened = opener.stderr(Stdio::null()).spawn();
    opened
        .map(drop)
        .map_err(IoError::on("find a program that opens pages"))
        .in_file(page)
}
