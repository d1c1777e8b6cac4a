//! What the flow makes of a site: the outputs of its stages.

use super::choice::KernelChoice;
use crate::{
    error::Error,
    spice::{KernelSet, RequiredCoverage},
    stage::Output,
    stages::{
        adjust::Adjusted, check_heights::HeightCheck, check_ranges::RangeCheck,
        compare_pairs::PairComparison, convert_datum::Converted,
        describe_kernels::KernelDescription, group_profiles::Profile, intersect::IntersectedTies,
        read_ties::Ties, search_footprints::SearchResult, site_image::SiteImage,
        tag_times::ImageTimes,
    },
};

/// What the stages before the kernels' choice make of a site.
#[derive(Clone)]
pub(super) struct Prepared {
    pub(super) found: Output<SearchResult>,
    pub(super) converted: Output<Converted>,
    pub(super) utc: Output<Vec<String>>,
    pub(super) profiles: Output<Vec<Profile>>,
    /// Line times, in the order of the configuration.
    pub(super) images: Vec<Output<ImageTimes>>,
    /// The times at which the site reads kernels; `None` while they are not known.
    pub(super) required: Option<RequiredCoverage>,
}

/// A site with the outputs of all its stages.
pub(super) struct Site {
    pub(super) found: Output<SearchResult>,
    pub(super) converted: Output<Converted>,
    pub(super) utc: Output<Vec<String>>,
    pub(super) profiles: Output<Vec<Profile>>,
    pub(super) required: Option<RequiredCoverage>,
    pub(super) choice: Option<Output<KernelChoice>>,
    pub(super) kernels: Option<KernelSet>,
    pub(super) described: Output<KernelDescription>,
    pub(super) ranges: Output<RangeCheck>,
    /// In the order of the configuration.
    pub(super) images: Vec<SiteImage>,
    /// Nothing for a site without tie points, and none when it failed.
    pub(super) adjustment: Option<Adjustment>,
    /// Why there is no adjustment although there are tie points.
    pub(super) adjustment_failure: Option<Error>,
}

/// What tie points make of a site, before and after the adjustment.
pub(super) struct Adjustment {
    pub(super) ties: Output<Ties>,
    pub(super) intersected: Output<IntersectedTies>,
    pub(super) pairs: Output<Vec<PairComparison>>,
    /// Heights of the intersected points.
    pub(super) heights: Output<HeightCheck>,
    pub(super) adjusted: Output<Adjusted>,
    /// Heights of the adjusted points.
    pub(super) adjusted_heights: Output<HeightCheck>,
    /// The same images with their adjusted orientation.
    pub(super) adjusted_images: Vec<SiteImage>,
    pub(super) adjusted_intersected: Output<IntersectedTies>,
    pub(super) adjusted_pairs: Output<Vec<PairComparison>>,
}
