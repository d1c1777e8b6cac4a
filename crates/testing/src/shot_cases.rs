//! Files with and without common shots: cases that every caller must handle.

use std::path::PathBuf;

use areograph_base::{
    body::Datum,
    footprints::{AsRead, Footprint, Footprints, SourceFile},
};

/// Successive shots 0.1 s apart: microseconds from the start to the first one, and their number.
pub type Run = (i64, u32);

/// Some files, in the order in which they are searched.
pub struct Case {
    pub name: &'static str,
    pub files: &'static [&'static [Run]],
    /// The first two files with a common shot.
    pub shared: Option<[usize; 2]>,
}

/// A time tag of the mission with all its digits, microseconds.
const START_US: i64 = 38_593_125_159_870;

impl Case {
    /// Fails unless the refusal of `file` because of shots in another file, named in the reason, is that of the case.
    pub fn judge(&self, refusal: Option<(Option<PathBuf>, String)>, paths: &[PathBuf]) {
        match (refusal, self.shared) {
            (None, None) => {}
            (Some((path, why)), Some([other, file])) => {
                assert_eq!(path.as_ref(), Some(&paths[file]), "{}", self.name);
                let other = paths[other].display().to_string();
                assert!(why.contains(&other), "{}: {why}", self.name);
            }
            (found, _) => panic!("{}: {found:?}", self.name),
        }
    }

    /// Time tags of a file, ET seconds.
    pub fn tags_s(&self, file: usize) -> Vec<f64> {
        let tag_s = |first_us: i64, shot: u32| {
            (START_US + first_us + 100_000 * i64::from(shot)) as f64 * 1e-6
        };
        let runs = self.files[file].iter();
        runs.flat_map(|(first_us, shots)| (0..*shots).map(move |shot| tag_s(*first_us, shot)))
            .collect()
    }
}

pub const CASES: &[Case] = &[
    Case {
        name: "a copy",
        files: &[&[(0, 40)], &[(0, 40)]],
        shared: Some([0, 1]),
    },
    Case {
        name: "files that follow each other, 0.1 s apart",
        files: &[&[(0, 40)], &[(4_000_000, 40)]],
        shared: None,
    },
    Case {
        name: "files that overlap by one shot",
        files: &[&[(0, 40)], &[(3_900_000, 40)]],
        shared: Some([0, 1]),
    },
    Case {
        name: "the later file first",
        files: &[&[(4_000_000, 40)], &[(0, 40)]],
        shared: None,
    },
    Case {
        name: "the later file first, with a shot of the earlier one",
        files: &[&[(4_000_000, 40)], &[(0, 41)]],
        shared: Some([0, 1]),
    },
    Case {
        name: "files 0.05 s apart, half the time between two shots",
        files: &[&[(0, 40)], &[(3_950_000, 40)]],
        shared: Some([0, 1]),
    },
    Case {
        name: "files 0.05 s and a microsecond apart",
        files: &[&[(0, 40)], &[(3_950_001, 40)]],
        shared: None,
    },
    Case {
        name: "a later version with tags moved by 30 ms",
        files: &[&[(0, 40)], &[(30_000, 40)]],
        shared: Some([0, 1]),
    },
    Case {
        name: "a short file within a long one",
        files: &[&[(0, 1_000)], &[(30_000_000, 20)]],
        shared: Some([0, 1]),
    },
    Case {
        name: "a file with an orbit between the orbits of another file",
        files: &[
            &[(0, 40), (20_000_000_000, 40)],
            &[(10_000_000_000, 40), (30_000_000_000, 40)],
        ],
        shared: None,
    },
    Case {
        name: "a file with an orbit between the orbits of another file, and one orbit in both",
        files: &[
            &[(0, 40), (20_000_000_000, 40)],
            &[(10_000_000_000, 40), (20_001_000_000, 40)],
        ],
        shared: Some([0, 1]),
    },
    Case {
        name: "a frame missing from the other file",
        files: &[&[(0, 20), (4_000_000, 20)], &[(2_000_000, 20)]],
        shared: None,
    },
    Case {
        name: "shots of a frame without a return in the other file",
        files: &[&[(0, 5), (1_000_000, 10)], &[(600_000, 3)]],
        shared: Some([0, 1]),
    },
    Case {
        name: "the first shot of a profile after a pause",
        files: &[&[(0, 20), (400_000_000, 20)], &[(400_000_000, 1)]],
        shared: Some([0, 1]),
    },
    Case {
        name: "the shot before the first shot after a pause",
        files: &[&[(0, 20), (400_000_000, 20)], &[(399_900_000, 1)]],
        shared: None,
    },
    Case {
        name: "an overlap of the first and the third file",
        files: &[&[(0, 40)], &[(4_000_000, 40)], &[(3_900_000, 1)]],
        shared: Some([0, 2]),
    },
    Case {
        name: "an overlap with an earlier file between",
        files: &[&[(100_000_000, 40)], &[(0, 40)], &[(103_900_000, 40)]],
        shared: Some([0, 2]),
    },
    Case {
        name: "a file without shots",
        files: &[&[(0, 40)], &[], &[(4_000_000, 40)]],
        shared: None,
    },
];

/// File `file`, with its own name.
pub fn source(file: usize) -> SourceFile {
    SourceFile {
        name: format!("file{file}.b"),
        version: None,
        datum: Datum::Iau2000,
        blake3: String::new(),
        is_table: false,
    }
}

/// Its path.
pub fn path(file: usize) -> PathBuf {
    PathBuf::from(source(file).name)
}

impl Case {
    /// The shots of file `file`.
    pub fn footprints(&self, file: usize) -> Footprints<AsRead> {
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
