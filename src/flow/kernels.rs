//! The kernels that a site uses, and the required times.

use std::collections::BTreeMap;

use super::RivalSet;
use crate::{
    config::{SiteConfig, built_in_instruments},
    constants::SPACECRAFT,
    error::Result,
    files::InputFiles,
    kernel_source::{KernelList, KernelSource},
    spice::{KernelSet, RequiredCoverage},
    stages::{check_ranges::trajectory_reach_s, group_profiles::Profile, tag_times::ImageTimes},
    time::Intervals,
};

/// The kernels of the configuration; from a folder, those that cover `required` (text kernels always); of rival sets
/// the `chosen` one, which is the first if only clocks are needed.
pub(super) fn load_kernels(
    config: &SiteConfig,
    required: &RequiredCoverage,
    chosen: usize,
    files: &InputFiles,
) -> Result<KernelSet> {
    match &config.kernels.source {
        KernelSource::Listed(list) => load_list(list, files),
        KernelSource::Root(selection) => {
            KernelSet::select_of(files, selection, built_in_instruments(), required)
        }
        KernelSource::Sets(sets) => sets.get(chosen).map_or_else(
            || Ok(KernelSet::default()),
            |set| load_list(&set.list, files),
        ),
    }
}

fn load_list(list: &KernelList, files: &InputFiles) -> Result<KernelSet> {
    match list {
        KernelList::Metakernel(path) => KernelSet::from_metakernel_of(files, path),
        KernelList::Files(paths) => KernelSet::from_files_of(files, paths),
    }
}

/// The rival sets of the configuration; empty if it names one source.
pub(super) fn load_rivals(config: &SiteConfig, files: &InputFiles) -> Result<Vec<RivalSet>> {
    let KernelSource::Sets(sets) = &config.kernels.source else {
        return Ok(Vec::new());
    };
    let rivals = sets.iter().map(|set| {
        Ok(RivalSet {
            id: set.id.clone(),
            kernels: load_list(&set.list, files)?,
        })
    });
    rivals.collect()
}

/// Times at which the site reads kernels: exposures with their padding and the light time, flights over the windows
/// up to the range of the scan, and attitudes at the exposures shifted by the pointing bias.
pub(super) fn required_coverage(
    config: &SiteConfig,
    images: &[&ImageTimes],
    profiles: &[Profile],
) -> RequiredCoverage {
    let (kernels, reach_s) = (
        &config.kernels,
        trajectory_reach_s(&config.range_check, &config.altimeter_clock),
    );
    let mut by_spacecraft: BTreeMap<&str, Vec<&ImageTimes>> = BTreeMap::new();
    // Images with support data read no kernels.
    for image in images.iter().filter(|image| image.support.is_none()) {
        let of = by_spacecraft.entry(&image.instrument.spacecraft.id);
        of.or_default().push(image);
    }
    // The spacecraft of tables has no kernels.
    let flown = if config.shots.is_empty() {
        profiles
    } else {
        &[]
    };
    let flights = flown.iter().map(|profile| profile.interval.padded(reach_s));
    let light_time = config.orientation.light_time;
    let position =
        |image: &&ImageTimes| light_time.read_over(image.exposures().padded(kernels.padding_s));
    // Within the tolerance, a look-up reaches kernels that end before it or begin after it.
    let padding_s = kernels.padding_s + kernels.ck_tolerance_s;
    let attitude = |image: &&ImageTimes| {
        let bias_s = config.pointing.bias_of(&image.instrument).seconds();
        image.exposures().shifted(bias_s).padded(padding_s)
    };
    let own = by_spacecraft.remove(&*SPACECRAFT.id).unwrap_or_default();
    let others = by_spacecraft.into_iter().map(|(id, images)| {
        let required = RequiredCoverage {
            positions: Intervals::union_of(images.iter().map(position)),
            attitudes: Intervals::union_of(images.iter().map(attitude)),
            ..RequiredCoverage::default()
        };
        (id.to_owned(), required)
    });
    RequiredCoverage {
        positions: Intervals::union_of(own.iter().map(position).chain(flights)),
        attitudes: Intervals::union_of(own.iter().map(attitude)),
        others: others.collect(),
    }
}
