//! Gives staged products their final names, and removes products that are no longer made.
//!
//! Renaming many files is not atomic, so a journal records that it has begun and which files it may affect. While the
//! journal exists there is no manifest: without a manifest a reader has no products. The next publication completes
//! the work of a journal that it finds.
//!
//! The manifest comes last, and the next run checks every product against it.

use std::{
    collections::BTreeSet,
    fs, io,
    ops::Deref,
    path::{Component, Path, PathBuf},
};

use rayon::prelude::*;

use super::{
    atomic,
    cache::stored,
    manifest::{Manifest, ProductEntry},
};
use crate::files::{InputFiles, hash_file, short_hash};
use areograph_base::error::{Cause, IoError, Locate, Result};

pub use super::manifest::MANIFEST;

/// Name of the last stage of every flow.
const PUBLISH: &str = "publish";

/// Name of the folder of stored stages.
pub const CACHE: &str = ".cache";

/// Name of the folder of incomplete products.
const STAGING: &str = ".staging";

/// Empty file by which that folder is recognised.
const STAGING_MARK: &str = ".areograph";

/// Paths below the site's folder that a publication in progress may have created or will remove.
pub(super) const JOURNAL: &str = ".publishing";

/// The manifest of the products that preceded the present ones.
pub const PREVIOUS: &str = ".previous.json";

/// Reason why the last run of the site failed; absent after a successful run.
const FAILED: &str = ".failed";

/// Stores why a run of the site failed, for the page over all sites; `None` if it succeeded.
///
/// Write errors are ignored here: the caller reports the failure itself.
pub fn note_failure(site_folder: &Path, failure: Option<&str>) {
    let path = site_folder.join(FAILED);
    if let Some(text) = failure {
        let _ = atomic::write(&path, text.as_bytes());
    } else {
        let _ = fs::remove_file(path);
    }
}

/// Reason why the last run of the site failed.
#[must_use]
pub fn last_failure(site_folder: &Path) -> Option<String> {
    fs::read_to_string(site_folder.join(FAILED)).ok()
}

/// Folder in which products of a site are made.
#[must_use]
pub fn staging_path(site_folder: &Path) -> PathBuf {
    site_folder.join(STAGING)
}

/// A folder for incomplete products, which is removed with this value.
#[derive(Debug)]
pub struct Staging {
    folder: PathBuf,
}

impl Deref for Staging {
    type Target = Path;

    fn deref(&self) -> &Path {
        &self.folder
    }
}

impl Drop for Staging {
    fn drop(&mut self) {
        // After a publication it no longer exists; the next run removes files that cannot be removed now.
        let _ = remove_marked(&self.folder);
    }
}

/// An empty folder for incomplete products inside the site's folder, hence on the same file system.
///
/// # Errors
/// The folder cannot be created, or an earlier one could not be removed.
pub fn staging(site_folder: &Path) -> Result<Staging> {
    let folder = site_folder.join(STAGING);
    fs::create_dir(&folder)
        .map_err(IoError::on("create the folder"))
        .in_file(&folder)?;
    let staging = Staging { folder };
    let mark = staging.join(STAGING_MARK);
    fs::File::create(&mark)
        .map_err(IoError::on("create"))
        .in_file(&mark)?;
    Ok(staging)
}

/// Removes the incomplete products of a killed run; a folder of another program remains.
pub(super) fn remove_staging(site_folder: &Path) {
    let folder = site_folder.join(STAGING);
    // Files that cannot be removed are reported when publishing.
    let _ = if folder.join(STAGING_MARK).is_file() {
        remove_marked(&folder)
    } else {
        fs::remove_dir(folder)
    };
}

/// Removes a folder with the mark. The mark goes last: whoever is killed meanwhile leaves a folder that the next run
/// recognises.
fn remove_marked(folder: &Path) -> io::Result<()> {
    let mark = folder.join(STAGING_MARK);
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            fs::remove_dir_all(entry.path())?;
        } else if entry.path() != mark {
            fs::remove_file(entry.path())?;
        }
    }
    match fs::remove_file(mark) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => fs::remove_dir(folder),
    }
}

/// Whether a run ever worked in the folder: it contains stored stages or a publication in progress.
#[must_use]
pub fn has_work(site_folder: &Path) -> bool {
    [CACHE, STAGING, JOURNAL, FAILED]
        .iter()
        .any(|name| site_folder.join(name).exists())
}

/// Hashes and flushes staged files, given as paths below `staging` with their rows.
///
/// # Errors
/// A file cannot be read or flushed.
pub fn entries(staging: &Path, files: &[(PathBuf, u64)]) -> Result<Vec<ProductEntry>> {
    let paths = files.iter().map(|(relative, _)| staging.join(relative));
    atomic::sync_files(&paths.collect::<Vec<_>>())?;
    files
        .par_iter()
        .map(|(relative, rows)| {
            let (blake3, bytes) = hash_file(&staging.join(relative))?;
            Ok(ProductEntry {
                path: relative.to_string_lossy().replace('\\', "/"),
                bytes,
                blake3,
                rows: *rows,
            })
        })
        .collect()
}

/// Products of a different kind in the folder, which a publication would remove.
#[derive(Debug, thiserror::Error, Cause)]
#[error("the folder contains other products: {name}, created by {stage}")]
#[cause(Configuration: "choose a different name, or a different folder for the products (--out)")]
struct OtherKind {
    name: String,
    stage: String,
}

/// Keys by one of which a configuration names what it describes. Matches and archives have no configuration.
const NAMING_KEYS: [&str; 3] = ["site", "net", "calibration"];

/// Whether two manifests are of one flow: by the key that names what they describe, or by a stage.
fn is_same_kind(standing: &Manifest, next: &Manifest) -> bool {
    let kinds = [standing, next].map(|of| {
        let mut keys = NAMING_KEYS.iter();
        keys.find(|key| of.configuration.keys.contains_key(**key))
    });
    if let [Some(standing), Some(next)] = kinds {
        return standing == next;
    }
    let own = standing.stages.iter().filter(|of| of.name != PUBLISH);
    let mut own = own.map(|of| &of.name);
    own.any(|name| next.stages.iter().any(|of| of.name == *name))
}

/// Ensures that existing products in the folder were made by the same flow.
fn require_same_kind(site_folder: &Path, next: &Manifest) -> Result<()> {
    let Some(standing) = read_manifest(site_folder) else {
        return Ok(());
    };
    if is_same_kind(&standing, next) {
        return Ok(());
    }
    let own = standing.stages.iter().filter(|stage| stage.name != PUBLISH);
    match own.into_iter().next() {
        Some(stage) => Err(OtherKind {
            name: standing.site.clone(),
            stage: stage.name.clone(),
        })
        .in_file(site_folder),
        None => Ok(()),
    }
}

/// A file in the place of a product that no record of areograph names.
#[derive(Debug, thiserror::Error, Cause)]
#[error(
    "occupies the path of a product, but was not written by areograph; expected a new path, or a product of an earlier run"
)]
#[cause(Configuration: "move the file, or choose a different folder for the products (--out)")]
struct InPlaceOfProduct;

/// Ensures that a publication replaces only products, or files that equal them.
fn refuse_foreign(site_folder: &Path, next: &Manifest, earlier: &BTreeSet<String>) -> Result<()> {
    let mut known = earlier.clone();
    let records = [
        read_previous(site_folder),
        stored::<String>(&site_folder.join(CACHE), PUBLISH)
            .and_then(|text| serde_json::from_str(&text).ok()),
    ];
    let records: Vec<Manifest> = records.into_iter().flatten().collect();
    let of_records = records.iter().flat_map(|record| &record.products);
    known.extend(of_records.map(|product| product.path.clone()));
    let manifest = site_folder.join(MANIFEST);
    known.extend(paths_of_damaged(&manifest));
    if known.is_empty() && fs::symlink_metadata(&manifest).is_ok() {
        return Err(InPlaceOfProduct).in_file(manifest);
    }
    for product in &next.products {
        let path = site_folder.join(&product.path);
        if known.contains(&product.path) || fs::symlink_metadata(&path).is_err() {
            continue;
        }
        if hash_file(&path)
            .ok()
            .is_none_or(|(blake3, _)| blake3 != product.blake3)
        {
            return Err(InPlaceOfProduct).in_file(path);
        }
    }
    Ok(())
}

/// Products that a manifest of areograph names, even if it cannot be parsed.
fn paths_of_damaged(manifest: &Path) -> Vec<String> {
    let bytes = fs::read(manifest).unwrap_or_default();
    let text = String::from_utf8_lossy(&bytes);
    let path_of = |line: &str| {
        let path = line.trim().strip_prefix("\"path\": \"")?;
        Some(path.trim_end_matches(',').trim_end_matches('"').to_owned())
    };
    if text.contains("\"tool\": \"areograph\"") {
        text.lines().filter_map(path_of).collect()
    } else {
        Vec::new()
    }
}

/// Renames staged products into place, removes earlier ones that are no longer made, writes the manifest last.
///
/// # Errors
/// Products of a different kind; a file in the place of a product that areograph did not write; a file that cannot be
/// renamed or removed: publishing again repairs the folder.
pub fn publish(site_folder: &Path, staging: &Path, manifest: &Manifest) -> Result<()> {
    require_same_kind(site_folder, manifest)?;
    let made: BTreeSet<&str> = manifest
        .products
        .iter()
        .map(|product| &*product.path)
        .collect();
    let earlier = earlier_products(site_folder);
    refuse_foreign(site_folder, manifest, &earlier)?;
    let concerned: Vec<&str> = made
        .iter()
        .copied()
        .chain(earlier.iter().map(|path| &**path))
        .collect();
    keep_previous(site_folder, manifest)?;
    let journal = site_folder.join(JOURNAL);
    atomic::write(&journal, concerned.join("\n").as_bytes())?;
    remove_if_there(&site_folder.join(MANIFEST))?;

    let mut folders = BTreeSet::from([site_folder.to_owned()]);
    for path in &made {
        let target = site_folder.join(path);
        let folder = target.parent().unwrap_or(site_folder).to_owned();
        fs::create_dir_all(&folder)
            .map_err(IoError::on("create the folder"))
            .in_file(&folder)?;
        fs::rename(staging.join(path), &target)
            .map_err(IoError::on("rename into place"))
            .in_file(&target)?;
        folders.insert(folder);
    }
    for path in earlier.iter().filter(|path| !made.contains(&***path)) {
        let path = site_folder.join(path);
        remove_if_there(&path)?;
        // The folder of an image that is no longer configured is removed with its last file.
        let _ = path.parent().map(fs::remove_dir);
    }
    for folder in &folders {
        atomic::sync_folder(folder);
    }
    atomic::write(&site_folder.join(MANIFEST), &manifest_bytes(manifest)?)?;
    remove_if_there(&journal)?;
    remove_marked(staging)
        .map_err(IoError::on("remove the folder"))
        .in_file(staging)
}

/// Keeps the manifest of the folder, if its products differ from the products of `next`.
fn keep_previous(site_folder: &Path, next: &Manifest) -> Result<()> {
    match read_manifest(site_folder) {
        Some(standing) if standing.products != next.products => {
            atomic::write(&site_folder.join(PREVIOUS), &manifest_bytes(&standing)?)
        }
        _ => Ok(()),
    }
}

/// The manifest of the preceding products; `None` for the first ones.
#[must_use]
pub fn read_previous(site_folder: &Path) -> Option<Manifest> {
    let text = fs::read_to_string(site_folder.join(PREVIOUS)).ok()?;
    serde_json::from_str(&text).ok()
}

/// Products that earlier runs may have left, from the manifest and an unfinished journal.
///
/// Paths that lead out of the site's folder, which areograph never writes, are left out.
fn earlier_products(site_folder: &Path) -> BTreeSet<String> {
    let journal = fs::read_to_string(site_folder.join(JOURNAL)).unwrap_or_default();
    let manifest = read_manifest(site_folder).map_or_else(Vec::new, |manifest| manifest.products);
    let inside = |path: &String| {
        let mut components = Path::new(path).components();
        components.all(|component| matches!(component, Component::Normal(_)))
    };
    journal
        .lines()
        .map(str::to_owned)
        .chain(manifest.into_iter().map(|product| product.path))
        .filter(|path| !path.is_empty() && inside(path))
        .collect()
}

fn remove_if_there(path: &Path) -> Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(IoError::on("remove")(error)).in_file(path)
        }
        _ => Ok(()),
    }
}

/// A manifest that cannot be written.
#[derive(Debug, thiserror::Error, Cause)]
#[error("the manifest cannot be written as JSON: {0}")]
#[cause(Bug: "this is a bug in areograph; please report it with the configuration")]
struct Unwritable(serde_json::Error);

fn manifest_bytes(manifest: &Manifest) -> Result<Vec<u8>> {
    let mut bytes = serde_json::to_vec_pretty(manifest).map_err(Unwritable)?;
    bytes.push(b'\n');
    Ok(bytes)
}

/// The manifest of the folder, if it can be read.
#[must_use]
pub fn read_manifest(site_folder: &Path) -> Option<Manifest> {
    serde_json::from_slice(&fs::read(site_folder.join(MANIFEST)).ok()?).ok()
}

/// Products that differ from the manifest, with the difference, or why they cannot be read.
pub(super) fn damaged<'a>(
    site_folder: &Path,
    manifest: &'a Manifest,
) -> impl Iterator<Item = (&'a ProductEntry, Result<String>)> {
    let hash = |path: &Path| hash_file(path);
    differing(site_folder, manifest, hash)
}

/// The first product that is missing or differs from the manifest; `files` knows those that are unchanged.
#[must_use]
pub fn damaged_product(
    site_folder: &Path,
    manifest: &Manifest,
    files: &InputFiles,
) -> Option<String> {
    let (product, _) = differing_product(site_folder, manifest, files)?;
    Some(product.path.clone())
}

/// This product, with the difference, or why it cannot be read.
pub(super) fn differing_product<'a>(
    site_folder: &Path,
    manifest: &'a Manifest,
    files: &InputFiles,
) -> Option<(&'a ProductEntry, Result<String>)> {
    let hash = |path: &Path| files.hash(path).map(|file| (file.blake3, file.bytes));
    differing(site_folder, manifest, hash).next()
}

fn differing<'a>(
    site_folder: &Path,
    manifest: &'a Manifest,
    hash: impl Fn(&Path) -> Result<(String, u64)>,
) -> impl Iterator<Item = (&'a ProductEntry, Result<String>)> {
    manifest.products.iter().filter_map(move |product| {
        let path = site_folder.join(&product.path);
        let found = match hash(&path) {
            Ok((blake3, _)) if blake3 == product.blake3 => return None,
            Ok((blake3, bytes)) => Ok(format!(
                "has {bytes} bytes with the hash {}",
                short_hash(&blake3)
            )),
            Err(_) if !path.exists() => Ok("is missing".to_owned()),
            Err(failure) => Err(failure),
        };
        Some((product, found))
    })
}
