//! One step of the flow per stage: its parts, the stored output or a run, and the place of a failure.

use std::path::PathBuf;

use super::{
    Ending, RunOptions, Stage,
    choice::{KernelChoice, choose_kernels},
    kernels::{load_kernels, load_rivals, trajectory_reach_s},
    parts, publish,
    results::Results,
};
use crate::{
    config::SiteConfig,
    error::{Failure, Fault, Kind, Place, Result, Stopped},
    spice::{KernelSet, Session, Trajectory, Wanted},
    stages::{
        check_ranges::{RangeCheck, check_ranges},
        convert_datum::{Converted, convert_datum},
        fit_sensor_model::{SensorModel, fit_sensor_model},
        group_profiles::{Profile, group_profiles},
        register::{ImageRegistration, register},
        sample_orientation::{Orientation, sample_orientation},
        search_footprints::{SearchResult, search_footprints},
        tag_times::{ImageTimes, tag_times},
    },
    store::cache::{Output, StageCache},
    time::Intervals,
};

/// The tabulated trajectory stays this close to the kernels, metres: a tenth of a PEDR centimetre.
const TRAJECTORY_TOLERANCE_M: f64 = 0.001;

/// A site that is being run.
pub(super) struct Steps<'a> {
    pub(super) config: &'a SiteConfig,
    pub(super) options: &'a RunOptions<'a>,
    pub(super) cache: StageCache,
    pub(super) folder: PathBuf,
}

/// Why the flow ends before its end.
pub(super) enum Leave {
    /// The last stage that was asked for is done.
    AsAsked,
    /// Something failed.
    Failed(Failure),
}

impl From<Failure> for Leave {
    fn from(failure: Failure) -> Self {
        Self::Failed(failure)
    }
}

pub(super) type Step<T> = std::result::Result<T, Leave>;

/// A PEDR file changed between its hash and its search.
#[derive(Debug, thiserror::Error)]
#[error("the file changed while it was read")]
struct ChangedFile;

impl Fault for ChangedFile {
    fn kind(&self) -> Kind {
        Kind::Input
    }

    fn advice(&self) -> String {
        "run again when the archive is not being written".to_owned()
    }
}

impl Steps<'_> {
    /// Leaves the flow before `stage` when it is not asked for, or when the user stops the program.
    pub(super) fn enter(&self, stage: Stage) -> Step<()> {
        if self.options.until < stage {
            return Err(Leave::AsAsked);
        }
        Ok(Stopped::check(self.options.stop).in_stage(stage.name())?)
    }

    /// Makes sure that the kernels are still what was hashed, after stages that read them.
    ///
    /// Otherwise the fresh outputs would stand under the hashes of other kernels: they are forgotten.
    fn check_kernels<S: AsRef<str>>(
        &self,
        kernels: &KernelSet,
        stages: impl IntoIterator<Item = (S, bool)>,
    ) -> Result<()> {
        let fresh: Vec<S> = stages
            .into_iter()
            .filter(|(_, fresh)| *fresh)
            .map(|(stage, _)| stage)
            .collect();
        if fresh.is_empty() {
            return Ok(());
        }
        let unchanged = kernels.verify_unchanged();
        if unchanged.is_err() {
            for stage in &fresh {
                self.cache.forget(stage.as_ref());
            }
        }
        unchanged
    }

    pub(super) fn load_kernels(
        &self,
        wanted: &Wanted,
        choice: Option<&Output<KernelChoice>>,
    ) -> Step<KernelSet> {
        self.enter(Stage::LoadKernels)?;
        let chosen = choice.map_or(0, |choice| choice.value.chosen);
        Ok(load_kernels(self.config, wanted, chosen).in_stage(Stage::LoadKernels.name())?)
    }

    pub(super) fn choose_kernels(&self, wanted: &Wanted) -> Step<Option<Output<KernelChoice>>> {
        self.enter(Stage::ChooseKernels)?;
        let stage = Stage::ChooseKernels.name();
        let rivals = load_rivals(self.config).in_stage(stage)?;
        if rivals.is_empty() {
            return Ok(None);
        }
        let parts = parts::choose_kernels(self.config, wanted, &rivals);
        let choice = self.cache.stage(stage, parts, || {
            choose_kernels(self.config, wanted, &rivals).in_stage(stage)
        })?;
        for rival in &rivals {
            self.check_kernels(&rival.kernels, [(stage, choice.fresh)])?;
        }
        for note in &choice.value.notes {
            tracing::info!(stage, "{note}");
        }
        Ok(Some(choice))
    }

    pub(super) fn tag_times(&self, clocks: &KernelSet) -> Step<Output<Vec<ImageTimes>>> {
        self.enter(Stage::TagTimes)?;
        let stage = Stage::TagTimes.name();
        let parts = parts::tag_times(self.config, clocks).in_stage(stage)?;
        let images = self.cache.stage(stage, parts, || {
            tag_times(&self.config.images, &Session::open(clocks)?).in_stage(stage)
        })?;
        self.check_kernels(clocks, [(stage, images.fresh)])?;
        Ok(images)
    }

    pub(super) fn search_footprints(&self) -> Step<Output<SearchResult>> {
        self.enter(Stage::SearchFootprints)?;
        let stage = Stage::SearchFootprints.name();
        let hashes =
            parts::hash_files(&self.config.pedr.files, self.options.stop).in_stage(stage)?;
        let parts = parts::search_footprints(self.config, &hashes);
        let correction_s = self.config.mola_clock.correction_s();
        Ok(self.cache.stage(stage, parts, || {
            let (pedr, windows) = (&self.config.pedr, &self.config.windows);
            let found = search_footprints(pedr, windows, correction_s, self.options.stop)?;
            for ((file, hash), path) in found.footprints.files.iter().zip(&hashes).zip(&pedr.files)
            {
                if file.blake3 != *hash {
                    return Err(Failure::from(ChangedFile).in_file(path).in_stage(stage));
                }
            }
            Ok(found)
        })?)
    }

    pub(super) fn convert_datum(&self, found: &Output<SearchResult>) -> Step<Output<Converted>> {
        self.enter(Stage::ConvertDatum)?;
        let parts = parts::convert_datum(self.config, Some(&found.blake3));
        Ok(self.cache.stage(Stage::ConvertDatum.name(), parts, || {
            let footprints = found.value.footprints.clone();
            Ok(convert_datum(footprints, &self.config.mola_clock))
        })?)
    }

    pub(super) fn group_profiles(
        &self,
        converted: &Output<Converted>,
        images: &Output<Vec<ImageTimes>>,
    ) -> Step<Output<Vec<Profile>>> {
        self.enter(Stage::GroupProfiles)?;
        let parts =
            parts::group_profiles(self.config, Some(&converted.blake3), Some(&images.blake3));
        Ok(self.cache.stage(Stage::GroupProfiles.name(), parts, || {
            let footprints = &converted.value.footprints;
            Ok(group_profiles(
                footprints,
                &self.config.windows,
                &images.value,
            ))
        })?)
    }

    pub(super) fn check_ranges(
        &self,
        kernels: &KernelSet,
        converted: &Output<Converted>,
        profiles: &Output<Vec<Profile>>,
    ) -> Step<Output<RangeCheck>> {
        self.enter(Stage::CheckRanges)?;
        let stage = Stage::CheckRanges.name();
        let outputs = [&converted.blake3, &profiles.blake3].map(|blake3| Some(&**blake3));
        let parts = parts::check_ranges(self.config, kernels, outputs[0], outputs[1]);
        let ranges = self.cache.stage(stage, parts, || {
            let trajectory = self.trajectory(kernels, &profiles.value).in_stage(stage)?;
            check_ranges(
                &converted.value.footprints,
                &profiles.value,
                &trajectory,
                &self.config.mola_clock,
                &self.config.range_check,
                self.options.stop,
            )
            .in_stage(stage)
        })?;
        self.check_kernels(kernels, [(stage, ranges.fresh)])?;
        Ok(ranges)
    }

    /// Tabulates the spacecraft's path over all profiles, as far as the scan reaches and the kernels go.
    fn trajectory(&self, kernels: &KernelSet, profiles: &[Profile]) -> Result<Trajectory> {
        let session = Session::open(kernels)?;
        for profile in profiles {
            session.require_position(profile.interval)?;
        }
        let reach_s = trajectory_reach_s(self.config);
        let reach = profiles
            .iter()
            .map(|profile| profile.interval.padded(reach_s));
        let covered = Intervals::union_of(reach).intersection(&session.coverage()?.spk);
        session.trajectory(&covered, TRAJECTORY_TOLERANCE_M)
    }

    pub(super) fn sample_orientation(
        &self,
        kernels: &KernelSet,
        images: &Output<Vec<ImageTimes>>,
    ) -> Step<Vec<Output<Orientation>>> {
        self.enter(Stage::SampleOrientation)?;
        let config = self.config;
        let orientations = images.value.iter().map(|image| {
            let stage = Stage::SampleOrientation.of_image(&image.id);
            let parts = parts::sample_orientation(config, kernels, image);
            self.cache.stage(&stage, parts, || {
                let session = Session::open(kernels).in_stage(&stage)?;
                let (bias, sampling) = (&config.pointing, &config.orientation);
                sample_orientation(&session, image, &config.kernels, bias, sampling)
                    .in_stage(&stage)
            })
        });
        let orientations = orientations.collect::<Result<Vec<_>>>()?;
        let fresh = orientations.iter().map(|orientation| {
            let stage = Stage::SampleOrientation.of_image(&orientation.value.image);
            (stage, orientation.fresh)
        });
        self.check_kernels(kernels, fresh)?;
        Ok(orientations)
    }

    pub(super) fn fit_sensor_model(
        &self,
        orientations: &[Output<Orientation>],
    ) -> Step<Vec<Output<SensorModel>>> {
        self.enter(Stage::FitSensorModel)?;
        let models = orientations.iter().map(|orientation| {
            let image = &orientation.value.image;
            let stage = Stage::FitSensorModel.of_image(image);
            let parts = parts::fit_sensor_model(self.config, image, Some(&orientation.blake3));
            self.cache.stage(&stage, parts, || {
                fit_sensor_model(&orientation.value, &self.config.orientation).in_stage(&stage)
            })
        });
        Ok(models.collect::<Result<_>>()?)
    }

    pub(super) fn register(
        &self,
        images: &Output<Vec<ImageTimes>>,
        orientations: &[Output<Orientation>],
        models: &[Output<SensorModel>],
        converted: &Output<Converted>,
        profiles: &Output<Vec<Profile>>,
    ) -> Step<Vec<Output<ImageRegistration>>> {
        self.enter(Stage::Register)?;
        let oriented = orientations.iter().zip(models);
        let registrations =
            images
                .value
                .iter()
                .zip(oriented)
                .map(|(image, (orientation, model))| {
                    let stage = Stage::Register.of_image(&image.id);
                    let outputs = [
                        &orientation.blake3,
                        &model.blake3,
                        &converted.blake3,
                        &profiles.blake3,
                    ];
                    let parts =
                        parts::register(self.config, image, outputs.map(|hash| Some(&**hash)));
                    self.cache.stage(&stage, parts, || {
                        register(
                            image,
                            &orientation.value,
                            &model.value,
                            &converted.value.footprints,
                            &profiles.value,
                            &self.config.registration,
                            self.options.stop,
                        )
                        .in_stage(&stage)
                    })
                });
        Ok(registrations.collect::<Result<_>>()?)
    }

    pub(super) fn publish(&self, results: &Results<'_>) -> Step<Ending> {
        self.enter(Stage::Publish)?;
        let ending = publish::publish(&self.folder, &self.cache, results);
        Ok(ending.in_stage(Stage::Publish.name())?)
    }
}
