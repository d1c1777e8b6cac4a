//! Programs of other people that read the products.

use std::{
    path::{Path, PathBuf},
    process::Command,
};

use serde_json::Value;

use crate::common::outside;

/// Where `scripts/readers` put the Python packages, and whether every reader must be there: `scripts/test`
/// names the folder in `AREOGRAPH_READERS` once it has provided them.
#[allow(
    clippy::disallowed_methods,
    reason = "tests find their readers by an environment variable"
)]
fn folder() -> (PathBuf, bool) {
    let named = std::env::var("AREOGRAPH_READERS");
    let usual = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/readers");
    named.map_or((usual, false), |folder| (PathBuf::from(folder), true))
}

fn absent(reader: &str, test: &str, required: bool) {
    assert!(
        !required,
        "{test}: {reader} must be there; run scripts/readers"
    );
    outside::skipped(test, &format!("no {reader} (run scripts/readers)"));
}

/// A program, if it can be run; without it the test is counted as skipped.
pub(crate) fn program(name: &str, test: &str) -> Option<Command> {
    if Command::new(name).arg("--version").output().is_ok() {
        outside::found(test);
        return Some(Command::new(name));
    }
    absent(name, test, folder().1);
    None
}

/// A Python script of this folder, if its packages are there.
pub(crate) fn python(script: &str, test: &str) -> Option<Command> {
    let (folder, required) = folder();
    if !folder.join("requirements.txt").is_file() {
        absent("Python packages", test, required);
        return None;
    }
    outside::found(test);
    let mut command = Command::new("python3");
    let path = format!("{}/tests/exchange/{script}", env!("CARGO_MANIFEST_DIR"));
    command.env("PYTHONPATH", folder).arg("-B").arg(path);
    Some(command)
}

/// A Python script of this folder for Debian's Python, if that has the module.
pub(crate) fn system_python(script: &str, module: &str, test: &str) -> Option<Command> {
    let python = "/usr/bin/python3";
    let import = format!("import {module}");
    let found = Command::new(python).args(["-c", &import]).output();
    if !found.is_ok_and(|found| found.status.success()) {
        outside::skipped(test, &format!("no {module} (run scripts/readers)"));
        return None;
    }
    outside::found(test);
    let mut command = Command::new(python);
    let path = format!("{}/tests/exchange/{script}", env!("CARGO_MANIFEST_DIR"));
    command.arg("-B").arg(path);
    Some(command)
}

/// Every raster below a folder, by path: rows, columns, cells with a value, and whether it is on a projected map; each as rio-cogeo validates
/// it and Rasterio reads it.
pub(crate) fn cloud_optimised(folder: &Path) -> Option<Value> {
    let mut script = python("validate_cog.py", "rio-cogeo and Rasterio")?;
    Some(serde_json::from_str(&output(script.arg(folder))).unwrap())
}

/// What the program prints; it must succeed.
pub(crate) fn output(command: &mut Command) -> String {
    let output = command.output().unwrap();
    assert!(
        output.status.success(),
        "{command:?}: {}{}",
        String::from_utf8_lossy(&output.stderr),
        String::from_utf8_lossy(&output.stdout)
    );
    String::from_utf8(output.stdout).unwrap()
}

/// usgscsm's line scanner with the support data `isd` and a question, if `scripts/readers` found its sources.
pub(crate) fn camera(isd: &Path, question: &str, test: &str) -> Option<Command> {
    let program = folder().0.join("usgscsm/camera");
    if !program.is_file() {
        outside::skipped(
            test,
            "no usgscsm (its sources are beside the project or not at all)",
        );
        return None;
    }
    outside::found(test);
    let mut command = Command::new(program);
    command.arg(isd).arg(question);
    Some(command)
}
