//! The way of the data: kernels → times → footprints → IAU 2000 → ranges → orientation → model → registration → adjustment → products.

mod check;
mod choice;
mod compare;
mod geometric;
mod kernels;
mod manifest;
mod out;
mod parts;
mod plan;
mod publish;
mod results;
mod sites;
mod steps;

use std::{fmt, path::PathBuf, sync::atomic::AtomicBool};

use crate::{
    config::SiteConfig,
    error::{Place, Result},
    spice::Wanted,
    store::{
        cache::StageCache,
        lock::SiteLock,
        manifest::Manifest,
        publish::{CACHE, note_failure},
    },
};

pub use check::{Checked, check_site};
pub use choice::{rival_sets, wanted_by_site};
pub use compare::{
    Compared, EPOCHS_MAX, LeftOut, Request, RivalSet, compare_kernels, require_different,
};
pub use out::{OutFault, check_out};
pub use plan::{PlannedStage, plan_site};
pub use sites::publish_sites;

use geometric::Prepared;
use kernels::wanted;
use results::Results;
use steps::{Leave, Steps};

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
    /// Of rival kernel sets the one closest to the mean of all; nothing when there is one source.
    ChooseKernels,
    /// Three-way range check.
    CheckRanges,
    /// Exterior orientation at 31 epochs.
    SampleOrientation,
    /// Polynomials of first and second order.
    FitSensorModel,
    /// Lines and samples of the footprints in every image.
    Register,
    /// Tie points with the site's names of images.
    ReadTies,
    /// Ground points of the tie points; every pair of images compared.
    Intersect,
    /// Combined adjustment of images, footprints, ranges and tie points.
    Adjust,
    /// Orientation, models, footprints and tie points once more, as adjusted.
    ApplyAdjustment,
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
            Self::ChooseKernels => "choose_kernels",
            Self::CheckRanges => "check_ranges",
            Self::SampleOrientation => "sample_orientation",
            Self::FitSensorModel => "fit_sensor_model",
            Self::Register => "register",
            Self::ReadTies => "read_ties",
            Self::Intersect => "intersect",
            Self::Adjust => "adjust",
            Self::ApplyAdjustment => "apply_adjustment",
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
    /// Set from outside to stop between two stages, or inside the search and the range check.
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
    Published(Manifest),
    /// Nothing had changed; the products of an earlier run stand.
    Unchanged(Manifest),
    /// Stopped after the stage that was asked for.
    StoppedAfter(Stage),
}

/// Runs one site from its configuration to its products.
///
/// A stage whose parts did not move is not run; its stored output is used. Nothing else than the flow
/// decides that, and no stage knows of another.
///
/// # Errors
/// The first failure, with site, stage and file; products of an earlier run stay as they are.
pub fn run_site(config: &SiteConfig, options: &RunOptions<'_>) -> Result<SiteOutcome> {
    let span = tracing::info_span!("site", id = %config.site);
    let _entered = span.enter();
    let folder = options.out.join(&config.site);
    let _lock = SiteLock::take(&folder).in_site(&config.site)?;
    let steps = Steps {
        config,
        options,
        cache: StageCache::new(&folder.join(CACHE), options.force),
        folder,
    };
    let ending = match run_steps(&steps) {
        Ok(ending) => ending,
        Err(Leave::AsAsked) => Ending::StoppedAfter(options.until),
        Err(Leave::Failed(failure)) => {
            note_failure(&steps.folder, Some(&failure.to_string()));
            return Err(failure.in_site(&config.site));
        }
    };
    note_failure(&steps.folder, None);
    Ok(SiteOutcome {
        site: config.site.clone(),
        folder: steps.folder,
        ending,
    })
}

/// The way of the data; every step keeps its stored output when nothing that it depends on moved.
fn run_steps(steps: &Steps<'_>) -> std::result::Result<Ending, Leave> {
    let clocks = steps.load_kernels(&Wanted::default(), None)?;
    let images = steps.tag_times(&clocks)?;
    let found = steps.search_footprints()?;
    let converted = steps.convert_datum(&found)?;
    let profiles = steps.group_profiles(&converted, &images)?;

    let wanted = wanted(steps.config, &images.value, &profiles.value);
    let choice = steps.choose_kernels(&wanted)?;
    let kernels = steps.load_kernels(&wanted, choice.as_ref())?;
    let ranges = steps.check_ranges(&kernels, &converted, &profiles)?;
    let orientations = steps.sample_orientation(&kernels, &images)?;
    let models = steps.fit_sensor_model(&orientations)?;
    let registrations = steps.register(&images, &orientations, &models, &converted, &profiles)?;
    let geometric = steps.geometric(&Prepared {
        images: &images,
        converted: &converted,
        profiles: &profiles,
        orientations: &orientations,
        models: &models,
        registrations: &registrations,
    })?;

    steps.publish(&Results {
        config: steps.config,
        kernels: &kernels,
        wanted: &wanted,
        choice: choice.as_ref(),
        images: &images,
        found: &found,
        converted: &converted,
        profiles: &profiles,
        ranges: &ranges,
        orientations: &orientations,
        models: &models,
        registrations: &registrations,
        geometric: geometric.as_ref(),
    })
}
