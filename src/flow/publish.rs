//! The last stage: products staged, read back, named, and explained by the manifest.

use std::path::{Path, PathBuf};

use super::{
    Ending, Stage,
    choice::KernelChoice,
    manifest::{Account, kernel_entries, kernel_lines, pck_note},
    parts,
};
use crate::{
    config::SiteConfig,
    error::Result,
    products::{ImageProducts, SiteProducts, write_products},
    report,
    spice::{KernelSet, Session, Wanted},
    stages::{
        check_ranges::RangeCheck, convert_datum::Converted, fit_sensor_model::SensorModel,
        group_profiles::Profile, register::ImageRegistration, sample_orientation::Orientation,
        search_footprints::SearchResult, tag_times::ImageTimes,
    },
    store::{
        atomic,
        cache::{Output, StageCache},
        fingerprint::{Because, Parts},
        manifest::Manifest,
        publish::{
            MANIFEST, damaged_product, entries, publish as publish_files, read_manifest, staging,
        },
    },
    time::Et,
};

/// Metakernel that reproduces the run.
const METAKERNEL: &str = "kernels.tm";

/// Everything that the earlier stages made.
pub(super) struct Results<'a> {
    pub(super) config: &'a SiteConfig,
    pub(super) kernels: &'a KernelSet,
    pub(super) wanted: &'a Wanted,
    pub(super) choice: Option<&'a Output<KernelChoice>>,
    pub(super) images: &'a Output<Vec<ImageTimes>>,
    pub(super) found: &'a Output<SearchResult>,
    pub(super) converted: &'a Output<Converted>,
    pub(super) profiles: &'a Output<Vec<Profile>>,
    pub(super) ranges: &'a Output<RangeCheck>,
    pub(super) orientations: &'a [Output<Orientation>],
    pub(super) models: &'a [Output<SensorModel>],
    pub(super) registrations: &'a [Output<ImageRegistration>],
}

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
    let stages = published.stages.iter().map(|stage| &*stage.name);
    cache.keep_only(stages);
    Ok(Ending::Published(published))
}

fn make_products(folder: &Path, results: &Results<'_>, fingerprint: String) -> Result<Manifest> {
    let session = Session::open(results.kernels)?;
    let footprints = &results.converted.value.footprints;
    let utc = footprints
        .et_s
        .iter()
        .map(|et_s| session.et_to_utc(Et::from_seconds(*et_s)))
        .collect::<Result<Vec<String>>>()?;
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

    let images: Vec<ImageProducts<'_>> = results
        .images
        .value
        .iter()
        .zip(results.orientations)
        .zip(results.models)
        .zip(results.registrations)
        .map(
            |(((times, orientation), model), registration)| ImageProducts {
                times,
                orientation: &orientation.value,
                model: &model.value,
                registration: &registration.value,
            },
        )
        .collect();
    let complaints: Vec<String> = results
        .found
        .value
        .complaints
        .iter()
        .map(ToString::to_string)
        .collect();
    let rejected = results.rejected();
    let site = SiteProducts {
        config: results.config,
        kernels: &lines,
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
    };
    let (invalid_because, remarks) = (site.invalid_because(), site.remarks());
    let staging = staging(folder)?;
    let mut files: Vec<(PathBuf, u64)> = write_products(&staging, &site, &report::page(&site)?)?
        .into_iter()
        .map(|product| (product.path, product.rows))
        .collect();
    let metakernel = results.kernels.metakernel_text(Some(folder));
    atomic::write(&staging.join(METAKERNEL), metakernel.as_bytes())?;
    files.push((METAKERNEL.into(), 1));
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

impl Results<'_> {
    fn outputs(&self) -> Vec<(String, Option<String>)> {
        self.stages()
            .into_iter()
            .map(|(stage, output, _)| (stage, Some(output)))
            .collect()
    }

    /// Name, output hash and fingerprint of every stage that ran or was kept.
    pub(super) fn stages(&self) -> Vec<(String, String, String)> {
        fn entry<T>(name: String, output: &Output<T>) -> (String, String, String) {
            (name, output.blake3.clone(), output.fingerprint.clone())
        }
        let mut stages = vec![
            entry(Stage::TagTimes.name().to_owned(), self.images),
            entry(Stage::SearchFootprints.name().to_owned(), self.found),
            entry(Stage::ConvertDatum.name().to_owned(), self.converted),
            entry(Stage::GroupProfiles.name().to_owned(), self.profiles),
        ];
        let choice = self.choice.into_iter();
        stages.extend(choice.map(|choice| entry(Stage::ChooseKernels.name().to_owned(), choice)));
        stages.push(entry(Stage::CheckRanges.name().to_owned(), self.ranges));
        for (orientation, model) in self.orientations.iter().zip(self.models) {
            let image = &orientation.value.image;
            stages.push(entry(Stage::SampleOrientation.of_image(image), orientation));
            stages.push(entry(Stage::FitSensorModel.of_image(image), model));
        }
        for registration in self.registrations {
            let stage = Stage::Register.of_image(&registration.value.image);
            stages.push(entry(stage, registration));
        }
        stages
    }
}
