//! Products of a triangulated net: tables as Parquet and CSV, points for GIS, a document, the report.

mod controls;
mod deviations;
mod document;
mod mosaic;
mod pictures;
mod points;

use std::{borrow::Cow, path::Path};

use schemars::JsonSchema;
use serde::Serialize;

use super::{
    files::{write_json, write_text},
    parquet,
    product::{Content, Declaration, Group, Product, Role, described, write_each},
    table::{Meaning, Table},
    text_table,
};
use areograph_base::{error::Result, schema::DocumentSchema};
use areograph_config::NetConfig;
use areograph_stages::{map_pictures::PicturesOnMap, triangulate::Triangulation};

/// Inputs of the products of a net.
#[derive(Debug, Clone, Copy)]
pub struct NetProducts<'a> {
    /// The configuration.
    pub config: &'a NetConfig,
    /// The triangulated net.
    pub result: &'a Triangulation,
    /// Its pictures on the map; `None` without an image.
    pub mosaic: Option<&'a PicturesOnMap>,
    /// The report.
    pub page: &'a str,
}

/// Writer of a product of a net; returns its number of rows.
pub(super) type WriteNet = fn(&Path, &NetProducts) -> Result<u64>;

/// The products of a net, in the order in which they are written.
static PRODUCTS: &[&Declaration<WriteNet>] = &[
    &points::TABLE,
    &points::CSV,
    &points::GEOJSON,
    &points::GEOPACKAGE,
    &pictures::TABLE,
    &pictures::CSV,
    &deviations::TABLE,
    &deviations::CSV,
    &controls::TABLE,
    &controls::CSV,
    &COLUMNS,
    &document::DOCUMENT,
    &REPORT,
];

/// The products of a net with images.
static OF_IMAGES: &[&Declaration<WriteNet>] =
    &[&mosaic::MOSAIC, &mosaic::SOURCES, &mosaic::DOCUMENT];

static REPORT: Declaration<WriteNet> = Declaration::report("the report of the net", |path, of| {
    write_text(path, of.page).map(|()| 0)
});

/// The products in the documentation.
pub(super) fn group() -> Group {
    Group {
        heading: "Nets of rectified pictures",
        source: "`areograph triangulate`, in the folder of the net",
        prefix: "net",
        placeholders: "",
        products: [described(PRODUCTS), described(OF_IMAGES)].concat(),
    }
}

static COLUMNS: Declaration<WriteNet> = Declaration {
    path: "columns.json",
    what: "units and descriptions of the columns of all CSV files",
    readers: "scripts",
    rows: "",
    role: Role::Metadata,
    content: Content::Document(columns_schema),
    write: |path, _| write_json(path, &ColumnsDocument::new()).map(|()| 0),
    uses: &[],
};

/// Writes every product of a net below `directory`, and reads each of them back.
///
/// # Errors
/// [`Kind::Io`](areograph_base::error::Kind::Io) for errors of the disk; [`Kind::Bug`](areograph_base::error::Kind::Bug) for numbers that
/// are not finite and files that read back differently.
pub fn write_net_products(directory: &Path, net: &NetProducts) -> Result<Vec<Product>> {
    let write = |declarations| {
        write_each(directory, declarations, |write: &WriteNet, path| {
            write(path, net)
        })
    };
    let mut products = write(PRODUCTS)?;
    if net.mosaic.is_some() {
        products.extend(write(OF_IMAGES)?);
    }
    Ok(products)
}

/// Writes a table as Parquet with its metadata.
fn write_parquet(path: &Path, net: &NetProducts, table: &Table) -> Result<u64> {
    parquet::write(path, table, vec![("net", net.config.net.clone())])
}

/// The columns of every CSV file.
#[derive(Serialize, JsonSchema)]
#[schemars(title = "Columns of the tables of a net")]
struct ColumnsDocument {
    /// Always `areograph net columns 1`.
    #[schemars(extend("const" = "areograph net columns 1"))]
    format: &'static str,
    /// The tables.
    #[schemars(length(min = 1))]
    tables: Vec<TableColumns>,
}

/// A table.
#[derive(Serialize, JsonSchema)]
struct TableColumns {
    /// The file.
    file: &'static str,
    /// Meaning of a row.
    rows: &'static str,
    /// Its columns in order.
    columns: Vec<ColumnOfTable>,
}

/// A column.
#[derive(Serialize, JsonSchema)]
struct ColumnOfTable {
    /// Its name.
    name: &'static str,
    /// Unit of the column; absent for a column without a unit.
    #[serde(skip_serializing_if = "Option::is_none")]
    unit: Option<&'static str>,
    /// Meaning of its values.
    meaning: Cow<'static, str>,
    /// Whether rows may lack a value.
    optional: bool,
}

impl ColumnsDocument {
    fn new() -> Self {
        let tables = PRODUCTS
            .iter()
            .filter(|product| product.media_type() == Some("text/csv"));
        let tables = tables.filter_map(|product| match product.content {
            Content::Table(columns) => Some(TableColumns {
                file: product.path,
                rows: product.rows,
                columns: columns().iter().map(ColumnOfTable::of).collect(),
            }),
            _ => None,
        });
        Self {
            format: "areograph net columns 1",
            tables: tables.collect(),
        }
    }
}

impl ColumnOfTable {
    fn of(column: &Meaning) -> Self {
        Self {
            name: column.name,
            unit: column.unit.symbol(),
            meaning: column.description.clone(),
            optional: column.optional,
        }
    }
}

fn columns_schema() -> DocumentSchema {
    DocumentSchema::of::<ColumnsDocument>("net_columns")
}

/// Writes a table as CSV.
fn write_csv(path: &Path, table: Table) -> Result<u64> {
    text_table::write(path, table)
}
