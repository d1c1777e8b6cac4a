//! What is generated from declarations and kept in the repository is what the declarations say now;
//! `SNAPSHOTS=overwrite cargo test --test products generated` writes it anew.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    reason = "the test may fail loudly, and writes into the repository when asked"
)]

use areograph_testing::kept;

use crate::common::{files_below, mission::site_run};
use areograph::{capabilities::declarations, schema::DocumentSchema, terms::Terms};
use kept::is_up_to_date;

#[test]
fn the_list_of_products_is_up_to_date() {
    is_up_to_date(
        "docs/products.md",
        &areograph::products::documentation(declarations()),
    );
}

/// Columns can be attributes in Python (`frame.return_class`), and a description needs no other column to be understood.
#[test]
fn columns_have_names_and_descriptions_of_their_own() {
    const RESERVED: [&str; 35] = [
        "False", "None", "True", "and", "as", "assert", "async", "await", "break", "class",
        "continue", "def", "del", "elif", "else", "except", "finally", "for", "from", "global",
        "if", "import", "in", "is", "lambda", "nonlocal", "not", "or", "pass", "raise", "return",
        "try", "while", "with", "yield",
    ];
    let text = areograph::products::documentation(declarations());
    let columns = text.lines().filter_map(|line| {
        let cells: Vec<&str> = line.split(" | ").collect();
        let name = cells[0].strip_prefix("| `")?.strip_suffix('`')?;
        (cells.len() == 4).then(|| (name, cells[3]))
    });
    let mut count = 0;
    for (name, description) in columns {
        assert!(!RESERVED.contains(&name), "{name}");
        for other in ["likewise", "the same of", "as above", "ditto"] {
            assert!(!description.contains(other), "{name}: {description}");
        }
        count += 1;
    }
    assert!(count > 500, "{count} columns");
}

#[test]
fn schemas_are_up_to_date() {
    let mut schemas = areograph::products::schemas(declarations());
    schemas.push(areograph::store::manifest::schema());
    schemas.push(areograph::difference::schema());
    schemas.push(areograph::flow::comparison_schema());
    for DocumentSchema { name, schema } in schemas {
        let text = serde_json::to_string_pretty(&schema).unwrap() + "\n";
        is_up_to_date(&format!("config/schema/{name}.schema.json"), &text);
    }
}

/// Pages, documents, tables with their metadata, and text name no term in braces that has not been filled in.
#[test]
fn texts_of_a_site_have_all_their_terms() {
    let files = files_below(&site_run("gusev_crater"));
    // Page data contain declared texts.
    let files = files
        .iter()
        .filter(|path| path.extension().is_none_or(|kind| kind != "postcard"));
    let mut read = 0;
    for path in files {
        let bytes = std::fs::read(path).unwrap();
        let text = String::from_utf8_lossy(&bytes);
        assert!(Terms::MARS.fill(&text) == text, "{}", path.display());
        read += 1;
    }
    assert!(read > 60, "{read} files");
}
