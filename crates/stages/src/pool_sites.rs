//! Pools the published results of many sites: the tables of Shan et al. 2005 over all of them, and biases of mission phases.
//!
//! Rows of sites without usable products, and of invalid sites, are counted but not pooled. An image, a pair of images or a
//! profile that several sites have counts once. Pairs that share an image or an orbit share its errors: standard
//! deviations of means are from the scatter between groups of pairs without a common image or orbit.
//!
//! # Source
//! Shan et al. 2005, Tables 2 to 5, and eq. 5 to 9 with the squares averaged over the sites.

mod measures;
mod phases;
mod pooled;
mod repeated;
mod rows;
mod summary;

pub use measures::{ImageGeometry, shot_spacing_m};
pub use phases::{PhaseSummary, Quantity, phase_or_unknown};
pub use pooled::{
    HeightsPooled, ImageResidualsPooled, ImagesPooled, MisregistrationPooled, RangesPooled,
    ResidualsPooled, RmsePooled,
};
pub use rows::{
    CampaignRows, ImageRow, KernelSetName, Measured, OrientedImageRow, PairHeights,
    PairMisregistration, PairRow, PairState, PolynomialRmse, ProfileRow, RangeStatistics, SiteRow,
    SiteState,
};
pub use summary::{BudgetsPooled, CampaignSummary, SiteCounts, StatePooled, pool_sites};

#[cfg(test)]
mod tests;
