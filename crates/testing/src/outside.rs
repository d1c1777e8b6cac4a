//! What tests need from outside the project, noted test by test; `scripts/test` counts it at the end.

use std::{env, fs, path::PathBuf};

/// Folder of the notes of one run of all tests; nothing is noted where nobody asks for it.
const NOTES: &str = "AREOGRAPH_TEST_NOTES";

/// Writes what a test says of itself under a name that is its own: its program's and its function's, after which
/// the harness names its thread; run in one thread, it is known by its words.
fn note(folder: &str, test: &str, text: &str) {
    let Some(notes) = env::var_os(NOTES) else {
        return;
    };
    let folder = PathBuf::from(notes).join(folder);
    fs::create_dir_all(&folder).unwrap();
    let thread = std::thread::current();
    let function = thread.name().filter(|name| *name != "main");
    let program = std::env::current_exe().unwrap();
    let program = program.file_stem().unwrap().to_string_lossy();
    // Cargo adds a hash.
    let (program, _) = program.rsplit_once('-').unwrap();
    let name = format!("{program} {}", function.unwrap_or(test)).replace(['/', ':'], "-");
    fs::write(folder.join(name), text).unwrap();
}

/// The test has what it needs.
pub fn found(test: &str) {
    note("found", test, "");
}

/// The test does nothing, for this reason.
#[allow(clippy::print_stderr, reason = "tests say what they skip")]
pub fn skipped(test: &str, why: &str) {
    eprintln!("skipped {test}: {why}");
    note("skipped", test, why);
}

/// The test is left to the long run.
pub fn left(test: &str) {
    note("left", test, test);
}
