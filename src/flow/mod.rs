//! The way of the data: kernels → times → footprints → IAU 2000 → ranges → orientation → model → products.

mod check;
mod parts;
mod plan;
mod publish;

use std::{
    fmt,
    path::PathBuf,
    sync::atomic::{AtomicBool, Ordering},
};

use crate::{
    config::{KernelSource, SiteConfig},
    error::{Fault, Kind, Place, Result},
    spice::{KernelSet, Session},
    stages::{
        check_ranges::check_ranges, convert_datum::convert_datum,
        fit_sensor_model::fit_sensor_model, group_profiles::group_profiles,
        sample_orientation::sample_orientation, search_footprints::search_footprints,
        tag_times::tag_times,
    },
    store::{cache::StageCache, lock::SiteLock, manifest::Verdict},
    time::{Interval, Intervals},
};

pub use check::{Checked, check_site};
pub use plan::{PlannedStage, plan_site};

/// The tabulated trajectory stays this close to the kernels, metres: a tenth of a PEDR centimetre.
const TRAJECTORY_TOLERANCE_M: f64 = 0.001;

/// Seconds of trajectory beyond what the scan of the clock bias reaches.
const TRAJECTORY_MARGIN_S: f64 = 0.5;

/// The stages, in order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, clap::ValueEnum)]
#[value(rename_all = "snake_case")]
pub enum Stage {
    /// Read and hash kernels.
    LoadKernels,
    /// Image labels to line times.
    TagTimes,
    /// Shots inside the windows.
    SearchFootprints,
    /// Coordinates to IAU 2000.
    ConvertDatum,
    /// Shots of one orbit in one window.
    GroupProfiles,
    /// Three-way range check.
    CheckRanges,
    /// Exterior orientation at 31 epochs.
    SampleOrientation,
    /// Polynomials of first and second order.
    FitSensorModel,
    /// Products under their final names.
    Publish,
}

impl Stage {
    /// Name as logs, messages and the command line write it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::LoadKernels => "load_kernels",
            Self::TagTimes => "tag_times",
            Self::SearchFootprints => "search_footprints",
            Self::ConvertDatum => "convert_datum",
            Self::GroupProfiles => "group_profiles",
            Self::CheckRanges => "check_ranges",
            Self::SampleOrientation => "sample_orientation",
            Self::FitSensorModel => "fit_sensor_model",
            Self::Publish => "publish",
        }
    }

    /// Name of the stage for one image.
    #[must_use]
    pub fn of_image(self, image: &str) -> String {
        format!("{}/{image}", self.name())
    }
}

impl fmt::Display for Stage {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

/// How a site is run.
#[derive(Debug)]
pub struct RunOptions<'a> {
    /// Products go to `<out>/<site>`.
    pub out: PathBuf,
    /// Last stage to run.
    pub until: Stage,
    /// Use no stored output.
    pub force: bool,
    /// Set from outside to stop between two stages.
    pub stop: &'a AtomicBool,
}

/// What a run did.
#[derive(Debug)]
pub struct SiteOutcome {
    /// Site identifier.
    pub site: String,
    /// Folder of the products.
    pub folder: PathBuf,
    /// How the run ended.
    pub ending: Ending,
}

/// How a run ended.
#[derive(Debug)]
pub enum Ending {
    /// Products were published.
    Published(Verdict),
    /// Nothing had changed; the products of an earlier run stand.
    Unchanged(Verdict),
    /// Stopped after the stage that was asked for.
    StoppedAfter(Stage),
}

/// The user stopped the program.
#[derive(Debug, thiserror::Error)]
#[error("stopped before {before}")]
struct Stopped {
    before: Stage,
}

impl Fault for Stopped {
    fn kind(&self) -> Kind {
        Kind::Interrupted
    }

    fn advice(&self) -> String {
        "run again: finished stages are kept".to_owned()
    }
}

/// Runs one site from its configuration to its products.
///
/// A stage whose parts did not move is not run; its stored output is used. Nothing else than this
/// function decides that, and no stage knows of another.
///
/// # Errors
/// The first failure, with site, stage, file and record; products of an earlier run stay as they are.
pub fn run_site(config: &SiteConfig, options: &RunOptions<'_>) -> Result<SiteOutcome> {
    let span = tracing::info_span!("site", id = %config.site);
    let _entered = span.enter();
    run_stages(config, options).in_site(&config.site)
}

fn run_stages(config: &SiteConfig, options: &RunOptions<'_>) -> Result<SiteOutcome> {
    let folder = options.out.join(&config.site);
    let _lock = SiteLock::take(&folder)?;
    let cache = StageCache::new(&folder.join(".cache"), options.force);
    let ended = |ending| {
        Ok(SiteOutcome {
            site: config.site.clone(),
            folder: folder.clone(),
            ending,
        })
    };
    // Leaves the flow after the stage that was asked for, or where the user stopped it.
    macro_rules! until {
        ($stage:expr, $next:expr) => {
            if options.until == $stage {
                return ended(Ending::StoppedAfter($stage));
            }
            if options.stop.load(Ordering::Relaxed) {
                return Err(Stopped { before: $next }.into());
            }
        };
    }

    let clocks = load_kernels(config, &[]).in_stage(Stage::LoadKernels.name())?;
    until!(Stage::LoadKernels, Stage::TagTimes);

    let stage = Stage::TagTimes.name();
    let parts = parts::tag_times(config, &clocks).in_stage(stage)?;
    let images = cache.stage(stage, parts, || {
        tag_times(&config.images, &Session::open(&clocks)?).in_stage(stage)
    })?;
    until!(Stage::TagTimes, Stage::SearchFootprints);

    let stage = Stage::SearchFootprints.name();
    let parts = parts::search_footprints(config).in_stage(stage)?;
    let found = cache.stage(stage, parts, || {
        search_footprints(
            &config.pedr,
            &config.windows,
            config.mola_clock.correction_s(),
        )
        .in_stage(stage)
    })?;
    until!(Stage::SearchFootprints, Stage::ConvertDatum);

    let stage = Stage::ConvertDatum.name();
    let parts = parts::convert_datum(config, Some(&found.blake3));
    let converted = cache.stage(stage, parts, || {
        Ok(convert_datum(
            found.value.footprints.clone(),
            &config.mola_clock,
        ))
    })?;
    until!(Stage::ConvertDatum, Stage::GroupProfiles);

    let stage = Stage::GroupProfiles.name();
    let parts = parts::group_profiles(config, Some(&converted.blake3), Some(&images.blake3));
    let profiles = cache.stage(stage, parts, || {
        Ok(group_profiles(
            &converted.value.footprints,
            &config.windows,
            &images.value,
        ))
    })?;
    until!(Stage::GroupProfiles, Stage::CheckRanges);

    let exposures = images.value.iter().map(|image| image.exposures());
    let flights = profiles.value.iter().map(|profile| profile.interval);
    let wanted: Vec<Interval> = exposures.chain(flights).collect();
    let kernels = load_kernels(config, &wanted).in_stage(Stage::LoadKernels.name())?;

    let stage = Stage::CheckRanges.name();
    let parts = parts::check_ranges(
        config,
        &kernels,
        Some(&converted.blake3),
        Some(&profiles.blake3),
    );
    let ranges = cache.stage(stage, parts, || {
        let trajectory = trajectory(config, &kernels, &profiles.value).in_stage(stage)?;
        check_ranges(
            &converted.value.footprints,
            &profiles.value,
            &trajectory,
            &config.mola_clock,
            &config.range_check,
        )
        .in_stage(stage)
    })?;
    until!(Stage::CheckRanges, Stage::SampleOrientation);

    let mut orientations = Vec::with_capacity(images.value.len());
    for image in &images.value {
        let stage = Stage::SampleOrientation;
        let parts = parts::sample_orientation(config, &kernels, image);
        orientations.push(cache.stage(&stage.of_image(&image.id), parts, || {
            let session = Session::open(&kernels).in_stage(stage.name())?;
            sample_orientation(
                &session,
                image,
                &config.kernels,
                &config.pointing,
                &config.orientation,
            )
            .in_stage(stage.name())
        })?);
    }
    until!(Stage::SampleOrientation, Stage::FitSensorModel);

    let mut models = Vec::with_capacity(images.value.len());
    for orientation in &orientations {
        let stage = Stage::FitSensorModel;
        let image = &orientation.value.image;
        let parts = parts::fit_sensor_model(config, image, Some(&orientation.blake3));
        models.push(cache.stage(&stage.of_image(image), parts, || {
            fit_sensor_model(&orientation.value, &config.orientation).in_stage(stage.name())
        })?);
    }
    until!(Stage::FitSensorModel, Stage::Publish);

    let results = publish::Results {
        config,
        kernels: &kernels,
        wanted: &wanted,
        images: &images,
        found: &found,
        converted: &converted,
        profiles: &profiles,
        ranges: &ranges,
        orientations: &orientations,
        models: &models,
    };
    ended(publish::publish(&folder, &cache, &results).in_stage(Stage::Publish.name())?)
}

/// The kernels of the configuration; from a folder, those that cover `wanted` (text kernels always).
fn load_kernels(config: &SiteConfig, wanted: &[Interval]) -> Result<KernelSet> {
    match &config.kernels.source {
        KernelSource::Metakernel(path) => KernelSet::from_metakernel(path),
        KernelSource::Files(paths) => KernelSet::from_files(paths),
        KernelSource::Root(selection) => KernelSet::select(selection, wanted),
    }
}

/// Tabulates the spacecraft's path over all profiles, as far as the scan reaches and the kernels go.
fn trajectory(
    config: &SiteConfig,
    kernels: &KernelSet,
    profiles: &[crate::stages::group_profiles::Profile],
) -> Result<crate::spice::Trajectory> {
    let session = Session::open(kernels)?;
    for profile in profiles {
        session.require_position(profile.interval)?;
    }
    let reach_s =
        config.range_check.scan_half_width_s + config.mola_clock.bias_s + TRAJECTORY_MARGIN_S;
    let wanted = Intervals::union_of(profiles.iter().map(|p| p.interval.padded(reach_s)));
    let covered = wanted.intersection(&session.coverage()?.spk);
    session.trajectory(&covered, TRAJECTORY_TOLERANCE_M)
}
