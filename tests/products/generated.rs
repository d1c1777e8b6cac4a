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
