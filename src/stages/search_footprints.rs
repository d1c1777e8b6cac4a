//! Searches PEDR files for the shots in a site's windows: one pass over every file for all windows.

mod left_out;
mod repeats;

use std::{collections::BTreeMap, fmt, ops::Range, path::Path, sync::atomic::AtomicBool};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use self::repeats::{Copies, require_distinct};
use crate::{
    altimetry::{DatumChoice, ShotFilter},
    config::{PedrConfig, WindowConfig},
    error::{Cause, Kind, Locate, Result, Stopped},
    files::{HashedFile, file_name},
    footprints::{AsRead, Footprint, Footprints, SourceFile},
    frames::{MarsDatum, MarsIau2000},
    geom::{
        ellipsoid::{Spherical, spherical_to_xyz_m},
        mars_rotation::convert_datum,
        window::Region,
    },
    pds::pedr::{
        Complaint, FieldGuard, File, FileName, Frame, Reason, SHOTS, SpoiledShots, decide_datum,
    },
    stage::{InOrder, Input, Inputs, Stage},
    stage_inputs,
    time::Et,
    units::RADIANS_PER_DEGREE,
};

/// Complaints kept with their text; all are counted.
const COMPLAINTS_MAX: usize = 1_000;
/// Records searched by one task.
const BLOCK_RECORDS: usize = 2_048;
/// No two of the known datums are turned against each other by more than this, radians: 0.271° and
/// 0.003° per decade, and pole differences of 0.0006°.
const DATUM_MARGIN_RAD: f64 = 0.3 * RADIANS_PER_DEGREE;

/// Why a shot inside a window was rejected; the first that applies counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ShotRejection {
    /// No laser return.
    NoReturn,
    /// A radius, range or parallax that contradicts the record's other values.
    Spoiled,
    /// Classification not accepted.
    Class,
    /// Trigger channel not accepted.
    Channel,
    /// Attitude flag not accepted.
    Attitude,
    /// Off-nadir angle too large.
    OffNadir,
}

impl fmt::Display for ShotRejection {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::NoReturn => "no return",
            Self::Spoiled => "spoiled values",
            Self::Class => "class",
            Self::Channel => "channel",
            Self::Attitude => "attitude flag",
            Self::OffNadir => "off-nadir angle",
        })
    }
}

/// What the search found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SearchResult {
    /// Shots in the windows, ordered by file, record and shot, in the coordinates of their files.
    pub footprints: Footprints<AsRead>,
    /// What is wrong with the files, ordered by file and record; at most 1000 are kept.
    pub complaints: Vec<Complaint>,
    /// All complaints by reason.
    pub complaint_counts: BTreeMap<Reason, u64>,
    /// Rejected shots inside a window, by reason.
    pub rejected: BTreeMap<ShotRejection, u64>,
    /// Records looked at.
    pub frames_read: u64,
    /// Shots whose own position was tested, those of frames near a window.
    pub shots_read: u64,
    /// How files were understood, one sentence for each way, and which were copies of others.
    pub notes: Vec<String>,
}

/// More files than footprints can count.
#[derive(Debug, thiserror::Error)]
#[error("{0} PEDR files; expected at most {max}", max = u16::MAX)]
struct TooManyFiles(usize);

impl Cause for TooManyFiles {
    fn kind(&self) -> Kind {
        Kind::Configuration
    }

    fn advice(&self) -> String {
        "name only the files of the site's orbits in pedr.files".to_owned()
    }
}

stage_inputs! {
    /// PEDR files, what to keep of them, and the windows.
    pub struct SearchFootprints<'a> {
        /// Datum, filter, and the paths of the files.
        pub pedr: &'a PedrConfig,
        /// The same files with their hashes.
        pub files: PedrFiles<'a>,
        /// Windows on the ground.
        pub windows: &'a [WindowConfig],
        /// Seconds to add to time tags.
        pub clock_correction_s: &'a f64,
    }
}

/// The PEDR files of a site, in order.
#[derive(Debug)]
pub struct PedrFiles<'a>(pub &'a [HashedFile]);

impl Input for PedrFiles<'_> {
    fn add_to(&self, _field: &str, inputs: &mut Inputs) {
        InOrder(self.0).add_to("pedr", inputs);
    }
}

impl Stage for SearchFootprints<'_> {
    const NAME: &'static str = "search_footprints";
    const METHOD: u32 = 2;
    const CHECKED: bool = true;
    type Output = SearchResult;
    stage_inputs!(fingerprint);

    fn run(&self, stop: &AtomicBool) -> Result<SearchResult> {
        search_footprints(self.pedr, self.windows, *self.clock_correction_s, stop)
    }

    fn findings(&self, result: &SearchResult) -> Vec<String> {
        let spoiled = result.rejected.get(&ShotRejection::Spoiled);
        let spoiled = spoiled.copied().unwrap_or_default();
        left_out::findings(&result.complaints, &result.complaint_counts, spoiled)
    }

    fn examine(&self) -> Vec<Result<String>> {
        let files = self.pedr.files.iter();
        files
            .map(|path| examine_file(path, self.pedr.datum))
            .collect()
    }
}

/// What can be said of a PEDR file without searching it.
fn examine_file(path: &Path, choice: DatumChoice) -> Result<String> {
    let file = File::open(path)?;
    file.require_records()?;
    let version = file.name().map(|name| name.version);
    let datum = decide_datum(choice, version, file.label().datum).in_file(path)?;
    let complaints = file.label_complaints().iter();
    let complaints = complaints.map(|complaint| format!("; {}", complaint.text));
    Ok(format!(
        "{}: {} frames in {datum}{}",
        path.display(),
        file.records().len(),
        complaints.collect::<String>()
    ))
}

/// Searches all files of `pedr` for shots in any of `windows`.
///
/// Every shot is judged by its own position, in IAU 2000 at its time tag. `correction_s` is added to
/// tags to give `et_s`. The result does not depend on the number of threads. A file with the bytes of
/// an earlier one is not read again; a note says so. `stop` is looked at before every block of records.
///
/// # Errors
/// A file that cannot be opened, holds no good record, or whose datum cannot be told; two files that
/// hold the same shot in a window; [`Stopped`]. Anything else wrong inside a file is a complaint; its
/// good records are kept.
pub fn search_footprints(
    pedr: &PedrConfig,
    windows: &[WindowConfig],
    correction_s: f64,
    stop: &AtomicBool,
) -> Result<SearchResult> {
    const STAGE: &str = "search_footprints";
    if pedr.files.len() > usize::from(u16::MAX) {
        return Err(TooManyFiles(pedr.files.len())).in_stage(STAGE);
    }
    let regions: Vec<Region> = windows
        .iter()
        .map(|window| Region::new(&window.shape))
        .collect();
    let searched: Vec<Result<(SourceFile, Found, String)>> = pedr
        .files
        .par_iter()
        .enumerate()
        .map(|(index, path)| search_file(pedr, index, path, &regions, correction_s, stop))
        .collect();

    let mut all = Found::new();
    let mut files: Vec<SourceFile> = Vec::with_capacity(searched.len());
    let mut understood: BTreeMap<String, u32> = BTreeMap::new();
    let (mut copies, mut copy_notes) = (Copies::default(), Vec::new());
    // In the order of the files, so that of several failures it is always the same one that is told.
    for (index, result) in searched.into_iter().enumerate() {
        let (source, found, note) = result.in_stage(STAGE)?;
        if let Some(original) = copies.original_of(index, &source, &files) {
            copy_notes.push(format!(
                "PEDR file {} ({}) holds the same bytes as file {} ({}): read once",
                index + 1,
                source.name,
                original + 1,
                files[original].name
            ));
        } else {
            all.append(found);
            *understood.entry(note).or_default() += 1;
        }
        files.push(source);
    }
    require_distinct(&all.footprints, &pedr.files).in_stage(STAGE)?;
    all.footprints.files = files;
    let mut notes: Vec<String> = understood
        .into_iter()
        .map(|(note, files)| {
            format!(
                "{files} PEDR file{}: {note}",
                if files == 1 { "" } else { "s" }
            )
        })
        .collect();
    notes.extend(copy_notes);
    Ok(SearchResult {
        footprints: all.footprints,
        complaints: all.complaints,
        complaint_counts: all.complaint_counts,
        rejected: all.rejected,
        frames_read: all.frames_read,
        shots_read: all.shots_read,
        notes,
    })
}

/// What a block, a file or all files gave.
struct Found {
    footprints: Footprints<AsRead>,
    complaints: Vec<Complaint>,
    complaint_counts: BTreeMap<Reason, u64>,
    rejected: BTreeMap<ShotRejection, u64>,
    frames_read: u64,
    shots_read: u64,
}

impl Found {
    const fn new() -> Self {
        Self {
            footprints: Footprints::new(Vec::new()),
            complaints: Vec::new(),
            complaint_counts: BTreeMap::new(),
            rejected: BTreeMap::new(),
            frames_read: 0,
            shots_read: 0,
        }
    }

    fn complain(&mut self, complaint: Complaint) {
        *self.complaint_counts.entry(complaint.reason).or_default() += 1;
        if self.complaints.len() < COMPLAINTS_MAX {
            self.complaints.push(complaint);
        }
    }

    fn append(&mut self, other: Self) {
        self.footprints.append(other.footprints);
        let room = COMPLAINTS_MAX.saturating_sub(self.complaints.len());
        self.complaints
            .extend(other.complaints.into_iter().take(room));
        for (reason, count) in other.complaint_counts {
            *self.complaint_counts.entry(reason).or_default() += count;
        }
        for (reason, count) in other.rejected {
            *self.rejected.entry(reason).or_default() += count;
        }
        self.frames_read += other.frames_read;
        self.shots_read += other.shots_read;
    }
}

/// One file with all that judging its shots needs.
struct Search<'a> {
    file: &'a File,
    index: u16,
    datum: MarsDatum,
    guard: FieldGuard,
    filter: &'a ShotFilter,
    regions: &'a [Region],
    correction_s: f64,
    stop: &'a AtomicBool,
}

fn search_file(
    pedr: &PedrConfig,
    index: usize,
    path: &Path,
    regions: &[Region],
    correction_s: f64,
    stop: &AtomicBool,
) -> Result<(SourceFile, Found, String)> {
    let file = File::open(path)?;
    file.require_records()?;
    let version = file.name().map(|name: FileName| name.version);
    let datum = decide_datum(pedr.datum, version, file.label().datum).in_file(path)?;
    let software_version = file.label().software_version;
    let search = Search {
        file: &file,
        // search_footprints checked the number of files.
        index: u16::try_from(index).unwrap_or(u16::MAX),
        datum,
        guard: FieldGuard::new(software_version),
        filter: &pedr.filter,
        regions,
        correction_s,
        stop,
    };
    let records = file.records().len();
    let blocks = (0..records.div_ceil(BLOCK_RECORDS))
        .into_par_iter()
        .map(|block| search.block(block * BLOCK_RECORDS..(block + 1) * BLOCK_RECORDS))
        .collect::<Result<Vec<Found>>>()?;
    let mut found = Found::new();
    for complaint in file.label_complaints() {
        found.complain(complaint.clone());
    }
    for block in blocks {
        found.append(block);
    }
    if let Some(complaint) = file.trailing_complaint() {
        found.complain(complaint);
    }
    let source = SourceFile {
        name: file_name(path),
        version,
        datum,
        blake3: file.blake3(),
    };
    let software = software_version.map_or_else(
        || "unknown, taken as new".to_owned(),
        |version| version.to_string(),
    );
    let letter = version.map_or_else(|| "none".to_owned(), |letter| letter.to_string());
    let note = format!("version letter {letter}, datum {datum}, software version {software}");
    Ok((source, found, note))
}

impl Search<'_> {
    fn block(&self, rows: Range<usize>) -> Result<Found> {
        Stopped::check(self.stop)?;
        let mut found = Found::new();
        for (row, frame) in self.file.frames(rows, self.guard) {
            found.frames_read += 1;
            match frame {
                Ok(frame) => self.frame(row, &frame, &mut found),
                Err(error) => found.complain(self.file.record_complaint(row, &error)),
            }
        }
        Ok(found)
    }

    fn frame(&self, row: usize, frame: &Frame<'_>, found: &mut Found) {
        let (longitude_rad, latitude_rad) = frame.mid_point();
        let mut margin_rad = frame.reach_rad();
        if self.datum != MarsDatum::Iau2000 {
            margin_rad += DATUM_MARGIN_RAD;
        }
        let near =
            |region: &Region| region.may_contain_within(longitude_rad, latitude_rad, margin_rad);
        if !self.regions.iter().any(near) {
            return;
        }
        let spoiled = frame.spoiled_shots();
        if let Some(error) = spoiled.error() {
            found.complain(self.file.record_complaint(row, error));
        }
        for shot in (1..).take(SHOTS).filter_map(|shot| frame.shot(shot)) {
            found.shots_read += 1;
            let windows = self.windows_of(&shot);
            if windows == 0 {
                continue;
            }
            if let Some(reason) = self.reject(&shot, &spoiled) {
                *found.rejected.entry(reason).or_default() += 1;
                continue;
            }
            found.footprints.push(&Footprint {
                et_s: shot.et_tag_s + self.correction_s,
                file: self.index,
                record: self.file.record_number(row),
                windows,
                ..shot
            });
        }
    }

    /// Bits of the windows that hold the shot, by its position in IAU 2000.
    fn windows_of(&self, shot: &Footprint) -> u64 {
        let (longitude_rad, latitude_rad) = self.iau2000(shot);
        (0..u64::BITS)
            .zip(self.regions)
            .filter(|(_, region)| region.contains(longitude_rad, latitude_rad))
            .fold(0, |bits, (bit, _)| bits | 1 << bit)
    }

    /// East longitude and areocentric latitude in IAU 2000, radians.
    fn iau2000(&self, shot: &Footprint) -> (f64, f64) {
        if self.datum == MarsDatum::Iau2000 {
            return (shot.longitude_rad, shot.latitude_rad);
        }
        let at = Et::from_seconds(shot.et_tag_s);
        let direction = spherical_to_xyz_m(shot.longitude_rad, shot.latitude_rad, 1.0);
        let direction = convert_datum::<MarsIau2000>(direction, self.datum, at, at);
        let spherical = Spherical::from_xyz_m(&direction.xyz_m);
        (spherical.longitude_rad, spherical.latitude.0)
    }

    fn reject(&self, shot: &Footprint, spoiled: &SpoiledShots) -> Option<ShotRejection> {
        let filter = self.filter;
        let tests = [
            (ShotRejection::NoReturn, shot.range_m > 0.0),
            (ShotRejection::Spoiled, !spoiled.contains(shot.shot)),
            (ShotRejection::Class, filter.classes.contains(&shot.class)),
            (
                ShotRejection::Channel,
                filter.channels.contains(&shot.channel),
            ),
            (
                ShotRejection::Attitude,
                filter.attitude_flags.contains(&shot.attitude_flag),
            ),
            (
                ShotRejection::OffNadir,
                shot.off_nadir_rad.abs() <= filter.off_nadir_max_rad,
            ),
        ];
        tests
            .into_iter()
            .find_map(|(reason, passed)| (!passed).then_some(reason))
    }
}
