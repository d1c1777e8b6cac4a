//! The last stage: products staged, read back, named, and explained by the manifest.

use std::{collections::BTreeMap, path::Path};

use super::{Ending, Stage, parts};
use crate::{
    config::{BiasScope, SiteConfig},
    error::Result,
    files::file_name,
    frames::MarsIau2000,
    geom::mars_rotation::mars_rotation,
    products::{ImageProducts, KernelLine, SiteProducts, write_products},
    spice::{KernelSet, Session},
    stages::{
        check_ranges::RangeCheck, convert_datum::Converted, fit_sensor_model::SensorModel,
        group_profiles::Profile, sample_orientation::Orientation, search_footprints::SearchResult,
        tag_times::ImageTimes,
    },
    store::{
        cache::{Output, StageCache},
        fingerprint::{Because, Parts},
        manifest::{
            BiasEntry, Complaints, ConfigurationEntry, KernelEntry, Manifest, StageEntry, Verdict,
        },
        publish::{
            MANIFEST, damaged_product, entries, publish as publish_files, read_manifest, staging,
        },
    },
    time::{Et, Interval, Intervals},
};

/// Complaints that the manifest quotes; all are counted.
const COMPLAINTS_QUOTED: usize = 100;

/// A PCK that turns Mars by more than this against the IAU 2000 formula holds another model, radians
/// (1e-7 rad is 0.3 m on the ground; the models differ by 4e-3 rad).
const PCK_TOLERANCE_RAD: f64 = 1e-7;

/// Everything that the earlier stages made.
pub(super) struct Results<'a> {
    pub(super) config: &'a SiteConfig,
    pub(super) kernels: &'a KernelSet,
    pub(super) wanted: &'a [Interval],
    pub(super) images: &'a Output<Vec<ImageTimes>>,
    pub(super) found: &'a Output<SearchResult>,
    pub(super) converted: &'a Output<Converted>,
    pub(super) profiles: &'a Output<Vec<Profile>>,
    pub(super) ranges: &'a Output<RangeCheck>,
    pub(super) orientations: &'a [Output<Orientation>],
    pub(super) models: &'a [Output<SensorModel>],
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
    let parts = parts::publish(results.config, results.kernels, results.outputs());
    match standing(folder, cache, &parts) {
        Ok(manifest) => {
            tracing::info!(stage = name, "kept: {}", Because::Unchanged);
            return Ok(Ending::Unchanged(manifest));
        }
        Err(because) => {
            tracing::info!(stage = name, "making products: {because}");
            cache.forget(name);
        }
    }
    let fingerprint = parts.fingerprint();
    let manifest = cache.stage(name, parts, || make_products(folder, results, fingerprint))?;
    Ok(Ending::Published(manifest.value))
}

fn make_products(folder: &Path, results: &Results<'_>, fingerprint: String) -> Result<Manifest> {
    let session = Session::open(results.kernels)?;
    let footprints = &results.converted.value.footprints;
    let utc = footprints
        .et_s
        .iter()
        .map(|et_s| session.et_to_utc(Et::from_seconds(*et_s)))
        .collect::<Result<Vec<String>>>()?;
    let mut notes = results.notes();
    notes.extend(pck_note(&session, results.wanted));
    let kernels = kernel_entries(&session, results)?;
    drop(session);

    let lines: Vec<KernelLine> = kernels
        .iter()
        .map(|kernel| KernelLine {
            name: kernel.name.clone(),
            role: kernel.role.clone(),
            bytes: kernel.bytes,
            blake3: kernel.blake3.clone(),
        })
        .collect();
    let images: Vec<ImageProducts<'_>> = results
        .images
        .value
        .iter()
        .zip(results.orientations)
        .zip(results.models)
        .map(|((times, orientation), model)| ImageProducts {
            times,
            orientation: &orientation.value,
            model: &model.value,
        })
        .collect();
    let complaints: Vec<String> = results
        .found
        .value
        .complaints
        .iter()
        .map(ToString::to_string)
        .collect();
    let rejected = results.rejected();
    let staging = staging(folder)?;
    let mut files: Vec<(std::path::PathBuf, u64)> = write_products(
        &staging,
        &SiteProducts {
            config: results.config,
            kernels: &lines,
            images: &images,
            footprints,
            utc: &utc,
            profiles: &results.profiles.value,
            ranges: &results.ranges.value,
            rejected: &rejected,
            complaints: &complaints,
            notes: &notes,
        },
    )?
    .into_iter()
    .map(|product| (product.path, product.rows))
    .collect();
    let metakernel = results.kernels.metakernel_text(Some(folder));
    crate::store::atomic::write(&staging.join("kernels.tm"), metakernel.as_bytes())?;
    files.push(("kernels.tm".into(), 1));
    results.kernels.verify_unchanged()?;

    let products = entries(&staging, &files)?;
    let manifest = results.manifest(kernels, products, notes, &complaints, fingerprint);
    publish_files(folder, &staging, &manifest, read_manifest(folder).as_ref())?;
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
    fn stages(&self) -> Vec<(String, String, String)> {
        fn entry<T>(name: String, output: &Output<T>) -> (String, String, String) {
            (name, output.blake3.clone(), output.fingerprint.clone())
        }
        let mut stages = vec![
            entry(Stage::TagTimes.name().to_owned(), self.images),
            entry(Stage::SearchFootprints.name().to_owned(), self.found),
            entry(Stage::ConvertDatum.name().to_owned(), self.converted),
            entry(Stage::GroupProfiles.name().to_owned(), self.profiles),
            entry(Stage::CheckRanges.name().to_owned(), self.ranges),
        ];
        for (orientation, model) in self.orientations.iter().zip(self.models) {
            let image = &orientation.value.image;
            stages.push(entry(Stage::SampleOrientation.of_image(image), orientation));
            stages.push(entry(Stage::FitSensorModel.of_image(image), model));
        }
        stages
    }

    fn notes(&self) -> Vec<String> {
        let mut notes = self.kernels.explanation().to_vec();
        notes.extend(self.found.value.notes.iter().cloned());
        notes.extend(self.converted.value.notes.iter().cloned());
        for image in &self.images.value {
            notes.extend(
                image
                    .notes
                    .iter()
                    .map(|note| format!("image {}: {note}", image.id)),
            );
        }
        for model in self
            .models
            .iter()
            .filter(|model| model.value.near_gimbal_lock)
        {
            notes.push(format!(
                "image {}: |cos φ| falls to {:.3}, where ω and κ are badly determined; use the rotation-vector form",
                model.value.image, model.value.cos_phi_min
            ));
        }
        notes
    }

    fn rejected(&self) -> BTreeMap<String, u64> {
        let rejected = self.found.value.rejected.iter();
        rejected
            .map(|(reason, count)| (reason.to_string(), *count))
            .collect()
    }

    fn verdict(&self) -> Verdict {
        let profiles = self.ranges.value.profiles.iter().flat_map(|profile| {
            let reasons = profile.invalid_because.iter();
            reasons.map(move |reason| format!("profile {}: {reason}", profile.profile))
        });
        let models = self.models.iter().flat_map(|model| {
            let reasons = model.value.invalid_because.iter();
            reasons.map(move |reason| format!("image {}: {reason}", model.value.image))
        });
        let mut reasons: Vec<String> = profiles.chain(models).collect();
        let searched = !self.config.pedr.files.is_empty();
        if searched && self.converted.value.footprints.is_empty() {
            reasons.insert(0, "no footprint in any window".to_owned());
        }
        Verdict {
            valid: reasons.is_empty(),
            reasons,
        }
    }

    fn manifest(
        &self,
        kernels: Vec<KernelEntry>,
        products: Vec<crate::store::manifest::ProductEntry>,
        notes: Vec<String>,
        complaints: &[String],
        fingerprint: String,
    ) -> Manifest {
        let config = self.config;
        let found = &self.found.value;
        let mut stages: Vec<StageEntry> = self
            .stages()
            .into_iter()
            .map(|(name, _, fingerprint)| StageEntry { name, fingerprint })
            .collect();
        stages.push(StageEntry {
            name: Stage::Publish.name().to_owned(),
            fingerprint,
        });
        let counts = BTreeMap::from([
            ("frames_read".to_owned(), found.frames_read),
            ("shots_read".to_owned(), found.shots_read),
            (
                "footprints".to_owned(),
                self.converted.value.footprints.len() as u64,
            ),
            ("profiles".to_owned(), self.profiles.value.len() as u64),
            ("images".to_owned(), self.images.value.len() as u64),
        ]);
        Manifest {
            tool: "areograph".to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            site: config.site.clone(),
            verdict: self.verdict(),
            configuration: ConfigurationEntry {
                file_name: file_name(&config.file),
                blake3: config.blake3.clone(),
            },
            biases: biases(config),
            kernels,
            stages,
            products,
            counts,
            rejected: self.rejected(),
            complaints: Complaints {
                count: found.complaint_counts.values().sum(),
                texts: complaints.iter().take(COMPLAINTS_QUOTED).cloned().collect(),
            },
            notes,
            finished_utc: chrono::Utc::now().format("%Y-%m-%dT%H:%M:%SZ").to_string(),
        }
    }
}

fn biases(config: &SiteConfig) -> Vec<BiasEntry> {
    let scope = match config.mola_clock.scope {
        BiasScope::SpkLookup => "spacecraft position in the range check",
        BiasScope::Rotation => "rotation of Mars into IAU 2000",
        BiasScope::Both => {
            "spacecraft position in the range check, and rotation of Mars into IAU 2000"
        }
        BiasScope::None => "nothing",
    };
    vec![
        BiasEntry {
            name: "ck_bias".to_owned(),
            correction_s: config.pointing.ck_bias.seconds(),
            scope: "attitude look-ups".to_owned(),
            source: config.pointing.source.clone(),
        },
        BiasEntry {
            name: "mola_clock".to_owned(),
            correction_s: config.mola_clock.correction_s(),
            scope: scope.to_owned(),
            source: config.mola_clock.source.clone(),
        },
    ]
}

fn kernel_entries(session: &Session, results: &Results<'_>) -> Result<Vec<KernelEntry>> {
    let coverage = session.coverage()?;
    let wanted = Intervals::union_of(results.wanted.iter().copied());
    let entries = results.kernels.kernels().iter().enumerate();
    Ok(entries
        .map(|(index, kernel)| {
            let own = coverage.per_kernel.iter().find(|(of, _)| *of == index);
            KernelEntry {
                name: kernel.file_name(),
                role: kernel.role.to_string(),
                bytes: kernel.bytes,
                blake3: kernel.blake3.clone(),
                coverage_used: own.map_or_else(Vec::new, |(_, held)| {
                    held.intersection(&wanted).as_slice().to_vec()
                }),
            }
        })
        .collect())
}

/// Products use the IAU 2000 formula whatever the PCK says; whoever loads `kernels.tm` should know.
fn pck_note(session: &Session, wanted: &[Interval]) -> Option<String> {
    let at = wanted
        .first()
        .map_or(Et::from_seconds(0.0), |interval| interval.start);
    let ours = *mars_rotation::<MarsIau2000>(at).matrix();
    // Without a PCK there is nothing to compare, and nothing that could mislead.
    let theirs = session.mars_matrix(at).ok()?;
    let turn_rad = crate::geom::attitude::rotation_vector(&(theirs * ours.transpose())).norm();
    (turn_rad > PCK_TOLERANCE_RAD).then(|| {
        format!(
            "the PCK turns IAU_MARS by {:.5}° against IAU 2000; products use the IAU 2000 constants",
            turn_rad / crate::units::RADIANS_PER_DEGREE
        )
    })
}
