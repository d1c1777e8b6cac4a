//! Queries of an archive on a scheduler and executors: the answers of this computer alone, or a clear error.
#![cfg(feature = "cluster")]
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    clippy::disallowed_methods,
    reason = "helpers of tests fail as tests do"
)]

mod asked;
#[path = "../common/mod.rs"]
mod common;
mod processes;
mod table;

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

use areograph::body::Datum;
use areograph_testing::track::{FRAMES, write};

/// Frames in each file of [`archive`].
const FRAMES_OF_FILE: u32 = FRAMES / 2;

fn areograph() -> Command {
    Command::new(env!("CARGO_BIN_EXE_areograph"))
}

fn index(archive: &Path) {
    let indexed = areograph().args(["pedr", "index"]).arg(archive).output();
    let indexed = indexed.unwrap();
    assert!(indexed.status.success(), "{indexed:?}");
}

/// An archive of files that follow each other, with its index.
fn archive(folder: &Path, files: u32) -> PathBuf {
    let archive = folder.join("archive");
    fs::create_dir(&archive).unwrap();
    for file in 0..files {
        let datum = if file.is_multiple_of(2) {
            Datum::Iau2000
        } else {
            Datum::Iau1991
        };
        let path = archive.join(name(file));
        write(&path, datum, file * FRAMES_OF_FILE, |_, _| ());
    }
    index(&archive);
    archive
}

fn name(file: u32) -> String {
    let version = if file.is_multiple_of(2) { 'l' } else { 'k' };
    format!("ap190{:02}{version}.b", 20 + file)
}

fn sql(archive: &Path, question: &str, more: &[&str]) -> Command {
    let mut command = areograph();
    command.args(["--quiet", "pedr", "sql"]).arg(archive);
    command.arg(question).args(["--format", "csv"]).args(more);
    command
}

/// Lines of an answer.
fn lines(output: &Output) -> Vec<String> {
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{error}");
    let text = String::from_utf8(output.stdout.clone()).unwrap();
    text.lines().map(str::to_owned).collect()
}

/// The message of a failure.
fn failed(output: &Output) -> String {
    assert!(!output.status.success(), "{output:?}");
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!error.contains("panicked"), "{error}");
    error
}
