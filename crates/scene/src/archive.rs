//! A synthetic archive: PEDR files of any number of days, their kernels, and the drawn errors.

use std::{
    fmt,
    path::{Path, PathBuf},
};

use rayon::prelude::*;
use serde::Serialize;

use super::{
    archive_frames::{ArchiveFrame, Badness, RANGE_NOISE_M, RANGE_STEP_M, fly},
    error::SceneError,
    error_sources::Relief,
    files::{Draft, put},
    kernels::{ARCHIVE_METAKERNEL, write_archive_kernels},
    laser::{CROSSOVER_AMPLITUDE_M, CROSSOVER_PERIOD_S, FRAME_S},
    orbit::Orbit,
    pedr::NOTE,
    random::Random,
    terrain::Terrain,
};
use areograph_base::{
    body::Datum,
    error::{IoError, Locate, Result},
    time::{Et, Interval},
    watch::Watch,
};
use areograph_config::usual_altimeter;
use areograph_pds::pedr::{LabelInfo, PedrWriter, RECORD_BYTES};

/// Fewest and most files; the mission had some 830 days of mapping.
const DAYS: [f64; 2] = [1.0, 2_000.0];
/// Revolutions of a file, about a day.
const REVOLUTIONS: u32 = 12;
/// The first revolution begins after this, ET seconds: 1999-03-01, when mapping began.
const START_S: f64 = -26_570_000.0;
/// Seconds without frames at the ends of a revolution with late tags, so that the files stay in order.
const APART_S: f64 = 16.0;
/// Lost packets: share of revolutions with a gap, and shortest and longest gap, seconds.
const GAP_SHARE: f64 = 0.3;
const GAP_S: [f64; 2] = [14.0, 420.0];
/// In each group of this many files, three have a bad revolution, each of a different kind.
const BAD_EVERY: u32 = 5;

/// Options of a synthetic archive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArchiveOptions {
    /// Seed of all drawn values.
    pub seed: u64,
    /// Files, of 12 revolutions each: about a day.
    pub days: u32,
}

impl ArchiveOptions {
    /// The archive of about `gb` gigabytes (10⁹ bytes); at least one file.
    #[must_use]
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a cast from floating point saturates; too many files are rejected"
    )]
    pub fn of_size(seed: u64, gb: f64) -> Self {
        let frames = f64::from(REVOLUTIONS) * Orbit::period_s() / FRAME_S;
        let days = (gb * 1e9 / (frames * RECORD_BYTES as f64)).round().max(1.0);
        Self {
            seed,
            days: days as u32,
        }
    }
}

/// Summary of the archive written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ArchiveSummary {
    /// Folder of the archive; PEDR files lie in `pedr`, kernels in `kernels`.
    pub directory: PathBuf,
    /// PEDR files.
    pub files: usize,
    /// Frames in them.
    pub frames: u64,
}

impl fmt::Display for ArchiveSummary {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let directory = self.directory.display();
        write!(
            formatter,
            "{directory}: {} frames in {} PEDR file{}; next: areograph pedr qa {directory}/pedr --kernels \
             {directory}/kernels/{ARCHIVE_METAKERNEL} --out qa",
            self.frames,
            self.files,
            if self.files == 1 { "" } else { "s" },
        )
    }
}

/// `truth.json`.
#[derive(Debug, Serialize)]
struct ArchiveTruth {
    made_by: &'static str,
    synthetic: &'static str,
    seed: u64,
    mola_clock_bias_s: f64,
    mola_clock_rule: &'static str,
    range_noise_m: f64,
    range_step_m: f64,
    crossover_amplitude_m: f64,
    crossover_period_s: f64,
    crossover_rule: &'static str,
    bad_rule: &'static str,
    bad_profiles: Vec<BadTruth>,
    files: Vec<ArchiveFileTruth>,
}

/// A bad revolution of a file.
#[derive(Debug, Clone, Serialize)]
struct BadTruth {
    file: String,
    orbit: u32,
    what: Badness,
}

/// A file.
#[derive(Debug, Clone, Serialize)]
struct ArchiveFileTruth {
    file: String,
    frames: u64,
    first_orbit: u32,
    gaps_et_s: Vec<[f64; 2]>,
    #[serde(skip)]
    bad: Option<BadTruth>,
}

/// Writes an archive into `directory`, replacing an older scene unless files were added or changed.
///
/// The same options give the same bytes with any number of threads. Coordinates are IAU 2000, as in files of version L.
///
/// * `watch` – counts the files
///
/// # Errors
/// Too few or too many days; a folder that holds something else; errors of writing.
pub fn write_archive(
    directory: &Path,
    options: &ArchiveOptions,
    watch: Watch<'_>,
) -> Result<ArchiveSummary> {
    let days = f64::from(options.days);
    let [least, most] = DAYS;
    if !(least..=most).contains(&days) {
        let option = "days";
        let value = days;
        let error = SceneError::Option {
            option,
            value,
            least,
            most,
        };
        return Err(error.into());
    }
    let draft = Draft::begin(directory, README)?;
    let orbit = Orbit::new(Et::from_seconds(START_S), 0.3, 0.0);
    let files: Vec<PlannedFile> = (0..options.days)
        .map(|day| PlannedFile::new(options.seed, day))
        .collect();
    let spans: Vec<Interval> = files.iter().map(PlannedFile::span).collect();
    write_archive_kernels(&draft.folder("kernels")?, &orbit, &spans)?;
    let terrain = Terrain::new(options.seed, &[], Relief::Gentle);
    let pedr = draft.folder("pedr")?;
    watch.announce(files.len());
    let written = files.par_iter().map(|file| {
        let written = file.write(&pedr, &orbit, &terrain);
        watch.step(1, "PEDR files");
        written
    });
    let written: Vec<ArchiveFileTruth> = written.collect::<Result<_>>()?;
    let frames = written.iter().map(|file| file.frames).sum();
    write_truth(&draft, options, written)?;
    draft.finish()?;
    Ok(ArchiveSummary {
        directory: directory.to_owned(),
        files: files.len(),
        frames,
    })
}

fn write_truth(
    draft: &Draft,
    options: &ArchiveOptions,
    files: Vec<ArchiveFileTruth>,
) -> Result<()> {
    let truth = ArchiveTruth {
        made_by: concat!("areograph scene ", env!("CARGO_PKG_VERSION")),
        synthetic: "all values are invented",
        seed: options.seed,
        mola_clock_bias_s: usual_altimeter().clock_bias_s,
        mola_clock_rule: "true time = tag - mola_clock_bias_s, in all files; coordinates are valid at the true time",
        range_noise_m: RANGE_NOISE_M,
        range_step_m: RANGE_STEP_M,
        crossover_amplitude_m: CROSSOVER_AMPLITUDE_M,
        crossover_period_s: CROSSOVER_PERIOD_S,
        crossover_rule: "in the files, ground and spacecraft are too high by the residual, amplitude sin(2 pi et / \
                             period) at the mid-point of the frame; radii are the values before its subtraction",
        bad_rule: "errors of a whole revolution: range_m, excess of the ranges; time_s, delay of the time tags in \
                       addition to the clock bias; orbit_m, excess height of ground and spacecraft",
        bad_profiles: files.iter().filter_map(|file| file.bad.clone()).collect(),
        files,
    };
    let path = draft.root().join("truth.json");
    let text = serde_json::to_string_pretty(&truth)
        .map_err(|error| IoError {
            action: "write",
            source: error.into(),
        })
        .in_file(&path)?;
    put(&path, &text)
}

/// A file before its frames are computed.
struct PlannedFile {
    name: String,
    first_orbit: u32,
    seed: u64,
    /// For each revolution: its error, and a gap in its frames.
    revolutions: Vec<(Option<Badness>, Option<Interval>)>,
}

impl PlannedFile {
    fn new(seed: u64, day: u32) -> Self {
        let first_orbit = 1 + REVOLUTIONS * day;
        let mut random = Random::new(seed, &format!("archive day {day}"));
        let bad = match day % BAD_EVERY {
            0 => Some(Badness::RangeM(6.0)),
            1 => Some(Badness::TimeS(0.3)),
            2 => Some(Badness::OrbitM(30.0)),
            _ => None,
        };
        let bad_at = bad_revolution(random.bits());
        let revolutions = (0..REVOLUTIONS)
            .map(|number| {
                let [chance, share] = [0, 1].map(|_| random.between(0.0, 1.0));
                let length_s = random.between_log(GAP_S[0], GAP_S[1]);
                let start_s = 600.0 + share * (Orbit::period_s() - 1_200.0 - length_s);
                let gap = (chance < GAP_SHARE).then(|| {
                    let start = start_of(first_orbit + number).plus(start_s);
                    Interval::new(start, start.plus(length_s))
                });
                (bad.filter(|_| number == bad_at), gap)
            })
            .collect();
        Self {
            name: format!("ap{:05}l.b", 10_000 + first_orbit),
            first_orbit,
            seed: random.bits(),
            revolutions,
        }
    }

    /// From its first to its last frame, true times.
    fn span(&self) -> Interval {
        Interval::new(
            start_of(self.first_orbit),
            start_of(self.first_orbit + REVOLUTIONS),
        )
    }

    fn write(&self, folder: &Path, orbit: &Orbit, terrain: &Terrain) -> Result<ArchiveFileTruth> {
        let path = folder.join(&self.name);
        let label = LabelInfo {
            product_id: self.name.to_uppercase(),
            software_version: 7.25,
            datum: Datum::Iau2000,
            note: NOTE.to_owned(),
        };
        let mut writer = PedrWriter::create(&path, &label)?;
        let (mut index, mut frames) = (0, 0);
        let mut bad_truth = None;
        for (orbit_number, (bad, gap)) in (self.first_orbit..).zip(&self.revolutions) {
            if let Some(what) = *bad {
                bad_truth = Some(BadTruth {
                    file: self.name.clone(),
                    orbit: orbit_number,
                    what,
                });
            }
            for tag in Self::tags(orbit_number, *bad) {
                index += 1;
                if gap.is_some_and(|gap| gap.contains(tag)) {
                    continue;
                }
                let frame = ArchiveFrame {
                    tag,
                    index,
                    orbit: orbit_number,
                    bad: *bad,
                    seed: self.seed,
                };
                writer.write_record(&fly(orbit, terrain, &frame).in_file(&path)?)?;
                frames += 1;
            }
        }
        writer.finish()?;
        let gaps = self.revolutions.iter().filter_map(|(_, gap)| *gap);
        Ok(ArchiveFileTruth {
            file: self.name.clone(),
            frames,
            first_orbit: self.first_orbit,
            gaps_et_s: gaps
                .map(|gap| [gap.start.seconds(), gap.stop.seconds()])
                .collect(),
            bad: bad_truth,
        })
    }

    /// Tags of the frames of a revolution: whole microseconds, 2 s apart from one revolution to the next.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a revolution has 3,500 frames"
    )]
    fn tags(orbit_number: u32, bad: Option<Badness>) -> impl Iterator<Item = Et> + use<> {
        let grid_us = (START_S + usual_altimeter().clock_bias_s + 0.5 * FRAME_S) * 1e6;
        let number = |orbit_number: u32| {
            (start_of(orbit_number).since(Et::from_seconds(START_S)) / FRAME_S).ceil() as u64
        };
        let late_s = Badness::time_s(bad);
        let apart = if late_s.abs() > 0.0 {
            (APART_S / FRAME_S) as u64
        } else {
            0
        };
        let numbers = number(orbit_number) + apart..number(orbit_number + 1) - apart;
        numbers.map(move |number| {
            let tag_us = grid_us.round() + (number as f64 * FRAME_S + late_s) * 1e6;
            Et::from_seconds(tag_us / 1e6)
        })
    }
}

/// Start of a revolution.
fn start_of(orbit_number: u32) -> Et {
    Et::from_seconds(START_S + f64::from(orbit_number.saturating_sub(1)) * Orbit::period_s())
}

/// The index of a file's bad revolution: neither the first nor the last.
fn bad_revolution(bits: u64) -> u32 {
    1 + u32::try_from(bits % u64::from(REVOLUTIONS - 2)).unwrap_or(0)
}

/// Contents of the archive, for `README.txt`.
const README: &str = "\
pedr/*.b        PEDR files of 12 revolutions each (about a day)
kernels/        archive.tm and the kernels that it loads: leap seconds, clock, Mars, orbit
truth.json      injected errors: clock bias, noise, bad revolutions, gaps
";
