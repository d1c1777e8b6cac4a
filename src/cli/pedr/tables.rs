//! Counts of the tables of the Orbital Data Explorer.

use std::{collections::BTreeMap, path::Path};

use serde_json::{Value, json};

use crate::{
    body::Body,
    error::Result,
    files::{file_name, hash_file},
    flow::state_nadir_by_range,
    pds::shot_table::{RowComplaint, ShotRow, TableColumns, Utc, read_shot_table},
};

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
