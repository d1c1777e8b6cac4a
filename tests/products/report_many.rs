//! The page of a site of many images: it stays small, shows those that matter, and can be made from its data again.

#![allow(clippy::unwrap_used, reason = "helpers of tests may fail loudly")]

use std::collections::BTreeSet;

use crate::common::{page::assert_complete, products_site as fixture};

use areograph::{
    capabilities::{self, write_products},
    products::{IMAGES_SHOWN, PageData, Pages, SiteProducts},
    stages::register::ImageRegistration,
};
use fixture::Site;

/// Bytes that the page may grow by for an image more, most of them a link to its file and its place in the plots.
const BYTES_EACH_MAX: usize = 400;

fn page(site: &Site, count: usize) -> String {
    site.with_copies(count, capabilities::page).unwrap()
}

/// Images with a plot called after them.
fn drawn(page: &str, title: &str) -> Vec<String> {
    let start = format!("<figure id=\"{title}-");
    let figures = page.split(&start).skip(1);
    figures
        .map(|figure| figure.split('"').next().unwrap().to_owned())
        .collect()
}

#[test]
fn a_few_images_have_all_plots() {
    let page = page(&Site::small(), IMAGES_SHOWN);
    assert_complete(&page);
    assert_eq!(drawn(&page, "residuals-of").len(), IMAGES_SHOWN);
    assert_eq!(drawn(&page, "profiles-on").len(), IMAGES_SHOWN);
    assert!(!page.contains("All images") && !page.contains("Rows and plots"));
}

#[test]
fn the_page_of_many_images_hardly_grows_with_them() {
    let site = Site::small();
    let [some, many] = [120, 240].map(|count| page(&site, count));
    assert_complete(&many);
    let each = many.len().saturating_sub(some.len()) / 120;
    assert!(each <= BYTES_EACH_MAX, "{each} bytes for an image more");
    for title in ["residuals-of", "profiles-on"] {
        let images = drawn(&many, title);
        assert_eq!(images.len(), IMAGES_SHOWN, "{images:?}");
        // The invalid one is the last.
        assert!(
            images.iter().any(|image| image == "m04-00239"),
            "{images:?}"
        );
    }
    assert!(many.contains("<caption>All images</caption>"));
    assert!(many.contains("Invalid images: 1 of 240."));
    for index in 0..240 {
        let file = format!("<a href=\"../images/M04-{index:05}/orientation.json\">");
        assert!(many.contains(&file), "{file}");
    }
}

#[test]
fn the_page_of_many_images_is_made_again_from_its_data() {
    let folder = tempfile::tempdir().unwrap();
    let site = Site::small();
    let written = |products: &SiteProducts| {
        let page = capabilities::page(products)?;
        let pages = Pages {
            report: &page,
            overlays: None,
        };
        write_products(folder.path(), products, pages)?;
        Ok::<_, areograph::error::Error>(page)
    };
    let page = site.with_copies(2 * IMAGES_SHOWN, written).unwrap();
    let again = PageData::read(folder.path()).unwrap();
    assert_eq!(
        again
            .with(capabilities::declarations(), capabilities::page)
            .unwrap(),
        page
    );
    // The same if footprints are inside images without plots alone.
    let copies = 2 * IMAGES_SHOWN;
    let shown = site.with_copies(copies, |site| -> BTreeSet<usize> {
        site.shown_images().into_iter().collect()
    });
    let hide = |index: usize, registration: &mut ImageRegistration| {
        if shown.contains(&index) {
            let points = &mut registration.points;
            points.inside = points.inside.changed(|_, _| false);
            for profile in &mut registration.profiles {
                profile.inside = 0;
            }
        }
    };
    let page = site.with_changed_copies(copies, hide, written).unwrap();
    assert!(page.contains("registered_footprints.parquet"));
    let again = PageData::read(folder.path()).unwrap();
    let again = again.with(capabilities::declarations(), capabilities::page);
    assert_eq!(again.unwrap(), page);
    // What is not on the page is a file.
    for index in 0..2 * IMAGES_SHOWN {
        let file = format!("images/M04-{index:05}/orientation.json");
        assert!(folder.path().join(&file).is_file(), "{file}");
    }
}
