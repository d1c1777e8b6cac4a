//! The first page for a reader: verdict, residuals, orientation, map and kernels of one site.
//!
//! One HTML file without scripts or outside parts, for light and dark screens, phones and paper.
//! Every plot is described in words and carries its numbers; all text from files is escaped.

#![allow(
    clippy::format_push_string,
    reason = "pages are assembled once from small pieces"
)]
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    reason = "pixels, bars and grid lines are small numbers, and casts of floats saturate"
)]

mod adjustment;
mod archive;
mod calibration;
mod calibration_rounds;
mod calibration_series;
mod campaign;
mod checks;
mod clocks_and_datum;
mod compare;
mod convergence;
mod corrections;
mod correlation;
mod diff;
pub mod difference;
mod elevation_curves;
mod fidelity;
mod graticule;
mod grey;
mod heights;
mod html;
mod image_strips;
mod images;
mod laser_match;
mod many;
mod map;
mod matching;
mod misregistration;
mod moved;
mod net;
mod net_pictures;
mod notes;
mod numbers;
mod offset_arrows;
mod outcome;
mod outlines;
mod overlays;
mod plots;
mod profiles;
mod provenance;
mod published;
mod ranges;
mod readings;
mod registration;
mod reliability;
mod residuals;
mod scan;
mod section;
mod selection;
mod sites;
mod sites_map;
mod sky;
mod source;
mod summary;
mod support_data;
mod terrain_pictures;
mod timeline;
mod uncertainty;

use areograph_base::error::Result;
use areograph_products::SiteProducts;

pub use archive::archive_page;
pub use calibration::calibration_page;
pub use calibration_series::{CalibrationSeries, SeriesOrbit, calibration_series_page};
pub use campaign::campaign_page;
pub use compare::{KernelComparison, comparison_page};
pub use diff::difference_page;
pub use fidelity::{
    FIDELITY_FILE, Fidelity, FidelityKind, FidelityPaper, FidelityRow, fidelity_page,
    published_fidelity_page,
};
pub use html::STYLE;
pub use laser_match::match_page;
pub use net::net_page;
pub use offset_arrows::{Offsets, offset_arrows};
pub use overlays::overlays_page;
pub use readings::{ReadPair, Readings, readings_page};
pub use section::Section;
pub use sites::{Earlier, SiteLine, SiteSummary, sites_page};
pub use summary::{DOWNLOADS, UNADJUSTED};
pub use terrain_pictures::terrain_pictures;

/// Parts of sections that are declared outside this crate.
pub mod parts {
    pub use super::{
        grey::{grey, stretched},
        html::{Cell, Column, Table, folded_unless, link, paragraph},
        map::globe::globe,
        map::{
            relief::{COLOURS as HEIGHT_COLOURS, relief_of_shots, shade},
            round_length_m,
        },
        numbers::{signed, whole},
        outlines::{Outline, windows as window_outlines},
        overlays::picture_of,
        plots::label,
    };
}

/// The first sections of a site's page, in order.
const FIRST_SECTIONS: &[Section] = &[
    heights::SECTION,
    misregistration::SECTION,
    matching::SECTION,
];

/// The sections after those of further capabilities.
const LAST_SECTIONS: &[Section] = &[
    adjustment::SECTION,
    profiles::SECTION,
    ranges::SECTION,
    scan::SECTION,
    images::SECTION,
    support_data::SECTION,
    registration::SECTION,
    overlays::SECTION,
    map::SECTION,
    timeline::SECTION,
    selection::SECTION,
    clocks_and_datum::SECTION,
    notes::SECTION,
    provenance::SECTION,
    convergence::SECTION,
    published::SECTION,
    uncertainty::SECTION,
];

/// The report of `site` as one HTML page, with the sections of further capabilities.
///
/// # Errors
/// A plot that cannot be drawn, which is a bug in areograph.
pub fn page(site: &SiteProducts, of_capabilities: &[Section]) -> Result<String> {
    let sections: Vec<&Section> = sections(of_capabilities).collect();
    let written = sections.iter().map(|section| section.of(site));
    let written: Vec<html::Section> = written
        .filter_map(Result::transpose)
        .collect::<Result<_>>()?;
    let lead = summary::lead(site, &sections)?;
    let page = html::page(&site.config.site, &lead, &written);
    Ok(plots::with_files(&page))
}

/// Every section of a site's page, in its order.
pub fn sections(of_capabilities: &[Section]) -> impl Iterator<Item = &Section> {
    FIRST_SECTIONS
        .iter()
        .chain(of_capabilities)
        .chain(LAST_SECTIONS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn anchors_are_unique_and_need_no_escape() {
        let mut anchors: Vec<&str> = sections(&[]).map(|section| section.anchor).collect();
        let count = anchors.len();
        assert!(anchors.iter().all(|anchor| html::slug(anchor) == *anchor));
        anchors.sort_unstable();
        anchors.dedup();
        assert_eq!(anchors.len(), count);
    }
}
