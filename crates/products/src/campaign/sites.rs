//! Sites of a campaign.

use super::{WriteCampaign, phase_column, write_csv, write_parts};
use crate::{
    product::{Content, Declaration, Role},
    table::{Column, Unit, column, meanings},
};
use areograph_base::units::RADIANS_PER_DEGREE;
use areograph_stages::pool_sites::SiteRow;

pub(super) static TABLE: Declaration<WriteCampaign> = Declaration {
    path: "sites/phase=<phase>/part-0.parquet",
    what: "verdict, counts and inputs of every site, by the mission phase of its first image",
    readers: "scripts, DuckDB, Polars, `areograph pedr sql`",
    rows: "sites",
    role: Role::Data,
    content: Content::Table(|| meanings(&columns())),
    write: |folder, of| write_parts(folder, "sites", columns, &of.rows.sites, |row| &row.phase),
    uses: &[],
};

pub(super) static CSV: Declaration<WriteCampaign> = Declaration {
    path: "sites.csv",
    what: "the sites as CSV, with their phases",
    readers: "spreadsheets, scripts",
    rows: "sites",
    role: Role::Data,
    content: Content::Foreign,
    write: |folder, of| write_csv(folder, CSV.path, columns(), &of.rows.sites),
    uses: &[],
};

fn columns<'a>() -> Vec<Column<&'a SiteRow>> {
    [outcome(), counts(), inputs()]
        .into_iter()
        .flatten()
        .collect()
}

fn outcome<'a>() -> Vec<Column<&'a SiteRow>> {
    type Row<'a> = &'a SiteRow;
    vec![
        phase_column(|row: &SiteRow| &row.phase),
        column("site", Unit::None, "identifier of the site", |row: &Row| {
            row.site.clone()
        }),
        column(
            "state",
            Unit::None,
            "published; failed (last run), absent (no run has finished) or unusable (damaged, or of a different version)",
            |row: &Row| row.state.word().to_owned(),
        ),
        column(
            "verdict",
            Unit::None,
            "verdict in words; empty unless published",
            |row: &Row| row.verdict.to_owned(),
        ),
        column(
            "is_valid",
            Unit::None,
            "whether the site is published and valid, with or without remarks: only such sites are pooled",
            |row: &Row| row.is_valid,
        ),
        column(
            "reasons",
            Unit::None,
            "exceeded limits, in words; empty if no limit is exceeded",
            |row: &Row| row.reasons.join("; "),
        ),
        column(
            "remarks",
            Unit::None,
            "remarks of the verdict",
            |row: &Row| row.remarks.join("; "),
        ),
        column(
            "failure",
            Unit::None,
            "why the site has no usable products; empty if it has",
            |row: &Row| row.failure.clone(),
        ),
    ]
}

fn counts<'a>() -> Vec<Column<&'a SiteRow>> {
    type Row<'a> = &'a SiteRow;
    let degrees = |radians: f64| radians / RADIANS_PER_DEGREE;
    vec![
        column("body", Unit::None, "the body", |row: &Row| {
            row.body.to_string()
        }),
        column(
            "longitude_deg",
            Unit::Degree,
            "east longitude of the middle of the first image, or of the first window",
            move |row: &Row| row.place_rad.map(|of| degrees(of[0])),
        ),
        column(
            "latitude_deg",
            Unit::Degree,
            "areocentric latitude of the same place",
            move |row: &Row| row.place_rad.map(|of| degrees(of[1])),
        ),
        column("images", Unit::None, "images", |row: &Row| row.images),
        column(
            "pairs",
            Unit::None,
            "pairs of images with common tie points",
            |row: &Row| row.pairs,
        ),
        column("profiles", Unit::None, "profiles", |row: &Row| row.profiles),
        column("ties", Unit::None, "tie points", |row: &Row| row.ties),
        column("footprints", Unit::None, "footprints", |row: &Row| {
            row.footprints
        }),
    ]
}

fn inputs<'a>() -> Vec<Column<&'a SiteRow>> {
    type Row<'a> = &'a SiteRow;
    vec![
        column(
            "folder",
            Unit::None,
            "folder of the products, from the folder of the campaign",
            |row: &Row| format!("../{}", row.site),
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
        column(
            "configuration_blake3",
            Unit::None,
            "BLAKE3 of the keys and values of the configuration",
            |row: &Row| row.configuration_blake3.clone(),
        ),
        column(
            "fingerprint",
            Unit::None,
            "fingerprint of all inputs of the products",
            |row: &Row| row.fingerprint.clone(),
        ),
        column(
            "version",
            Unit::None,
            "version of areograph that wrote the products; empty without products",
            |row: &Row| row.version.clone(),
        ),
    ]
}
