//! What tests need from outside the project, noted test by test; `tests/zz_skipped.rs` counts it at the end.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
};

/// Notes of this call of `cargo test`, which starts one test program after the other.
fn notes() -> PathBuf {
    let call = std::os::unix::process::parent_id();
    Path::new(env!("CARGO_TARGET_TMPDIR"))
        .join("outside")
        .join(call.to_string())
}

/// Writes what a test says of itself under a name that is its own: its program's and its function's, after which
/// the harness names its thread; run in one thread, it is known by its words.
fn note(folder: &str, test: &str, text: &str) {
    let folder = notes().join(folder);
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
pub(crate) fn found(test: &str) {
    note("found", test, "");
}

/// The test does nothing, for this reason.
#[allow(clippy::print_stderr, reason = "tests say what they skip")]
pub(crate) fn skipped(test: &str, why: &str) {
    eprintln!("skipped {test}: {why}");
    note("skipped", test, why);
}

/// How many tests had what they need, and which were skipped, and why; the notes go away.
pub(crate) fn take_notes() -> (usize, BTreeMap<String, String>) {
    let folder = notes();
    let names = |of: &str| -> BTreeSet<String> {
        let entries = fs::read_dir(folder.join(of)).into_iter().flatten();
        entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect()
    };
    let why = |name: &String| fs::read_to_string(folder.join("skipped").join(name)).unwrap();
    let skipped = names("skipped");
    let found = names("found").difference(&skipped).count();
    let skipped = skipped.into_iter().map(|name| (name.clone(), why(&name)));
    let told = (found, skipped.collect());
    // Also the notes of calls that ended at a failure.
    let _ = fs::remove_dir_all(folder.parent().unwrap());
    told
}
