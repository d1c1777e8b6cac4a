//! The page that a person looks at first: verdict, residuals, orientation, map and kernels of one site.
//!
//! One HTML file without scripts or outside parts, for light and dark screens, phones and paper.
//! Every plot is told in words and carries its numbers; everything that came from files is escaped.

#![allow(
    clippy::format_push_string,
    clippy::format_collect,
    reason = "pages are put together once from small pieces"
)]
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    reason = "pixels, bars and grid lines are small numbers, and casts of floats saturate"
)]

mod adjustment;
mod compare;
mod corrections;
mod diff;
mod graticule;
mod html;
mod images;
mod map;
mod misregistration;
mod moved;
mod outlines;
mod plots;
mod ranges;
mod registration;
mod reliability;
mod scan;
mod sites;
mod summary;
mod timeline;
mod uncertainty;

use crate::{error::Result, products::SiteProducts};

pub use compare::{KernelComparison, comparison_page};
pub use diff::difference_page;
pub use sites::{SiteLine, SiteSummary, sites_page};

use html::Section;

/// The report of `site` as one HTML page.
///
/// # Errors
/// A plot that cannot be drawn, which is a fault of areograph.
pub fn page(site: &SiteProducts) -> Result<String> {
    let sections = [
        Section::new("Range check", ranges::section(site)?),
        Section::new("Clock bias scan", scan::section(site)?),
        Section::new("Exterior orientation", images::section(site)?),
        Section::new("Registration", registration::section(site)?),
        Section::new(
            "Tie points and misregistration",
            misregistration::section(site)?,
        ),
        Section::new("Combined adjustment", adjustment::section(site)?),
        Section::new("Uncertainty of ground points", uncertainty::section(site)),
        Section::new("Map", map::section(site)?),
        Section::new("Selection of shots", summary::selection(site)),
        Section::new("Clock corrections and datum", summary::corrections(site)),
        Section::new("Kernel coverage", timeline::section(site)?),
        Section::new("Notes", summary::notes(site)),
        Section::new("Provenance", summary::provenance(site)),
    ];
    Ok(html::page(
        &site.config.site,
        &summary::lead(site),
        &sections,
    ))
}
