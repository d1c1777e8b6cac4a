//! Files generated from the declarations and kept in the repository: `docs/products.md`, `config/schema`.

use std::fmt::Write as _;

use super::{
    archive, calibration, campaign, laser_match, net,
    product::{Content, Declaration, Group},
    table::{Kind, Meaning},
};
use areograph_base::{schema::DocumentSchema, terms::Terms};

/// The flows other than the flow of sites, each with its products.
const GROUPS: [fn() -> Group; 5] = [
    net::group,
    calibration::group,
    laser_match::group,
    archive::group,
    campaign::group,
];

/// JSON Schemas of the documents, each once; `of_sites` are all products of sites.
#[must_use]
pub fn schemas(of_sites: &[&'static Declaration]) -> Vec<DocumentSchema> {
    let mut schemas: Vec<DocumentSchema> = Vec::new();
    for content in contents(of_sites) {
        if let Content::Document(schema) = content {
            let schema = schema();
            if !schemas.contains(&schema) {
                schemas.push(schema);
            }
        }
    }
    schemas
}

/// The content declarations of all files.
fn contents(of_sites: &[&'static Declaration]) -> impl Iterator<Item = Content> {
    let of_groups = GROUPS.iter().flat_map(|group| group().products);
    let of_sites = of_sites.iter().map(|product| product.content);
    of_sites.chain(of_groups.map(|product| product.content))
}

/// `docs/products.md`: every product, and the columns of every table.
#[must_use]
pub fn documentation(of_sites: &[&'static Declaration]) -> String {
    let mut text = "# Products\n\n\
        This page is generated from the declarations in `crates/products/src`; `tests/products/generated.rs` reports \
        an outdated page.\n\n\
        Paths are relative to the site's folder; `<image>` stands for the identifier of an image. `manifest.json`, \
        which is written last, records the inputs of all products.\n\n\
        | file | what it is | for | one for | rows | schema |\n|---|---|---|---|---|---|\n"
        .to_owned();
    for product in of_sites {
        let _infallible = writeln!(
            text,
            "| `{}` | {} | {} | {} | {} | {} |",
            product.path,
            Terms::MARS.fill(product.what),
            product.readers,
            product.when(),
            product.rows,
            schema_link(product),
        );
    }
    text += "\n## Columns\n\nNames end in the unit. `?` marks columns that lack a value in some rows.\n";
    for product in of_sites {
        text += &columns_of(product, "");
    }
    for group in GROUPS {
        text += &group_of(&group());
    }
    text
}

/// Products of a flow other than the flow of sites. CSV files have the columns of the Parquet files.
fn group_of(group: &Group) -> String {
    let Group {
        heading,
        source,
        prefix,
        placeholders,
        products,
    } = group;
    let mut text = format!(
        "\n## {heading}\n\nProducts of {source}; `manifest.json` is written last here as well. `{prefix}:` precedes \
        the names of these products below{placeholders}.\n\n\
        | file | what it is | for | rows | schema |\n|---|---|---|---|---|\n"
    );
    text.extend(products.iter().map(line_of));
    let of_its_own = |product: &&Declaration<()>| {
        let csv = product.path.strip_suffix(".csv");
        let parquet = csv.map(|stem| format!("{stem}.parquet"));
        !products
            .iter()
            .any(|of| Some(of.path) == parquet.as_deref())
    };
    let tables = products.iter().filter(of_its_own);
    text.extend(tables.map(|product| columns_of(product, &format!("{prefix}: "))));
    text
}

/// A line for a product of which exactly one is written.
fn line_of<W>(product: &Declaration<W>) -> String {
    format!(
        "| `{}` | {} | {} | {} | {} |\n",
        product.path,
        Terms::MARS.fill(product.what),
        product.readers,
        product.rows,
        schema_link(product),
    )
}

/// The columns of a table; empty for other files.
fn columns_of<W>(product: &Declaration<W>, of: &str) -> String {
    let Content::Table(columns) = product.content else {
        return String::new();
    };
    let rows: Vec<String> = columns().iter().map(row).collect();
    format!(
        "\n### {of}`{}`\n\n| column | type | unit | what it is |\n|---|---|---|---|\n{}",
        product.path,
        rows.concat()
    )
}

fn schema_link<W>(product: &Declaration<W>) -> String {
    let name = match product.content {
        Content::Document(schema) => schema().name,
        Content::Table(_) | Content::Foreign => return String::new(),
    };
    format!("[{name}](../config/schema/{name}.schema.json)")
}

fn row(column: &Meaning) -> String {
    let kind = match column.kind {
        Kind::Real => "real",
        Kind::Natural => "natural number",
        Kind::Integer => "integer",
        Kind::Flag => "true or false",
        Kind::Time => "time, UTC",
        Kind::Text => "text",
        Kind::List => "list of texts",
        Kind::Bytes => "bytes",
    };
    format!(
        "| `{}` | {kind}{} | {} | {} |\n",
        column.name,
        if column.optional { " ?" } else { "" },
        column.unit.symbol().unwrap_or_default(),
        Terms::MARS.fill(&column.description).replace('|', "\\|"),
    )
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use areograph_base::body::Body;

    #[test]
    fn names_of_our_columns_end_in_their_unit() {
        let declared = crate::declarations(&[]);
        let columns = contents(&declared).filter_map(|content| match content {
            Content::Table(columns) => Some(columns()),
            _ => None,
        });
        for column in columns.flatten() {
            let foreign = column.name.chars().all(|of| of.is_uppercase() || of == '_');
            let ending = match column.name.rsplit('_').next() {
                Some("line" | "lines") => Some("line"),
                Some("offset") if column.name == "line_offset" => Some("line"),
                Some("px" | "sample") => Some("pixel"),
                Some(unit @ ("m" | "km" | "s" | "ms" | "deg" | "arcsec" | "rad")) => Some(unit),
                _ => None,
            };
            assert!(foreign || ending == column.unit.symbol(), "{}", column.name);
        }
    }

    #[test]
    fn declared_texts_name_only_terms_of_the_site() {
        let lunar = Terms {
            body: Body::Moon,
            altimeter: "LOLA",
            has_tables: true,
            has_areoid: false,
        };
        let texts = crate::declarations(&[]).into_iter().flat_map(|product| {
            let columns = match product.content {
                Content::Table(columns) => columns(),
                _ => Vec::new(),
            };
            let columns = columns.into_iter().map(|column| column.description);
            let uses = product.uses.iter().map(|of| of.lines.into());
            columns.chain(uses).chain([product.what.into()])
        });
        for text in texts {
            let text = lunar.fill(&text).replace("areograph", "");
            // A name in braces that is left is misspelt; programs of AWK have blanks in theirs.
            let mut parts = text
                .split('{')
                .skip(1)
                .filter_map(|part| part.split_once('}'));
            let is_name = |(name, _): (&str, &str)| {
                name.chars().all(|of| of.is_ascii_lowercase() || of == '_')
            };
            assert!(!parts.any(is_name), "{text}");
            for word in ["MOLA", "PEDR", "Mars", "MARS", "IAU 2000", "areo"] {
                assert!(!text.contains(word), "{text}");
            }
        }
    }

    #[test]
    fn a_product_is_declared_once() {
        let declared = crate::declarations(&[]);
        let paths: BTreeSet<&str> = declared.iter().map(|product| product.path).collect();
        assert_eq!(paths.len(), declared.len());
    }
}
