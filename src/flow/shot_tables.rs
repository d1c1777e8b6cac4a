//! Tables of the Orbital Data Explorer where PEDR files are expected.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::{
    error::{Cause, Error, Result},
    pds::{
        archive::SearchedTable,
        shot_table::{OffNadirPass, is_ode_pedr},
    },
    spice::{KernelSet, Session},
    time::Et,
};

/// Tables where they cannot be used.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Configuration)]
enum Misplaced {
    #[error("a table of the Orbital Data Explorer among PEDR files; expected files of one kind")]
    #[cause("search tables and PEDR files separately")]
    Mixed,
    #[error(
        "a table of the Orbital Data Explorer, which contains no spacecraft positions; expected PEDR files"
    )]
    #[cause(
        "name the table in [[shots]] of a site, with layout = \"ode_pedr\" and kernels: the range check compares the table \
         with the kernels"
    )]
    NotPedr,
}

/// The first table among these paths, and whether all of them are tables.
fn first(paths: &[PathBuf]) -> (Option<&PathBuf>, bool) {
    // A path that cannot be read is reported by the reader of PEDR files.
    let is_table = |path: &&PathBuf| is_ode_pedr(path).unwrap_or(false);
    let tables: Vec<&PathBuf> = paths.iter().filter(is_table).collect();
    (tables.first().copied(), tables.len() == paths.len())
}

/// Whether these paths are tables.
///
/// # Errors
/// Some are tables and some are not.
pub fn tables_among(paths: &[PathBuf]) -> Result<bool> {
    match first(paths) {
        (None, _) => Ok(false),
        (Some(_), true) => Ok(true),
        (Some(path), false) => Err(Error::from(Misplaced::Mixed).in_file(path)),
    }
}

/// Refuses tables.
///
/// # Errors
/// One of the paths is a table.
pub fn refuse_tables(paths: &[PathBuf]) -> Result<()> {
    match first(paths) {
        (None, _) => Ok(()),
        (Some(path), _) => Err(Error::from(Misplaced::NotPedr).in_file(path)),
    }
}

/// A session with leap seconds alone, if a kernel is named.
///
/// # Errors
/// A kernel that cannot be read.
pub fn leap_second_clock(leap_seconds: Option<&Path>) -> Result<Option<Session>> {
    let Some(kernel) = leap_seconds else {
        return Ok(None);
    };
    let kernels = KernelSet::from_files(&[kernel.to_owned()])?;
    Session::open(&kernels).map(Some)
}

/// The instant of a time in UTC.
///
/// # Errors
/// A time that the clock does not know; no clock.
pub fn instant_of_table(clock: Option<&Session>, text: &str) -> Result<Et> {
    match clock {
        Some(clock) => clock.utc_to_et(text),
        None => Err(Misplaced::NotPedr.into()),
    }
}

/// A table in the answer of a search.
pub(super) fn described(table: &SearchedTable) -> Value {
    json!({"file": table.file.name, "rows": table.rows, "datum": table.file.datum})
}

/// States in an answer that the positions of the spacecraft are nadir by range. Positions in PEDR files are measured.
pub fn state_nadir_by_range(answer: &mut Value) {
    answer["nadir_by_range"] = true.into();
    answer["range_minus_distance_m"] = Value::Null;
    answer["remark"] = "a table contains no spacecraft position: the spacecraft is assumed to be on the radius through the \
        footprint, one range above it, so that range and distance cannot be compared"
        .into();
}

/// Passes off nadir in an answer.
pub(super) fn passes(passes: &[OffNadirPass]) -> Value {
    let passes = passes.iter().map(|pass| {
        // A hundredth of a degree: the orbit of the others is known to a few kilometres.
        let off_nadir_deg = (pass.angle_rad.to_degrees() * 100.0).round() / 100.0;
        json!({"orbit": pass.orbit, "off_nadir_deg": off_nadir_deg})
    });
    passes.collect()
}
