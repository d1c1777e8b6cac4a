//! The outputs of the stages of a site.

use crate::{
    error::Error,
    spice::{KernelSet, RequiredCoverage},
    stage::Output,
    stages::{
        check_heights::HeightCheck, compare_pairs::PairComparison, convert_datum::Converted,
        group_profiles::Profile, intersect::IntersectedTies, search_footprints::SearchResult,
        site_image::SiteImage, tag_times::ImageTimes,
    },
    store::book::Book,
};

/// Outputs of the stages before the choice of kernels.
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
    /// The outputs, except outputs of images.
    pub(super) book: Book,
    /// Footprints and profiles again, inputs of most stages.
    pub(super) converted: Output<Converted>,
    pub(super) profiles: Output<Vec<Profile>>,
    pub(super) required: Option<RequiredCoverage>,
    pub(super) kernels: Option<KernelSet>,
    /// In the order of the configuration.
    pub(super) images: Vec<SiteImage>,
    /// The images with their adjusted orientation; `None` without an adjustment.
    pub(super) adjusted_images: Option<Vec<SiteImage>>,
    /// Reason why a site with tie points has no adjustment.
    pub(super) adjustment_failure: Option<Error>,
}

/// Ground points of the tie points, and the internal agreement of every pair of images.
#[derive(Clone)]
pub(super) struct Intersection {
    pub(super) intersected: Output<IntersectedTies>,
    pub(super) pairs: Output<Vec<PairComparison>>,
    /// Heights of the intersected points, or of the adjusted points.
    pub(super) heights: Output<HeightCheck>,
}
