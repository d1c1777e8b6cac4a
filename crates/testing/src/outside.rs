//! External requirements of tests, recorded test by test; `scripts/test` counts them at the end.

use std::{env, fs, path::PathBuf};

/// Folder of the records of one run of all tests; without it nothing is recorded.
const NOTES: &str = "AREOGRAPH_TEST_NOTES";

/// Writes the record of a test under a unique name: that of its program and its function, after which the harness
/// names its thread; in a single-threaded run, its text is used.
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

/// The requirements of the test are met.
pub fn found(test: &str) {
    note("found", test, "");
}

/// The test is skipped, for this reason.
#[allow(clippy::print_stderr, reason = "skipped tests are reported")]
pub fn skipped(test: &str, why: &str) {
    eprintln!("skipped {test}: {why}");
    note("skipped", test, why);
}

/// The test is left to the long run.
pub fn left(test: &str) {
    note("left", test, test);
}
