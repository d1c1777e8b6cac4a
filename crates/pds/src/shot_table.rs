//! Tables of laser shots: comma-separated text with one shot per row, whose columns are configured or known.

mod columns;
mod ode_pedr;
mod off_nadir;

use std::{fs::File, path::Path};

use csv::StringRecord;

use self::columns::{Fields, is_header};
pub use self::{
    columns::ShotColumns,
    ode_pedr::{is_ode_pedr, ode_pedr_heading},
    off_nadir::{OffNadir, OffNadirPass},
};
use areograph_base::{
    body::Body,
    error::{Cause, IoError, Locate, Result},
    footprints::Footprint,
    time::Et,
    units::wrap_two_pi,
};
use areograph_geom::ellipsoid::{on_ellipsoid_m, spherical_to_xyz_m};

/// Largest distance of a footprint from the ellipsoid, as a share of its radius.
const RELIEF: f64 = 0.05;
/// Longest range, metres: beyond every orbit from which a laser reaches the ground.
const RANGE_MAX_M: f64 = 1e7;
/// Tolerance between range and distance of spacecraft and footprint: a share of the range, plus a constant, metres.
/// Clocks, orbits and datums leave less, another unit or column far more.
const RANGE_SHARE: f64 = 0.01;
const RANGE_BESIDE_M: f64 = 1_000.0;
/// Ephemeris times, seconds: five centuries around J2000.
const ET_S: [f64; 2] = [-1e10, 1e10];

/// Classification of ground returns, as in the PEDR.
const GROUND: i16 = 1;

/// The instant of a time in UTC.
pub type Utc<'a> = &'a dyn Fn(&str) -> Result<Et>;

/// The columns of a table.
#[derive(Debug, Clone, PartialEq, Eq)]
#[expect(clippy::large_enum_variant, reason = "one for each table")]
pub enum TableColumns {
    /// As assigned.
    Assigned(ShotColumns),
    /// Columns of the PEDR query of the Orbital Data Explorer, without the position of the spacecraft.
    OdePedr,
}

/// A shot of a table, its coordinates in the table's datum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShotRow {
    /// Line of the file, from 1.
    pub line: u32,
    /// Time, ET seconds.
    pub et_s: f64,
    /// East longitude of the footprint, radians, not wrapped.
    pub longitude_rad: f64,
    /// Latitude of its direction, radians.
    pub latitude_rad: f64,
    /// Its distance from the centre of the body, metres.
    pub radius_m: f64,
    /// One-way range, metres.
    pub range_m: f64,
    /// East longitude, radians, latitude, radians, and distance from the centre, metres, of the spacecraft; `None`
    /// where the table has no position of it.
    pub spacecraft: Option<[f64; 3]>,
    /// Orbit number, 0 where the table has none.
    pub orbit: u32,
    /// Radius of the areoid, metres; `None` where the table has none.
    pub areoid_radius_m: Option<f64>,
    /// Trigger channel, 1 where the table has none.
    pub channel: u8,
    /// Classification: 1 ground, 0 cloud or noise; 1 where the table has none.
    pub class: i16,
    /// Attitude flag as in the PEDR, 0 where the table has none.
    pub attitude_flag: u16,
}

impl ShotRow {
    /// The columns of the shot; values that a table lacks are set for a ground return of one laser.
    ///
    /// Without its position, the spacecraft is put on the radius through the footprint, at the range ("nadir by range").
    /// The radius in the table serves as both radii: no table has the crossover correction itself.
    ///
    /// * `file` – index of the table
    /// * `correction_s` – seconds to add to its time
    #[must_use]
    pub fn footprint(&self, body: Body, file: u16, correction_s: f64) -> Footprint {
        let direction = spherical_to_xyz_m(self.longitude_rad, self.latitude_rad, 1.0);
        let by_range = [
            self.longitude_rad,
            self.latitude_rad,
            self.radius_m + self.range_m,
        ];
        let [longitude_rad, latitude_rad, radius_m] = self.spacecraft.unwrap_or(by_range);
        let off_nadir_rad = self.spacecraft.map_or(0.0, |_| {
            let spacecraft_m = spherical_to_xyz_m(longitude_rad, latitude_rad, radius_m);
            (spacecraft_m - self.radius_m * direction).angle(&spacecraft_m)
        });
        let ellipsoid_m = || on_ellipsoid_m(body.model(), &direction).norm();
        Footprint {
            et_tag_s: self.et_s,
            et_s: self.et_s + correction_s,
            orbit: self.orbit,
            file,
            record: self.line,
            shot: 1,
            longitude_rad: wrap_two_pi(self.longitude_rad),
            latitude_rad: self.latitude_rad,
            radius_m: self.radius_m,
            radius_crossover_m: self.radius_m,
            areoid_radius_m: self.areoid_radius_m.unwrap_or_else(ellipsoid_m),
            range_m: self.range_m,
            spacecraft_longitude_rad: wrap_two_pi(longitude_rad),
            spacecraft_latitude_rad: latitude_rad,
            spacecraft_radius_m: radius_m,
            off_nadir_rad,
            channel: self.channel,
            class: self.class,
            attitude_flag: self.attitude_flag,
            orbit_quality: 0,
            windows: 0,
        }
    }
}

/// An invalid row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RowComplaint {
    /// Line of the file, from 1.
    pub line: u32,
    /// The value found and the value expected.
    pub text: String,
}

/// A table without a readable shot.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Input)]
enum ShotTableError {
    #[error("unknown column \"{name}\" (shots.columns.{key}); the first row contains {}", found.join(", "))]
    #[cause("give the column name as in the table, or the column number, counted from 1")]
    Column {
        key: &'static str,
        name: String,
        found: Vec<String>,
    },
    #[error("line 1: column {column} is \"{found}\"; expected {}", expected.join(" or "))]
    #[cause(
        "give a table of the MOLA PEDR query of the Orbital Data Explorer with the heading that the service writes, or omit \
         the layout and assign the columns in shots.columns"
    )]
    Heading {
        column: usize,
        found: String,
        expected: &'static [&'static str; 2],
    },
    #[error("line 1: the heading has {found} columns; expected {expected}")]
    #[cause(like = Heading)]
    HeadingWidth { found: usize, expected: usize },
    #[error("the table cannot be read: {0}")]
    #[cause("give a comma-separated text table with one shot per row")]
    Table(String),
    #[error("none of its {rows} rows is a valid shot; line {}: {}", first.line, first.text)]
    #[cause(
        "compare shots.columns (or shots.layout) with the table: the column and the unit of each quantity; also check \
         body"
    )]
    Unreadable { rows: u64, first: RowComplaint },
    #[error("it has no rows")]
    #[cause(like = Table)]
    Empty,
}

/// Reads the table at `path` and passes every shot, or the fault of its row, to `take`, in order.
///
/// A first row without a number in the configured columns is a header. A table of the Orbital Data Explorer may consist of its
/// heading.
///
/// * `body` – the body of the footprints
/// * `utc` – the instant of a time in UTC; without it, times in UTC are faults, or not compared
///
/// # Errors
/// The file cannot be read; a missing column or another heading; a table without a valid shot; errors of `take`.
pub fn read_shot_table(
    path: &Path,
    columns: &TableColumns,
    body: Body,
    utc: Option<Utc<'_>>,
    mut take: impl FnMut(std::result::Result<ShotRow, RowComplaint>) -> Result<()>,
) -> Result<()> {
    let file = File::open(path)
        .map_err(IoError::on("read"))
        .in_file(path)?;
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .trim(csv::Trim::All)
        // Ends of lines of two characters would be counted one record late.
        .terminator(csv::Terminator::Any(b'\n'))
        .from_reader(file);
    let mut record = StringRecord::new();
    let mut known = Known::Unread(columns);
    let mut rows = Rows::default();
    // Only the row after it shows whether a row is the last one.
    let mut pending = None;
    while reader
        .read_record(&mut record)
        .map_err(|error| ShotTableError::Table(error.to_string()))
        .in_file(path)?
    {
        let is_blank = record.len() == 1 && record[0].is_empty();
        if is_blank || known.is_heading(&record).in_file(path)? {
            continue;
        }
        let line = record.position().map_or(0, csv::Position::line);
        // Longer tables are not shot tables.
        let line = u32::try_from(line).unwrap_or(u32::MAX);
        let row = known
            .shot(&record, line, body, utc)
            .map_err(|text| RowComplaint { line, text });
        if let Some(row) = pending.replace(row) {
            take(rows.count(row))?;
        }
    }
    if let Some(row) = pending {
        let is_cut = *columns == TableColumns::OdePedr && ode_pedr::ends_within_a_row(path)?;
        let cut = |row: ShotRow| {
            let text = "the file ends within this row; expected the end of the line".to_owned();
            let line = row.line;
            if is_cut {
                Err(RowComplaint { line, text })
            } else {
                Ok(row)
            }
        };
        take(rows.count(row.and_then(cut)))?;
    }
    match known {
        // The heading alone is the table of a box without shots.
        Known::OdePedr if rows.all == 0 => Ok(()),
        _ => rows.end().in_file(path),
    }
}

/// The rows of a table so far.
#[derive(Debug, Default)]
struct Rows {
    all: u64,
    good: u64,
    first: Option<RowComplaint>,
}

impl Rows {
    fn count(
        &mut self,
        row: std::result::Result<ShotRow, RowComplaint>,
    ) -> std::result::Result<ShotRow, RowComplaint> {
        self.all += 1;
        match &row {
            Ok(_) => self.good += 1,
            Err(complaint) if self.first.is_none() => self.first = Some(complaint.clone()),
            Err(_) => {}
        }
        row
    }

    fn end(self) -> std::result::Result<(), ShotTableError> {
        match self.first {
            Some(first) if self.good == 0 => Err(ShotTableError::Unreadable {
                rows: self.all,
                first,
            }),
            _ if self.all == 0 => Err(ShotTableError::Empty),
            _ => Ok(()),
        }
    }
}

/// The columns of a table, from its first row on.
#[expect(clippy::large_enum_variant, reason = "one for each table")]
enum Known<'a> {
    Unread(&'a TableColumns),
    Assigned(Fields),
    OdePedr,
}

impl Known<'_> {
    /// Whether the row is the heading; the first row determines the places of the columns.
    fn is_heading(&mut self, record: &StringRecord) -> std::result::Result<bool, ShotTableError> {
        let Self::Unread(columns) = self else {
            return Ok(false);
        };
        match columns {
            TableColumns::OdePedr => {
                ode_pedr::check_heading(record)?;
                *self = Self::OdePedr;
                Ok(true)
            }
            TableColumns::Assigned(columns) => {
                let (fields, names) = Fields::of(columns, record)?;
                let is_heading = names || is_header(&fields, record);
                *self = Self::Assigned(fields);
                Ok(is_heading)
            }
        }
    }

    fn shot(
        &self,
        record: &StringRecord,
        line: u32,
        body: Body,
        utc: Option<Utc<'_>>,
    ) -> std::result::Result<ShotRow, String> {
        match self {
            Self::Assigned(fields) => shot(fields, record, line, body, utc),
            Self::Unread(_) | Self::OdePedr => ode_pedr::shot(record, line, body, utc),
        }
    }
}

/// The shot of a row, or its fault.
fn shot(
    fields: &Fields,
    record: &StringRecord,
    line: u32,
    body: Body,
    utc: Option<Utc<'_>>,
) -> std::result::Result<ShotRow, String> {
    let model = body.model();
    let radii = [1.0 - RELIEF, 1.0 + RELIEF].map(|share| share * model.equatorial_radius_m);
    let latitude_rad = fields.latitude.number(record)?;
    let mut row = ShotRow {
        line,
        et_s: fields.time.et_s(record, ET_S, utc)?,
        longitude_rad: fields.longitude.number(record)?,
        latitude_rad,
        radius_m: fields.radius.radius_m(record, model, latitude_rad, radii)?,
        range_m: fields
            .range
            .within(record, [f64::MIN_POSITIVE, RANGE_MAX_M])?,
        spacecraft: None,
        orbit: 0,
        areoid_radius_m: None,
        channel: 1,
        class: GROUND,
        attitude_flag: 0,
    };
    let spacecraft = [
        fields.spacecraft_longitude.number(record)?,
        fields.spacecraft_latitude.number(record)?,
        fields
            .spacecraft_radius
            .within(record, [radii[0], radii[1] + RANGE_MAX_M])?,
    ];
    row.orbit = fields.orbit(record)?;
    row.spacecraft = Some(spacecraft);
    agrees(&row, spacecraft)?;
    Ok(row)
}

/// Checks that the range is about the distance of spacecraft and footprint.
fn agrees(
    row: &ShotRow,
    [longitude_rad, latitude_rad, radius_m]: [f64; 3],
) -> std::result::Result<(), String> {
    let ground_m = spherical_to_xyz_m(row.longitude_rad, row.latitude_rad, row.radius_m);
    let spacecraft_m = spherical_to_xyz_m(longitude_rad, latitude_rad, radius_m);
    let distance_m = (spacecraft_m - ground_m).norm();
    let limit_m = RANGE_SHARE * row.range_m + RANGE_BESIDE_M;
    // Written so that NaN is rejected too.
    if (distance_m - row.range_m).abs() <= limit_m {
        return Ok(());
    }
    Err(format!(
        "the range is {:.0} m; expected the distance between spacecraft and footprint, {distance_m:.0} m, within {limit_m:.0} m",
        row.range_m
    ))
}

#[cfg(test)]
mod tests;
