//! Reads tables of laser shots for those in a site's windows: the counterpart of the search of PEDR files for other
//! altimeters.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
    sync::atomic::AtomicBool,
};

use super::{outline_windows::Windows, search_footprints::SearchResult};
use areograph_base::{
    altimetry::NO_ATTITUDE,
    body::{Body, Datum},
    error::{Cause, Result, Stopped},
    footprints::{AsRead, Footprint, Footprints, SourceFile},
    time::Et,
    units::{RADIANS_PER_DEGREE, wrap_two_pi},
};
use areograph_config::{ShotColumns, ShotLayout, ShotTableConfig, WindowConfig};
use areograph_geom::{
    body_rotation::convert_datum,
    ellipsoid::{Spherical, spherical_to_xyz_m},
    window::Region,
};
use areograph_pds::{
    archive::{Repetition, ShotRejection, TableRows, repetition_complaint},
    pedr::{Complaint, Reason},
    shot_table::{self, OffNadir, RowComplaint, ShotRow, TableColumns, read_shot_table},
};
use areograph_spice::KernelView;
use areograph_store::{
    files::{HashedFile, file_name},
    stage::{InOrder, Input, Inputs, Stage},
    stage_inputs,
};

/// Complaints kept with their text; all are counted.
const COMPLAINTS_MAX: usize = 1_000;
/// Classification of ground returns, as in the PEDR: others are rejected.
const GROUND: i16 = 1;

stage_inputs! {
    /// Tables of shots, and the windows.
    pub struct ReadShots<'a> {
        /// The body of the site.
        pub body: &'a Body,
        /// Columns and datum of each list of tables.
        pub shots: &'a [ShotTableConfig],
        /// The tables of each with their hashes.
        pub files: ShotFiles<'a>,
        /// Windows on the ground.
        pub windows: Windows<'a>,
        /// Seconds to add to times.
        pub clock_correction_s: &'a f64,
        /// Text kernels, for times in UTC.
        pub kernels: &'a KernelView,
    }
}

/// The tables of shots of a site, in order.
#[derive(Debug)]
pub struct ShotFiles<'a>(pub &'a [Vec<HashedFile>]);

impl Input for ShotFiles<'_> {
    fn add_to(&self, _field: &str, inputs: &mut Inputs) {
        for files in self.0 {
            InOrder(files).add_to("shots", inputs);
        }
    }
}

impl Stage for ReadShots<'_> {
    const NAME: &'static str = "search_footprints";
    const METHOD: u32 = 8;
    const CHECKED: bool = true;
    type Output = SearchResult;
    stage_inputs!(fingerprint);

    fn run(&self, stop: &AtomicBool) -> Result<SearchResult> {
        let session = self.kernels.session()?;
        let utc = |text: &str| session.utc_to_et(text);
        let tables = self.shots.iter().zip(self.files.0);
        let tables = tables.flat_map(|(table, files)| files.iter().map(move |file| (table, file)));
        let tables: Vec<(&ShotTableConfig, &HashedFile)> = tables.collect();
        read_shots(
            *self.body,
            &tables,
            self.windows.value()?,
            *self.clock_correction_s,
            &utc,
            stop,
        )
    }

    fn findings(&self, result: &SearchResult) -> Vec<String> {
        let said = result.complaint_counts.values().sum::<u64>();
        let first = result.complaints.first();
        let first = first
            .map(|complaint| format!("rows without a valid shot: {said}, the first: {complaint}"));
        first.into_iter().collect()
    }
}

/// More tables than footprints can index.
#[derive(Debug, thiserror::Error, Cause)]
#[error("{0} tables of shots; expected at most {max}", max = u16::MAX)]
#[cause(Configuration: "name only the tables of the site in shots.files")]
struct TooManyTables(usize);

/// Reads `tables`, each with its columns, for shots of `body` in any of `windows`.
///
/// Every shot is judged by its own position, in the frame of the products at its time. `correction_s` is added to times to
/// give `et_s`. Duplicate rows, in one table or in several, are counted once.
///
/// # Errors
/// A table that cannot be read, lacks columns, or holds no shot; [`Stopped`]. Any other malformed row is a complaint.
pub fn read_shots(
    body: Body,
    tables: &[(&ShotTableConfig, &HashedFile)],
    windows: &[WindowConfig],
    correction_s: f64,
    utc: &dyn Fn(&str) -> Result<Et>,
    stop: &AtomicBool,
) -> Result<SearchResult> {
    if tables.len() > usize::from(u16::MAX) {
        return Err(TooManyTables(tables.len()).into());
    }
    let regions: Vec<Region> = windows
        .iter()
        .map(|window| Region::new(&window.shape))
        .collect();
    let mut gathered = Gathered {
        body,
        regions: &regions,
        correction_s,
        seen: TableRows::default(),
        repeated: 0,
        layouts: BTreeSet::new(),
        without_rows: Vec::new(),
        result: empty(body),
    };
    for (index, (table, file)) in (0_u16..).zip(tables) {
        let datum = table.datum.unwrap_or(body.datum());
        gathered.result.footprints.files.push(SourceFile {
            name: file_name(&file.path),
            version: None,
            datum,
            blake3: file.blake3.clone(),
            is_table: true,
        });
        let (path, columns) = (&file.path, columns_of(table));
        gathered.layouts.insert(columns == TableColumns::OdePedr);
        let before = gathered.result.frames_read;
        read_shot_table(path, &columns, body, Some(utc), |row| {
            Stopped::check(stop)?;
            gathered.take(index, datum, path, row);
            Ok(())
        })?;
        if gathered.result.frames_read == before {
            gathered.without_rows.push(file_name(path));
        }
    }
    Ok(gathered.finish(tables.len()))
}

/// The columns of the configuration, in the type of the reader of tables.
fn columns_of(table: &ShotTableConfig) -> TableColumns {
    if table.layout == Some(ShotLayout::OdePedr) {
        return TableColumns::OdePedr;
    }
    TableColumns::Assigned(assigned(table.columns()))
}

fn assigned(columns: ShotColumns) -> shot_table::ShotColumns {
    shot_table::ShotColumns {
        utc: columns.utc,
        et_s: columns.et_s,
        longitude_deg: columns.longitude_deg,
        latitude_deg: columns.latitude_deg,
        radius_km: columns.radius_km,
        radius_m: columns.radius_m,
        height_m: columns.height_m,
        range_km: columns.range_km,
        range_m: columns.range_m,
        spacecraft_longitude_deg: columns.spacecraft_longitude_deg,
        spacecraft_latitude_deg: columns.spacecraft_latitude_deg,
        spacecraft_radius_km: columns.spacecraft_radius_km,
        spacecraft_radius_m: columns.spacecraft_radius_m,
        orbit: columns.orbit,
    }
}

fn empty(body: Body) -> SearchResult {
    SearchResult {
        footprints: Footprints::on(body, Vec::new()),
        complaints: Vec::new(),
        complaint_counts: BTreeMap::new(),
        rejected: BTreeMap::new(),
        frames_read: 0,
        shots_read: 0,
        notes: Vec::new(),
    }
}

/// The note on passes off nadir, whose shots get their angle.
fn passes_off_nadir(footprints: &mut Footprints<AsRead>) -> Option<String> {
    let shots: Vec<Footprint> = (0..footprints.len())
        .map(|row| footprints.row(row))
        .collect();
    let off_nadir = OffNadir::of(&shots);
    footprints.off_nadir_rad = off_nadir.angles_rad.into();
    let passes = off_nadir.passes.into_iter().map(|pass| {
        let angle_deg = pass.angle_rad / RADIANS_PER_DEGREE;
        format!("orbit {} ({angle_deg:.0}°)", pass.orbit)
    });
    let passes: Vec<String> = passes.collect();
    (!passes.is_empty()).then(|| {
        format!(
            "off-nadir passes, with ranges too long for the orbit of the other passes: {}; the spacecraft was not \
             above the footprints",
            passes.join(", ")
        )
    })
}

/// Results of reading all tables.
struct Gathered<'a> {
    body: Body,
    regions: &'a [Region],
    correction_s: f64,
    /// The shots in the windows.
    seen: TableRows,
    /// Rows that repeat another one.
    repeated: u64,
    /// Whether tables are from the Orbital Data Explorer, for the tables so far.
    layouts: BTreeSet<bool>,
    /// Names of tables that contain only a heading.
    without_rows: Vec<String>,
    result: SearchResult,
}

impl Gathered<'_> {
    fn take(
        &mut self,
        file: u16,
        datum: Datum,
        path: &Path,
        row: std::result::Result<ShotRow, RowComplaint>,
    ) {
        self.result.frames_read += 1;
        match row {
            Ok(row) => self.shot(file, datum, path, &row),
            Err(complaint) => self.complain(path, complaint),
        }
    }

    fn complain(&mut self, path: &Path, complaint: RowComplaint) {
        let counts = &mut self.result.complaint_counts;
        *counts.entry(Reason::Row).or_default() += 1;
        if self.result.complaints.len() < COMPLAINTS_MAX {
            self.result.complaints.push(Complaint {
                file: file_name(path),
                record: Some(complaint.line),
                reason: Reason::Row,
                text: complaint.text,
            });
        }
    }

    fn shot(&mut self, file: u16, datum: Datum, path: &Path, row: &ShotRow) {
        self.result.shots_read += 1;
        let windows = self.windows(datum, row);
        if windows == 0 {
            return;
        }
        match self.seen.take(file, row) {
            Repetition::New => {}
            Repetition::Same => {
                self.repeated += 1;
                return;
            }
            Repetition::Other(earlier, line) => {
                let earlier = &self.result.footprints.files[usize::from(earlier)].name;
                let complaint = repetition_complaint(row.line, earlier, line);
                return self.complain(path, complaint);
            }
        }
        let shot = Footprint {
            windows,
            ..row.footprint(self.body, file, self.correction_s)
        };
        if shot.class == GROUND {
            self.result.footprints.push(&shot);
        } else {
            let rejected = &mut self.result.rejected;
            *rejected.entry(ShotRejection::Class).or_default() += 1;
        }
    }

    /// The windows that hold the shot, as bits.
    fn windows(&self, datum: Datum, row: &ShotRow) -> u64 {
        let (longitude_rad, latitude_rad) = if datum == self.body.datum() {
            (wrap_two_pi(row.longitude_rad), row.latitude_rad)
        } else {
            let at = Et::from_seconds(row.et_s);
            let direction = spherical_to_xyz_m(row.longitude_rad, row.latitude_rad, 1.0);
            let direction = convert_datum(self.body, direction, datum, at, at);
            let spherical = Spherical::from_xyz_m(&direction.xyz_m);
            (spherical.longitude_rad, spherical.latitude.0)
        };
        let regions = self.regions.iter().enumerate();
        let holding = regions.filter(|(_, region)| region.contains(longitude_rad, latitude_rad));
        holding.fold(0, |windows, (bit, _)| windows | 1 << bit)
    }

    fn finish(self, tables: usize) -> SearchResult {
        let mut result = self.result;
        let plural = if tables == 1 { "" } else { "s" };
        let mut notes = vec![format!(
            "{tables} table{plural} of laser shots: {} rows{}",
            result.frames_read,
            if self.layouts.contains(&false) {
                "; heights above the ellipsoid are used as topography, and radii are not corrected by crossovers"
            } else {
                ""
            }
        )];
        if self.layouts.contains(&true) {
            notes.push(
                "Tables of the Orbital Data Explorer: planet_rad, which is corrected by crossovers, serves as the \
                 radius before and after this correction, and topography is taken from the table; the spacecraft is \
                 assumed to be on the radius through the footprint, at the measured range (nadir by range), because \
                 the tables do not state its position"
                    .to_owned(),
            );
            if !self.layouts.contains(&false) {
                notes.extend(passes_off_nadir(&mut result.footprints));
            }
            let flags = result.footprints.attitude_flag.iter();
            let unknown = flags.filter(|flag| *flag >= NO_ATTITUDE).count();
            if unknown > 0 {
                notes.push(format!(
                    "{unknown} shots in the windows have attitude flag 2 or 3: their positions assume that the laser \
                     pointed to nadir"
                ));
            }
        }
        if !self.without_rows.is_empty() {
            notes.push(format!(
                "tables without rows: {}",
                self.without_rows.join(", ")
            ));
        }
        if self.repeated > 0 {
            notes.push(format!(
                "{} rows in the windows duplicate other rows and are counted once",
                self.repeated
            ));
        }
        result.notes = notes;
        result
    }
}
