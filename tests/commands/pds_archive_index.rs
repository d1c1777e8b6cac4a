//! An index changes nothing but the time a search takes, whatever became of it or of the files.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "helpers of tests fail as tests do"
)]

use areograph_testing::track;

use std::{
    f64::consts::{FRAC_PI_2, TAU},
    fs,
    io::Write as _,
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
    time::{Duration, SystemTime},
};

use areograph::{
    altimetry::{DatumChoice, ShotFilter},
    body::Datum,
    error::{Error, Result},
    files::Identity,
    geom::window::{Region, WindowShape},
    pds::archive::{
        Found, INDEX, Index, IndexedFile, Indexes, Judged, Listing, Query, Sink, Source, search,
    },
    time::{Et, Interval},
};
use proptest::{prelude::*, test_runner::TestRunner};
use track::{DEGREE, FRAMES, write};

static RUN_ON: AtomicBool = AtomicBool::new(false);

/// All that a search tells.
#[derive(Debug, Default, PartialEq)]
struct Told {
    rows: Vec<(u16, u32, u8, Vec<u32>)>,
    complaints: Vec<String>,
    rejected: u64,
    frames_read: u64,
    shots_read: u64,
}

impl Sink for Told {
    fn found(&mut self, _: usize, found: Found) -> Result<()> {
        for row in 0..found.footprints.len() {
            let shot = found.footprints.row(row);
            let windows = found.windows.of(row).to_vec();
            self.rows.push((shot.file, shot.record, shot.shot, windows));
        }
        let complaints = found.complaints.iter().map(ToString::to_string);
        self.complaints.extend(complaints);
        self.rejected += found.rejected.values().sum::<u64>();
        self.frames_read += found.frames_read;
        self.shots_read += found.shots_read;
        Ok(())
    }

    fn failed(&mut self, _: usize, failure: Error) -> Result<()> {
        Err(failure)
    }
}

fn filter() -> ShotFilter {
    ShotFilter {
        classes: vec![1],
        channels: vec![1, 2, 3],
        attitude_flags: vec![0],
        off_nadir_max_rad: 0.02,
        solar_longitude_rad: ShotFilter::ALL_SEASONS,
    }
}

fn box_deg(west: f64, width: f64, south: f64, north: f64) -> Region {
    Region::new(&WindowShape::Box {
        west_rad: west.rem_euclid(360.0) * DEGREE,
        east_rad: (west + width).rem_euclid(360.0) * DEGREE,
        south_rad: south * DEGREE,
        north_rad: north * DEGREE,
    })
}

fn told(
    paths: &[PathBuf],
    indexes: &Indexes,
    windows: &[Region],
    judged: Judged,
    time: Option<Interval>,
) -> Told {
    let open =
        |path: &PathBuf| Source::open(path, DatumChoice::Auto, indexes).expect("a good file");
    let sources: Vec<Source> = paths.iter().map(open).collect();
    let filter = filter();
    let query = Query::new(windows.to_vec(), &filter, judged).within(time);
    let mut told = Told::default();
    search(&sources, &query, &RUN_ON, &mut told).expect("nobody stops it");
    told
}

/// Files in two folders, old enough to be indexed at once: an older one, one with some bad records, one with records out
/// of order.
fn archive(folder: &Path) -> Vec<PathBuf> {
    let paths = ["a/ap19019k.b", "b/AP19020L.B", "b/ap19021l.b"].map(|name| folder.join(name));
    for path in &paths {
        fs::create_dir_all(path.parent().expect("a folder")).expect("a writable folder");
    }
    write(&paths[0], Datum::Iau1991, 0, |_, _| ());
    write(
        &paths[1],
        Datum::Iau2000,
        FRAMES / 2,
        |number, record| match number % 200 {
            7 => record.clock_frequency_hz.set(7),
            9 => record.shot_radius_cm[4].set(i32::MAX),
            11 if number > 4_000 => record.ground_latitude_microdegrees.set(i32::MIN),
            13 if number > 4_000 => record.ground_longitude_change_microdegrees.set(i32::MAX),
            _ => (),
        },
    );
    write(&paths[2], Datum::Iau2000, FRAMES, |number, record| {
        if number == FRAMES + 700 {
            record.time_s.set(1e7);
            record.time_whole_s.set(10_000_000);
            record.time_fraction_us.set(0);
        }
    });
    for path in &paths {
        age(path);
    }
    paths.to_vec()
}

/// The time of the last change cannot be set: files are waited for once.
fn age(path: &Path) {
    let file = fs::File::options()
        .append(true)
        .open(path)
        .expect("a writable file");
    file.set_modified(SystemTime::now() - Duration::from_secs(10))
        .expect("a file system with times");
}

fn indexed(folder: &Path, paths: &[PathBuf]) -> Index {
    let of = |path: &PathBuf| {
        let below = path.strip_prefix(folder).expect("a file below the folder");
        IndexedFile::of(path, below, &RUN_ON).expect("a good file")
    };
    paths.iter().map(of).collect()
}

fn overwrite(path: &Path, bytes: &[u8]) {
    let mut file = fs::File::create(path).expect("a writable folder");
    file.write_all(bytes).expect("room on the disk");
}

#[test]
fn with_an_index_and_without_a_search_tells_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let paths = archive(folder.path());
    let index = indexed(folder.path(), &paths);
    overwrite(&folder.path().join(INDEX), &index.encode().unwrap());
    let indexes = Indexes::beside(&paths, Index::read);
    for path in &paths {
        let identity = Identity::of(&fs::metadata(path).unwrap());
        assert!(indexes.find(path, &identity).is_some(), "the index is used");
    }
    let none = Indexes::default();
    let window = (
        0.0..360.0_f64,
        0.01..60.0_f64,
        -90.0..89.0_f64,
        0.01..1.0_f64,
    );
    let time = proptest::option::of((0.0..15_000.0_f64, 0.0..5_000.0_f64));
    let (mut rows, mut complaints) = (0, 0);
    let counts = std::cell::RefCell::new((&mut rows, &mut complaints));
    let mut runner = TestRunner::new(ProptestConfig::with_cases(32));
    runner
        .run(
            &(proptest::collection::vec(window, 0..4), time),
            |(windows, time)| {
                let windows: Vec<Region> = windows
                    .into_iter()
                    .map(|(west, width, south, share)| {
                        box_deg(west, width, south, south + share * (90.0 - south))
                    })
                    .collect();
                let time = time.map(|(start, length)| {
                    let start = Et::from_seconds(-20_000_000.0 + start);
                    Interval::new(start, start.plus(length))
                });
                for judged in [Judged::All, Judged::Near] {
                    let without = told(&paths, &none, &windows, judged, time);
                    prop_assert_eq!(&told(&paths, &indexes, &windows, judged, time), &without);
                    let mut counts = counts.borrow_mut();
                    *counts.0 += without.rows.len();
                    *counts.1 += without.complaints.len();
                }
                Ok(())
            },
        )
        .unwrap();
    assert!(
        rows > 10_000 && complaints > 100,
        "{rows} rows, {complaints} complaints"
    );
}

#[test]
fn an_index_that_is_damaged_or_of_another_version_is_as_good_as_none() {
    let folder = tempfile::tempdir().unwrap();
    let paths = archive(folder.path());
    let bytes = indexed(folder.path(), &paths[..1]).encode().unwrap();
    assert_eq!(Index::decode(&bytes).unwrap().files().len(), 1);
    assert_eq!(Index::decode(&bytes).unwrap().encode().unwrap(), bytes);
    for length in 0..bytes.len() {
        assert!(Index::decode(&bytes[..length]).is_none(), "{length} bytes");
    }
    let mut flipped = bytes.clone();
    for bit in 0..8 * bytes.len() {
        flipped[bit / 8] ^= 1 << (bit % 8);
        assert!(Index::decode(&flipped).is_none(), "bit {bit}");
        flipped[bit / 8] ^= 1 << (bit % 8);
    }
    let other = [b"areograph pedr index 2\n", &bytes[23..]].concat();
    assert!(Index::decode(&other).is_none());
    for hostile in [&[0xff_u8; 40][..], &[0x80; 40], b""] {
        let hash = blake3::hash(hostile);
        let bytes = [b"areograph pedr index 1\n", &hash.as_bytes()[..], hostile].concat();
        assert!(Index::decode(&bytes).is_none());
    }
    // A folder in its place, or a file that is no index.
    fs::create_dir(folder.path().join(INDEX)).unwrap();
    overwrite(&folder.path().join("a").join(INDEX), b"index");
    let indexes = Indexes::beside(&paths, Index::read);
    let windows = [box_deg(0.0, 170.0, -60.0, 60.0)];
    let found = told(&paths, &indexes, &windows, Judged::All, None);
    assert_eq!(
        found,
        told(&paths, &Indexes::default(), &windows, Judged::All, None)
    );
}

#[test]
fn a_file_that_changed_since_is_read_as_if_there_were_no_index() {
    let folder = tempfile::tempdir().unwrap();
    let paths = archive(folder.path());
    let index = indexed(folder.path(), &paths);
    overwrite(&folder.path().join(INDEX), &index.encode().unwrap());
    // Other shots under the same name and with the same size; and one file more.
    write(&paths[0], Datum::Iau1991, 40_000, |_, _| ());
    let mut paths = paths;
    paths.push(folder.path().join("b/ap19022l.b"));
    write(&paths[3], Datum::Iau2000, 50_000, |_, _| ());
    let indexes = Indexes::beside(&paths, Index::read);
    let everywhere = [Region::new(&WindowShape::Box {
        west_rad: 0.0,
        east_rad: TAU,
        south_rad: -FRAC_PI_2,
        north_rad: FRAC_PI_2,
    })];
    let found = told(&paths, &indexes, &everywhere, Judged::All, None);
    assert_eq!(
        found,
        told(&paths, &Indexes::default(), &everywhere, Judged::All, None)
    );
    assert!(found.rows.iter().any(|row| row.0 == 0) && found.rows.iter().any(|row| row.0 == 3));
}

#[test]
fn an_index_is_small_and_knows_the_bytes_of_its_files() {
    let folder = tempfile::tempdir().unwrap();
    let paths = archive(folder.path());
    let index = indexed(folder.path(), &paths);
    let archive_bytes: u64 = paths
        .iter()
        .map(|path| fs::metadata(path).unwrap().len())
        .sum();
    let bytes = index.encode().unwrap().len() as f64;
    assert!(
        bytes < 0.01 * archive_bytes as f64,
        "{bytes} bytes for {archive_bytes}"
    );
    for file in index.files() {
        let path = folder.path().join(file.path());
        assert_eq!(file.blake3(), areograph::files::hash_file(&path).unwrap().0);
    }
}

#[test]
fn files_that_hold_no_records_are_not_indexed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("empty.b");
    overwrite(&path, b"");
    let failure = IndexedFile::of(&path, Path::new("empty.b"), &RUN_ON).unwrap_err();
    assert!(failure.to_string().contains("no valid record"), "{failure}");
}

#[test]
fn folders_are_listed_in_order_and_what_cannot_be_looked_into_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let elsewhere = tempfile::tempdir().unwrap();
    let file = |folder: &Path, name: &str| {
        let path = folder.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        overwrite(&path, b"");
    };
    for name in [
        "b/two.B",
        "a/one.b",
        "a/label.lbl",
        "a/notes.gz",
        "three.b",
        "three.b.Z",
        "four.B.gz",
    ] {
        file(folder.path(), name);
    }
    file(elsewhere.path(), "disc/five.b");
    fs::create_dir(folder.path().join("folder.b")).unwrap();
    let link = |to: &Path, name: &str| {
        std::os::unix::fs::symlink(to, folder.path().join(name)).unwrap();
    };
    link(Path::new("nowhere"), "dangling.b");
    link(Path::new("not_mounted"), "volume_9");
    link(elsewhere.path(), "volume_1");
    // Circles: to the folder itself, to one beside the link, and from a volume back.
    link(folder.path(), "circle");
    link(Path::new("b"), "a_again");
    std::os::unix::fs::symlink(folder.path(), elsewhere.path().join("back")).unwrap();
    let listing = Listing::below(folder.path());
    let names: Vec<_> = listing
        .paths
        .iter()
        .map(|path| path.strip_prefix(folder.path()).unwrap())
        .collect();
    let expected = ["a/one.b", "b/two.B", "three.b", "volume_1/disc/five.b"];
    assert_eq!(names, expected.map(Path::new));
    let told: Vec<String> = listing.failures.iter().map(ToString::to_string).collect();
    assert_eq!(told.len(), 3, "{told:#?}");
    for (failure, expected) in told.iter().zip([
        "dangling.b: cannot open",
        "four.B.gz: a compressed PEDR file; expected four.B beside it",
        "volume_9: cannot open",
    ]) {
        assert!(failure.contains(expected), "{failure}");
    }
    // The same files named twice, and by another name, are taken once.
    let again = [
        folder.path().join("a"),
        folder.path().join("a/one.b"),
        folder.path().join("circle/a/one.b"),
        folder.path().join("gone.b"),
    ];
    let paths = Listing::of(&again).paths;
    assert_eq!(paths, [again[1].clone(), again[3].clone()]);
    let gone = Listing::below(&folder.path().join("gone"));
    assert!(gone.paths.is_empty() && gone.failures.len() == 1);
}

#[test]
fn a_folder_that_is_away_for_a_while_keeps_its_entries() {
    let folder = tempfile::tempdir().unwrap();
    let elsewhere = tempfile::tempdir().unwrap();
    let (volume, away) = (
        elsewhere.path().join("volume"),
        elsewhere.path().join("away"),
    );
    fs::create_dir(&volume).unwrap();
    for (place, name) in [(folder.path(), "ap19019l.b"), (&volume, "ap19020l.b")] {
        write(&place.join(name), Datum::Iau2000, 0, |_, _| ());
        age(&place.join(name));
    }
    std::os::unix::fs::symlink(&volume, folder.path().join("volume")).unwrap();
    let index = || {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_areograph"));
        let command = command.args(["--quiet", "pedr", "index"]);
        let output = command.arg(folder.path()).output().unwrap();
        let said = String::from_utf8(output.stdout).unwrap();
        (output.status.success(), said)
    };
    let (is_well, said) = index();
    assert!(is_well && said.contains("2 of them read now"), "{said}");
    fs::rename(&volume, &away).unwrap();
    let (is_well, said) = index();
    assert!(!is_well && said.contains("0 removed"), "{said}");
    fs::rename(&away, &volume).unwrap();
    let (is_well, said) = index();
    assert!(is_well && said.contains("2 files"), "{said}");
    assert!(said.contains("0 of them read now"), "{said}");
}

/// A small archive, and the bytes of its index.
fn encoded() -> (tempfile::TempDir, Vec<u8>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ap19019l.b");
    write(&path, Datum::Iau2000, 0, |_, _| ());
    age(&path);
    let file = IndexedFile::of(&path, Path::new("ap19019l.b"), &RUN_ON).unwrap();
    let index: Index = [file].into_iter().collect();
    let encoded = index.encode().unwrap();
    (folder, encoded)
}

/// What is cut off or has a bit turned over is not believed, wherever; what is random bytes under a true hash does not end
/// the program.
#[test]
fn bytes_that_are_no_index_are_never_believed() {
    let (_folder, encoded) = encoded();
    assert!(Index::decode(&encoded).is_some());
    let header = encoded.iter().position(|byte| *byte == b'\n').unwrap() + 1;
    let strategy = (
        0..encoded.len(),
        0..8_u32,
        proptest::collection::vec(any::<u8>(), 0..300),
    );
    let ran = TestRunner::default().run(&strategy, |(at, bit, bytes)| {
        prop_assert!(Index::decode(&encoded[..at]).is_none());
        let mut turned = encoded.clone();
        turned[at] ^= 1 << bit;
        prop_assert!(Index::decode(&turned).is_none());
        prop_assert!(Index::decode(&bytes).is_none());
        // With a hash that is right the entries themselves are read: random ones, and good ones that end early.
        let rest = &encoded[header + 32..];
        let early = &rest[..at.saturating_sub(header + 32).min(rest.len() - 1)];
        for entries in [&bytes[..], early] {
            let hash = blake3::hash(entries);
            let whole = [&encoded[..header], hash.as_bytes(), entries].concat();
            prop_assert!(Index::decode(&whole).is_none_or(|index| index.files().len() == 0));
        }
        Ok(())
    });
    ran.unwrap();
}

/// Whenever an index is killed, there is none, or the whole of it.
#[test]
fn a_killed_index_leaves_nothing_half_written() {
    let folder = tempfile::tempdir().unwrap();
    for number in 0..6 {
        let path = folder.path().join(format!("ap{}l.b", 19_019 + number));
        write(&path, Datum::Iau2000, FRAMES / 2 * number, |_, _| ());
        age(&path);
    }
    let index = folder.path().join(INDEX);
    let mut killed = 0;
    for wait_ms in [0, 2, 5, 10, 15, 20, 30, 40, 60, 90] {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_areograph"));
        let command = command
            .args(["--quiet", "pedr", "index"])
            .arg(folder.path());
        let mut child = command.stdout(std::process::Stdio::null()).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(wait_ms));
        killed += usize::from(child.try_wait().unwrap().is_none());
        child.kill().unwrap();
        child.wait().unwrap();
        if index.exists() {
            assert_eq!(Index::read(&index).unwrap().files().len(), 6);
            fs::remove_file(&index).unwrap();
        }
    }
    assert!(killed > 0);
}
