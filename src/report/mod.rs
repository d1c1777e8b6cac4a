//! The page that a person looks at first: verdict, what was used, residuals and plots of one site.
//!
//! One HTML file without scripts or outside parts; everything that came from files is escaped.

mod diff;
mod html;
mod images;
mod map;
mod plots;
mod ranges;
mod summary;

pub use diff::difference_page;

use crate::{error::Result, products::SiteProducts};

/// The report of `site` as one HTML page.
///
/// # Errors
/// A plot that cannot be drawn, which is a fault of areograph.
pub fn page(site: &SiteProducts) -> Result<String> {
    let sections = [
        summary::verdict(site),
        summary::inputs(site),
        summary::corrections(site),
        map::map(site)?,
        ranges::profiles(site),
        ranges::residual_plots(site)?,
        ranges::scan_plots(site)?,
        images::models(site),
        images::residual_plots(site)?,
        summary::remarks(site),
    ];
    Ok(html::page(&site.config.site, &sections.concat()))
}
