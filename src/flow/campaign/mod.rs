//! A campaign: images of an index, selected by rule, become sites; sites run like any other, and their results are pooled.
//!
//! `selection` applies the rules of the campaign file, `files` finds the files of the images, `site_files` writes the site
//! files, `costs` remembers what they cost, and `ended` runs one of them. `results` reads the published products of every
//! site, one by one (`site_rows` turns a site into rows), pools them (`stages::pool_sites`), and publishes tables, summary and
//! page to the folder `campaign` beside the sites.

mod costs;
mod ended;
mod files;
mod pooled_sites;
mod results;
mod selection;
mod site_files;
mod site_rows;

use crate::pds::image_index::IndexedImage;

pub use costs::{Costs, InputSize};
pub use ended::{End, SiteEnd, SiteTask, run_site_file};
pub(in crate::flow) use results::is_of_campaign;
pub use results::{CAMPAIGN, CampaignAnswer, publish_results};
pub use selection::{Campaign, LeftOut, PlannedSite, select_campaign};

/// Folder of the site files in the output folder.
pub const SITES: &str = "sites";

/// A site of a campaign.
#[derive(Debug, Clone, Default)]
pub struct CampaignSite<'a> {
    /// Its identifier, which is the name of its folder.
    pub id: &'a str,
    /// Its images in the index; those that the index does not have are missing.
    pub images: Vec<&'a IndexedImage>,
    /// Reason why it has no products of this campaign, whatever its folder contains.
    pub failure: Option<String>,
    /// BLAKE3, hexadecimal, of the keys and values of its site file; products of other keys are not used.
    pub configuration_blake3: Option<String>,
}
