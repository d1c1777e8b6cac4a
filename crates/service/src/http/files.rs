//! Files of runs and logs: only those named in a manifest or the database, and only below their own folder.

use std::{
    fs::File,
    io::Read as _,
    path::{Component, Path, PathBuf},
};

use rustix::{
    fs::{CWD, Mode, OFlags, ResolveFlags, openat, openat2},
    io::Errno,
};

use super::problem::Problem;
use crate::database::shown::Run;
use areograph_store::{
    manifest::{Manifest, ProductEntry},
    publish::MANIFEST,
};

/// Longest accepted manifest.
const MANIFEST_MAX: u64 = 64 << 20;

/// A product that matches its manifest.
#[derive(Debug)]
pub(super) struct Product {
    pub(super) file: File,
    pub(super) entry: ProductEntry,
}

/// Folder of a run below the products folder.
fn run_folder(run: &Run) -> PathBuf {
    Path::new(&run.site).join("runs").join(&run.id)
}

/// The page that compares a run with its predecessor.
pub(super) fn difference(products: &Path, run: &Run) -> Result<Vec<u8>, Problem> {
    let path = Path::new(&run.site)
        .join("diffs")
        .join(format!("{}.html", run.id));
    let file = open_below(products, &path)?;
    let file =
        file.ok_or_else(|| Problem::not_found("This run was not compared with another one."))?;
    let mut page = Vec::new();
    file.take(MANIFEST_MAX)
        .read_to_end(&mut page)
        .map_err(Problem::internal)?;
    Ok(page)
}

/// Opens the file `path` below `folder`: no component may be a symbolic link or lead outside.
pub(super) fn open_below(folder: &Path, path: &Path) -> Result<Option<File>, Problem> {
    let plain = |part: Component<'_>| matches!(part, Component::Normal(_));
    if path.as_os_str().is_empty() || !path.components().all(plain) {
        return Ok(None);
    }
    let folder = match openat(
        CWD,
        folder,
        OFlags::PATH | OFlags::DIRECTORY | OFlags::CLOEXEC,
        Mode::empty(),
    ) {
        Ok(folder) => folder,
        Err(Errno::NOENT) => return Ok(None),
        Err(error) => return Err(Problem::internal(error)),
    };
    // Does not wait for a writer if it is a pipe.
    let flags = OFlags::RDONLY | OFlags::CLOEXEC | OFlags::NONBLOCK | OFlags::NOCTTY;
    let resolve = ResolveFlags::BENEATH | ResolveFlags::NO_SYMLINKS | ResolveFlags::NO_MAGICLINKS;
    let opened = match openat2(folder, path, flags, Mode::empty(), resolve) {
        Ok(opened) => File::from(opened),
        Err(
            Errno::NOENT
            | Errno::LOOP
            | Errno::XDEV
            | Errno::NOTDIR
            | Errno::NAMETOOLONG
            | Errno::INVAL,
        ) => {
            return Ok(None);
        }
        Err(error) => return Err(Problem::internal(error)),
    };
    let is_file = opened.metadata().map_err(Problem::internal)?.is_file();
    Ok(is_file.then_some(opened))
}

/// The manifest of a run, if it is the published one.
pub(super) fn manifest(products: &Path, run: &Run) -> Result<Manifest, Problem> {
    let bytes = manifest_bytes(products, run)?;
    serde_json::from_slice(&bytes)
        .map_err(|error| Problem::internal(format!("{}: {error}", run.id)))
}

fn manifest_bytes(products: &Path, run: &Run) -> Result<Vec<u8>, Problem> {
    if run.removed_utc.is_some() {
        return Err(Problem::new(
            axum::http::StatusCode::GONE,
            "The products of this run were removed, since they were too old to be kept.",
        ));
    }
    let file = open_below(products, &run_folder(run).join(MANIFEST))?;
    let file = file.ok_or_else(|| Problem::not_found("The products of this run are missing."))?;
    let mut bytes = Vec::new();
    file.take(MANIFEST_MAX)
        .read_to_end(&mut bytes)
        .map_err(Problem::internal)?;
    if blake3::hash(&bytes).to_hex().as_str() != run.manifest_blake3 {
        return Err(Problem::conflict(
            "The manifest of this run is not the one that was published; its products are withheld.",
        ));
    }
    Ok(bytes)
}

/// A product named in the manifest of a run, or the manifest itself.
pub(super) fn product(products: &Path, run: &Run, path: &str) -> Result<Product, Problem> {
    let no_product = || Problem::not_found("The manifest of this run lists no such product.");
    let entry = if path == MANIFEST {
        let bytes = manifest_bytes(products, run)?;
        ProductEntry {
            path: path.to_owned(),
            bytes: bytes.len() as u64,
            blake3: run.manifest_blake3.clone(),
            rows: 1,
        }
    } else {
        let manifest = manifest(products, run)?;
        let named = manifest
            .products
            .into_iter()
            .find(|entry| entry.path == path);
        named.ok_or_else(no_product)?
    };
    let file = open_below(products, &run_folder(run).join(&entry.path))?;
    let contradicts = || {
        Problem::conflict(
            "This product does not match its manifest; it is withheld. Run the site again.",
        )
    };
    let file = file.ok_or_else(contradicts)?;
    if file.metadata().map_err(Problem::internal)?.len() != entry.bytes {
        return Err(contradicts());
    }
    Ok(Product { file, entry })
}
