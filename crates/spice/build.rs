//! Links CSPICE so that the build products can be moved.
//!
//! `cspice-sys` requires a static `libcspice.a`, and where one exists it is linked into the program. Where
//! `$CSPICE_DIR/lib` holds the shared library and an empty archive instead, the shared library is copied beside the
//! programs of the profile, and dependent crates receive its path (`DEP_AREOGRAPH_CSPICE_SHARED`).

use std::{
    env,
    error::Error,
    fs::{self, File},
    path::{Path, PathBuf},
};

const SHARED: &str = "libcspice.so";

/// An archive without members consists of its magic number, `!<arch>` and a line end.
const EMPTY_ARCHIVE_BYTES: u64 = 8;

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-env-changed=CSPICE_DIR");
    let Some(library) = env::var_os("CSPICE_DIR").map(|folder| PathBuf::from(folder).join("lib"))
    else {
        return Ok(());
    };
    let (archive, shared) = (library.join("libcspice.a"), library.join(SHARED));
    for file in [&archive, &shared] {
        println!("cargo:rerun-if-changed={}", file.display());
    }
    let static_library =
        fs::metadata(&archive).is_ok_and(|archive| archive.len() > EMPTY_ARCHIVE_BYTES);
    if static_library || !shared.is_file() {
        return Ok(());
    }
    // <profile>/build/<package>/out
    let out = PathBuf::from(env::var_os("OUT_DIR").ok_or("cargo sets OUT_DIR")?);
    let profile = out.ancestors().nth(3).ok_or("OUT_DIR is too short")?;
    let copy = profile.join(SHARED);
    copy_with_time(&shared, &copy)?;
    println!("cargo:rerun-if-changed={}", copy.display());
    // Cargo adds this folder to the LD_LIBRARY_PATH of tests.
    println!("cargo:rustc-link-search=native={}", profile.display());
    println!("cargo:rustc-link-lib=dylib=cspice");
    println!("cargo:shared=1");
    Ok(())
}

/// Copies a file unless the copy exists; keeps its time, so that cargo does not take the copy for a change.
fn copy_with_time(from: &Path, to: &Path) -> Result<(), Box<dyn Error>> {
    let (source, present) = (fs::metadata(from)?, fs::metadata(to));
    let modified = source.modified()?;
    if present.is_ok_and(|present| {
        present.len() == source.len() && present.modified().is_ok_and(|time| time == modified)
    }) {
        return Ok(());
    }
    // A program may be running from the old copy: it keeps that one.
    let staged = to.with_extension("so.new");
    fs::copy(from, &staged)?;
    File::options()
        .append(true)
        .open(&staged)?
        .set_modified(modified)?;
    fs::rename(&staged, to)?;
    Ok(())
}
