//! Shots of a site and their footprints.

use std::path::Path;

use super::columns;
use areograph_base::error::Result;

/// Columns of `footprints.parquet` that identify the shot of a row and its footprint.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FootprintRows {
    /// Names of PEDR files, in order of appearance.
    pub files: Vec<String>,
    /// Index into `files`.
    pub file: Vec<u32>,
    /// Orbit number.
    pub orbit: Vec<u32>,
    /// Record of the file, counted from 1.
    pub record: Vec<u32>,
    /// Shot in the frame, 1 to 20.
    pub shot: Vec<u32>,
    /// Corrected time of the shot, ET seconds.
    pub et_s: Vec<f64>,
    /// The footprint with its raw radius, IAU 2000, metres.
    pub xyz_m: Vec<[f64; 3]>,
    /// Height above the areoid, after the crossover correction, metres.
    pub topography_m: Vec<f64>,
}

impl FootprintRows {
    /// Number of shots.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.et_s.len()
    }

    /// Whether there are no shots.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.et_s.is_empty()
    }

    /// Index of the file of this name, added when new.
    #[allow(
        clippy::cast_possible_truncation,
        reason = "footprints count files in 16 bits"
    )]
    fn file_index(&mut self, name: &str) -> u32 {
        // Rows come file by file: the last one is nearly always the one.
        let known = self.files.iter().rposition(|file| file == name);
        let index = known.unwrap_or_else(|| {
            self.files.push(name.to_owned());
            self.files.len() - 1
        });
        index as u32
    }
}

/// Reads `footprints.parquet`.
///
/// # Errors
/// An error of the disk; a file that is not Parquet; a column that is missing or of another type.
pub fn read_footprints(path: &Path) -> Result<FootprintRows> {
    let mut rows = FootprintRows::default();
    let names = [
        "source_file",
        "orbit",
        "record",
        "shot",
        "et_s",
        "x_m",
        "y_m",
        "z_m",
        "topography_m",
    ];
    columns::read(path, &names, |batch| {
        for name in batch.texts("source_file")?.iter().flatten() {
            let index = rows.file_index(name);
            rows.file.push(index);
        }
        rows.orbit.extend(batch.counts("orbit")?.values());
        rows.record.extend(batch.counts("record")?.values());
        rows.shot.extend(batch.counts("shot")?.values());
        rows.et_s.extend(batch.numbers("et_s")?.values());
        let (x, y, z) = (
            batch.numbers("x_m")?,
            batch.numbers("y_m")?,
            batch.numbers("z_m")?,
        );
        rows.xyz_m
            .extend((0..batch.rows()).map(|row| [x.value(row), y.value(row), z.value(row)]));
        rows.topography_m
            .extend(batch.numbers("topography_m")?.values());
        Ok(())
    })?;
    Ok(rows)
}
