//! The search of many PEDR files and windows compared with brute force over every shot, and files that fail meanwhile.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "helpers of tests fail as tests do"
)]

use areograph_testing::brute_force;
use areograph_testing::track;

use std::{
    collections::BTreeMap,
    f64::consts::{FRAC_PI_2, TAU},
    fs,
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
};

use areograph_base::{
    altimetry::{DatumChoice, ShotFilter},
    body::Datum,
    error::{Error, Result},
    time::{Et, Interval},
};
use areograph_geom::window::{Region, WindowShape};
use areograph_pds::archive::{Found, Indexes, Judged, Query, Sink, Source, search};
use brute_force::{TrueShot, every_shot};
use proptest::{prelude::*, test_runner::TestRunner};
use track::{DEGREE, FRAMES, write, write_frames};

static RUN_ON: AtomicBool = AtomicBool::new(false);

/// File, record, shot, and the windows that contain it.
type Row = (usize, u32, u8, Vec<u32>);

fn filter() -> ShotFilter {
    ShotFilter {
        classes: vec![0, 1],
        channels: vec![1, 2, 3, 4],
        attitude_flags: vec![0, 3],
        off_nadir_max_rad: 1.0,
        solar_longitude_rad: ShotFilter::ALL_SEASONS,
    }
}

/// Result of a search.
#[derive(Default)]
struct Rows {
    rows: Vec<Row>,
    complaints: Vec<String>,
    failures: BTreeMap<usize, Error>,
    frames_read: u64,
    shots_read: u64,
    /// Called with the first result.
    meanwhile: Option<Box<dyn FnOnce() + Send>>,
}

impl Sink for Rows {
    fn found(&mut self, file: usize, found: Found) -> Result<()> {
        if let Some(meanwhile) = self.meanwhile.take() {
            meanwhile();
        }
        for row in 0..found.footprints.len() {
            let shot = found.footprints.row(row);
            assert_eq!(usize::from(shot.file), file);
            let windows = found.windows.of(row).to_vec();
            self.rows.push((file, shot.record, shot.shot, windows));
        }
        self.complaints
            .extend(found.complaints.iter().map(ToString::to_string));
        self.frames_read += found.frames_read;
        self.shots_read += found.shots_read;
        Ok(())
    }

    fn failed(&mut self, file: usize, failure: Error) -> Result<()> {
        self.failures.insert(file, failure);
        Ok(())
    }
}

fn open(paths: &[PathBuf]) -> Vec<Source> {
    let open = |path: &PathBuf| {
        Source::open(path, DatumChoice::Auto, &Indexes::default()).expect("a good file")
    };
    paths.iter().map(open).collect()
}

fn searched(sources: &[Source], query: &Query<'_>) -> Rows {
    let mut rows = Rows::default();
    search(sources, query, &RUN_ON, &mut rows).expect("nobody stops it");
    rows
}

/// An older file and a newer one that continues it.
fn archive(folder: &Path) -> Vec<PathBuf> {
    let files = [folder.join("ap19019k.b"), folder.join("AP19020L.B")];
    write(&files[0], Datum::Iau1991, 0, |_, _| ());
    write(&files[1], Datum::Iau2000, FRAMES / 2, |_, _| ());
    files.to_vec()
}

fn brute_force(shots: &[TrueShot], regions: &[Region], time: Option<Interval>) -> Vec<Row> {
    let in_time = |known: &&TrueShot| {
        let at = Et::from_seconds(known.shot.et_tag_s);
        time.is_none_or(|time| time.contains(at))
    };
    let rows = shots.iter().filter(in_time).map(|known| {
        let [longitude, latitude] = known.place_rad;
        let held = (0..).zip(regions);
        let held = held.filter(|(_, region)| region.contains(longitude, latitude));
        (
            usize::from(known.shot.file),
            known.shot.record,
            known.shot.shot,
            held.map(|(window, _)| window).collect(),
        )
    });
    rows.filter(|(_, _, _, windows): &Row| !windows.is_empty())
        .collect()
}

/// Windows of every kind: boxes, also over 0°, polygons with holes, caps at either pole, tiny and large ones.
fn shape() -> impl Strategy<Value = WindowShape> {
    let measures = (
        0.0..360.0_f64,
        0.001..1.0_f64,
        -90.0..90.0_f64,
        0.01..1.0_f64,
        0..5,
    );
    measures.prop_map(|(west, width, south, share, kind)| {
        let width = if kind == 0 {
            2.0 * width
        } else {
            170.0 * width
        };
        let north = south + share * (90.0 - south) * if kind == 0 { 0.03 } else { 1.0 };
        let wrapped = |degrees: f64| degrees.rem_euclid(360.0) * DEGREE;
        let ring = |shrink: f64| {
            let (middle, centre) = (west + 0.5 * width, 0.5 * (south + north));
            let corners = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.2, 0.5]];
            let corner = |[x, y]: [f64; 2]| {
                let longitude = middle + shrink * x * width;
                [
                    longitude * DEGREE,
                    (centre + shrink * y * (north - south)) * DEGREE,
                ]
            };
            corners.map(corner).to_vec()
        };
        match kind {
            0 | 1 => WindowShape::Box {
                west_rad: wrapped(west),
                east_rad: wrapped(west + width),
                south_rad: south * DEGREE,
                north_rad: north * DEGREE,
            },
            2 => WindowShape::Polygons {
                polygons: vec![vec![ring(1.0)], vec![ring(0.1)]],
            },
            3 => WindowShape::Polygons {
                polygons: vec![vec![ring(1.0), ring(0.5)]],
            },
            _ => WindowShape::Box {
                west_rad: 0.0,
                east_rad: TAU,
                south_rad: if south > 0.0 {
                    (80.0 + 0.1 * south) * DEGREE
                } else {
                    -FRAC_PI_2
                },
                north_rad: if south > 0.0 {
                    FRAC_PI_2
                } else {
                    (-80.0 + 0.1 * south) * DEGREE
                },
            },
        }
    })
}

#[test]
fn any_windows_and_times_hold_the_shots_that_brute_force_finds() {
    let folder = tempfile::tempdir().unwrap();
    let paths = archive(folder.path());
    let (sources, shots, filter) = (open(&paths), every_shot(&paths), filter());
    let mut rows_found = 0;
    let count = std::cell::RefCell::new(&mut rows_found);
    let time = proptest::option::of((-100.0..9_000.0_f64, 0.0..5_000.0_f64));
    let mut runner = TestRunner::new(ProptestConfig::with_cases(24));
    runner
        .run(
            &(proptest::collection::vec(shape(), 1..80), time),
            |(shapes, time)| {
                let regions: Vec<Region> = shapes.iter().map(Region::new).collect();
                let time = time.map(|(start, length)| {
                    let start = Et::from_seconds(-20_000_000.0 + start);
                    Interval::new(start, start.plus(length))
                });
                let expected = brute_force(&shots, &regions, time);
                **count.borrow_mut() += expected.len();
                for judged in [Judged::All, Judged::Near] {
                    let query = Query::new(regions.clone(), &filter, judged).within(time);
                    let found = searched(&sources, &query);
                    prop_assert_eq!(&found.rows, &expected);
                    prop_assert_eq!(found.frames_read, u64::from(FRAMES));
                    prop_assert!(found.failures.is_empty() && found.complaints.is_empty());
                }
                Ok(())
            },
        )
        .unwrap();
    assert!(
        rows_found > 10_000,
        "only {rows_found} rows: the test says little"
    );
}

#[test]
fn any_number_of_threads_gives_the_same_rows_and_counts() {
    let folder = tempfile::tempdir().unwrap();
    let sources = open(&archive(folder.path()));
    let filter = filter();
    let window = Region::new(&WindowShape::Box {
        west_rad: 0.0,
        east_rad: 3.0,
        south_rad: -1.2,
        north_rad: 1.2,
    });
    let of_threads = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new();
        let pool = pool.num_threads(threads).build().unwrap();
        let query = Query::new(vec![window.clone()], &filter, Judged::All);
        let rows = pool.install(|| searched(&sources, &query));
        (rows.rows, rows.frames_read, rows.shots_read)
    };
    let one = of_threads(1);
    assert!(!one.0.is_empty());
    for threads in [2, 3, 7] {
        assert!(of_threads(threads) == one, "{threads} threads");
    }
}

#[test]
fn a_record_far_from_every_window_is_judged_only_when_all_are() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("AP19019L.B");
    write(&path, Datum::Iau2000, 0, |number, record| {
        if number.is_multiple_of(100) {
            record.clock_frequency_hz.set(7);
        }
        if number == 50 {
            record.ground_latitude_microdegrees.set(i32::MAX);
        }
    });
    let (sources, filter) = (open(&[path]), filter());
    let nowhere = Query::new(Vec::new(), &filter, Judged::Near);
    assert_eq!(
        searched(&sources, &nowhere).complaints,
        [
            "AP19019L.B record 61: ground latitude is 2147483647 microdegrees; expected -90 to 90 degrees"
        ]
    );
    let all = Query::new(Vec::new(), &filter, Judged::All);
    assert_eq!(searched(&sources, &all).complaints.len(), 26);
    let everywhere = Region::new(&WindowShape::Box {
        west_rad: 0.0,
        east_rad: TAU,
        south_rad: -FRAC_PI_2,
        north_rad: FRAC_PI_2,
    });
    let near = Query::new(vec![everywhere], &filter, Judged::Near);
    assert_eq!(searched(&sources, &near).complaints.len(), 26);
}

/// Effect of `spoil` on a valid file before it is searched: none, or its failure.
fn spoilt(spoil: impl Fn(&Path)) -> (usize, Option<String>) {
    let folder = tempfile::tempdir().unwrap();
    let paths = archive(folder.path());
    let (sources, filter) = (open(&paths), filter());
    spoil(&paths[0]);
    let window = Region::new(&WindowShape::Box {
        west_rad: 0.0,
        east_rad: TAU,
        south_rad: -FRAC_PI_2,
        north_rad: FRAC_PI_2,
    });
    let found = searched(&sources, &Query::new(vec![window], &filter, Judged::Near));
    assert!(!found.failures.contains_key(&1));
    let rows_of = |file: usize| found.rows.iter().filter(|row| row.0 == file).count();
    assert!(
        rows_of(1) > 40_000,
        "the other file is searched all the same"
    );
    let failure = found.failures.get(&0);
    (rows_of(0), failure.map(ToString::to_string))
}

#[test]
fn a_file_that_is_not_what_it_was_fails_and_the_others_are_searched() {
    let (rows, failure) = spoilt(|_| ());
    assert!(rows > 40_000 && failure.is_none());
    let touch = |path: &Path| {
        let file = fs::File::options().append(true).open(path).unwrap();
        file.set_modified(std::time::SystemTime::UNIX_EPOCH)
            .unwrap();
    };
    let shorten = |path: &Path| {
        let file = fs::File::options().write(true).open(path).unwrap();
        file.set_len(100_000).unwrap();
    };
    let replace = |path: &Path| {
        fs::remove_file(path).unwrap();
        fs::create_dir(path).unwrap();
    };
    for (spoil, expected) in [
        (
            &touch as &dyn Fn(&Path),
            "the file changed while it was read",
        ),
        (&shorten, "the file changed while it was read"),
        (&|path| fs::remove_file(path).unwrap(), "cannot open"),
        (&replace, "not a regular file"),
    ] {
        let (rows, failure) = spoilt(spoil);
        let failure = failure.expect("a failure");
        assert!(rows == 0 && failure.contains("ap19019k.b"), "{failure}");
        assert!(failure.contains(expected), "{expected}: {failure}");
    }
}

/// A file with more records than are in memory at once, and an event when its first shots are found.
fn meanwhile(happens: impl FnOnce(&Path) + Send + 'static) -> Rows {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("AP19019L.B");
    write_frames(&path, Datum::Iau2000, 0..66_000, |_, _| ());
    let (sources, filter) = (open(std::slice::from_ref(&path)), filter());
    let window = Region::new(&WindowShape::Box {
        west_rad: 0.0,
        east_rad: 1.0,
        south_rad: -0.3,
        north_rad: 0.3,
    });
    let query = Query::new(vec![window], &filter, Judged::All);
    let mut rows = Rows {
        meanwhile: Some(Box::new(move || happens(&path))),
        ..Rows::default()
    };
    search(&sources, &query, &RUN_ON, &mut rows).unwrap();
    rows
}

#[test]
fn a_file_that_shrinks_or_vanishes_while_it_is_read_fails_without_a_signal() {
    let whole = meanwhile(|_| ());
    assert!(whole.failures.is_empty() && whole.rows.len() > 1_000);
    let shrunk = meanwhile(|path| {
        let file = fs::File::options().write(true).open(path).unwrap();
        file.set_len(1_000_000).unwrap();
    });
    let failure = shrunk.failures[&0].to_string();
    let expected = "the file was truncated while it was read: it had 51223760 bytes when opened";
    assert!(failure.contains(expected), "{failure}");
    let removed = meanwhile(|path| fs::remove_file(path).unwrap());
    let failure = removed.failures[&0].to_string();
    assert!(
        failure.contains("the file was removed while it was read"),
        "{failure}"
    );
}

#[test]
fn files_of_another_kind_are_refused_before_the_search() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::io::Write::write_all(&mut fs::File::create(&path).unwrap(), bytes).unwrap();
        let failure = Source::open(&path, DatumChoice::Auto, &Indexes::default())
            .unwrap_err()
            .to_string();
        assert!(failure.contains(name), "{failure}");
        failure
    };
    assert!(refused("empty.b", b"").contains("the file has 0 bytes"));
    assert!(refused("text.b", &vec![b'x'; 20_000]).contains("no valid record"));
    assert!(refused("zeros.b", &vec![0; 900_000]).contains("no valid record"));
    let failure = Source::open(folder.path(), DatumChoice::Auto, &Indexes::default()).unwrap_err();
    assert!(failure.to_string().contains("not a regular file"));
}
