//! Searches a synthetic archive of PEDR files, compared with the limits of the machine.
//!
//! `cargo bench --bench archive -- --gb 2`: ratios go to `target/bench/archive.json`. "Warm" is with all files in the
//! system's cache, the best of a few alternating rounds; "cold" after their pages were released, once each. With
//! `--scaling` archives of 0.5 to 4 GB one after the other, and `docs/archive_scaling.svg`.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::print_stdout,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::too_many_lines,
    reason = "a benchmark may fail loudly, counts little and prints its figures in one list"
)]

mod scaling;
mod writing;

use std::{
    collections::BTreeMap,
    f64::consts::TAU,
    fs,
    hint::black_box,
    io::{BufReader, Read as _},
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
    time::Instant,
};

use areograph::{
    altimetry::{BiasScope, DatumChoice, MolaClock, ShotFilter, TagSign},
    error::{Error, Result},
    flow::{ArchiveRequest, PUBLISH, RunOptions, Task, run_task},
    geom::{
        range_residuals::{RangeResiduals, SpacecraftState},
        window::{Region, WindowShape},
    },
    pds::{
        archive::{
            Found, Index, IndexedFile, Indexes, Judged, Listing, Query, Sink, Source, search,
        },
        pedr::{FieldGuard, LABEL_BYTES, RECORD_BYTES, Reader},
    },
    scene::{ArchiveOptions, write_archive},
    spice::{KernelSet, Session},
    store::hashes::HashCache,
    watch::Watch,
};
use rayon::prelude::*;
use serde_json::{Value, json};

static RUN_ON: AtomicBool = AtomicBool::new(false);
const ROUNDS: usize = 5;
const DEGREE: f64 = std::f64::consts::PI / 180.0;
/// Frames whose shots each use a CSPICE state.
const SLOW_FRAMES: usize = 10_000;
/// Offset of the ground latitude of the mid-point in a record.
const MID_POINT: usize = 336;

#[derive(Default)]
struct Count {
    shots: usize,
    frames: u64,
}

impl Sink for Count {
    fn found(&mut self, _: usize, found: Found) -> Result<()> {
        self.shots += black_box(found.footprints).len();
        self.frames += found.frames_read;
        Ok(())
    }

    fn failed(&mut self, _: usize, failure: Error) -> Result<()> {
        Err(failure)
    }
}

struct Archive {
    folder: PathBuf,
    paths: Vec<PathBuf>,
    bytes: u64,
}

impl Archive {
    /// A synthetic archive with its kernels.
    fn write(folder: &Path, gb: f64) -> Self {
        write_archive(
            folder,
            &ArchiveOptions::of_size(1, gb),
            Watch::from(&AtomicBool::new(false)),
        )
        .unwrap();
        let folder = folder.join("pedr");
        let paths = Listing::below(&folder).paths;
        let sizes = paths.iter().map(|path| fs::metadata(path).unwrap().len());
        Self {
            bytes: sizes.sum(),
            paths,
            folder,
        }
    }

    /// A window of half a degree about a shot in the middle of the archive.
    fn around_a_shot(&self) -> Region {
        let reader = Reader::open(&self.paths[self.paths.len() / 2]).unwrap();
        let row = reader.head().record_count() / 3;
        let stretch = reader.stretch(row..row + 1, Vec::new()).unwrap();
        let (_, frame) = stretch
            .frames(row..row + 1, FieldGuard::new(None))
            .next()
            .unwrap();
        let (longitude_rad, latitude_rad) = frame.unwrap().mid_point();
        half_degree(longitude_rad / DEGREE - 0.25, latitude_rad / DEGREE - 0.25)
    }

    fn kernels(&self) -> PathBuf {
        self.folder.with_file_name("kernels").join("archive.tm")
    }

    /// The range check of all shots with its products; returns the number of checked shots.
    fn check_ranges(&self, out: &Path) -> u64 {
        let request = ArchiveRequest {
            paths: std::slice::from_ref(&self.folder),
            kernels: &self.kernels(),
            clock: clock(),
            allow_uncovered: false,
            workers: None,
        };
        let options = RunOptions {
            out: out.to_owned(),
            until: PUBLISH,
            force: true,
            stop: &RUN_ON,
            hashes: &HashCache::in_folder(out, false),
            roots: &[],
            observer: &(),
        };
        let outcome = run_task(Task::Archive(&request), &options).unwrap();
        assert!(outcome.left_out.is_empty());
        outcome.manifest().unwrap().counts["shots"]
    }

    /// The same residuals for some frames, one after the other with a CSPICE state each; returns shots per second.
    fn one_state_a_shot(&self) -> f64 {
        let session = Session::open(&KernelSet::from_metakernel(&self.kernels()).unwrap()).unwrap();
        let reader = Reader::open(&self.paths[0]).unwrap();
        let start = Instant::now();
        let stretch = reader.stretch(0..SLOW_FRAMES, Vec::new()).unwrap();
        let (mut shots, mut sum_m) = (0_u32, 0.0);
        for (_, frame) in stretch.frames(0..SLOW_FRAMES, FieldGuard::new(None)) {
            let frame = frame.unwrap();
            for shot in (1..=20).filter_map(|shot| frame.shot(shot)) {
                if shot.range_m <= 0.0 || shot.class != 1 {
                    continue;
                }
                let at = clock().spacecraft_time(shot.et_tag_s);
                let state = session.state(at).unwrap();
                let craft = SpacecraftState::of(at, &state.position, &state.velocity_m_s);
                sum_m += RangeResiduals::of(&shot, &craft).range_minus_distance_m;
                shots += 1;
            }
        }
        black_box(sum_m);
        f64::from(shots) / start.elapsed().as_secs_f64()
    }

    fn sources(&self, indexes: &Indexes) -> Vec<Source> {
        let paths = self.paths.par_iter();
        paths
            .map(|path| Source::open(path, DatumChoice::Auto, indexes).unwrap())
            .collect()
    }

    fn search(&self, windows: &[Region], judged: Judged, indexes: &Indexes) -> Count {
        let filter = ShotFilter {
            classes: vec![1],
            channels: vec![1, 2, 3, 4],
            attitude_flags: vec![0, 1],
            off_nadir_max_rad: TAU,
            solar_longitude_rad: ShotFilter::ALL_SEASONS,
        };
        let query = Query::new(windows.to_vec(), &filter, judged);
        let mut count = Count::default();
        search(&self.sources(indexes), &query, &RUN_ON, &mut count).unwrap();
        count
    }

    /// One number of one 64-byte line of every record, by all threads, of files mapped into memory.
    fn lines_mapped(&self) -> u64 {
        let of_file = |path: &PathBuf| {
            let file = fs::File::open(path).unwrap();
            #[allow(
                unsafe_code,
                reason = "no other process shortens the files of the benchmark"
            )]
            // SAFETY: the map is read only, and only this program uses the files.
            let map = unsafe { memmap2::Mmap::map(&file) }.unwrap();
            let records = map[LABEL_BYTES..].chunks_exact(RECORD_BYTES);
            records
                .map(|record| u64::from(record[MID_POINT]))
                .sum::<u64>()
        };
        self.paths.par_iter().map(of_file).sum()
    }

    /// The same for files copied piece by piece into the processor's cache.
    fn lines_copied(&self) -> u64 {
        use std::os::unix::fs::FileExt as _;
        let of_file = |path: &PathBuf| {
            let file = fs::File::open(path).unwrap();
            let length = file.metadata().unwrap().len();
            let mut buffer = vec![0; 512 * RECORD_BYTES];
            let mut sum = 0;
            for from in (LABEL_BYTES as u64..length).step_by(buffer.len()) {
                let part = (length - from).min(buffer.len() as u64) as usize;
                file.read_exact_at(&mut buffer[..part], from).unwrap();
                let records = buffer[..part].chunks_exact(RECORD_BYTES);
                sum += records
                    .map(|record| u64::from(record[MID_POINT]))
                    .sum::<u64>();
            }
            sum
        };
        self.paths.par_iter().map(of_file).sum()
    }

    /// Every mid-point, decoded by one thread through a `BufReader`.
    fn plain_reader(&self) -> u64 {
        let mut inside = 0;
        for path in &self.paths {
            let mut reader = BufReader::new(fs::File::open(path).unwrap());
            let mut label = [0; LABEL_BYTES];
            reader.read_exact(&mut label).unwrap();
            let mut record = [0; RECORD_BYTES];
            while reader.read_exact(&mut record).is_ok() {
                let angle = |at: usize| {
                    let bytes: [u8; 4] = record[at..at + 4].try_into().unwrap();
                    f64::from(i32::from_be_bytes(bytes)) * 1e-6
                };
                let (latitude, longitude) = (angle(MID_POINT), angle(MID_POINT + 4));
                let is_inside =
                    (10.0..10.5).contains(&latitude) && (20.0..20.5).contains(&longitude);
                inside += u64::from(is_inside);
            }
        }
        inside
    }

    /// All bytes in order by one thread, a mebibyte at a time, as `dd bs=1M` reads them.
    fn sequential(&self) -> u64 {
        let (mut buffer, mut bytes) = (vec![0; 1 << 20], 0);
        for path in &self.paths {
            let mut file = fs::File::open(path).unwrap();
            loop {
                let read = file.read(&mut buffer).unwrap();
                bytes += read as u64;
                if read == 0 {
                    break;
                }
            }
        }
        bytes
    }

    /// Makes the system release the pages of the files.
    fn cool(&self) {
        for path in &self.paths {
            let file = fs::File::open(path).unwrap();
            file.sync_all().unwrap();
            rustix::fs::fadvise(&file, 0, None, rustix::fs::Advice::DontNeed).unwrap();
        }
    }

    fn index(&self, earlier: &Index) -> Index {
        let file = |path: &PathBuf| {
            let below = path.strip_prefix(&self.folder).unwrap();
            let identity = areograph::files::Identity::of(&fs::metadata(path).unwrap());
            match earlier.find(below, &identity) {
                Some(known) => IndexedFile::clone(&known),
                None => IndexedFile::of(path, below, &RUN_ON).unwrap(),
            }
        };
        self.paths.iter().map(file).collect()
    }
}

fn clock() -> MolaClock {
    MolaClock {
        bias_s: 0.117,
        sign: TagSign::Late,
        scope: BiasScope::SpkLookup,
        source: String::new(),
    }
}

/// Largest distance of tabulated positions from CSPICE, as in the products of a check, metres.
fn position_error_m(out: &Path) -> f64 {
    let document = fs::read_to_string(out.join("archive.json")).unwrap();
    let document: Value = serde_json::from_str(&document).unwrap();
    document["positions"]["largest_error_m"].as_f64().unwrap()
}

fn seconds(mut work: impl FnMut()) -> f64 {
    let start = Instant::now();
    work();
    start.elapsed().as_secs_f64()
}

/// The largest resident set so far, MB.
fn peak_mb() -> f64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|line| line.starts_with("VmHWM"));
    let kib = line.and_then(|line| line.split_whitespace().nth(1)?.parse::<f64>().ok());
    kib.map_or(f64::NAN, |kib| kib * 1024.0 / 1e6)
}

fn half_degree(west: f64, south: f64) -> Region {
    Region::new(&WindowShape::Box {
        west_rad: west.rem_euclid(360.0) * DEGREE,
        east_rad: (west + 0.5).rem_euclid(360.0) * DEGREE,
        south_rad: south * DEGREE,
        north_rad: (south + 0.5) * DEGREE,
    })
}

/// All of Mars.
fn everywhere() -> Region {
    Region::new(&WindowShape::Box {
        west_rad: 0.0,
        east_rad: TAU,
        south_rad: -TAU / 4.0,
        north_rad: TAU / 4.0,
    })
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let gb = arguments.iter().position(|argument| argument == "--gb");
    let gb = gb.map_or(2.0, |at| arguments[at + 1].parse().unwrap());
    fs::create_dir_all("target/bench").unwrap();
    let measured = |gb: f64| {
        let folder = tempfile::tempdir_in("target").unwrap();
        measure(folder.path(), gb)
    };
    if arguments.iter().any(|argument| argument == "--scaling") {
        let path = Path::new("docs/archive_scaling.svg");
        return scaling::plot(path, &scaling::SIZES_GB.map(measured));
    }
    let text = format!("{:#}\n", measured(gb));
    let mut file = fs::File::create("target/bench/archive.json").unwrap();
    std::io::Write::write_all(&mut file, text.as_bytes()).unwrap();
}

/// All measurements for an archive of about `gb` gigabytes.
fn measure(folder: &Path, gb: f64) -> Value {
    let writing = Instant::now();
    let archive = Archive::write(&folder.join("archive"), gb);
    println!(
        "written at {:.2} GB/s",
        archive.bytes as f64 / writing.elapsed().as_secs_f64() / 1e9
    );
    let one = vec![archive.around_a_shot()];
    // Spread over the globe by the golden ratio.
    let thousand: Vec<Region> = (0..1_000)
        .map(|n| half_degree(f64::from(n) * 222.492_235, -87.0 + 0.173 * f64::from(n)))
        .collect();
    let everywhere = vec![everywhere()];
    let none = Indexes::default();
    let mut best: BTreeMap<&str, f64> = BTreeMap::new();
    let mut note = |name: &'static str, taken_s: f64| {
        let known = best.entry(name).or_insert(f64::INFINITY);
        *known = known.min(taken_s);
    };
    archive.cool();
    note("cold dd", seconds(|| _ = black_box(archive.sequential())));
    archive.cool();
    note(
        "cold scan",
        seconds(|| _ = black_box(archive.search(&one, Judged::Near, &none))),
    );
    let before_mb = peak_mb();
    for _ in 0..ROUNDS {
        note(
            "scan",
            seconds(|| _ = black_box(archive.search(&one, Judged::Near, &none))),
        );
        note(
            "scan, all judged",
            seconds(|| _ = black_box(archive.search(&one, Judged::All, &none))),
        );
        note(
            "1000 windows",
            seconds(|| _ = black_box(archive.search(&thousand, Judged::Near, &none))),
        );
        note(
            "plain reader",
            seconds(|| _ = black_box(archive.plain_reader())),
        );
        note(
            "lines, copied",
            seconds(|| _ = black_box(archive.lines_copied())),
        );
    }
    note(
        "every shot",
        seconds(|| _ = black_box(archive.search(&everywhere, Judged::Near, &none))),
    );
    let index = archive.index(&Index::default());
    for _ in 0..2 {
        note(
            "index build",
            seconds(|| _ = black_box(archive.index(&Index::default()))),
        );
        note(
            "index update, nothing new",
            seconds(|| _ = black_box(archive.index(&index))),
        );
    }
    let index_path = archive.folder.join(areograph::pds::archive::INDEX);
    let encoded = index.encode().unwrap();
    std::io::Write::write_all(&mut fs::File::create(&index_path).unwrap(), &encoded).unwrap();
    for _ in 0..ROUNDS {
        note(
            "indexed",
            seconds(|| {
                let indexes = Indexes::beside(&archive.paths, Index::read);
                black_box(archive.search(&one, Judged::Near, &indexes));
            }),
        );
    }
    let out = folder.join("qa");
    let (mut checked, mut slow_per_s) = (0, 0.0_f64);
    for _ in 0..2 {
        note(
            "range check",
            seconds(|| checked = archive.check_ranges(&out)),
        );
        slow_per_s = slow_per_s.max(archive.one_state_a_shot());
    }
    let range_check = RangeCheck {
        shots: checked,
        slow_per_s,
        position_error_m: position_error_m(&out),
    };
    let memory_mb = peak_mb();
    for _ in 0..ROUNDS {
        note(
            "lines, mapped",
            seconds(|| _ = black_box(archive.lines_mapped())),
        );
    }
    let found = archive.search(&one, Judged::Near, &none);
    let written = writing::rows_per_s(&archive, folder);
    let document = report(
        &archive,
        &best,
        &encoded,
        [before_mb, memory_mb],
        &found,
        &range_check,
    );
    println!("rows written per second: {written:#}");
    json!({ "rows_written_per_s": written, "searches_and_checks": document })
}

/// Results of the range check, and the rate of one CSPICE state per shot.
struct RangeCheck {
    shots: u64,
    slow_per_s: f64,
    position_error_m: f64,
}

fn report(
    archive: &Archive,
    best: &BTreeMap<&str, f64>,
    index: &[u8],
    peaks_mb: [f64; 2],
    found: &Count,
    range_check: &RangeCheck,
) -> Value {
    let bytes = archive.bytes as f64;
    println!(
        "{} files, {:.3} GB, {} threads; {} shots in the window of {} frames",
        archive.paths.len(),
        bytes / 1e9,
        rayon::current_num_threads(),
        found.shots,
        found.frames
    );
    for (name, taken_s) in best {
        println!(
            "{name:28}{:10.2} ms  {:8.2} GB/s",
            taken_s * 1e3,
            bytes / taken_s / 1e9
        );
    }
    let of = |name: &str| best[name];
    let checked_per_s = range_check.shots as f64 / of("range check");
    let ratios: Value = json!({
        "scan_over_one_line_of_each_record_warm": of("lines, mapped") / of("scan"),
        "scan_over_one_line_copied_warm": of("lines, copied") / of("scan"),
        "scan_over_plain_reader_warm": of("plain reader") / of("scan"),
        "scan_over_dd_cold": of("cold dd") / of("cold scan"),
        "time_of_1000_windows_over_one_warm": of("1000 windows") / of("scan"),
        "time_all_judged_over_near_warm": of("scan, all judged") / of("scan"),
        "indexed_half_degree_window_ms_warm": of("indexed") * 1e3,
        "index_build_gb_per_s_warm": bytes / of("index build") / 1e9,
        "index_update_ms": of("index update, nothing new") * 1e3,
        "index_share_of_archive": index.len() as f64 / bytes,
        "range_check_million_shots_per_s_warm": checked_per_s / 1e6,
        "range_check_over_one_cspice_state_a_shot_warm": checked_per_s / range_check.slow_per_s,
        "range_check_position_error_m": range_check.position_error_m,
        "peak_memory_after_cold_scan_mb": peaks_mb[0],
        "peak_memory_mb": peaks_mb[1],
    });
    println!("{ratios:#}");
    json!({
        "gb": bytes / 1e9,
        "threads": rayon::current_num_threads(),
        "seconds": best,
        "ratios": ratios,
    })
}
