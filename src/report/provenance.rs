//! Program, configuration, and the files that were read.

use super::{
    html::{Cell, Column, Table, escape, folded, paragraph},
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
        "Cite as: areograph {}, site {}, configuration {} (BLAKE3 of its keys {}).",
        env!("CARGO_PKG_VERSION"),
        config.site,
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
    for support in site
        .images
        .iter()
        .filter_map(|image| image.times.support.as_ref())
    {
        files.row(
            true,
            [
                (&support.name).into(),
                "ISD".into(),
                whole(support.bytes).into(),
                hash(&support.blake3),
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
    paragraph(&words) + LINKS + &files.finish() + &settings(site)
}

/// Where the rest is, from the folder of the page.
const LINKS: &str = "<p><a href=\"../manifest.json\">manifest.json</a>: every product with its hash, every stage with its \
    fingerprint, all checks, and when the run ended. <a href=\"../kernels.tm\">kernels.tm</a> loads the same kernels in the \
    same order. <a href=\"../../index.html\">All sites</a>.</p>\n";

/// The keys of the configuration that were written; all others have their defaults.
fn settings(site: &SiteProducts) -> String {
    if site.config.keys.is_empty() {
        return String::new();
    }
    let columns = &[Column::Text("key"), Column::Text("value")];
    let mut table = Table::new("Settings as written; all others are the defaults", columns);
    for (key, value) in &site.config.keys {
        table.row(true, [key.into(), value.into()]);
    }
    folded("Settings", &table.finish())
}

/// A hash in letters of one width.
fn hash(blake3: &str) -> Cell {
    Cell::Html(format!("<span class=\"hash\">{}</span>", escape(blake3)))
}
