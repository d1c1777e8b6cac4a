//! Shots of one profile with their residuals.

use std::path::Path;

use crate::{
    parquet,
    product::{Content, Declaration, Product, Role},
    table::{Column, Table, Unit, column, meanings},
};
use areograph_base::{
    error::{Locate as _, Result},
    units::RADIANS_PER_DEGREE,
};
use areograph_stages::check_archive::{ArchiveProfile, CheckedFile, CheckedShot};
use areograph_store::files::file_name;

/// Placeholder of a profile in the path.
const PROFILE: &str = "<profile>";

/// Writer of the shots of a profile; returns their number of rows.
type WriteShots = fn(&Path, &ArchiveProfile, &[CheckedShot]) -> Result<u64>;

pub(super) static SHOTS: Declaration<WriteShots> = Declaration {
    path: "shots/<profile>.parquet",
    what: "every selected shot of a profile with its residuals; one file for each of the worst profiles",
    readers: "scripts",
    rows: "shots",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: |path, profile, shots| {
        let table = Table::new(columns(), shots.to_vec());
        parquet::write(path, &table, vec![("profile", profile.id())])
    },
    uses: &[],
};

/// Digits of the hash of a path that distinguish files of the same name.
const HASH_DIGITS: usize = 8;

/// The name of a profile as part of a file name.
#[must_use]
pub fn profile_name(file: &CheckedFile, profile: &ArchiveProfile) -> String {
    let own = file_name(&file.path);
    let mut name = profile.id_in(&own).replace(['/', '.'], "_");
    if file.found.file != own {
        let hash = blake3::hash(file.path.as_os_str().as_encoded_bytes());
        name.push('_');
        name.extend(hash.to_hex().chars().take(HASH_DIGITS));
    }
    name
}

/// Writes the shots of a profile below `directory`, and reads them back.
///
/// # Errors
/// Errors of the disk; numbers that are not finite; a file that reads back differently.
pub fn write_profile_shots(
    directory: &Path,
    file: &CheckedFile,
    profile: &ArchiveProfile,
    shots: &[CheckedShot],
) -> Result<Product> {
    let relative = SHOTS.path.replace(PROFILE, &profile_name(file, profile));
    let path = directory.join(&relative);
    let rows = (SHOTS.write)(&path, profile, shots).in_file(&path)?;
    Ok(Product {
        path: relative.into(),
        rows,
    })
}

fn columns() -> Vec<Column<CheckedShot>> {
    type Row = CheckedShot;
    let degrees = |radians: f64| radians / RADIANS_PER_DEGREE;
    vec![
        column(
            "record",
            Unit::None,
            "number of the record in the file, counted from 1, label records included",
            |row: &Row| row.record,
        ),
        column(
            "shot",
            Unit::None,
            "number of the shot in its PEDR frame, 1 to 20",
            |row: &Row| u32::from(row.shot),
        ),
        column(
            "et_tag_s",
            Unit::Second,
            "time tag, TDB seconds past J2000",
            |row: &Row| row.et_tag_s,
        ),
        column(
            "et_s",
            Unit::Second,
            "corrected time, TDB seconds past J2000",
            |row: &Row| row.et_s,
        ),
        column(
            "longitude_deg",
            Unit::Degree,
            "east longitude, IAU 2000",
            move |row: &Row| degrees(row.place_rad[0]),
        ),
        column(
            "latitude_deg",
            Unit::Degree,
            "areocentric latitude, IAU 2000",
            move |row: &Row| degrees(row.place_rad[1]),
        ),
        column(
            "off_nadir_deg",
            Unit::Degree,
            "off-nadir angle of the laser",
            move |row: &Row| degrees(row.off_nadir_rad),
        ),
        column(
            "range_minus_distance_m",
            Unit::Metre,
            "range minus distance from the spacecraft (kernels) to the footprint (raw radius); missing where the \
             kernels contain no position",
            |row: &Row| Some(row.residuals?.range_minus_distance_m),
        ),
        column(
            "range_minus_distance_crossover_m",
            Unit::Metre,
            "range minus distance from the spacecraft (kernels) to the footprint (crossover-corrected radius); \
             missing where the kernels contain no position",
            |row: &Row| Some(row.residuals?.range_minus_distance_crossover_m),
        ),
        column(
            "decoding_m",
            Unit::Metre,
            "range minus distance from the spacecraft (PEDR file) to the footprint (raw radius)",
            |row: &Row| Some(row.residuals?.decoding_m),
        ),
        column(
            "spacecraft_radial_m",
            Unit::Metre,
            "difference of spacecraft positions, PEDR file minus kernels, away from Mars",
            |row: &Row| Some(row.residuals?.spacecraft_m.x),
        ),
        column(
            "spacecraft_along_m",
            Unit::Metre,
            "difference of spacecraft positions, PEDR file minus kernels, along the flight",
            |row: &Row| Some(row.residuals?.spacecraft_m.y),
        ),
        column(
            "spacecraft_cross_m",
            Unit::Metre,
            "difference of spacecraft positions, PEDR file minus kernels, along the orbital angular momentum",
            |row: &Row| Some(row.residuals?.spacecraft_m.z),
        ),
    ]
}
