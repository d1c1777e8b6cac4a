//! Checks, before any stage runs, whether products can be written into a folder.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

use crate::{
    config::SiteConfig,
    error::{Cause, Locate, Result},
    files::{overlap, real_path, require_own},
    kernel_source::{KernelList, KernelSource},
    products::KernelReaders,
    report::FIDELITY_FILE,
    spice::PATH_LENGTH_MAX,
    store::{
        page::{PAGE, SITES_PAGE},
        publish::staging_path,
    },
};

/// Longest component of a path that common file systems accept, bytes.
const PART_LENGTH_MAX: usize = 255;

/// Reasons why no products can be written into a folder.
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
    /// Folders cannot be made in it.
    #[error("--out is {}, which is not a folder", .out.display())]
    #[cause("name a folder for --out")]
    NoFolder {
        /// The path.
        out: PathBuf,
    },
    /// Products would be inputs of the next run, or inputs lie among products.
    #[error(
        "the output folder {} overlaps the input folder {}; expected separate folders",
        .out.display(), .input.display()
    )]
    #[cause(
        "name a folder for the products (--out) that neither contains inputs nor lies in an input folder"
    )]
    Overlap {
        /// The folder of all products, or of the site's products.
        out: PathBuf,
        /// A folder of inputs.
        input: PathBuf,
    },
    /// No file system accepts it.
    #[error(
        "--out has a path component of {bytes} bytes, {part:.20}…; expected at most {PART_LENGTH_MAX}"
    )]
    #[cause("name a folder with a shorter path for --out; a relative path is counted as written")]
    LongPart {
        /// The part.
        part: String,
        /// Its length.
        bytes: usize,
    },
    /// A kernel of an adjusted image has a path that CSPICE does not accept.
    #[error(
        "with this --out, the path of a product, {}, is {} bytes long during writing; CSPICE accepts at most \
         {PATH_LENGTH_MAX}",
        .product.display(), .product.as_os_str().len()
    )]
    #[cause(like = LongPart)]
    LongPath {
        /// The product.
        product: PathBuf,
    },
}

/// Ensures that the products of `sites` can be written into `out`, and replace no input.
///
/// # Errors
/// [`OutError`], of kind configuration; a page over all sites would replace a file that areograph did not write.
pub fn check_out(out: &Path, sites: &[SiteConfig]) -> Result<()> {
    check_out_path(out)?;
    for page in [SITES_PAGE, FIDELITY_FILE] {
        require_own(&out.join(page), &PAGE)?;
    }
    for site in sites {
        check_apart(out, site).in_site(&site.site)?;
    }
    for site in sites.iter().filter(|site| site.ties.are_there()) {
        let staging = staging_path(&out.join(&site.site));
        let ids = site.images.iter().map(|image| &*image.id);
        let kernels = ids.flat_map(|id| KernelReaders::ALL.map(|readers| readers.paths(id)));
        let products = kernels.flatten().map(|path| staging.join(path));
        let longest = products.max_by_key(|product| product.as_os_str().len());
        if let Some(product) = longest.filter(|path| path.as_os_str().len() > PATH_LENGTH_MAX) {
            return Err(OutError::LongPath { product }).in_site(&site.site);
        }
    }
    Ok(())
}

/// Ensures that products and inputs of a site are in separate folders.
///
/// A folder that is searched for kernels, with its subfolders, holds no products and is not among them. Products are
/// not in the folder of a single input either, unless the site file is in or below it: then inputs and products share
/// this folder.
fn check_apart(out: &Path, site: &SiteConfig) -> std::result::Result<(), OutError> {
    let products = out.join(&site.site);
    let apart = |meet: bool, out: &Path, input: &Path| {
        let overlap = || OutError::Overlap {
            out: out.to_owned(),
            input: input.to_owned(),
        };
        if meet { Err(overlap()) } else { Ok(()) }
    };
    if let KernelSource::Root(selection) = &site.kernels.source {
        let root = &selection.root;
        apart(overlap(&products, root), &products, root)?;
        apart(real_path(out).starts_with(real_path(root)), out, root)?;
    }
    let folder_of = |path: &Path| match path.parent() {
        Some(folder) if folder != Path::new("") => folder.to_owned(),
        _ => PathBuf::from("."),
    };
    let of_site = real_path(&folder_of(&site.file));
    let (real_out, real_products) = (real_path(out), real_path(&products));
    let mut folders: BTreeSet<PathBuf> = inputs(site).into_iter().map(folder_of).collect();
    folders.extend(site.calibration.from.clone());
    for folder in &folders {
        let real = real_path(folder);
        apart(real.starts_with(&real_products), &products, folder)?;
        let is_common = of_site.starts_with(&real);
        apart(!is_common && real_out.starts_with(&real), out, folder)?;
    }
    Ok(())
}

fn of_list(list: &KernelList) -> &[PathBuf] {
    match list {
        KernelList::Metakernel(path) => std::slice::from_ref(path),
        KernelList::Files(paths) => paths,
    }
}

/// The files that the site names.
fn inputs(site: &SiteConfig) -> Vec<&Path> {
    let kernels: Vec<&PathBuf> = match &site.kernels.source {
        KernelSource::Listed(list) => of_list(list).iter().collect(),
        KernelSource::Root(_) => Vec::new(),
        KernelSource::Sets(sets) => sets.iter().flat_map(|set| of_list(&set.list)).collect(),
    };
    let images = site.images.iter();
    let images = images.flat_map(|image| image.source().into_iter().chain(&image.pixels));
    let tables = site.shots.iter().flat_map(|table| &table.files);
    let files = site.pedr.files.iter().chain(tables).chain(&site.ties.files);
    let all = files.chain(images).chain(kernels);
    all.map(PathBuf::as_path).collect()
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
    if out.exists() && !out.is_dir() {
        let out = out.to_owned();
        return Err(OutError::NoFolder { out }.into());
    }
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
