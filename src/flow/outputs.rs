//! The outputs of the stages of a site.

use super::choice::KernelChoice;
use crate::{
    error::Error,
    spice::{KernelSet, RequiredCoverage},
    stage::Output,
    stages::{
        adjust::Adjusted, check_beam::ImageBeam, check_heights::HeightCheck,
        check_ranges::RangeCheck, compare_pairs::PairComparison, convert_datum::Converted,
        describe_kernels::KernelDescription, group_profiles::Profile, intersect::IntersectedTies,
        lay_overlays::Overlays, map_surface::Surface, read_ties::Ties,
        search_footprints::SearchResult, site_image::SiteImage, tabulate_kernels::KernelTables,
        tag_times::ImageTimes,
    },
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
    /// Of the same images.
    pub(super) beam: Output<Vec<ImageBeam>>,
    /// `None` for a site without tie point files.
    pub(super) ties: Option<Output<Ties>>,
    /// With the orientation of the kernels; `None` if it failed.
    pub(super) intersection: Option<Intersection>,
    /// `None` if it failed.
    pub(super) adjustment: Option<Adjustment>,
    /// Overlays on the images; `None` for a site without pixels.
    pub(super) overlays: Option<Output<Overlays>>,
    /// A terrain model; `None` for a site that requests none.
    pub(super) surface: Option<Output<Surface>>,
    /// Why a site with tie points has no adjustment.
    pub(super) adjustment_failure: Option<Error>,
}

/// Ground points of the tie points, and the internal agreement of every pair of images.
pub(super) struct Intersection {
    pub(super) intersected: Output<IntersectedTies>,
    pub(super) pairs: Output<Vec<PairComparison>>,
    /// Heights of the intersected points, or of those of the adjustment.
    pub(super) heights: Output<HeightCheck>,
}

/// Outputs of the adjustment of a site.
pub(super) struct Adjustment {
    pub(super) adjusted: Output<Adjusted>,
    /// The images with their adjusted orientation.
    pub(super) images: Vec<SiteImage>,
    /// Contents of the adjusted kernels of every image.
    pub(super) tables: Vec<Output<KernelTables>>,
    /// With the adjusted orientation.
    pub(super) intersection: Intersection,
}
