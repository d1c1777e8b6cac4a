//! Files of runs and logs: only those named in a manifest or the database, and only below their own folder.

use std::{
    fs::File,
    io::Read as _,
    path::{Path, PathBuf},
    sync::Arc,
};

use super::{
    app::{App, blocking},
    problem::Problem,
};
use crate::{
    contents::{Contents, open_below},
    database::shown::Run,
    engine::damage::{Damage, is_known_damage, note_damage},
};
use areograph_store::{
    files::Identity,
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
    /// As it was when its content was read.
    pub(super) identity: Identity,
}

/// Whether the content of a file has not been written since; a link to it may have come or gone.
pub(super) fn is_unwritten(file: &File, before: &Identity) -> bool {
    let now = file.metadata().map(|now| Identity::of(&now));
    now.is_ok_and(|now| (now.bytes, now.modified) == (before.bytes, before.modified))
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
    let file = open_below(products, &path).map_err(Problem::internal)?;
    let file =
        file.ok_or_else(|| Problem::not_found("This run has not been compared with another run."))?;
    let mut page = Vec::new();
    file.take(MANIFEST_MAX)
        .read_to_end(&mut page)
        .map_err(Problem::internal)?;
    Ok(page)
}

/// A product that cannot be given out.
#[derive(Debug)]
enum Withheld {
    /// For a reason that concerns the request or the disk.
    Problem(Problem),
    /// It does not match its manifest, or the manifest is not the published one.
    Damaged(String),
}

impl From<Problem> for Withheld {
    fn from(problem: Problem) -> Self {
        Self::Problem(problem)
    }
}

impl From<std::io::Error> for Withheld {
    fn from(error: std::io::Error) -> Self {
        Self::Problem(Problem::internal(error))
    }
}

/// The manifest of a run, if it is the published one.
pub(super) fn manifest(products: &Path, run: &Run) -> Result<Manifest, Problem> {
    read_manifest(products, run).map_err(|withheld| match withheld {
        Withheld::Problem(problem) => problem,
        Withheld::Damaged(what) => conflict(&what),
    })
}

fn read_manifest(products: &Path, run: &Run) -> Result<Manifest, Withheld> {
    let bytes = manifest_bytes(products, run)?;
    serde_json::from_slice(&bytes)
        .map_err(|error| Problem::internal(format!("{}: {error}", run.id)).into())
}

fn manifest_bytes(products: &Path, run: &Run) -> Result<Vec<u8>, Withheld> {
    if run.removed_utc.is_some() {
        let text = "The products of this run were removed, since they were too old to be kept.";
        return Err(Problem::new(axum::http::StatusCode::GONE, text).into());
    }
    let file = open_below(products, &run_folder(run).join(MANIFEST))?;
    let file = file.ok_or_else(|| Problem::not_found("The products of this run are missing."))?;
    let mut bytes = Vec::new();
    file.take(MANIFEST_MAX).read_to_end(&mut bytes)?;
    if blake3::hash(&bytes).to_hex().as_str() != run.manifest_blake3 {
        let what = "the manifest of this run differs from the published manifest";
        return Err(Withheld::Damaged(what.to_owned()));
    }
    Ok(bytes)
}

fn conflict(what: &str) -> Problem {
    let mut sentence = what.to_owned();
    if let Some(first) = sentence.get_mut(..1) {
        first.make_ascii_uppercase();
    }
    Problem::conflict(format!(
        "{sentence}; it is withheld. Run the site again, or restore this run from a copy."
    ))
}

/// A product named in the manifest of a run, or the manifest itself, with the content that the manifest states. A
/// damaged one is withheld and reported.
pub(super) async fn product(app: &App, run: Run, path: String) -> Result<Product, Problem> {
    let (shared, config) = (Arc::clone(&app.shared), app.config());
    let (run, found) = blocking(move || {
        let found = open_product(&shared.contents, &config.outputs.products, &run, &path);
        (run, found)
    })
    .await?;
    match found {
        Ok(product) => Ok(product),
        Err(Withheld::Problem(problem)) => Err(problem),
        Err(Withheld::Damaged(what)) => {
            report(app, &run, &what).await?;
            Err(conflict(&what))
        }
    }
}

/// Whether the product `path` of the run `id` has the content that its manifest states, if the manifest lists it.
pub(super) async fn require_whole(app: &App, run: Run, path: &str) -> Result<(), Problem> {
    let run_id = run.id.clone();
    match product(app, run, path.to_owned()).await {
        Err(problem) if problem.status == axum::http::StatusCode::CONFLICT => {
            let detail = format!("Run {run_id}: {}", problem.detail);
            Err(Problem::conflict(detail))
        }
        Err(problem) if problem.status != axum::http::StatusCode::NOT_FOUND => Err(problem),
        _ => Ok(()),
    }
}

/// Reports a damaged product, once.
async fn report(app: &App, run: &Run, what: &str) -> Result<(), Problem> {
    let (id, config, now_ms) = (run.id.clone(), app.config(), app.now_ms());
    let known = app
        .read({
            let id = id.clone();
            move |connection| is_known_damage(connection, &id)
        })
        .await?;
    if known {
        return Ok(());
    }
    let (site, what) = (run.site.clone(), what.to_owned());
    app.write(move |transaction| {
        let damage = Damage {
            site: &site,
            run: &id,
            products: 1,
            what: &what,
        };
        note_damage(transaction, &config, now_ms, &damage)
    })
    .await
}

fn open_product(
    contents: &Contents,
    products: &Path,
    run: &Run,
    path: &str,
) -> Result<Product, Withheld> {
    let entry = if path == MANIFEST {
        let bytes = manifest_bytes(products, run)?;
        ProductEntry {
            path: path.to_owned(),
            bytes: bytes.len() as u64,
            blake3: run.manifest_blake3.clone(),
            rows: 1,
        }
    } else {
        let listed = read_manifest(products, run)?.products.into_iter();
        let mut named = listed.filter(|entry| entry.path == path);
        named.next().ok_or_else(|| {
            Problem::not_found("The manifest of this run does not list this product.")
        })?
    };
    let damaged = || Withheld::Damaged(format!("`{}` does not match its manifest", entry.path));
    let file = open_below(products, &run_folder(run).join(&entry.path))?.ok_or_else(damaged)?;
    let identity = Identity::of(&file.metadata()?);
    // A file of a different length need not be read.
    if identity.bytes != entry.bytes {
        return Err(damaged());
    }
    if !contents.of(&file)?.is(entry.bytes, &entry.blake3) {
        return Err(damaged());
    }
    Ok(Product {
        file,
        entry,
        identity,
    })
}
