//! Products of a campaign: tables of its sites, images, pairs and profiles, a summary, the page.
//!
//! Parquet tables are divided into folders by mission phase, as Hive and its readers name them: `phase=E02`. Rows of sites
//! without an index entry are in `phase=unknown`. The column of the phase is the name of the folder; CSV files hold it.

mod images;
mod pairs;
mod profiles;
mod read;
mod sites;

use std::{collections::BTreeMap, path::Path};

pub use read::{CampaignTable, is_campaign, read_campaign_tables};

use super::{
    files::{write_json, write_text},
    parquet,
    product::{Content, Declaration, Group, Product, Role, described},
    table::{Column, Table, Unit, column},
    text_table,
};
use areograph_base::{
    error::{Locate as _, Result},
    schema::DocumentSchema,
};
use areograph_stages::pool_sites::{CampaignRows, CampaignSummary, phase_or_unknown};

/// Inputs of the products of a campaign.
#[derive(Debug, Clone, Copy)]
pub struct CampaignProducts<'a> {
    /// The rows.
    pub rows: &'a CampaignRows,
    /// Results pooled over them.
    pub summary: &'a CampaignSummary,
    /// The page.
    pub page: &'a str,
}

/// Writer of products of a campaign below a folder.
type WriteCampaign = fn(&Path, &CampaignProducts) -> Result<Vec<Product>>;

/// Name of the column that divides the Parquet tables.
const PHASE: &str = "phase";
/// Name of the files of the Parquet tables.
const PART: &str = "part-0.parquet";

/// The products in the order in which they are written.
static PRODUCTS: &[&Declaration<WriteCampaign>] = &[
    &sites::TABLE,
    &sites::CSV,
    &images::TABLE,
    &images::CSV,
    &pairs::TABLE,
    &pairs::CSV,
    &profiles::TABLE,
    &profiles::CSV,
    &SUMMARY,
    &REPORT,
];

static SUMMARY: Declaration<WriteCampaign> = Declaration {
    path: "summary.json",
    what: "results pooled over the valid sites: Tables 2 to 5 and the budget of eq. 5 to 9 of Shan et al. 2005, and biases of \
           mission phases",
    readers: "scripts",
    rows: "",
    role: Role::Data,
    content: Content::Document(schema),
    write: |folder, of| {
        let path = folder.join(SUMMARY.path);
        write_json(&path, of.summary)?;
        Ok(vec![Product {
            path: SUMMARY.path.into(),
            rows: 1,
        }])
    },
    uses: &[],
};

static REPORT: Declaration<WriteCampaign> = Declaration {
    path: CAMPAIGN_PAGE,
    what: "the page of the campaign",
    readers: "people",
    rows: "",
    role: Role::Overview,
    content: Content::Foreign,
    write: |folder, of| {
        write_text(&folder.join(CAMPAIGN_PAGE), of.page)?;
        Ok(vec![Product {
            path: CAMPAIGN_PAGE.into(),
            rows: 0,
        }])
    },
    uses: &[],
};

/// Path of the page below the folder of the campaign.
pub const CAMPAIGN_PAGE: &str = "index.html";

fn schema() -> DocumentSchema {
    DocumentSchema::of::<CampaignSummary>("campaign_summary")
}

/// The products in the documentation.
pub(super) fn group() -> Group {
    Group {
        heading: "Campaigns",
        source: "`areograph campaign`, in the folder `campaign` of `--out`",
        prefix: "campaign",
        placeholders: "; `<phase>` stands for a mission phase",
        products: described(PRODUCTS),
    }
}

/// Writes every product of a campaign below `directory`, and reads each of them back.
///
/// # Errors
/// [`Kind::Io`](areograph_base::error::Kind::Io) for errors of the disk; [`Kind::Bug`](areograph_base::error::Kind::Bug) for numbers
/// that are not finite and files that read back differently.
pub fn write_campaign_products(directory: &Path, of: &CampaignProducts) -> Result<Vec<Product>> {
    let written = PRODUCTS.iter().map(|declaration| {
        let path = directory.join(declaration.path);
        (declaration.write)(directory, of).in_file(path)
    });
    Ok(written
        .collect::<Result<Vec<_>>>()?
        .into_iter()
        .flatten()
        .collect())
}

/// Writes the rows of each phase to a Parquet file of its own; without a row, one of the unknown phase with the columns.
fn write_parts<'a, R: Sync + 'a>(
    folder: &Path,
    name: &str,
    columns: impl Fn() -> Vec<Column<&'a R>>,
    rows: &'a [R],
    phase: impl Fn(&R) -> &str,
) -> Result<Vec<Product>> {
    let mut parts: BTreeMap<&str, Vec<&R>> = BTreeMap::new();
    for row in rows {
        parts
            .entry(phase_or_unknown(phase(row)))
            .or_default()
            .push(row);
    }
    if parts.is_empty() {
        parts.insert(phase_or_unknown(""), Vec::new());
    }
    let mut products = Vec::new();
    for (phase, rows) in parts {
        let relative = format!("{name}/{PHASE}={}/{PART}", in_folder_name(phase));
        let path = folder.join(&relative);
        let table = Table::new(columns(), rows).without(PHASE);
        let rows = parquet::write(&path, &table, vec![("areograph_campaign", name.to_owned())])?;
        products.push(Product {
            path: relative.into(),
            rows,
        });
    }
    Ok(products)
}

/// Writes all rows to one CSV file.
fn write_csv<'a, R: Sync + 'a>(
    folder: &Path,
    relative: &str,
    columns: Vec<Column<&'a R>>,
    rows: &'a [R],
) -> Result<Vec<Product>> {
    let table = Table::new(columns, rows.iter().collect());
    let rows = text_table::write(&folder.join(relative), table)?;
    Ok(vec![Product {
        path: relative.into(),
        rows,
    }])
}

/// A phase as Hive writes values in names of folders: other characters than letters, digits and a few marks as `%` and two
/// hexadecimal digits for each byte.
fn in_folder_name(phase: &str) -> String {
    let encode = |byte: u8| match byte {
        b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'-' | b'_' => char::from(byte).to_string(),
        byte => format!("%{byte:02X}"),
    };
    phase.bytes().map(encode).collect()
}

/// The column of the phase, which is the first one of every table.
fn phase_column<'a, R>(of: impl Fn(&R) -> &str + Send + Sync + 'static) -> Column<&'a R> {
    column(
        PHASE,
        Unit::None,
        "mission phase of the image (of the first image of a site or pair), by the index of images; unknown without an index \
         entry. Of Parquet files, the name of the folder",
        move |row: &&R| phase_or_unknown(of(row)).to_owned(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phases_are_names_of_folders() {
        assert_eq!(in_folder_name("E02"), "E02");
        assert_eq!(in_folder_name("MAPPING PHASE"), "MAPPING%20PHASE");
        assert_eq!(in_folder_name("../a=b"), "%2E%2E%2Fa%3Db");
    }
}
