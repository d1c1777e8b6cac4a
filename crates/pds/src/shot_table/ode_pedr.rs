//! Tables of the MOLA PEDR query of the Orbital Data Explorer (ODE): ten columns below one of two headings, padded with
//! blanks, with a range and without the position of the spacecraft.
//!
//! `planet_rad` is corrected by crossovers, `topography` is `planet_rad` minus the radius of the areoid, and `A` is the
//! attitude flag of the PEDR, plus 4 for returns of class 0, as `pedr2tab` writes it.

use std::{
    fs::File,
    io::{BufRead as _, BufReader, Read as _, Seek as _, SeekFrom},
    path::Path,
};

use csv::StringRecord;

use super::{
    ET_S, RELIEF, ShotRow, ShotTableError, Utc,
    columns::{Field, LATITUDE_DEG, LONGITUDE_DEG},
};
use areograph_base::{
    body::Body,
    error::{IoError, Locate as _, Result},
    units::RADIANS_PER_DEGREE,
};
use areograph_geom::ellipsoid::{on_ellipsoid_m, spherical_to_xyz_m};

/// Columns, by their names in the two headings of the service.
const COLUMNS: [[&str; 2]; 10] = [
    ["long_East", "LONG_EAST"],
    ["lat_North", "LAT_NORTH"],
    ["topography", "TOPOGRAPHY"],
    ["MOLArange", "MOLA_RANGE"],
    ["planet_rad", "PLANET_RAD"],
    ["c", "C"],
    ["A", "A"],
    ["Ephermis Time", "EMPHEMERIS_TIME"],
    ["UTC", "UTC"],
    ["Orbit", "ORBIT"],
];
/// The column of time, and its name where the service spells it correctly.
const TIME: usize = 7;
const TIME_SPELLED: &str = "ephemeristime";

/// Longest range, metres: the window of MOLA's receiver ends at 787 km.
const RANGE_MAX_M: f64 = 800_000.0;
/// Largest distance of the areoid from the ellipsoid, metres: it rises 2 km above it at Tharsis.
const AREOID_M: f64 = 5_000.0;
/// Largest difference of time and UTC, seconds: UTC is written in milliseconds.
const TIMES_AGREE_S: f64 = 0.002;
/// `A` of a return of class 0 is larger by this.
const NO_GROUND: u16 = 4;
const FLAG_MAX: f64 = 7.0;
const CHANNEL_MAX: f64 = 255.0;
const ORBIT_MAX: f64 = 99_999.0;

/// Longest row, bytes: the service writes 107.
const ROW_MAX: u64 = 1_024;

/// Letters and digits of a name, in lower case.
fn bare(name: &str) -> String {
    let kept = name.chars().filter(char::is_ascii_alphanumeric);
    kept.map(|letter| letter.to_ascii_lowercase()).collect()
}

/// The first heading of the service, as a line.
#[must_use]
pub fn ode_pedr_heading() -> String {
    let names = COLUMNS.map(|[name, _]| name);
    format!("{}\r\n", names.join(","))
}

/// Checks that a first row is one of the headings of the service.
pub(super) fn check_heading(record: &StringRecord) -> std::result::Result<(), ShotTableError> {
    for (at, names) in COLUMNS.iter().enumerate() {
        let found = record.get(at).unwrap_or_default();
        let written = bare(found);
        let is_known = names.iter().any(|name| bare(name) == written);
        if !is_known && (at != TIME || written != TIME_SPELLED) {
            return Err(ShotTableError::Heading {
                column: at + 1,
                found: found.to_owned(),
                expected: names,
            });
        }
    }
    if record.len() == COLUMNS.len() {
        Ok(())
    } else {
        Err(ShotTableError::HeadingWidth {
            found: record.len(),
            expected: COLUMNS.len(),
        })
    }
}

/// Whether the file is such a table, by its first row.
///
/// # Errors
/// The file cannot be read.
pub fn is_ode_pedr(path: &Path) -> Result<bool> {
    let file = File::open(path)
        .map_err(IoError::on("read"))
        .in_file(path)?;
    let mut first = Vec::new();
    BufReader::new(file.take(ROW_MAX))
        .read_until(b'\n', &mut first)
        .map_err(IoError::on("read"))
        .in_file(path)?;
    let text = String::from_utf8_lossy(&first);
    let names: Vec<&str> = text
        .trim_start_matches('\u{feff}')
        .split(',')
        .map(str::trim)
        .collect();
    Ok(check_heading(&StringRecord::from(names)).is_ok())
}

/// Column `at`, its numbers multiplied by `scale`, within `limits` as written.
const fn field(at: usize, scale: f64, limits: [f64; 2]) -> Field {
    Field {
        key: COLUMNS[at][0],
        at,
        scale,
        limits: Some(limits),
    }
}

/// The shot of a row, or its fault.
pub(super) fn shot(
    record: &StringRecord,
    line: u32,
    body: Body,
    utc: Option<Utc<'_>>,
) -> std::result::Result<ShotRow, String> {
    if record.len() != COLUMNS.len() {
        return Err(format!(
            "the row has {} columns; expected {}, as in the heading",
            record.len(),
            COLUMNS.len()
        ));
    }
    let equatorial_m = body.model().equatorial_radius_m;
    let radii_m = [1.0 - RELIEF, 1.0 + RELIEF].map(|share| share * equatorial_m);
    let longitude_rad = field(0, RADIANS_PER_DEGREE, LONGITUDE_DEG).number(record)?;
    let latitude_rad = field(1, RADIANS_PER_DEGREE, LATITUDE_DEG).number(record)?;
    let radius_m = field(4, 1.0, radii_m).number(record)?;
    let topography = field(2, 1.0, radii_m.map(|limit_m| limit_m - equatorial_m));
    let areoid_radius_m = radius_m - topography.number(record)?;
    let direction = spherical_to_xyz_m(longitude_rad, latitude_rad, 1.0);
    let ellipsoid_m = on_ellipsoid_m(body.model(), &direction).norm();
    if (areoid_radius_m - ellipsoid_m).abs() > AREOID_M {
        let [least_m, most_m] =
            [AREOID_M, -AREOID_M].map(|apart_m| radius_m - ellipsoid_m - apart_m);
        let expected = format!(
            "a number from {least_m:.0} to {most_m:.0}: planet_rad minus the areoid radius"
        );
        return Err(topography.refused(topography.text(record)?, &expected));
    }
    let flag = field(6, 1.0, [0.0, FLAG_MAX]).whole::<u16>(record)?;
    Ok(ShotRow {
        line,
        et_s: et_s(record, utc)?,
        longitude_rad,
        latitude_rad,
        radius_m,
        range_m: field(3, 1.0, [f64::MIN_POSITIVE, RANGE_MAX_M]).number(record)?,
        spacecraft: None,
        orbit: field(9, 1.0, [0.0, ORBIT_MAX]).whole(record)?,
        areoid_radius_m: Some(areoid_radius_m),
        channel: field(5, 1.0, [0.0, CHANNEL_MAX]).whole(record)?,
        class: i16::from(flag < NO_GROUND),
        attitude_flag: flag % NO_GROUND,
    })
}

/// The time of a row, ET seconds; compared with its UTC where leap seconds are known.
fn et_s(record: &StringRecord, utc: Option<Utc<'_>>) -> std::result::Result<f64, String> {
    let time = field(TIME, 1.0, ET_S);
    let et_s = time.number(record)?;
    let Some(utc) = utc else {
        return Ok(et_s);
    };
    let written = field(TIME + 1, 1.0, ET_S);
    let by_utc_s = written.instant(record, utc)?.seconds();
    // Written so that NaN is rejected too.
    if (et_s - by_utc_s).abs() <= TIMES_AGREE_S {
        return Ok(et_s);
    }
    let expected = format!(
        "{by_utc_s:.3} s within {:.0} ms, according to the UTC of the row, {}",
        1e3 * TIMES_AGREE_S,
        written.text(record)?
    );
    Err(time.refused(time.text(record)?, &expected))
}

/// Whether a file ends within a row: its last line has no end, and is shorter than the one before.
///
/// # Errors
/// The file cannot be read.
pub(super) fn ends_within_a_row(path: &Path) -> Result<bool> {
    let tail = || -> std::io::Result<Vec<u8>> {
        let mut file = File::open(path)?;
        let length = file.metadata()?.len();
        file.seek(SeekFrom::Start(length.saturating_sub(2 * ROW_MAX)))?;
        let mut tail = Vec::new();
        file.read_to_end(&mut tail)?;
        Ok(tail)
    };
    let tail = tail().map_err(IoError::on("read")).in_file(path)?;
    let mut lines = tail.rsplit(|byte| *byte == b'\n');
    let last = lines.next().unwrap_or_default().trim_ascii_end();
    let before = lines.next().unwrap_or_default().trim_ascii_end();
    Ok(!last.is_empty() && last.len() < before.len())
}
