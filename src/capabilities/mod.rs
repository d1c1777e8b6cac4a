//! What a stage adds to the products, the page and the verdict of a site.
//!
//! A capability declares its products, its section of the page, its findings for the verdict and its counts of the
//! manifest in one folder; each of them asks the book of outputs for what it needs. `CAPABILITIES` lists it once, and
//! files, catalogue, documentation, page and verdict follow. The flow (`flow/site.rs`) calls its stage. Stages that
//! many products use have these in the crates `products`, `report` and `stages/judge`.

mod explore;
mod orthoimages;
mod spacing;
mod terrain;

pub use spacing::{ByPeriod, MeasureSpacing, ProfileSpacing};

use std::{collections::BTreeMap, path::Path, sync::LazyLock};

use crate::{
    config::SiteConfig,
    error::Result,
    products::{self, Declaration, Pages, Product, SiteProducts},
    report::{self, Section},
    stages::judge::Findings,
    store::book::Book,
};

/// Judges a site by an output of its book.
type Judge = fn(&SiteConfig, &Book) -> Result<Findings>;
/// Counts of a site for its manifest.
type Count = fn(&Book) -> Result<Vec<(&'static str, u64)>>;

/// The products, section, findings and counts of a stage.
struct Capability {
    products: &'static [&'static Declaration],
    section: Section,
    judge: Option<Judge>,
    count: Option<Count>,
}

/// All capabilities, in the order of their products and sections.
static CAPABILITIES: &[&Capability] = &[
    &terrain::CAPABILITY,
    &orthoimages::CAPABILITY,
    &spacing::CAPABILITY,
    &explore::CAPABILITY,
];

/// All products that a site may have, in the order in which they are written.
#[must_use]
pub fn declarations() -> &'static [&'static Declaration] {
    static DECLARATIONS: LazyLock<Vec<&'static Declaration>> = LazyLock::new(|| {
        let own = CAPABILITIES.iter().flat_map(|of| of.products).copied();
        products::declarations(&own.collect::<Vec<_>>())
    });
    &DECLARATIONS
}

/// Writes every product of `site` below `directory`, with `pages` (or one page as its report), and reads each of them
/// back.
///
/// # Errors
/// Those of [`products::write_products`].
pub fn write_products<'a>(
    directory: &Path,
    site: &SiteProducts,
    pages: impl Into<Pages<'a>>,
) -> Result<Vec<Product>> {
    products::write_products(directory, site, declarations(), pages)
}

/// The report of `site` as one HTML page.
///
/// # Errors
/// A plot that cannot be drawn, which is a bug in areograph.
pub fn page(site: &SiteProducts) -> Result<String> {
    let sections: Vec<Section> = CAPABILITIES.iter().map(|of| of.section).collect();
    report::page(site, &sections)
}

/// The findings of all capabilities on a site.
///
/// # Errors
/// An output that is not known or cannot be read.
pub(crate) fn findings(config: &SiteConfig, book: &Book) -> Result<Vec<Findings>> {
    let judges = CAPABILITIES.iter().filter_map(|of| of.judge);
    judges.map(|judge| judge(config, book)).collect()
}

/// The counts of all capabilities for the manifest of a site.
///
/// # Errors
/// As [`findings`].
pub(crate) fn counts(book: &Book) -> Result<BTreeMap<String, u64>> {
    let mut counts = BTreeMap::new();
    for count in CAPABILITIES.iter().filter_map(|of| of.count) {
        counts.extend(
            count(book)?
                .into_iter()
                .map(|(name, of)| (name.to_owned(), of)),
        );
    }
    Ok(counts)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn downloads_of_the_page_are_declared() {
        for name in report::DOWNLOADS.into_iter().chain([report::UNADJUSTED]) {
            let is_it = |path: &str| path == name || path.ends_with(&format!("<image>/{name}"));
            assert!(declarations().iter().any(|of| is_it(of.path)), "{name}");
        }
    }

    #[test]
    fn every_path_and_anchor_is_declared_once() {
        let paths: BTreeSet<&str> = declarations().iter().map(|of| of.path).collect();
        assert_eq!(paths.len(), declarations().len());
        let own: Vec<Section> = CAPABILITIES.iter().map(|of| of.section).collect();
        let anchors: Vec<&str> = report::sections(&own).map(|of| of.anchor).collect();
        let distinct: BTreeSet<&str> = anchors.iter().copied().collect();
        assert_eq!(distinct.len(), anchors.len());
    }
}
