//! Profiles of a campaign.

use super::{WriteCampaign, phase_column, write_csv, write_parts};
use crate::{
    product::{Content, Declaration, Role},
    table::{Column, Unit, column, meanings},
};
use areograph_base::units::RADIANS_PER_DEGREE;
use areograph_stages::pool_sites::{ProfileRow, RangeStatistics};

pub(super) static TABLE: Declaration<WriteCampaign> = Declaration {
    path: "profiles/phase=<phase>/part-0.parquet",
    what: "range minus distance of every profile (Table 3 of Shan et al. 2005), of all its shots and of those in the simultaneous \
           image, by the mission phase of this image",
    readers: "scripts, DuckDB, Polars, `areograph pedr sql`",
    rows: "profiles",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: |folder, of| {
        write_parts(folder, "profiles", columns, &of.rows.profiles, |row| {
            &row.phase
        })
    },
    uses: &[],
};

pub(super) static CSV: Declaration<WriteCampaign> = Declaration {
    path: "profiles.csv",
    what: "the profiles as CSV, with their phases",
    readers: "spreadsheets, scripts",
    rows: "profiles",
    role: Role::Data,
    content: Content::Foreign,
    write: |folder, of| write_csv(folder, CSV.path, columns(), &of.rows.profiles),
    uses: &[],
};

/// A statistic of a profile with shots.
fn of<'a>(
    name: &'static str,
    description: &'static str,
    ranges: fn(&ProfileRow) -> &RangeStatistics,
    of: fn(&RangeStatistics) -> f64,
) -> Column<&'a ProfileRow> {
    column(name, Unit::Metre, description, move |row: &&ProfileRow| {
        let ranges = ranges(row);
        (ranges.n > 0).then(|| of(ranges))
    })
}

fn columns<'a>() -> Vec<Column<&'a ProfileRow>> {
    [names(), numbers(), outcome()]
        .into_iter()
        .flatten()
        .collect()
}

fn names<'a>() -> Vec<Column<&'a ProfileRow>> {
    type Row<'a> = &'a ProfileRow;
    vec![
        phase_column(|row: &ProfileRow| &row.phase),
        column("site", Unit::None, "identifier of the site", |row: &Row| {
            row.site.clone()
        }),
        column(
            "verdict",
            Unit::None,
            "verdict of the site in words",
            |row: &Row| row.verdict.to_owned(),
        ),
        column(
            "is_valid",
            Unit::None,
            "whether the site is valid: only such rows are pooled",
            |row: &Row| row.is_valid,
        ),
        column(
            "is_repeated",
            Unit::None,
            "whether another row counts for this orbit, of a valid site with a common image: a profile is pooled once",
            |row: &Row| row.is_repeated,
        ),
        column(
            "profile",
            Unit::None,
            "identifier of the profile: window, orbit and crossing",
            |row: &Row| row.profile.clone(),
        ),
        column("orbit", Unit::None, "orbit number", |row: &Row| row.orbit),
        column(
            "image",
            Unit::None,
            "image with the most shots of the profile during its exposure; empty without any",
            |row: &Row| row.image.clone(),
        ),
        column(
            "off_nadir_deg",
            Unit::Degree,
            "median angle of the beam off nadir",
            |row: &Row| row.off_nadir_rad / RADIANS_PER_DEGREE,
        ),
    ]
}

fn numbers<'a>() -> Vec<Column<&'a ProfileRow>> {
    type Row<'a> = &'a ProfileRow;
    let all: fn(&ProfileRow) -> &RangeStatistics = |row| &row.ranges;
    let inside: fn(&ProfileRow) -> &RangeStatistics = |row| &row.in_image;
    let measured = |row: &Row| row.ranges.n > 0;
    vec![
        column(
            "shots",
            Unit::None,
            "shots with a range and a position of the spacecraft",
            |row: &Row| row.ranges.n,
        ),
        of(
            "mean_m",
            "mean of range minus distance from the spacecraft (kernels) to the footprint (raw radius)",
            all,
            |of| of.mean_m,
        ),
        of(
            "deviation_m",
            "standard deviation of range minus distance",
            all,
            |of| of.deviation_m,
        ),
        column(
            "mean_without_outliers_m",
            Unit::Metre,
            "mean of range minus distance without outliers, which is compared with the limit",
            move |row: &Row| measured(row).then_some(row.mean_without_outliers_m),
        ),
        column("outliers", Unit::None, "outliers", |row: &Row| row.outliers),
        column(
            "in_image",
            Unit::None,
            "shots that the simultaneous image shows; 0 without such an image",
            |row: &Row| row.in_image.n,
        ),
        of(
            "in_image_mean_m",
            "mean of range minus distance of these shots",
            inside,
            |of| of.mean_m,
        ),
        of(
            "in_image_deviation_m",
            "standard deviation of range minus distance of these shots",
            inside,
            |of| of.deviation_m,
        ),
        column(
            "spacecraft_radial_m",
            Unit::Metre,
            "mean difference of spacecraft positions, PEDR file minus kernels, away from Mars",
            move |row: &Row| measured(row).then_some(row.spacecraft_m[0]),
        ),
        column(
            "spacecraft_along_m",
            Unit::Metre,
            "the same along the flight",
            move |row: &Row| measured(row).then_some(row.spacecraft_m[1]),
        ),
        column(
            "spacecraft_cross_m",
            Unit::Metre,
            "the same along the orbital angular momentum",
            move |row: &Row| measured(row).then_some(row.spacecraft_m[2]),
        ),
    ]
}

fn outcome<'a>() -> Vec<Column<&'a ProfileRow>> {
    type Row<'a> = &'a ProfileRow;
    vec![
        column(
            "is_judged",
            Unit::None,
            "whether the profile has enough shots for a comparison with the limits",
            |row: &Row| row.is_judged,
        ),
        column(
            "invalid_because",
            Unit::None,
            "exceeded limits of ranges, in words; empty if no limit is exceeded",
            |row: &Row| row.invalid_because.clone(),
        ),
        column(
            "rejected_because",
            Unit::None,
            "why the laser surface does not use the profile; empty if it does",
            |row: &Row| row.rejected_because.clone(),
        ),
        column(
            "kernel_set",
            Unit::None,
            "identifier of the chosen kernel set, or else the names of the SPK files in use",
            |row: &Row| row.kernels.name.clone(),
        ),
        column(
            "kernels_blake3",
            Unit::None,
            "BLAKE3 over role and hash of every kernel in use, in load order",
            |row: &Row| row.kernels.blake3.clone(),
        ),
    ]
}
