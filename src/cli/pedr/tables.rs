//! Tables of the Orbital Data Explorer where commands expect PEDR files.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use serde_json::{Value, json};

use crate::{
    body::Body,
    error::{Cause, Error, Result},
    files::{file_name, hash_file},
    pds::{
        archive::SearchedTable,
        shot_table::{
            OffNadirPass, RowComplaint, ShotRow, TableColumns, Utc, is_ode_pedr, read_shot_table,
        },
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
        "name the table in [[shots]] of a site, with layout = \"ode_pedr\" and kernels: the range check compares both"
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
pub(super) fn tables_among(paths: &[PathBuf]) -> Result<bool> {
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
pub(super) fn refuse(paths: &[PathBuf]) -> Result<()> {
    match first(paths) {
        (None, _) => Ok(()),
        (Some(path), _) => Err(Error::from(Misplaced::NotPedr).in_file(path)),
    }
}

/// A session with leap seconds alone.
pub(super) fn clock(leap_seconds: Option<&Path>) -> Result<Option<Session>> {
    let Some(kernel) = leap_seconds else {
        return Ok(None);
    };
    let kernels = KernelSet::from_files(&[kernel.to_owned()])?;
    Session::open(&kernels).map(Some)
}

/// The instant of a time in UTC.
pub(super) fn instant(clock: Option<&Session>, text: &str) -> Result<Et> {
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
pub(super) fn state_nadir_by_range(answer: &mut Value) {
    answer["nadir_by_range"] = true.into();
    answer["range_minus_distance_m"] = Value::Null;
    answer["remark"] = "a table contains no spacecraft position: the position is assumed on the radius through the \
        footprint, at the range, so a comparison of range and distance does not apply"
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

/// Counts of a table.
#[derive(Debug, Default)]
pub(super) struct TableCounts {
    rows: u64,
    span_s: Option<[f64; 2]>,
    rows_by_orbit: BTreeMap<u32, u64>,
    pub(super) shots_by_class: BTreeMap<i16, u64>,
    pub(super) shots_by_channel: BTreeMap<u8, u64>,
    pub(super) shots_by_attitude_flag: BTreeMap<u16, u64>,
    complaints: Vec<String>,
}

impl TableCounts {
    /// Counts the shots of a table.
    ///
    /// # Errors
    /// As of `read_shot_table`.
    pub(super) fn of(path: &Path, utc: Option<Utc<'_>>) -> Result<Self> {
        let mut counts = Self::default();
        read_shot_table(path, &TableColumns::OdePedr, Body::Mars, utc, |row| {
            counts.rows += 1;
            match row {
                Ok(row) => counts.add(&row),
                Err(RowComplaint { line, text }) => {
                    let complaint = format!("{} line {line}: {text}", file_name(path));
                    counts.complaints.push(complaint);
                }
            }
            Ok(())
        })?;
        Ok(counts)
    }

    fn add(&mut self, row: &ShotRow) {
        let [first_s, last_s] = self.span_s.unwrap_or([row.et_s; 2]);
        self.span_s = Some([first_s.min(row.et_s), last_s.max(row.et_s)]);
        *self.rows_by_orbit.entry(row.orbit).or_default() += 1;
        *self.shots_by_class.entry(row.class).or_default() += 1;
        *self.shots_by_channel.entry(row.channel).or_default() += 1;
        let flags = &mut self.shots_by_attitude_flag;
        *flags.entry(row.attitude_flag).or_default() += 1;
    }

    /// The counts as an answer.
    ///
    /// # Errors
    /// The file cannot be read.
    pub(super) fn answer(&self, path: &Path) -> Result<Value> {
        let shots: u64 = self.rows_by_orbit.values().sum();
        let (blake3, _) = hash_file(path)?;
        let mut answer = json!({
            "file": path,
            "layout": "ode_pedr",
            "rows": self.rows,
            "shots": shots,
            "orbits": self.rows_by_orbit.keys().collect::<Vec<_>>(),
            "et_first_s": self.span_s.map(|[first_s, _]| first_s),
            "et_last_s": self.span_s.map(|[_, last_s]| last_s),
            "shots_by_class": self.shots_by_class,
            "shots_by_channel": self.shots_by_channel,
            "shots_by_attitude_flag": self.shots_by_attitude_flag,
            "blake3": blake3,
            "complaints": self.complaints,
        });
        state_nadir_by_range(&mut answer);
        Ok(answer)
    }

    /// First and last time, ET seconds.
    pub(super) const fn span_s(&self) -> Option<[f64; 2]> {
        self.span_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_answer_of_a_table_compares_no_range() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table.csv");
        std::fs::File::create(&path).unwrap();
        let answer = TableCounts::default().answer(&path).unwrap();
        assert_eq!(answer["nadir_by_range"], true);
        assert!(answer["range_minus_distance_m"].is_null());
        let remark = answer["remark"].as_str().unwrap();
        assert!(remark.contains("no spacecraft position"), "{remark}");
    }
}
