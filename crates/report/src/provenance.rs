//! Program, configuration, and the files that were read.

use super::{
    html::{Cell, Column, Markup, Table, folded, html, link},
    many,
    numbers::whole,
    section::Section,
};
use std::collections::HashSet;

use areograph_config::{self as config};
use areograph_products::SiteProducts;

pub(super) const SECTION: Section = Section {
    title: "Provenance",
    anchor: "provenance",
    checks: &[],
    appears: |_| true,
    write: |site| Ok(write(site)),
};

fn write(site: &SiteProducts) -> Markup {
    let config = site.config;
    let file_name = areograph_store::files::file_name(&config.file);
    let words = format!(
        "Cite as: areograph {}, site {}, configuration {file_name} (BLAKE3 hash of its keys {}). Computed with {}.",
        env!("CARGO_PKG_VERSION"),
        config.site,
        config.blake3,
        site.program.cspice.replace('_', " ")
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
    for (index, kernel) in site.kernels.iter().enumerate() {
        files.row_of(
            &format!("manifest.json#/kernels/{index}"),
            true,
            [
                (&kernel.name).into(),
                (&kernel.role).into(),
                Cell::from(whole(kernel.bytes)).traced("/bytes"),
                hash(&kernel.blake3),
            ],
        );
    }
    for support in many::shown(site)
        .into_iter()
        .filter_map(|(_, image)| image.times.support.as_ref())
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
                site.config.terms().shot_source().into(),
                "–".into(),
                hash(&file.blake3),
            ],
        );
    }
    html! {
        p { (words) }
        p {
            "Made by " code { "areograph run " (file_name) } "; " code { "areograph report " (config.site) }
            " regenerates this page."
        }
        p {
            (link("../manifest.json", "manifest.json")) ": verdict, checks, figures and hashes for programs. "
            (link("../kernels.tm", "kernels.tm")) " loads the same kernels. "
            (link("../../index.html", "All sites")) "."
        }
        (folded("Files that were read", &files.finish()))
        (settings(site))
        (methods(site))
        (products(site))
    }
}

/// The number of each stage's method.
fn methods(site: &SiteProducts) -> Markup {
    let columns = &[Column::Text("stage"), Column::Number("method")];
    let mut table = Table::new(
        "Stages; the number increases when the method of a stage changes",
        columns,
    );
    for (stage, method) in &site.program.methods {
        table.row(true, [stage.into(), method.to_string().into()]);
    }
    folded("Methods", &table.finish())
}

/// Every file beside the page.
fn products(site: &SiteProducts) -> Markup {
    let columns = &[
        Column::Text("file"),
        Column::Text("content"),
        Column::Text("readers"),
    ];
    let mut table = Table::new("Products", columns);
    let shown = site.shown_images();
    let is_shown = |index: usize| shown.binary_search(&index).is_ok();
    let products = site.listed.iter();
    for product in products.filter(|product| product.image.is_none_or(is_shown)) {
        let place = format!("../{}", product.path);
        table.row(
            true,
            [
                link(&place, &product.path).into(),
                (&*product.what).into(),
                product.readers.into(),
            ],
        );
    }
    folded(
        "Products",
        &html! { (table.finish()) (many_have_the_same(site)) },
    )
}

/// The written keys of the configuration beside their defaults; all other keys have the defaults.
fn settings(site: &SiteProducts) -> Markup {
    if site.config.keys.is_empty() {
        return Markup::default();
    }
    let columns = &[
        Column::Text("key"),
        Column::Text("value"),
        Column::Text("default"),
    ];
    let mut table = Table::new(
        "Settings as written; all other settings have default values",
        columns,
    );
    let declared = config::keys();
    let hidden = hidden(site);
    let is_hidden = |key: &str| image_of(key).is_some_and(|image| hidden.contains(image));
    for (key, value) in &site.config.keys {
        if is_hidden(key) {
            continue;
        }
        let default = declared.iter().find(|declared| is_of(key, &declared.path));
        let default = default.and_then(|declared| declared.default.as_ref());
        let default = default.map_or_else(|| "–".to_owned(), ToString::to_string);
        table.row(true, [key.into(), value.into(), default.into()]);
    }
    folded(
        "Settings",
        &html! { (table.finish()) (many_have_the_same(site)) },
    )
}

/// A paragraph for tables that list some images of many.
fn many_have_the_same(site: &SiteProducts) -> Markup {
    html! {
        @if many::are_many(site) {
            p { "Only images with individual plots are listed; manifest.json lists all images." }
        }
    }
}

/// Names of the images without separate rows.
fn hidden<'a>(site: &SiteProducts<'a>) -> HashSet<&'a str> {
    let shown = site.shown_images();
    let images = site.images.iter().enumerate();
    let hidden = images.filter(|(index, _)| shown.binary_search(index).is_err());
    hidden.map(|(_, image)| &*image.times.id).collect()
}

/// The image that a key of the configuration is of.
fn image_of(key: &str) -> Option<&str> {
    let (image, _) = key.strip_prefix("images.")?.rsplit_once('.')?;
    Some(image)
}

/// Whether a key as written is the declared one: the name of a list of tables is followed by the entry.
fn is_of(key: &str, declared: &str) -> bool {
    let Some((table, name)) = declared.rsplit_once('.') else {
        return key == declared;
    };
    let rest = key
        .strip_prefix(table)
        .and_then(|rest| rest.strip_suffix(name));
    rest.is_some_and(|entry| entry.starts_with('.') && entry.ends_with('.'))
}

/// A hash in a monospaced font.
fn hash(blake3: &str) -> Cell {
    html! { span.hash { (blake3) } }.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn written_keys_find_their_declaration() {
        assert!(is_of("site", "site") && !is_of("sites", "site"));
        assert!(is_of("adjustment.model", "adjustment.model"));
        assert!(is_of("images.E02-02855.label", "images.label"));
        assert!(!is_of("adjustment.images.a.id", "images.id"));
        assert!(!is_of("pedr.files", "ties.files"));
    }
}
