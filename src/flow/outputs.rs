//! The outputs of the stages of a site.

use crate::{
    error::{Error, Result},
    spice::{KernelSet, RequiredCoverage},
    stage::{Output, Round},
    stages::{
        adjust::Adjusted, check_heights::HeightCheck, compare_pairs::PairComparison,
        convert_datum::Converted, group_profiles::Profile, intersect::IntersectedTies,
        search_footprints::SearchResult, site_image::SiteImage, tag_times::ImageTimes,
        tag_utc::ShotTimes,
    },
    store::book::Book,
};

/// Footprints and their profiles.
pub(super) type Shots<'a> = (&'a Output<Converted>, &'a Output<Vec<Profile>>);

/// Outputs of the stages before the choice of kernels.
#[derive(Clone)]
pub(super) struct Prepared {
    pub(super) found: Output<SearchResult>,
    pub(super) converted: Output<Converted>,
    pub(super) utc: Output<ShotTimes>,
    pub(super) profiles: Output<Vec<Profile>>,
    /// Line times, in the order of the configuration.
    pub(super) images: Vec<Output<ImageTimes>>,
    /// The times at which the site reads kernels; `None` while they are not known.
    pub(super) required: Option<RequiredCoverage>,
}

/// A site with the outputs of all its stages.
pub(super) struct Site {
    pub(super) book: Book,
    pub(super) required: Option<RequiredCoverage>,
    pub(super) kernels: Option<KernelSet>,
    /// Reason why a site with tie points has no adjustment.
    pub(super) adjustment_failure: Option<Error>,
}

impl Site {
    /// The images with the orientation from the kernels, in the order of the configuration.
    ///
    /// # Errors
    /// A bug in areograph: they were not entered.
    pub(super) fn images(&self) -> Result<Vec<SiteImage>> {
        SiteImage::all(&self.book, Round::Initial)
    }

    /// The images with their best orientation: the adjusted one, where there is an adjustment.
    ///
    /// # Errors
    /// As [`Site::images`].
    pub(super) fn best_images(&self) -> Result<Vec<SiteImage>> {
        let round = if self.is_adjusted()? {
            Round::Adjusted
        } else {
            Round::Initial
        };
        SiteImage::all(&self.book, round)
    }

    /// Whether the site has an adjustment.
    ///
    /// # Errors
    /// As [`Site::images`].
    pub(super) fn is_adjusted(&self) -> Result<bool> {
        Ok(self.book.output::<Adjusted>(Round::Initial)?.is_some())
    }

    /// Footprints and their profiles, inputs of most stages.
    ///
    /// # Errors
    /// As [`Site::images`].
    pub(super) fn shots(&self) -> Result<Shots<'_>> {
        let round = Round::Initial;
        Ok((self.book.require(round)?, self.book.require(round)?))
    }
}

/// Ground points of the tie points, and the internal agreement of every pair of images.
#[derive(Clone)]
pub(super) struct Intersection {
    pub(super) intersected: Output<IntersectedTies>,
    pub(super) pairs: Output<Vec<PairComparison>>,
    /// Heights of the intersected points, or of the adjusted points.
    pub(super) heights: Output<HeightCheck>,
}
