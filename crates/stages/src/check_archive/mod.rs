//! Range check of an archive, file by file: every shot against the kernels, statistics of every profile.
//!
//! A profile here is the part of one revolution in one file, in time order and without a gap of more than 300 s.
//! Residuals, limits and the scan of clock biases follow [`check_ranges`](super::check_ranges). To limit the
//! cost, the trajectory of a load of records is tabulated once, the spacecraft over a frame is interpolated by cubics
//! through four states, and the scan uses a few hundred shots of a profile.
//!
//! | step | where it runs |
//! |---|---|
//! | [`ArchiveSource::load`] reads records and tabulates the trajectory, the only part that calls CSPICE | one thread |
//! | [`FileCheck::add`] judges records, makes residuals, then statistics | all threads |
//!
//! Residuals (`geom/range_residuals`), limits (`RangeFigures`) and scan (`BiasScan`) are shared with the range check of
//! a site. The four states of a frame are in IAU 2000; their cubics are as exact as the tables, for a fifth of the
//! cost.

mod profile;
mod result;
mod rows;
mod spacecraft;

use std::{collections::BTreeMap, mem, ops::Range, path::Path, sync::Arc};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::{
    check_ranges::CheckRanges,
    convert_datum::{ConvertDatum, DatumTurn},
};
use areograph_base::{
    altimetry::{DatumChoice, MolaClock, ShotFilter},
    body::Datum,
    error::{Locate as _, Result},
    time::{Et, Interval, Intervals},
};
use areograph_config::RangeCheckConfig;
use areograph_pds::{
    archive::ShotRejection,
    pedr::{Complaint, FieldGuard, Reader, Stretch, decide_datum},
};
use areograph_spice::{Session, Trajectory};
use areograph_store::{
    files::{Identity, file_name},
    stage::{Called, called},
};

pub use profile::{ArchiveProfile, OffNadirBin};
pub use result::{ArchiveRanges, CheckedFile, FileCopy, FileFailure, KernelUsed};
pub use rows::CheckedShot;

use profile::Gathered;
use rows::{Rows, Task};

/// Name of the step in messages, and of its outputs.
pub const NAME: &str = "check_archive";
/// Raised when the results of the step change.
pub const METHOD: u32 = 8;
/// Stages whose functions it calls.
pub const CALLS: &[Called] = &[called::<ConvertDatum<'_>>(), called::<CheckRanges<'_>>()];

/// Records of a load: 51 MB, more than any day of the mission needs.
const LOAD_RECORDS: usize = 1 << 16;
/// Records of a task, and tasks of a wave, whose results are in memory at once: 14 MB.
const TASK_RECORDS: usize = 256;
const WAVE_TASKS: usize = 24;
/// The tabulated trajectory stays this close to the kernels, metres: a tenth of a PEDR centimetre.
pub const TRAJECTORY_TOLERANCE_M: f64 = 0.001;
/// Longest profile, seconds: a revolution is half as long. A longer one is cut, so that memory has a bound.
const LONGEST_S: f64 = 14_400.0;
/// Times of records farther apart than this have a trajectory each, seconds.
const APART_S: f64 = 600.0;
/// Seconds of trajectory beyond the shots of a frame and the scan.
const MARGIN_S: f64 = 2.0;
/// Complaints of a file that are kept with their text; all are counted.
const COMPLAINTS_KEPT: usize = 5;

/// Rules by which shots are judged.
#[derive(Debug, Clone, Copy)]
pub struct ArchiveRules<'a> {
    /// The clock of MOLA.
    pub clock: &'a MolaClock,
    /// Limits, and settings for the scan of clock biases.
    pub limits: &'a RangeCheckConfig,
    /// Shots that are checked.
    pub filter: &'a ShotFilter,
}

/// Results of the check of a file.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct FileRanges {
    /// File name without folders.
    pub file: String,
    /// BLAKE3 of its bytes, hexadecimal.
    pub blake3: String,
    /// Datum of its coordinates.
    pub datum: Option<Datum>,
    /// Its profiles, in the order of records.
    pub profiles: Vec<ArchiveProfile>,
    /// Data records.
    pub records: u64,
    /// Shots that were checked against the kernels.
    pub shots: u64,
    /// Number of shots without a spacecraft position in the kernels.
    pub not_covered: u64,
    /// Shots that were rejected, by reason.
    pub rejected: BTreeMap<ShotRejection, u64>,
    /// Complaints about records and label.
    pub complaint_count: u64,
    /// The first of them.
    pub complaints: Vec<String>,
    /// Shots of profiles within the limits by off-nadir angle, the smallest first.
    pub off_nadir: Vec<OffNadirBin>,
    /// Largest error of the tabulated trajectory against the kernels, metres.
    pub trajectory_error_m: f64,
}

/// A PEDR file that is to be checked.
#[derive(Debug)]
pub struct ArchiveSource {
    reader: Reader,
    datum: Datum,
}

/// Records of a file with the trajectory over their time.
#[derive(Debug)]
pub struct Load {
    rows: Range<usize>,
    stretch: Stretch,
    trajectory: Trajectory,
    is_last: bool,
}

impl ArchiveSource {
    /// Opens a file, reads its label and finds its first valid record.
    ///
    /// # Errors
    /// A file that cannot be read, is being written, holds no valid record, or whose datum cannot be determined.
    pub fn open(path: &Path) -> Result<Self> {
        let reader = Reader::open(path)?;
        reader.require_steady()?;
        reader.require_records()?;
        let head = reader.head();
        let version = head.name().map(|name| name.version);
        let datum = decide_datum(DatumChoice::Auto, version, head.label().datum).in_file(path)?;
        Ok(Self { reader, datum })
    }

    /// Opens a file again.
    ///
    /// # Errors
    /// As [`open`](Self::open); a file that has changed since, or was replaced.
    pub fn reopen(path: &Path, identity: &Identity) -> Result<Self> {
        let source = Self::open(path)?;
        source.reader.require_identity(identity)?;
        Ok(source)
    }

    /// Identity of the file in the file system when it was opened.
    #[must_use]
    pub const fn identity(&self) -> Identity {
        self.reader.identity()
    }

    /// The rows of each load, at least one.
    #[must_use]
    pub fn loads(&self) -> Vec<Range<usize>> {
        let records = self.reader.head().record_count();
        let starts = (0..records.max(1)).step_by(LOAD_RECORDS);
        let load = |start: usize| start..records.min(start + LOAD_RECORDS);
        starts.map(load).collect()
    }

    /// Reads some rows and tabulates the trajectory over them, as far as the kernels reach.
    ///
    /// # Errors
    /// Read errors; a file that became shorter; kernels that cannot be tabulated.
    pub fn load(
        &self,
        rows: Range<usize>,
        session: &Session,
        rules: &ArchiveRules<'_>,
    ) -> Result<Load> {
        let stretch = self.reader.stretch(rows.clone(), Vec::new())?;
        let mut times_s: Vec<f64> = stretch
            .records(rows.clone())
            .map(|(_, record)| record.time_s.get())
            .filter(|time_s| time_s.is_finite())
            .collect();
        times_s.sort_unstable_by(f64::total_cmp);
        // A profile that began in the load before is scanned with this one.
        let before_s = if rows.start == 0 { 0.0 } else { LONGEST_S };
        let reach_s = rules.limits.scan_half_width_s + rules.clock.bias_s + MARGIN_S;
        let spans = times_s.chunk_by(|a, b| b - a <= APART_S).map(|span| {
            let [start, stop] = [span[0], span[span.len() - 1]].map(Et::from_seconds);
            Interval::new(start.plus(-before_s), stop).padded(reach_s)
        });
        let path = self.reader.head().path();
        let covered = &session.coverage().in_file(path)?.spk;
        let covered = Intervals::union_of(spans).intersection(covered);
        let trajectory = session.trajectory(&covered, TRAJECTORY_TOLERANCE_M);
        Ok(Load {
            is_last: rows.end >= self.reader.head().record_count(),
            rows,
            stretch,
            trajectory: trajectory.in_file(path)?,
        })
    }
}

/// A file under check, load by load.
#[derive(Debug)]
pub struct FileCheck<'a> {
    source: Arc<ArchiveSource>,
    rules: ArchiveRules<'a>,
    turn: DatumTurn,
    guard: FieldGuard,
    hasher: blake3::Hasher,
    found: FileRanges,
    /// The profile at the end of the loads so far, which may continue.
    open: Gathered,
}

impl<'a> FileCheck<'a> {
    /// Begins the check of a file.
    #[must_use]
    pub fn new(source: Arc<ArchiveSource>, rules: ArchiveRules<'a>) -> Self {
        let head = source.reader.head();
        let mut hasher = blake3::Hasher::new();
        hasher.update(head.label_bytes());
        let complaints = head.label_complaints().to_vec();
        let mut check = Self {
            turn: DatumTurn::new(source.datum, rules.clock),
            guard: FieldGuard::new(head.label().software_version),
            found: FileRanges {
                file: file_name(head.path()),
                datum: Some(source.datum),
                records: head.record_count() as u64,
                off_nadir: OffNadirBin::all(),
                ..FileRanges::default()
            },
            source,
            rules,
            hasher,
            open: Gathered::default(),
        };
        check.complain(&complaints);
        check
    }

    /// Checks the next load; returns the results after the last one.
    ///
    /// # Errors
    /// A file that changed while it was read.
    pub fn add(&mut self, load: &Load) -> Result<Option<FileRanges>> {
        let mut hasher = mem::take(&mut self.hasher);
        rayon::join(
            || {
                hasher.update(load.stretch.bytes());
            },
            || self.check(load),
        );
        let error_m = load.trajectory.max_error_m();
        self.found.trajectory_error_m = self.found.trajectory_error_m.max(error_m);
        if !load.is_last {
            self.hasher = hasher;
            return Ok(None);
        }
        let last = mem::take(&mut self.open);
        self.take(statistics(&[last], &load.trajectory, &self.rules));
        let source = Arc::clone(&self.source);
        hasher.update(&source.reader.trailing_bytes()?);
        source.reader.unchanged()?;
        self.complain(source.reader.head().trailing_complaint().as_slice());
        // The label of a file on a server is not read.
        let stated = source.reader.stated_blake3();
        self.found.blake3 = stated.unwrap_or_else(|| hasher.finalize().to_hex().to_string());
        Ok(Some(mem::take(&mut self.found)))
    }

    fn check(&mut self, load: &Load) {
        let (rows, rules) = (self.rows(load), self.rules);
        let starts: Vec<usize> = load.rows.clone().step_by(TASK_RECORDS).collect();
        let mut ended: Vec<Gathered> = Vec::new();
        for wave in starts.chunks(WAVE_TASKS) {
            let task = |start: &usize| rows.check(*start..load.rows.end.min(start + TASK_RECORDS));
            // Statistics of a profile occupy one thread for long: the others continue meanwhile.
            let (tasks, finished) = rayon::join(
                || wave.par_iter().map(task).collect::<Vec<Task>>(),
                || statistics(&ended, &load.trajectory, &rules),
            );
            self.take(finished);
            ended.clear();
            for mut task in tasks {
                self.found.not_covered += task.not_covered;
                for (reason, count) in mem::take(&mut task.rejected) {
                    *self.found.rejected.entry(reason).or_default() += count;
                }
                self.complain(&task.complaints);
                ended.extend(self.open.append(task));
            }
        }
        self.take(statistics(&ended, &load.trajectory, &rules));
    }

    fn rows<'l>(&self, load: &'l Load) -> Rows<'l>
    where
        'a: 'l,
    {
        Rows {
            stretch: &load.stretch,
            trajectory: &load.trajectory,
            rules: self.rules,
            turn: self.turn,
            guard: self.guard,
        }
    }

    /// Adds profiles that have ended.
    fn take(&mut self, finished: Vec<Finished>) {
        for (mut profile, bins) in finished {
            let same = |earlier: &&ArchiveProfile| earlier.orbit == profile.orbit;
            let earlier = self.found.profiles.iter().filter(same).count();
            profile.part = u32::try_from(earlier + 1).unwrap_or(u32::MAX);
            profile.file.clone_from(&self.found.file);
            self.found.shots += u64::from(profile.shots);
            // One bad orbit would dominate the statistics of all others.
            if profile.is_judged() && profile.invalid_because.is_empty() {
                for (sum, bin) in self.found.off_nadir.iter_mut().zip(&bins) {
                    sum.add(bin);
                }
            }
            self.found.profiles.push(profile);
        }
    }

    fn complain(&mut self, complaints: &[Complaint]) {
        self.found.complaint_count += complaints.len() as u64;
        let room = COMPLAINTS_KEPT.saturating_sub(self.found.complaints.len());
        let texts = complaints.iter().take(room).map(ToString::to_string);
        self.found.complaints.extend(texts);
    }
}

/// Statistics of a profile, and its shots by off-nadir angle.
type Finished = (ArchiveProfile, Vec<OffNadirBin>);

/// Statistics of profiles that have ended.
fn statistics(
    ended: &[Gathered],
    trajectory: &Trajectory,
    rules: &ArchiveRules<'_>,
) -> Vec<Finished> {
    let profiles = ended.par_iter().filter(|profile| !profile.is_empty());
    profiles
        .map(|profile| ArchiveProfile::of(profile, trajectory, rules))
        .collect()
}

/// The shots of one profile with their residuals.
///
/// * `identity` – of the file when it was checked
///
/// # Errors
/// As [`ArchiveSource::load`]; a file that has changed.
pub fn shots_of(
    path: &Path,
    identity: &Identity,
    profile: &ArchiveProfile,
    session: &Session,
    rules: &ArchiveRules<'_>,
) -> Result<Vec<CheckedShot>> {
    let source = Arc::new(ArchiveSource::reopen(path, identity)?);
    let first = source.reader.head().record_number(0);
    let row = |record: u32| record.saturating_sub(first) as usize;
    let rows = row(profile.first_record)..row(profile.last_record) + 1;
    let load = source.load(rows.clone(), session, rules)?;
    let shots = FileCheck::new(source, *rules).rows(&load).check(rows).shots;
    let within = profile.start_et_s..=profile.stop_et_s;
    let of_profile =
        |shot: &CheckedShot| shot.orbit == profile.orbit && within.contains(&shot.et_s);
    Ok(shots.into_iter().filter(of_profile).collect())
}
