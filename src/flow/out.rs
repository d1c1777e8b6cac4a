//! Checks, before any stage runs, whether products can be written into a folder.

use std::path::{Path, PathBuf};

use crate::{
    config::SiteConfig,
    error::{Cause, Locate, Result},
    products::position_kernel,
    spice::PATH_LENGTH_MAX,
    store::publish::staging_path,
};

/// Longest component of a path that common file systems accept, bytes.
const PART_LENGTH_MAX: usize = 255;

/// Why no products can be written into a folder.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Configuration)]
pub enum OutError {
    /// Metakernels and CSPICE cannot name files in it.
    #[error("--out is {out:?}: it {holds}; expected UTF-8 without control characters")]
    #[cause("name a folder without such characters for --out")]
    Unspeakable {
        /// The folder.
        out: PathBuf,
        /// The obstacle.
        holds: &'static str,
    },
    /// No file system accepts it.
    #[error(
        "--out has a path component of {bytes} bytes, {part:.20}…; expected at most {PART_LENGTH_MAX}"
    )]
    #[cause("name a folder with a shorter path for --out; a relative path counts as it is written")]
    LongPart {
        /// The part.
        part: String,
        /// Its length.
        bytes: usize,
    },
    /// A kernel of an adjusted image has a path that CSPICE does not accept.
    #[error(
        "with --out the path of a product, {}, is {} bytes long while it is written; CSPICE accepts at most {PATH_LENGTH_MAX}",
        .product.display(), .product.as_os_str().len()
    )]
    #[cause(like = LongPart)]
    LongPath {
        /// The product.
        product: PathBuf,
    },
}

/// Ensures that the paths of all products of `sites` in `out` can be written.
///
/// # Errors
/// [`OutError`], of kind configuration.
pub fn check_out(out: &Path, sites: &[SiteConfig]) -> Result<()> {
    check_out_path(out)?;
    for site in sites.iter().filter(|site| site.ties.are_there()) {
        let staging = staging_path(&out.join(&site.site));
        let ids = site.images.iter().map(|image| &*image.id);
        let products = ids.map(|id| staging.join(position_kernel(id)));
        let longest = products.max_by_key(|product| product.as_os_str().len());
        if let Some(product) = longest.filter(|path| path.as_os_str().len() > PATH_LENGTH_MAX) {
            return Err(OutError::LongPath { product }).in_site(&site.site);
        }
    }
    Ok(())
}

/// Ensures that file systems and metakernels accept the path of a folder.
///
/// # Errors
/// [`OutError`], of kind configuration.
pub(super) fn check_out_path(out: &Path) -> Result<()> {
    let unspeakable = |holds| OutError::Unspeakable {
        out: out.to_owned(),
        holds,
    };
    let text = out.to_str().ok_or_else(|| unspeakable("is not UTF-8"))?;
    if text.contains(char::is_control) {
        return Err(unspeakable("contains control characters").into());
    }
    for part in out {
        if part.len() > PART_LENGTH_MAX {
            let part = part.to_string_lossy().into_owned();
            let bytes = part.len();
            return Err(OutError::LongPart { part, bytes }.into());
        }
    }
    Ok(())
}
