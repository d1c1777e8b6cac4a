//! Footprints of a published site in the formats of other programs, from its products.

use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::{
    capabilities::declarations,
    config::ShotFormat,
    error::{Cause, IoError, Locate, Result},
    files::PartialFolder,
    products::{PageData, SiteProducts, export_footprints, exported_names},
    store::{
        atomic,
        publish::read_manifest,
        published::{read_published_by_this_version, still_published},
    },
};

/// Reasons why nothing is exported.
#[derive(Debug, thiserror::Error, Cause)]
enum ExportError {
    /// There is nothing to write.
    #[error("the site {site} has no footprints; expected at least one to export")]
    #[cause(Input: "name the products of a site with shots in its windows")]
    NoFootprints { site: String },
    /// Such a folder contains what its manifest lists, and nothing else.
    #[error("this folder is among the products of a site; expected a different folder")]
    #[cause(Configuration: "give another folder with --to")]
    AmongProducts,
    /// The file may be another program's.
    #[error("the file exists; nothing was exported")]
    #[cause(Configuration: "remove the file, or give another folder with --to")]
    Exists,
}

/// Files of an export.
#[derive(Debug)]
pub struct Exported {
    /// The site.
    pub site: String,
    /// The files with their numbers of shots, 0 for files that describe others.
    pub files: Vec<(PathBuf, u64)>,
}

/// Writes the footprints of the site whose products are in `folder` to the folder `to`, by default `SITE_export`, which is
/// created if missing, in each of `formats`. A run writes the same files for `products.formats`.
///
/// # Errors
/// Products that are missing, damaged or of a different version; a site without footprints; files of the same names;
/// write errors.
pub fn export_site(folder: &Path, formats: &[ShotFormat], to: Option<&Path>) -> Result<Exported> {
    let manifest = read_published_by_this_version(folder, |_| false)?;
    let data = PageData::without_tables(folder)?;
    still_published(folder, &manifest)?;
    let site = manifest.site;
    let to = to.map_or_else(|| format!("{site}_export").into(), Path::to_owned);
    let files = data.with(declarations(), |products| {
        if products.footprints.is_empty() {
            let site = site.clone();
            return Err(ExportError::NoFootprints { site }).in_file(folder);
        }
        write(products, formats, &to)
    })?;
    Ok(Exported { site, files })
}

/// Writes the files beside their places and gives them their names when all are complete.
fn write(site: &SiteProducts, formats: &[ShotFormat], to: &Path) -> Result<Vec<(PathBuf, u64)>> {
    require_outside(to)?;
    fs::create_dir_all(to)
        .map_err(IoError::on("make the folder"))
        .in_file(to)?;
    // Now that it exists, without links and `..`.
    require_outside(to)?;
    for name in exported_names(formats) {
        let path = to.join(name);
        if path.symlink_metadata().is_ok() {
            return Err(ExportError::Exists).in_file(path);
        }
    }
    let draft = PartialFolder::new_in(to)
        .map_err(IoError::on("make a temporary folder in"))
        .in_file(to)?;
    let products = export_footprints(draft.path(), site, formats)?;
    let written = products.iter();
    let written: Vec<PathBuf> = written
        .map(|product| draft.path().join(&product.path))
        .collect();
    atomic::sync_files(&written)?;
    let files = products.into_iter().map(|product| {
        let path = to.join(&product.path);
        fs::rename(draft.path().join(&product.path), &path)
            .map_err(IoError::on("name"))
            .in_file(&path)?;
        Ok((path, product.rows))
    });
    let files = files.collect::<Result<_>>()?;
    atomic::sync_folder(to);
    Ok(files)
}

/// Requires that `folder`, of which the last parts may be missing, is not among the products of a site.
fn require_outside(folder: &Path) -> Result<()> {
    let existing = || {
        let path = std::path::absolute(folder)?;
        let existing = path.ancestors().find(|ancestor| ancestor.exists());
        fs::canonicalize(existing.unwrap_or(&path))
    };
    let existing = existing().map_err(IoError::on("find")).in_file(folder)?;
    if existing
        .ancestors()
        .any(|ancestor| read_manifest(ancestor).is_some())
    {
        return Err(ExportError::AmongProducts).in_file(folder);
    }
    Ok(())
}
