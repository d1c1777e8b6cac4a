//! Products of matching laser profiles with a terrain model: units, control points, the table that calibrations read,
//! the report.

mod control;
mod points;
mod units;

use std::path::Path;

use super::{
    files::write_text,
    parquet,
    product::{Content, Declaration, Product, Role, write_each},
    table::Table,
};
use areograph_base::error::Result;
use areograph_stages::match_laser::LaserMatch;

/// Inputs of the products of a match.
#[derive(Debug, Clone, Copy)]
pub struct MatchProducts<'a> {
    /// The match.
    pub result: &'a LaserMatch,
    /// The report.
    pub page: &'a str,
}

/// Writer of a product of a match; returns its number of rows.
pub(super) type WriteMatch = fn(&Path, &MatchProducts) -> Result<u64>;

/// The products of a match, in the order in which they are written.
pub(super) static MATCH_PRODUCTS: &[&Declaration<WriteMatch>] = &[
    &units::TABLE,
    &units::CSV,
    &points::TABLE,
    &points::CSV,
    &REPORT,
];

/// Laser points in images, if there are images.
pub(super) use control::CONTROL;

static REPORT: Declaration<WriteMatch> = Declaration {
    path: "report/index.html",
    what: "the report of the match",
    readers: "people",
    rows: "",
    role: Role::Overview,
    content: Content::Foreign,
    write: |path, of| write_text(path, of.page).map(|()| 0),
    uses: &[],
};

/// Writes every product of a match below `directory`, and reads each of them back.
///
/// # Errors
/// [`Kind::Io`](areograph_base::error::Kind::Io) for errors of the disk; [`Kind::Bug`](areograph_base::error::Kind::Bug) for numbers that
/// are not finite and files that read back differently.
pub fn write_match_products(directory: &Path, of: &MatchProducts) -> Result<Vec<Product>> {
    let write = |write: &WriteMatch, path: &Path| write(path, of);
    let mut products = write_each(directory, MATCH_PRODUCTS, write)?;
    if !of.result.images.is_empty() {
        products.extend(write_each(directory, &[&CONTROL], write)?);
    }
    Ok(products)
}

/// Writes a table as Parquet with its metadata.
fn write_parquet(path: &Path, of: &MatchProducts, table: &Table) -> Result<u64> {
    let similarity = of.result.similarity.word().to_owned();
    let about = vec![
        ("similarity", similarity),
        ("heights_above_m", of.result.radius_m.to_string()),
    ];
    parquet::write(path, table, about)
}

fn natural(count: usize) -> u32 {
    u32::try_from(count).unwrap_or(u32::MAX)
}
