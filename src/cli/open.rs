//! Pages in the browser.

use std::{
    io::Result,
    path::Path,
    process::{Command, ExitStatus, Stdio},
    thread::sleep,
    time::Duration,
};

use super::output;

/// Program that opens a file with the user's default application.
const OPENER: &str = if cfg!(target_os = "macos") {
    "open"
} else {
    "xdg-open"
};
/// Number of polls of the opener for failure, and the time between them; if it has not failed by then, the page is
/// shown.
const LOOKS: u32 = 40;
const BETWEEN_LOOKS: Duration = Duration::from_millis(50);

/// Opens `page` in the browser without waiting for it; on failure a warning states the path of the page.
pub(super) fn page(page: &Path) {
    let why = match failure(page) {
        Ok(None) => return,
        Ok(Some(status)) => format!("{OPENER} found no browser ({status})"),
        Err(error) => format!("cannot start {OPENER}: {error}"),
    };
    output::warning(format_args!("{why}; the page is {}", page.display()));
}

/// The failure of the opener, if any.
fn failure(page: &Path) -> Result<Option<ExitStatus>> {
    let mut opener = Command::new(OPENER);
    opener.arg(page).stdin(Stdio::null()).stdout(Stdio::null());
    let mut opener = opener.stderr(Stdio::null()).spawn()?;
    for _ in 0..LOOKS {
        if let Some(status) = opener.try_wait()? {
            return Ok((!status.success()).then_some(status));
        }
        sleep(BETWEEN_LOOKS);
    }
    Ok(None)
}
