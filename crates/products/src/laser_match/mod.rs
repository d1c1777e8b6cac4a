//! Products of matching laser profiles with a terrain model: units, control points, elevation curves, the table
//! that calibrations read, the report.

pub(super) mod control;
pub(super) mod curves;
mod points;
pub(super) mod score_maps;
pub(super) mod units;

use std::path::Path;

use super::{
    files::write_text,
    parquet,
    product::{Declaration, Group, Product, described, write_each},
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
static PRODUCTS: &[&Declaration<WriteMatch>] = &[
    &units::TABLE,
    &units::CSV,
    &points::TABLE,
    &points::CSV,
    &curves::TABLE,
    &score_maps::TABLE,
    &REPORT,
];

static REPORT: Declaration<WriteMatch> =
    Declaration::report("the report of the match", |path, of| {
        write_text(path, of.page).map(|()| 0)
    });

/// The products in the documentation.
pub(super) fn group() -> Group {
    Group {
        heading: "Laser control points from terrain models",
        source: "`areograph pedr match`, in the folder `--out`",
        prefix: "match",
        placeholders: "",
        products: [described(&[&control::CONTROL]), described(PRODUCTS)].concat(),
    }
}

/// Writes every product of a match below `directory`, and reads each of them back.
///
/// # Errors
/// [`Kind::Io`](areograph_base::error::Kind::Io) for errors of the disk; [`Kind::Bug`](areograph_base::error::Kind::Bug) for numbers that
/// are not finite and files that read back differently.
pub fn write_match_products(directory: &Path, of: &MatchProducts) -> Result<Vec<Product>> {
    let write = |write: &WriteMatch, path: &Path| write(path, of);
    let mut products = write_each(directory, PRODUCTS, write)?;
    if !of.result.images.is_empty() {
        products.extend(write_each(directory, &[&control::CONTROL], write)?);
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
