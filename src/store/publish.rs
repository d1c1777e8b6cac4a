//! Staged products go under their final names, and products that are no longer made go away.

use std::{
    fs,
    path::{Path, PathBuf},
};

use super::{
    atomic,
    manifest::{Manifest, ProductEntry},
};
use crate::error::{Fault, IoFault, Kind, Place, Result};

/// Name of the manifest in a site's folder.
pub const MANIFEST: &str = "manifest.json";

/// A folder for half-made products inside the site's folder, hence on the same file system.
///
/// What an interrupted run left in it is removed.
///
/// # Errors
/// The folder cannot be emptied or made.
pub fn staging(site_folder: &Path) -> Result<PathBuf> {
    let folder = site_folder.join(".staging");
    if folder.exists() {
        fs::remove_dir_all(&folder)
            .map_err(IoFault::on("empty the folder"))
            .in_file(&folder)?;
    }
    fs::create_dir_all(&folder)
        .map_err(IoFault::on("create the folder"))
        .in_file(&folder)?;
    Ok(folder)
}

/// Hashes and flushes staged files, given as paths below `staging` with their rows.
///
/// # Errors
/// A file cannot be read or flushed.
pub fn entries(staging: &Path, files: &[(PathBuf, u64)]) -> Result<Vec<ProductEntry>> {
    files
        .iter()
        .map(|(relative, rows)| {
            let path = staging.join(relative);
            atomic::sync_file(&path)?;
            let (blake3, bytes) = atomic::hash_file(&path)?;
            Ok(ProductEntry {
                path: relative.to_string_lossy().replace('\\', "/"),
                bytes,
                blake3,
                rows: *rows,
            })
        })
        .collect()
}

/// Renames staged products into place, removes those of `earlier` that are gone, writes the manifest last.
///
/// # Errors
/// A file cannot be renamed or removed; running again mends the folder.
pub fn publish(
    site_folder: &Path,
    staging: &Path,
    manifest: &Manifest,
    earlier: Option<&Manifest>,
) -> Result<()> {
    for product in &manifest.products {
        let target = site_folder.join(&product.path);
        if let Some(folder) = target.parent() {
            fs::create_dir_all(folder)
                .map_err(IoFault::on("create the folder"))
                .in_file(folder)?;
        }
        fs::rename(staging.join(&product.path), &target)
            .map_err(IoFault::on("rename into place"))
            .in_file(&target)?;
    }
    for product in earlier.map_or(&[][..], |manifest| &manifest.products) {
        let still_made = manifest
            .products
            .iter()
            .any(|made| made.path == product.path);
        let path = site_folder.join(&product.path);
        if !still_made && path.exists() {
            fs::remove_file(&path)
                .map_err(IoFault::on("remove an outdated product"))
                .in_file(&path)?;
            // The folder of an image that is no longer configured goes with its last file.
            let _ = path.parent().map(fs::remove_dir);
        }
    }
    atomic::sync_folder(site_folder);
    atomic::write(&site_folder.join(MANIFEST), &manifest_bytes(manifest)?)?;
    fs::remove_dir_all(staging)
        .map_err(IoFault::on("remove the folder"))
        .in_file(staging)
}

/// A manifest that cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("the manifest cannot be written as JSON: {0}")]
struct Unwritable(serde_json::Error);

impl Fault for Unwritable {
    fn kind(&self) -> Kind {
        Kind::Bug
    }

    fn advice(&self) -> String {
        "this is a fault of areograph; please report it with the configuration".to_owned()
    }
}

fn manifest_bytes(manifest: &Manifest) -> Result<Vec<u8>> {
    let mut bytes = serde_json::to_vec_pretty(manifest).map_err(Unwritable)?;
    bytes.push(b'\n');
    Ok(bytes)
}

/// The manifest that lies in the folder, if it can be read.
#[must_use]
pub fn read_manifest(site_folder: &Path) -> Option<Manifest> {
    serde_json::from_slice(&fs::read(site_folder.join(MANIFEST)).ok()?).ok()
}

/// The first product that is missing or not what the manifest says.
#[must_use]
pub fn damaged_product(site_folder: &Path, manifest: &Manifest) -> Option<String> {
    manifest
        .products
        .iter()
        .find(|product| {
            atomic::hash_file(&site_folder.join(&product.path))
                .map_or(true, |(blake3, _)| blake3 != product.blake3)
        })
        .map(|product| product.path.clone())
}
