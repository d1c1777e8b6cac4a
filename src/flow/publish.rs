//! The last stage: products staged, read back, named, and explained by the manifest.

use std::path::{Path, PathBuf};

use super::{
    Ending, Stage,
    manifest::{Account, kernel_entries, kernel_lines, pck_note},
    parts,
    results::Results,
};
use crate::{
    error::Result,
    products::{SiteProducts, write_products},
    report,
    spice::Session,
    store::{
        cache::{Output, StageCache},
        fingerprint::{Because, Parts},
        manifest::Manifest,
        publish::{
            MANIFEST, damaged_product, entries, publish as publish_files, read_manifest, staging,
        },
    },
    time::Et,
};

/// The products that stand for these parts, or why they have to be made.
pub(super) fn standing(
    folder: &Path,
    cache: &StageCache,
    parts: &Parts,
) -> std::result::Result<Manifest, Because> {
    let output: Output<Manifest> = cache.load(Stage::Publish.name(), parts)?;
    let manifest = output.value;
    if read_manifest(folder).as_ref() != Some(&manifest) {
        return Err(Because::Moved(vec![format!(
            "{MANIFEST} is missing or was changed"
        )]));
    }
    match damaged_product(folder, &manifest) {
        Some(path) => Err(Because::Moved(vec![format!(
            "{path} is missing or was changed"
        )])),
        None => Ok(manifest),
    }
}

/// Publishes the products unless those of an earlier run stand.
///
/// # Errors
/// A kernel that changed during the run, a product that does not read back, a disk that refuses.
pub(super) fn publish(folder: &Path, cache: &StageCache, results: &Results<'_>) -> Result<Ending> {
    let name = Stage::Publish.name();
    let parts = parts::publish(results.config, results.kernels, folder, results.outputs());
    match standing(folder, cache, &parts) {
        Ok(manifest) => {
            tracing::info!(stage = name, "kept: {}", Because::Unchanged);
            return Ok(Ending::Unchanged(manifest));
        }
        Err(because) => tracing::info!(stage = name, "running: {because}"),
    }
    let fingerprint = parts.fingerprint();
    let manifest = make_products(folder, results, fingerprint)?;
    let published = cache.store(name, parts, manifest)?.value;
    tracing::info!(
        stage = name,
        products = published.products.len(),
        "published"
    );
    let stages = published.stages.iter().map(|stage| &*stage.name);
    cache.keep_only(stages);
    Ok(Ending::Published(published))
}

fn make_products(folder: &Path, results: &Results<'_>, fingerprint: String) -> Result<Manifest> {
    let session = Session::open(results.kernels)?;
    let footprints = &results.converted.value.footprints;
    let utc = utc(&session, &footprints.et_s)?;
    let notes = results.notes();
    let warnings: Vec<String> = pck_note(&session, &results.wanted.positions)
        .into_iter()
        .collect();
    for warning in &warnings {
        tracing::warn!("{warning}");
    }
    let kernels = kernel_entries(&session, results)?;
    let lines = kernel_lines(&session, results.kernels)?;
    drop(session);

    let (images, complaints, rejected) = (
        results.image_products(),
        results.complaints(),
        results.rejected(),
    );
    let adjusted_images = results.adjusted_image_products();
    let site = SiteProducts {
        config: results.config,
        kernels: &lines,
        metakernel: &results.kernels.metakernel_text(Some(folder)),
        wanted: results.wanted,
        images: &images,
        conversions: &results.converted.value.files,
        footprints,
        utc: &utc,
        profiles: &results.profiles.value,
        ranges: &results.ranges.value,
        rejected: &rejected,
        complaints: &complaints,
        notes: &notes,
        warnings: &warnings,
        geometric: results.geometric_products(folder, &adjusted_images),
    };
    let (invalid_because, remarks) = (site.invalid_because(), site.remarks());
    let staging = staging(folder)?;
    let files: Vec<(PathBuf, u64)> = write_products(&staging, &site, &report::page(&site)?)?
        .into_iter()
        .map(|product| (product.path, product.rows))
        .collect();
    results.kernels.verify_unchanged()?;

    let account = Account {
        invalid_because,
        kernels,
        products: entries(&staging, &files)?,
        notes,
        remarks,
        complaints,
    };
    let manifest = results.manifest(account, fingerprint);
    publish_files(folder, &staging, &manifest)?;
    Ok(manifest)
}

/// Digits of a second in the UTC of shots: programs take the time from it, and MGS flies 3 m in a millisecond.
const SHOT_UTC_DECIMALS: u8 = 6;

fn utc(session: &Session, et_s: &[f64]) -> Result<Vec<String>> {
    let instants = et_s.iter().copied().map(Et::from_seconds);
    instants
        .map(|et| session.et_to_utc_with(et, SHOT_UTC_DECIMALS))
        .collect()
}
