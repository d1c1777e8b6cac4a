//! Published products: complete and in agreement with the manifest, or not to be used.

use std::{fs, io::ErrorKind, path::Path};

use super::{
    manifest::{Manifest, ProductEntry},
    publish::{CACHE, JOURNAL, MANIFEST, damaged, differing_product, has_work, read_manifest},
};
use crate::{
    files::{InputFiles, short_hash},
    hashes::HashCache,
};
use areograph_base::error::{Cause, IoError, Locate, Result};

/// Reasons why products in a folder are not to be used.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Input)]
pub enum PublishedError {
    /// Nothing was published.
    #[error("there is no {MANIFEST}, so there are no products")]
    #[cause("name the products folder of a complete run")]
    NoManifest,
    /// A run was killed, or is in progress, while files received their final names.
    #[error("the publication of products into this folder was not finished")]
    #[cause("wait for the run in progress, or run the site again to repair it")]
    Unfinished,
    /// The manifest is damaged, or of a version with other entries.
    #[error("this is not a manifest of areograph {}: {reason}", env!("CARGO_PKG_VERSION"))]
    #[cause(
        "run areograph again on the configuration file of these products: damaged products are rewritten"
    )]
    Unreadable {
        /// The parser's reason, with line and column.
        reason: String,
    },
    /// Products of a version that may have computed or stored other results.
    #[error("these are products of areograph {found}; expected {}, the running version", env!("CARGO_PKG_VERSION"))]
    #[cause("run the site again with this version, or use the other version")]
    OtherVersion {
        /// The version of the products.
        found: String,
    },
    /// A product differs from the published one.
    #[error(
        "{found}; expected {expected_bytes} bytes with the BLAKE3 hash {expected}, as in {MANIFEST}"
    )]
    #[cause(like = Unreadable)]
    Contradicts {
        /// The existing content.
        found: String,
        /// Size in the manifest.
        expected_bytes: u64,
        /// Hash in the manifest, shortened.
        expected: String,
    },
    /// Another run published meanwhile.
    #[error("the products were published again while they were being read")]
    #[cause(Io: "try again when the run has finished")]
    Replaced,
}

/// Whether the folder contains, or was meant to contain, a site's products.
#[must_use]
pub fn is_site_folder(folder: &Path) -> bool {
    folder.join(MANIFEST).exists() || has_work(folder)
}

/// The manifest of a site's folder; every product is checked against it.
///
/// # Errors
/// [`PublishedError`], of kind input; read errors.
pub fn read_published(folder: &Path) -> Result<Manifest> {
    read_published_but(folder, |_| false)
}

/// Reads them without the products, by their path, that will be made again; only of this version of areograph.
///
/// # Errors
/// As [`read_published`], and [`PublishedError::OtherVersion`].
pub fn read_published_by_this_version(
    folder: &Path,
    made_again: impl Fn(&str) -> bool,
) -> Result<Manifest> {
    let manifest = read_published_but(folder, made_again)?;
    require_this_version(folder, &manifest)?;
    Ok(manifest)
}

/// Reads them as [`read_published_by_this_version`], but trusts hashes of products that runs have stored, as the next run of the
/// site does: unchanged products of thousands of sites are not read again.
///
/// # Errors
/// As [`read_published_by_this_version`].
pub fn read_published_by_stored_hashes(folder: &Path) -> Result<Manifest> {
    let manifest = read_unchecked(folder)?;
    require_this_version(folder, &manifest)?;
    let files: InputFiles = HashCache::in_folder(&folder.join(CACHE), false).files();
    match differing_product(folder, &manifest, &files) {
        Some((product, found)) => {
            Err(contradicts(product, found?)).in_file(folder.join(&product.path))
        }
        None => Ok(manifest),
    }
}

fn read_published_but(folder: &Path, made_again: impl Fn(&str) -> bool) -> Result<Manifest> {
    let manifest = read_unchecked(folder)?;
    let mut damaged = damaged(folder, &manifest).filter(|(product, _)| !made_again(&product.path));
    if let Some((product, found)) = damaged.next() {
        return Err(contradicts(product, found?)).in_file(folder.join(&product.path));
    }
    drop(damaged);
    Ok(manifest)
}

fn contradicts(product: &ProductEntry, found: String) -> PublishedError {
    PublishedError::Contradicts {
        found,
        expected_bytes: product.bytes,
        expected: short_hash(&product.blake3),
    }
}

fn require_this_version(folder: &Path, manifest: &Manifest) -> Result<()> {
    if manifest.version == env!("CARGO_PKG_VERSION") {
        return Ok(());
    }
    Err(PublishedError::OtherVersion {
        found: manifest.version.clone(),
    })
    .in_file(folder)
}

/// The manifest of complete products, which are not checked against it.
fn read_unchecked(folder: &Path) -> Result<Manifest> {
    if folder.join(JOURNAL).exists() {
        return Err(PublishedError::Unfinished).in_file(folder);
    }
    let path = folder.join(MANIFEST);
    let bytes = match fs::read(&path) {
        Err(error) if error.kind() == ErrorKind::NotFound && folder.is_dir() => {
            return Err(PublishedError::NoManifest).in_file(folder);
        }
        read => read.map_err(IoError::on("read")).in_file(&path)?,
    };
    serde_json::from_slice(&bytes)
        .map_err(|error| PublishedError::Unreadable {
            reason: error.to_string(),
        })
        .in_file(&path)
}

/// Checks that `manifest` is still current after its products have been read.
///
/// # Errors
/// [`PublishedError::Replaced`].
pub fn still_published(folder: &Path, manifest: &Manifest) -> Result<()> {
    if read_manifest(folder).as_ref() == Some(manifest) {
        return Ok(());
    }
    Err(PublishedError::Replaced).in_file(folder)
}
