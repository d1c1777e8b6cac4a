//! Footprints of a published site in the formats of other programs, from its products.

use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::{
    config::ShotFormat,
    error::{Cause, IoError, Locate, Result},
    products::{PageData, export_footprints},
    store::published::{read_published_by_this_version, still_published},
};

/// Folder in which files are complete before they receive their names.
const STAGING: &str = ".areograph-export";

/// There is nothing to write.
#[derive(Debug, thiserror::Error, Cause)]
#[error("the site {site} has no footprints; expected at least one to export")]
#[cause(Input: "name the products of a site with shots in its windows")]
struct NoFootprints {
    site: String,
}

/// The folder of the products holds those that its manifest lists, and no others.
#[derive(Debug, thiserror::Error, Cause)]
#[error("this folder is among the products; expected another one")]
#[cause(Configuration: "give another folder with --to")]
struct AmongProducts;

/// A file may be another program's.
#[derive(Debug, thiserror::Error, Cause)]
#[error("the file exists; nothing was exported")]
#[cause(Configuration: "remove it, or give another folder with --to")]
struct Exists;

/// Files of an export.
#[derive(Debug)]
pub struct Exported {
    /// The site.
    pub site: String,
    /// The files.
    pub files: Vec<PathBuf>,
    /// Shots in each of them.
    pub shots: usize,
}

/// Writes the footprints of the site whose products are in `folder` to the folder `to`, which is made where missing, in
/// each of `formats`. The files are those that a run writes for `products.formats`.
///
/// # Errors
/// Products that are missing, damaged or of another version; a site without footprints; files of the same names; write
/// errors.
pub fn export_site(folder: &Path, formats: &[ShotFormat], to: &Path) -> Result<Exported> {
    let manifest = read_published_by_this_version(folder, |_| false)?;
    let data = PageData::read(folder)?;
    still_published(folder, &manifest)?;
    if is_within(to, folder)
        .map_err(IoError::on("find"))
        .in_file(to)?
    {
        return Err(AmongProducts).in_file(to);
    }
    fs::create_dir_all(to)
        .map_err(IoError::on("make the folder"))
        .in_file(to)?;
    let staging = to.join(STAGING);
    make_empty(&staging)?;
    let written = data.with(|site| {
        if site.footprints.is_empty() {
            let site = site.config.site.clone();
            return Err(NoFootprints { site }).in_file(folder);
        }
        let products = export_footprints(&staging, site, formats)?;
        Ok((products, site.footprints.len()))
    });
    let named = written.and_then(|(products, shots)| {
        let paths = products.iter().map(|product| to.join(&product.path));
        if let Some(existing) = paths.clone().find(|path| path.exists()) {
            return Err(Exists).in_file(existing);
        }
        let files = products.iter().zip(paths).map(|(product, path)| {
            fs::rename(staging.join(&product.path), &path)
                .map_err(IoError::on("name"))
                .in_file(&path)?;
            Ok(path)
        });
        Ok(Exported {
            site: manifest.site,
            files: files.collect::<Result<_>>()?,
            shots,
        })
    });
    // What is left of a failed export is of no use.
    let _left = fs::remove_dir_all(&staging);
    named
}

/// Whether `path`, of which the last folders may be missing, is `folder` or below it.
fn is_within(path: &Path, folder: &Path) -> std::io::Result<bool> {
    let path = std::path::absolute(path)?;
    let existing = path.ancestors().find(|ancestor| ancestor.exists());
    let existing = fs::canonicalize(existing.unwrap_or(&path))?;
    Ok(existing.starts_with(fs::canonicalize(folder)?))
}

/// Makes the folder anew: a killed export leaves its own.
fn make_empty(folder: &Path) -> Result<()> {
    if folder.exists() {
        fs::remove_dir_all(folder)
            .map_err(IoError::on("remove"))
            .in_file(folder)?;
    }
    fs::create_dir(folder)
        .map_err(IoError::on("make the folder"))
        .in_file(folder)
}
