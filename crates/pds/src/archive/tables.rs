//! Search of tables of the Orbital Data Explorer for the shots in windows, as of PEDR files.

use std::{
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
};

use super::{Found, Query, Repetition, ShotRejection, TableRows};
use crate::{
    pedr::{Complaint, Reason, SpoiledShots},
    shot_table::{
        OffNadir, OffNadirPass, RowComplaint, ShotRow, TableColumns, Utc, read_shot_table,
    },
};
use areograph_base::{
    body::{Body, Datum},
    error::{Error, Kind, Result, Stopped},
    footprints::{Footprint, SourceFile},
    time::Et,
};
use areograph_store::files::file_name;

/// A table that was searched.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchedTable {
    /// The table as footprints refer to it; its hash is unknown to a search.
    pub file: SourceFile,
    /// Its rows.
    pub rows: u64,
}

/// Results of a search of tables.
#[derive(Debug)]
pub struct FoundInTables {
    /// The tables, to which `file` of the shots refers by index.
    pub tables: Vec<SearchedTable>,
    /// The shots of all tables in order of time, each once.
    pub found: Found,
    /// Rows in the windows that repeat another one.
    pub repeated: u64,
    /// Passes off nadir, by the ranges of the shots in the windows.
    pub passes_off_nadir: Vec<OffNadirPass>,
    /// Tables that cannot be read.
    pub failures: Vec<Error>,
}

/// The complaint about a row that holds a shot of another row, with other values.
#[must_use]
pub fn repetition_complaint(line: u32, earlier: &str, earlier_line: u32) -> RowComplaint {
    RowComplaint {
        line,
        text: format!(
            "same shot as in {earlier} line {earlier_line}, but different values; expected the same values, or a different time"
        ),
    }
}

/// Searches `tables`, all of the Orbital Data Explorer, for requested shots.
///
/// * `utc` – the instant of a time in UTC, where leap seconds are known: the two times of a row are then compared
///
/// # Errors
/// [`Stopped`]. A table that cannot be read is a failure of this table, a malformed row a complaint.
pub fn search_tables(
    tables: &[PathBuf],
    query: &Query<'_>,
    utc: Option<Utc<'_>>,
    stop: &AtomicBool,
) -> Result<FoundInTables> {
    let mut search = Search {
        query,
        seen: TableRows::default(),
        near: Vec::new(),
        shots: Vec::new(),
        all: FoundInTables {
            tables: Vec::new(),
            found: Found::new(),
            repeated: 0,
            passes_off_nadir: Vec::new(),
            failures: Vec::new(),
        },
    };
    for path in tables {
        let file = u16::try_from(search.all.tables.len()).unwrap_or(u16::MAX);
        search.all.tables.push(SearchedTable {
            file: SourceFile {
                name: file_name(path),
                version: None,
                datum: Datum::Iau2000,
                blake3: String::new(),
                is_table: true,
            },
            rows: 0,
        });
        let read = read_shot_table(path, &TableColumns::OdePedr, Body::Mars, utc, |row| {
            Stopped::check(stop)?;
            search.take(file, path, row);
            Ok(())
        });
        match read {
            Ok(()) => {}
            Err(failure) if failure.kind() == Kind::Interrupted => return Err(failure),
            Err(failure) => search.all.failures.push(failure),
        }
    }
    Ok(search.end())
}

/// A search in progress.
struct Search<'a> {
    query: &'a Query<'a>,
    seen: TableRows,
    near: Vec<u32>,
    shots: Vec<(Footprint, Vec<u32>)>,
    all: FoundInTables,
}

impl Search<'_> {
    fn take(&mut self, file: u16, path: &Path, row: std::result::Result<ShotRow, RowComplaint>) {
        self.all.tables[usize::from(file)].rows += 1;
        self.all.found.frames_read += 1;
        let complaint = match row {
            Ok(row) => self.shot(file, &row),
            Err(complaint) => Some(complaint),
        };
        if let Some(RowComplaint { line, text }) = complaint {
            self.all.found.complain(Complaint {
                file: file_name(path),
                record: Some(line),
                reason: Reason::Row,
                text,
            });
        }
    }

    fn shot(&mut self, file: u16, row: &ShotRow) -> Option<RowComplaint> {
        let found = &mut self.all.found;
        found.shots_read += 1;
        let et_s = row.et_s + self.query.correction_s;
        if (self.query.time).is_some_and(|time| !time.contains(Et::from_seconds(et_s))) {
            return None;
        }
        let shot = row.footprint(Body::Mars, file, self.query.correction_s);
        let (longitude_rad, latitude_rad) = (shot.longitude_rad, shot.latitude_rad);
        let grid = &self.query.windows;
        grid.within(longitude_rad, latitude_rad, 0.0, &mut self.near);
        self.near
            .retain(|window| grid.holds(*window, longitude_rad, latitude_rad));
        if self.near.is_empty() {
            return None;
        }
        match self.seen.take(file, row) {
            Repetition::New => {}
            Repetition::Same => {
                self.all.repeated += 1;
                return None;
            }
            Repetition::Other(earlier, line) => {
                let earlier = &self.all.tables[usize::from(earlier)].file.name;
                return Some(repetition_complaint(row.line, earlier, line));
            }
        }
        match ShotRejection::of(&shot, &SpoiledShots::default(), self.query.filter) {
            Some(reason) => *found.rejected.entry(reason).or_default() += 1,
            None => self.shots.push((shot, self.near.clone())),
        }
        None
    }

    fn end(mut self) -> FoundInTables {
        // The sort is stable: shots with equal times stay in the order of the tables.
        self.shots
            .sort_by(|(one, _), (other, _)| one.et_tag_s.total_cmp(&other.et_tag_s));
        let (shots, windows): (Vec<Footprint>, Vec<Vec<u32>>) = self.shots.into_iter().unzip();
        let off_nadir = OffNadir::of(&shots);
        let found = &mut self.all.found;
        for ((shot, windows), off_nadir_rad) in shots.iter().zip(&windows).zip(off_nadir.angles_rad)
        {
            let shot = Footprint {
                off_nadir_rad,
                ..*shot
            };
            match ShotRejection::of(&shot, &SpoiledShots::default(), self.query.filter) {
                Some(reason) => *found.rejected.entry(reason).or_default() += 1,
                None => found.push(&shot, windows),
            }
        }
        self.all.passes_off_nadir = off_nadir.passes;
        self.all
    }
}
