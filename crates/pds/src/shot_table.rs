//! Tables of laser shots: comma-separated text with one shot per row, whose columns are configured.

mod columns;

use std::{fs::File, path::Path};

use csv::StringRecord;

pub use self::columns::ShotColumns;
use self::columns::{Fields, is_header};
use areograph_base::{
    body::Body,
    error::{Cause, IoError, Locate, Result},
    time::Et,
};
use areograph_geom::ellipsoid::spherical_to_xyz_m;

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
    /// East longitude, radians, latitude, radians, and distance from the centre, metres, of the spacecraft.
    pub spacecraft: [f64; 3],
    /// Orbit number, 0 where the table has none.
    pub orbit: u32,
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
    #[error("no column is called \"{name}\" (shots.columns.{key}); the first row has {}", found.join(", "))]
    #[cause("write the name of the column as in the table, or its number, from 1")]
    Column {
        key: &'static str,
        name: String,
        found: Vec<String>,
    },
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
/// A first row without a number in the configured columns is a header.
///
/// * `body` – the body of the footprints
/// * `utc` – the instant of a time in UTC
///
/// # Errors
/// The file cannot be read; a missing column; a table without a valid shot; errors of `take`.
pub fn read_shot_table(
    path: &Path,
    columns: &ShotColumns,
    body: Body,
    utc: &dyn Fn(&str) -> Result<Et>,
    mut take: impl FnMut(std::result::Result<ShotRow, RowComplaint>) -> Result<()>,
) -> Result<()> {
    let file = File::open(path)
        .map_err(IoError::on("read"))
        .in_file(path)?;
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .trim(csv::Trim::All)
        .from_reader(file);
    let mut record = StringRecord::new();
    let (mut fields, mut rows, mut good) = (None, 0_u64, 0_u64);
    let mut first = None;
    loop {
        let more = reader.read_record(&mut record);
        match more.map_err(|error| ShotTableError::Table(error.to_string())) {
            Ok(true) => {}
            Ok(false) => break,
            Err(error) => return Err(error).in_file(path),
        }
        let known = if let Some(fields) = &fields {
            fields
        } else {
            let (found, names) = Fields::of(columns, &record).in_file(path)?;
            let header = names || is_header(&found, &record);
            let found = fields.insert(found);
            if header {
                continue;
            }
            found
        };
        rows += 1;
        let line = record.position().map_or(0, csv::Position::line);
        // Longer tables are not shot tables.
        let line = u32::try_from(line).unwrap_or(u32::MAX);
        let row = shot(known, &record, line, body, utc).map_err(|text| RowComplaint { line, text });
        match &row {
            Ok(_) => good += 1,
            Err(complaint) if first.is_none() => first = Some(complaint.clone()),
            Err(_) => {}
        }
        take(row)?;
    }
    match first {
        Some(first) if good == 0 => Err(ShotTableError::Unreadable { rows, first }).in_file(path),
        _ if rows == 0 => Err(ShotTableError::Empty).in_file(path),
        _ => Ok(()),
    }
}

/// The shot of a row, or its fault.
fn shot(
    fields: &Fields,
    record: &StringRecord,
    line: u32,
    body: Body,
    utc: &dyn Fn(&str) -> Result<Et>,
) -> std::result::Result<ShotRow, String> {
    let model = body.model();
    let radii = [1.0 - RELIEF, 1.0 + RELIEF].map(|share| share * model.equatorial_radius_m);
    let latitude_rad = fields.latitude.number(record)?;
    let row = ShotRow {
        line,
        et_s: fields.time.et_s(record, ET_S, utc)?,
        longitude_rad: fields.longitude.number(record)?,
        latitude_rad,
        radius_m: fields.radius.radius_m(record, model, latitude_rad, radii)?,
        range_m: fields
            .range
            .within(record, [f64::MIN_POSITIVE, RANGE_MAX_M])?,
        spacecraft: [
            fields.spacecraft_longitude.number(record)?,
            fields.spacecraft_latitude.number(record)?,
            fields
                .spacecraft_radius
                .within(record, [radii[0], radii[1] + RANGE_MAX_M])?,
        ],
        orbit: fields.orbit(record)?,
    };
    agrees(&row)?;
    Ok(row)
}

/// Checks that the range is about the distance of spacecraft and footprint.
fn agrees(row: &ShotRow) -> std::result::Result<(), String> {
    let ground_m = spherical_to_xyz_m(row.longitude_rad, row.latitude_rad, row.radius_m);
    let [longitude_rad, latitude_rad, radius_m] = row.spacecraft;
    let spacecraft_m = spherical_to_xyz_m(longitude_rad, latitude_rad, radius_m);
    let distance_m = (spacecraft_m - ground_m).norm();
    let limit_m = RANGE_SHARE * row.range_m + RANGE_BESIDE_M;
    // Written so that NaN is rejected too.
    if (distance_m - row.range_m).abs() <= limit_m {
        return Ok(());
    }
    Err(format!(
        "the range is {:.0} m; expected the distance of spacecraft and footprint, {distance_m:.0} m, within {limit_m:.0} m",
        row.range_m
    ))
}

#[cfg(test)]
mod tests;
