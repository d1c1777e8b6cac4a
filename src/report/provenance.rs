//! Program, configuration, and the files that were read.

use super::{
    html::{Cell, Column, Table, escape, paragraph},
    numbers::whole,
    section::Section,
};
use crate::products::SiteProducts;

pub(super) const SECTION: Section = Section {
    title: "Provenance",
    anchor: "provenance",
    appears: |_| true,
    write: |site| Ok(write(site)),
};

fn write(site: &SiteProducts) -> String {
    let config = site.config;
    let words = format!(
        "areograph {}; configuration {}, BLAKE3 of its keys {}. ../manifest.json lists every product with its hash, and \
         every stage with its fingerprint; ../kernels.tm loads the same kernels in the same order.",
        env!("CARGO_PKG_VERSION"),
        crate::files::file_name(&config.file),
        config.blake3
    );
    let mut files = Table::new(
        "Files that were read",
        &[
            Column::Text("file, kernels in load order"),
            Column::Text("role"),
            Column::Number("bytes"),
            Column::Text("BLAKE3"),
        ],
    );
    for kernel in site.kernels {
        files.row(
            true,
            [
                (&kernel.name).into(),
                (&kernel.role).into(),
                whole(kernel.bytes).into(),
                hash(&kernel.blake3),
            ],
        );
    }
    for file in &site.footprints.files {
        files.row(
            true,
            [
                (&file.name).into(),
                "PEDR".into(),
                "–".into(),
                hash(&file.blake3),
            ],
        );
    }
    paragraph(&words) + &files.finish()
}

/// A hash in letters of one width.
fn hash(blake3: &str) -> Cell {
    Cell::Html(format!("<span class=\"hash\">{}</span>", escape(blake3)))
}
