//! Which stages would run, and why; nothing is written.

use std::{path::Path, sync::atomic::AtomicBool};

use serde::de::DeserializeOwned;

use super::{
    Stage,
    choice::KernelChoice,
    kernels::{load_kernels, load_rivals, wanted},
    parts, publish,
    results::{Intersected, Readjusted},
};
use crate::{
    config::SiteConfig,
    error::{Place, Result},
    kernel_source::KernelSource,
    spice::Wanted,
    stages::{
        adjust::Adjusted, check_ranges::RangeCheck, convert_datum::Converted,
        fit_sensor_model::SensorModel, group_profiles::Profile, read_ties::Ties,
        register::ImageRegistration, sample_orientation::Orientation,
        search_footprints::SearchResult, tag_times::ImageTimes,
    },
    store::{
        cache::{Output, StageCache},
        fingerprint::{Because, Parts},
        publish::CACHE,
    },
};

/// A stage with the reason why it would run, or [`Because::Unchanged`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PlannedStage {
    /// The stage.
    pub of: Stage,
    /// Name, for a stage of one image followed by `/` and the image.
    pub stage: String,
    /// Why it would run, or that it would not.
    pub because: Because,
}

/// Says what [`super::run_site`] would do, with the same parts.
///
/// A stage below one that would run is listed as running because that output may change; if it turns
/// out the same, the run will keep the later stage.
///
/// # Errors
/// Input files or kernels that cannot be read.
pub fn plan_site(
    config: &SiteConfig,
    out: &Path,
    until: Stage,
    force: bool,
) -> Result<Vec<PlannedStage>> {
    let mut planned = plan_stages(config, out, force).in_site(&config.site)?;
    planned.retain(|planned| planned.of <= until);
    Ok(planned)
}

fn plan_stages(config: &SiteConfig, out: &Path, force: bool) -> Result<Vec<PlannedStage>> {
    let folder = out.join(&config.site);
    let mut plan = Planner {
        cache: StageCache::new(&folder.join(CACHE), force),
        planned: Vec::new(),
        outputs: Vec::new(),
    };
    let clocks = load_kernels(config, &Wanted::default(), 0).in_stage(Stage::LoadKernels.name())?;
    let parts = parts::tag_times(config, &clocks).in_stage(Stage::TagTimes.name())?;
    let images = plan.look::<Vec<ImageTimes>>(Stage::TagTimes, &parts);
    let hashes = parts::hash_files(&config.pedr.files, &AtomicBool::new(false))
        .in_stage(Stage::SearchFootprints.name())?;
    let parts = parts::search_footprints(config, &hashes);
    let found = plan.look::<SearchResult>(Stage::SearchFootprints, &parts);
    let parts = parts::convert_datum(config, hash(found.as_ref()));
    let converted = plan.look::<Converted>(Stage::ConvertDatum, &parts);
    let parts = parts::group_profiles(config, hash(converted.as_ref()), hash(images.as_ref()));
    let profiles = plan.look::<Vec<Profile>>(Stage::GroupProfiles, &parts);

    let rivals = load_rivals(config).in_stage(Stage::ChooseKernels.name())?;
    let depends = !matches!(config.kernels.source, KernelSource::Listed(_));
    if depends && (images.is_none() || profiles.is_none()) {
        // Which kernels will be chosen is not known before the stages above have run.
        if !rivals.is_empty() {
            plan.add(Stage::ChooseKernels, None, follows());
        }
        return Ok(plan.all_follow(config));
    }
    let times = images.as_ref().map_or(&[][..], |images| &images.value);
    let flights = profiles
        .as_ref()
        .map_or(&[][..], |profiles| &profiles.value);
    let wanted = wanted(config, times, flights);
    let mut chosen = 0;
    if !rivals.is_empty() {
        let parts = parts::choose_kernels(config, &wanted, &rivals);
        match plan.look::<KernelChoice>(Stage::ChooseKernels, &parts) {
            Some(choice) => chosen = choice.value.chosen,
            None => return Ok(plan.all_follow(config)),
        }
    }
    let kernels = load_kernels(config, &wanted, chosen).in_stage(Stage::LoadKernels.name())?;
    let parts = parts::check_ranges(
        config,
        &kernels,
        hash(converted.as_ref()),
        hash(profiles.as_ref()),
    );
    plan.look::<RangeCheck>(Stage::CheckRanges, &parts);
    let mut oriented = Vec::new();
    for image in &config.images {
        let stage = Stage::SampleOrientation;
        let times = times.iter().find(|times| times.id == image.id);
        let orientation = times.and_then(|times| {
            let parts = parts::sample_orientation(config, &kernels, times);
            plan.look_for::<Orientation>(stage, Some(&image.id), &parts)
        });
        if times.is_none() {
            plan.outputs.push((stage.of_image(&image.id), None));
            plan.add(stage, Some(&image.id), follows());
        }
        let parts = parts::fit_sensor_model(config, &image.id, hash(orientation.as_ref()));
        let model = plan.look_for::<SensorModel>(Stage::FitSensorModel, Some(&image.id), &parts);
        oriented.push((
            orientation.map(|orientation| orientation.blake3),
            model.map(|model| model.blake3),
        ));
    }
    let shots = [hash(converted.as_ref()), hash(profiles.as_ref())];
    let registered = plan.register(config, times, &oriented, shots);
    let prepared = parts::Hashes {
        images: hash(images.as_ref()),
        converted: hash(converted.as_ref()),
        profiles: hash(profiles.as_ref()),
        orientations: oriented.iter().map(|(of, _)| of.as_deref()).collect(),
        models: oriented.iter().map(|(_, of)| of.as_deref()).collect(),
        registrations: registered.iter().map(Option::as_deref).collect(),
    };
    plan.geometric(config, &prepared)?;
    let outputs = std::mem::take(&mut plan.outputs);
    let parts = parts::publish(config, &kernels, &folder, outputs);
    let standing = publish::standing(&folder, &plan.cache, &parts);
    plan.add(
        Stage::Publish,
        None,
        standing.err().unwrap_or(Because::Unchanged),
    );
    Ok(plan.planned)
}

fn hash<T>(output: Option<&Output<T>>) -> Option<&str> {
    output.map(|output| &*output.blake3)
}

/// The reason of a stage whose parts are not known before earlier stages have run.
fn follows() -> Because {
    Because::Moved(vec!["output of earlier stages may change".to_owned()])
}

struct Planner {
    cache: StageCache,
    planned: Vec<PlannedStage>,
    /// Stages so far, with the hash of their output where it is known.
    outputs: Vec<(String, Option<String>)>,
}

impl Planner {
    fn look<T: DeserializeOwned>(&mut self, stage: Stage, parts: &Parts) -> Option<Output<T>> {
        self.look_for(stage, None, parts)
    }

    fn look_for<T: DeserializeOwned>(
        &mut self,
        stage: Stage,
        image: Option<&str>,
        parts: &Parts,
    ) -> Option<Output<T>> {
        let loaded = self.cache.load(&name(stage, image), parts);
        let (because, output) = match loaded {
            Ok(output) => (Because::Unchanged, Some(output)),
            Err(because) => (because, None),
        };
        self.outputs
            .push((name(stage, image), hash(output.as_ref()).map(str::to_owned)));
        self.add(stage, image, because);
        output
    }

    /// Registration of every image, with the hash of its output where it is known.
    fn register(
        &mut self,
        config: &SiteConfig,
        times: &[ImageTimes],
        oriented: &[(Option<String>, Option<String>)],
        [converted, profiles]: [Option<&str>; 2],
    ) -> Vec<Option<String>> {
        let stage = Stage::Register;
        let images = config.images.iter().zip(oriented);
        let registered = images.map(|(image, (orientation, model))| {
            let Some(times) = times.iter().find(|times| times.id == image.id) else {
                self.outputs.push((stage.of_image(&image.id), None));
                self.add(stage, Some(&image.id), follows());
                return None;
            };
            let outputs = [
                orientation.as_deref(),
                model.as_deref(),
                converted,
                profiles,
            ];
            let parts = parts::register(config, times, outputs);
            let found = self.look_for::<ImageRegistration>(stage, Some(&image.id), &parts);
            found.map(|registration| registration.blake3)
        });
        registered.collect()
    }

    /// The steps of a site with tie points.
    fn geometric(&mut self, config: &SiteConfig, prepared: &parts::Hashes<'_>) -> Result<()> {
        if config.ties.files.is_empty() {
            return Ok(());
        }
        let hashes = parts::hash_files(&config.ties.files, &AtomicBool::new(false))
            .in_stage(Stage::ReadTies.name())?;
        let parts = parts::read_ties(config, &hashes);
        let ties = self.look::<Ties>(Stage::ReadTies, &parts);
        let ties = hash(ties.as_ref());
        let parts = parts::intersect(config, prepared, ties);
        let intersected = self.look::<Intersected>(Stage::Intersect, &parts);
        let outputs = [ties, hash(intersected.as_ref())];
        let parts = parts::adjust(config, prepared, outputs);
        let adjusted = self.look::<Adjusted>(Stage::Adjust, &parts);
        let outputs = [ties, hash(adjusted.as_ref())];
        let parts = parts::apply_adjustment(config, prepared, outputs);
        self.look::<Readjusted>(Stage::ApplyAdjustment, &parts);
        Ok(())
    }

    /// The plan when the kernels are not known before earlier stages have run.
    fn all_follow(mut self, config: &SiteConfig) -> Vec<PlannedStage> {
        self.add(Stage::CheckRanges, None, follows());
        for image in &config.images {
            self.add(Stage::SampleOrientation, Some(&image.id), follows());
            self.add(Stage::FitSensorModel, Some(&image.id), follows());
        }
        for image in &config.images {
            self.add(Stage::Register, Some(&image.id), follows());
        }
        if !config.ties.files.is_empty() {
            for stage in [
                Stage::ReadTies,
                Stage::Intersect,
                Stage::Adjust,
                Stage::ApplyAdjustment,
            ] {
                self.add(stage, None, follows());
            }
        }
        self.add(Stage::Publish, None, follows());
        self.planned
    }

    fn add(&mut self, of: Stage, image: Option<&str>, because: Because) {
        self.planned.push(PlannedStage {
            of,
            stage: name(of, image),
            because,
        });
    }
}

fn name(stage: Stage, image: Option<&str>) -> String {
    image.map_or_else(|| stage.name().to_owned(), |image| stage.of_image(image))
}
