//! What is generated from declarations and kept in the repository is what the declarations say now;
//! `SNAPSHOTS=overwrite cargo test --test generated` writes it anew.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    reason = "the test may fail loudly, and writes into the repository when asked"
)]

use std::{env, fs, path::Path};

use areograph::schema::DocumentSchema;

fn is_up_to_date(relative: &str, expected: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(relative);
    if env::var("SNAPSHOTS").is_ok_and(|mode| mode == "overwrite") {
        fs::write(path, expected).unwrap();
        return;
    }
    let found = fs::read_to_string(path).unwrap_or_default();
    let differs = found
        .lines()
        .zip(expected.lines())
        .position(|(a, b)| a != b);
    let line = differs.unwrap_or_else(|| found.lines().count().min(expected.lines().count()));
    assert!(
        found == expected,
        "{relative}: line {} is {:?}, the declarations say {:?}; write it anew with \
         `SNAPSHOTS=overwrite cargo test --test generated`",
        line + 1,
        found.lines().nth(line),
        expected.lines().nth(line),
    );
}

#[test]
fn the_list_of_products_is_up_to_date() {
    is_up_to_date("docs/products.md", &areograph::products::documentation());
}

#[test]
fn schemas_are_up_to_date() {
    let mut schemas = areograph::products::schemas();
    schemas.push(areograph::store::manifest::schema());
    schemas.push(areograph::difference::schema());
    schemas.push(areograph::flow::comparison_schema());
    for DocumentSchema { name, schema } in schemas {
        let text = serde_json::to_string_pretty(&schema).unwrap() + "\n";
        is_up_to_date(&format!("config/schema/{name}.schema.json"), &text);
    }
}
