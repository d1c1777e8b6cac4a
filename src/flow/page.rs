//! The page of a published site, rebuilt from its products.
//!
//! The book of the site's outputs is a separate product, unrounded (`products/page_data.rs`), and the page depends only on
//! it and on tables beside it (decision 0023).

use std::path::{Path, PathBuf};

use crate::{
    capabilities::{declarations, page},
    error::{Cause, Locate, Result},
    products::{PAGE_DATA, PageData, REPORT},
    store::{
        atomic,
        lock::SiteLock,
        manifest::Manifest,
        published::{read_published_by_this_version, still_published},
    },
};

/// The page differs from the published one, although its content is unchanged.
#[derive(Debug, thiserror::Error, Cause)]
#[error("the page from these products differs from the published page")]
#[cause(Input: "the published page is from another build of this version: run the site again, or write the page elsewhere with \
    --page")]
struct OtherPage;

/// A rebuilt page.
#[derive(Debug)]
pub struct PageAgain {
    /// The site.
    pub site: String,
    /// The page.
    pub page: String,
    folder: PathBuf,
    manifest: Manifest,
}

/// Rebuilds the page of the site whose products are in `folder`: no site file, kernel or stored stage is read.
///
/// # Errors
/// Products that are missing, damaged or of a different version; the page itself may be.
pub fn page_again(folder: &Path) -> Result<PageAgain> {
    let manifest = read_published_by_this_version(folder, |path| path == REPORT)?;
    let data = PageData::read(folder)?;
    still_published(folder, &manifest)?;
    let page = data
        .with(declarations(), page)
        .in_file(folder.join(PAGE_DATA))?;
    Ok(PageAgain {
        site: manifest.site.clone(),
        page,
        folder: folder.to_owned(),
        manifest,
    })
}

impl PageAgain {
    /// Writes the page to its place among the products, and returns its path.
    ///
    /// # Errors
    /// A page that differs from the page of the manifest; another run in progress; write errors.
    pub fn put_back(&self) -> Result<PathBuf> {
        let path = self.folder.join(REPORT);
        let mut products = self.manifest.products.iter();
        let published = products.find(|product| product.path == REPORT);
        let hash = blake3::hash(self.page.as_bytes()).to_hex();
        if published.is_none_or(|product| product.blake3 != *hash) {
            return Err(OtherPage).in_file(path);
        }
        let _lock = SiteLock::take(&self.folder)?;
        still_published(&self.folder, &self.manifest)?;
        atomic::write(&path, self.page.as_bytes())?;
        Ok(path)
    }
}
