//! The cases of shots in two files, as callers receive them.

#[path = "../../crates/pds/src/archive/distinct/cases.rs"]
mod cases;

use std::path::PathBuf;

pub(crate) use cases::{CASES, Case};

use areograph_base::{
    body::Datum,
    footprints::{AsRead, Footprint, Footprints, SourceFile},
};

/// File `file`, with its own name.
pub(crate) fn source(file: usize) -> SourceFile {
    SourceFile {
        name: format!("file{file}.b"),
        version: None,
        datum: Datum::Iau2000,
        blake3: String::new(),
    }
}

/// Its path.
pub(crate) fn path(file: usize) -> PathBuf {
    PathBuf::from(source(file).name)
}

impl Case {
    /// The shots of file `file`.
    pub(crate) fn footprints(&self, file: usize) -> Footprints<AsRead> {
        let mut footprints = Footprints::new(Vec::new());
        for et_tag_s in self.tags_s(file) {
            footprints.push(&Footprint {
                et_tag_s,
                et_s: et_tag_s,
                orbit: 1,
                file: u16::try_from(file).unwrap(),
                record: 1,
                shot: 1,
                longitude_rad: 0.0,
                latitude_rad: 0.0,
                radius_m: 3_396_190.0,
                radius_crossover_m: 3_396_190.0,
                areoid_radius_m: 3_396_190.0,
                range_m: 400_000.0,
                spacecraft_longitude_rad: 0.0,
                spacecraft_latitude_rad: 0.0,
                spacecraft_radius_m: 3_796_190.0,
                off_nadir_rad: 0.0,
                channel: 1,
                class: 1,
                attitude_flag: 0,
                orbit_quality: 1,
                windows: 1,
            });
        }
        footprints
    }
}
