//! Which stages would run, and why; nothing is written.

use std::path::Path;

use super::{
    Stage, parts, publish,
    steps::{load_kernels, wanted},
};
use crate::{
    config::SiteConfig,
    error::{Place, Result},
    spice::Wanted,
    stages::{
        check_ranges::RangeCheck, convert_datum::Converted, fit_sensor_model::SensorModel,
        group_profiles::Profile, sample_orientation::Orientation, search_footprints::SearchResult,
        tag_times::ImageTimes,
    },
    store::{
        cache::{Output, StageCache},
        fingerprint::{Because, Parts},
    },
};

/// A stage with the reason why it would run, or [`Because::Unchanged`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PlannedStage {
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
pub fn plan_site(config: &SiteConfig, out: &Path, force: bool) -> Result<Vec<PlannedStage>> {
    plan_stages(config, out, force).in_site(&config.site)
}

fn plan_stages(config: &SiteConfig, out: &Path, force: bool) -> Result<Vec<PlannedStage>> {
    let folder = out.join(&config.site);
    let mut planner = Planner {
        cache: StageCache::new(&folder.join(".cache"), force),
        planned: Vec::new(),
    };
    let clocks = load_kernels(config, &Wanted::default()).in_stage(Stage::LoadKernels.name())?;
    let parts = parts::tag_times(config, &clocks).in_stage(Stage::TagTimes.name())?;
    let images: Option<Output<Vec<ImageTimes>>> = planner.look(Stage::TagTimes.name(), &parts);
    let parts = parts::search_footprints(config).in_stage(Stage::SearchFootprints.name())?;
    let found: Option<Output<SearchResult>> = planner.look(Stage::SearchFootprints.name(), &parts);
    let parts = parts::convert_datum(config, hash(found.as_ref()).as_deref());
    let converted: Option<Output<Converted>> = planner.look(Stage::ConvertDatum.name(), &parts);
    let parts = parts::group_profiles(
        config,
        hash(converted.as_ref()).as_deref(),
        hash(images.as_ref()).as_deref(),
    );
    let profiles: Option<Output<Vec<Profile>>> = planner.look(Stage::GroupProfiles.name(), &parts);

    let wanted = wanted(
        config,
        images.as_ref().map_or(&[], |output| &output.value),
        profiles.as_ref().map_or(&[], |output| &output.value),
    );
    let kernels = load_kernels(config, &wanted).in_stage(Stage::LoadKernels.name())?;

    let parts = parts::check_ranges(
        config,
        &kernels,
        hash(converted.as_ref()).as_deref(),
        hash(profiles.as_ref()).as_deref(),
    );
    let ranges: Option<Output<RangeCheck>> = planner.look(Stage::CheckRanges.name(), &parts);
    let mut outputs = vec![
        (Stage::TagTimes.name().to_owned(), hash(images.as_ref())),
        (
            Stage::SearchFootprints.name().to_owned(),
            hash(found.as_ref()),
        ),
        (
            Stage::ConvertDatum.name().to_owned(),
            hash(converted.as_ref()),
        ),
        (
            Stage::GroupProfiles.name().to_owned(),
            hash(profiles.as_ref()),
        ),
        (Stage::CheckRanges.name().to_owned(), hash(ranges.as_ref())),
    ];
    for image in &config.images {
        let times = images
            .as_ref()
            .and_then(|images| images.value.iter().find(|times| times.id == image.id));
        let stage = Stage::SampleOrientation.of_image(&image.id);
        let orientation: Option<Output<Orientation>> = match times {
            Some(times) => {
                planner.look(&stage, &parts::sample_orientation(config, &kernels, times))
            }
            None => planner.follows(&stage, Stage::TagTimes.name()),
        };
        let parts =
            parts::fit_sensor_model(config, &image.id, hash(orientation.as_ref()).as_deref());
        outputs.push((stage, hash(orientation.as_ref())));
        let stage = Stage::FitSensorModel.of_image(&image.id);
        let model: Option<Output<SensorModel>> = planner.look(&stage, &parts);
        outputs.push((stage, hash(model.as_ref())));
    }
    let parts = parts::publish(config, &kernels, &folder, outputs);
    let because = match publish::standing(&folder, &planner.cache, &parts) {
        Ok(_) => Because::Unchanged,
        Err(because) => because,
    };
    planner.planned.push(PlannedStage {
        stage: Stage::Publish.name().to_owned(),
        because,
    });
    Ok(planner.planned)
}

fn hash<T>(output: Option<&Output<T>>) -> Option<String> {
    output.map(|output| output.blake3.clone())
}

struct Planner {
    cache: StageCache,
    planned: Vec<PlannedStage>,
}

impl Planner {
    fn look<T: serde::de::DeserializeOwned>(
        &mut self,
        stage: &str,
        parts: &Parts,
    ) -> Option<Output<T>> {
        let (because, output) = match self.cache.load(stage, parts) {
            Ok(output) => (Because::Unchanged, Some(output)),
            Err(because) => (because, None),
        };
        self.planned.push(PlannedStage {
            stage: stage.to_owned(),
            because,
        });
        output
    }

    fn follows<T>(&mut self, stage: &str, earlier: &str) -> Option<Output<T>> {
        self.planned.push(PlannedStage {
            stage: stage.to_owned(),
            because: Because::Moved(vec![format!("output of {earlier} may change")]),
        });
        None
    }
}
