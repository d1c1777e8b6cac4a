//! Profiles of the archive, one per row.

use super::{ArchiveProducts, WriteArchive};
use crate::{
    parquet,
    product::{Content, Declaration, Role},
    table::{Column, Table, Unit, column, meanings},
    text_table,
};
use areograph_base::units::RADIANS_PER_DEGREE;
use areograph_stages::check_archive::ArchiveProfile;

pub(super) static TABLE: Declaration<WriteArchive> = Declaration {
    path: "profiles.parquet",
    what: "statistics of range minus distance, one row per profile (the shots of one file in one revolution)",
    readers: "scripts",
    rows: "profiles",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: |path, of| {
        let archive = ("archive", of.ranges.files.len().to_string() + " files");
        parquet::write(path, &table(of), vec![archive])
    },
    uses: &[],
};

pub(super) static CSV: Declaration<WriteArchive> = Declaration {
    path: "profiles.csv",
    what: "statistics of range minus distance per profile, as CSV",
    readers: "spreadsheets, scripts",
    rows: "profiles",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: |path, of| text_table::write(path, table(of)),
    uses: &[],
};

fn table<'a>(of: &ArchiveProducts<'a>) -> Table<'a> {
    Table::new(columns(), of.ranges.profiles().collect())
}

/// A figure of a profile that has checked shots.
fn checked<'a>(
    name: &'static str,
    unit: Unit,
    description: &'static str,
    of: impl Fn(&ArchiveProfile) -> f64 + Send + Sync + 'static,
) -> Column<&'a ArchiveProfile> {
    column(name, unit, description, move |row: &&ArchiveProfile| {
        (row.shots > 0).then(|| of(row))
    })
}

fn columns<'a>() -> Vec<Column<&'a ArchiveProfile>> {
    [times(), ranges(), orbits()]
        .into_iter()
        .flatten()
        .collect()
}

fn times<'a>() -> Vec<Column<&'a ArchiveProfile>> {
    type Row<'a> = &'a ArchiveProfile;
    let degrees = |radians: f64| radians / RADIANS_PER_DEGREE;
    vec![
        column(
            "file",
            Unit::None,
            "name of the PEDR file; its path if files in several folders have the same name",
            |row: &Row| row.file.clone(),
        ),
        column(
            "orbit",
            Unit::None,
            "orbit number in the PEDR file",
            |row: &Row| row.orbit,
        ),
        column(
            "part",
            Unit::None,
            "number of the part of the orbit, counted from 1; a new part starts after a pause of more than 300 s",
            |row: &Row| row.part,
        ),
        column(
            "first_record",
            Unit::None,
            "number of the first record with a selected shot, counted from 1, label records included",
            |row: &Row| row.first_record,
        ),
        column(
            "last_record",
            Unit::None,
            "number of the last record with a selected shot, counted from 1, label records included",
            |row: &Row| row.last_record,
        ),
        column(
            "start_et_s",
            Unit::Second,
            "corrected time of the first shot, TDB seconds past J2000",
            |row: &Row| row.start_et_s,
        ),
        column(
            "stop_et_s",
            Unit::Second,
            "corrected time of the last shot, TDB seconds past J2000",
            |row: &Row| row.stop_et_s,
        ),
        column(
            "shots",
            Unit::None,
            "shots that were checked",
            |row: &Row| row.shots,
        ),
        column(
            "not_covered",
            Unit::None,
            "shots that were not checked, because the kernels contain no position",
            |row: &Row| row.not_covered,
        ),
        column(
            "off_nadir_mean_deg",
            Unit::Degree,
            "mean off-nadir angle of the laser",
            move |row: &Row| degrees(row.off_nadir_rad[0]),
        ),
        column(
            "off_nadir_max_deg",
            Unit::Degree,
            "largest off-nadir angle of the laser",
            move |row: &Row| degrees(row.off_nadir_rad[1]),
        ),
    ]
}

fn ranges<'a>() -> Vec<Column<&'a ArchiveProfile>> {
    type Row<'a> = &'a ArchiveProfile;
    vec![
        checked(
            "mean_m",
            Unit::Metre,
            "mean of range minus distance from the spacecraft (kernels) to the footprint (raw radius); missing where \
             no shot was checked",
            |row| row.range_minus_distance_m.mean,
        ),
        checked(
            "mean_without_outliers_m",
            Unit::Metre,
            "mean of range minus distance without outliers, which is compared with the limit",
            |row| row.mean_without_outliers_m,
        ),
        checked(
            "standard_deviation_m",
            Unit::Metre,
            "standard deviation of range minus distance",
            |row| row.range_minus_distance_m.standard_deviation,
        ),
        checked(
            "median_m",
            Unit::Metre,
            "median of range minus distance",
            |row| row.range_minus_distance_m.median,
        ),
        checked(
            "nmad_m",
            Unit::Metre,
            "normalised median absolute deviation of range minus distance",
            |row| row.range_minus_distance_m.nmad,
        ),
        checked(
            "min_m",
            Unit::Metre,
            "smallest range minus distance",
            |row| row.range_minus_distance_m.min,
        ),
        checked(
            "max_m",
            Unit::Metre,
            "largest range minus distance",
            |row| row.range_minus_distance_m.max,
        ),
        column(
            "outliers",
            Unit::None,
            "shots more than 5 NMAD (and more than 0.05 m) from the median",
            |row: &Row| row.outliers,
        ),
        checked(
            "crossover_mean_m",
            Unit::Metre,
            "mean of range minus distance from the spacecraft (kernels) to the footprint (crossover-corrected radius)",
            |row| row.crossover_mean_m,
        ),
        checked(
            "decoding_mean_m",
            Unit::Metre,
            "mean of range minus distance from the spacecraft (PEDR file) to the footprint (raw radius)",
            |row| row.decoding_mean_m,
        ),
        checked(
            "decoding_without_outliers_m",
            Unit::Metre,
            "decoding_mean_m without outliers, which is compared with the limit",
            |row| row.decoding_without_outliers_m,
        ),
    ]
}

fn orbits<'a>() -> Vec<Column<&'a ArchiveProfile>> {
    type Row<'a> = &'a ArchiveProfile;
    vec![
        checked(
            "spacecraft_radial_m",
            Unit::Metre,
            "mean difference of spacecraft positions, PEDR file minus kernels, away from Mars",
            |row| row.spacecraft_m[0],
        ),
        checked(
            "spacecraft_along_m",
            Unit::Metre,
            "mean difference of spacecraft positions, PEDR file minus kernels, along the flight",
            |row| row.spacecraft_m[1],
        ),
        checked(
            "spacecraft_cross_m",
            Unit::Metre,
            "mean difference of spacecraft positions, PEDR file minus kernels, along the orbital angular momentum",
            |row| row.spacecraft_m[2],
        ),
        column(
            "best_correction_s",
            Unit::Second,
            "correction of time tags that minimises the spread of range minus distance; missing if the spread has no minimum",
            |row: &Row| row.best_correction_s,
        ),
        column(
            "best_correction_sigma_s",
            Unit::Second,
            "standard uncertainty of best_correction_s",
            |row: &Row| row.correction_uncertainty_s,
        ),
        column(
            "best_correction_radius",
            Unit::None,
            "footprint radius used for best_correction_s: crossover (corrected radius, used if it reduces the least \
             spread by more than 2 %) or raw",
            |row: &Row| {
                let word = row.best_correction_s.map(|_| row.correction_radius.word());
                word.unwrap_or_default().to_owned()
            },
        ),
        column(
            "share_of_limits",
            Unit::None,
            "largest ratio of a checked value to its limit; above 1 if a limit is exceeded; missing if too few shots \
             were checked",
            |row: &Row| row.share_of_limits,
        ),
        column(
            "invalid_because",
            Unit::None,
            "exceeded limits, in words; empty if no limit is exceeded",
            |row: &Row| row.invalid_because.join("; "),
        ),
    ]
}
