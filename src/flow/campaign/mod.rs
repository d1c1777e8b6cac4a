//! A campaign: images of an index, selected by rule, become sites; sites run like any other, and their results are pooled.
//!
//! `selection` applies the rules of the campaign file, `files` finds the files of the images, `site_files` writes the site
//! files, `costs` remembers what they cost, and `ended` runs one of them. `results` reads the published products of every
//! site, one by one (`site_rows` turns a site into rows), pools them (`stages::pool_sites`), and publishes tables, summary and
//! page to the folder `campaign` beside the sites.

mod costs;
mod ended;
mod files;
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

/// A site of a campaign.
#[derive(Debug, Clone)]
pub struct CampaignSite<'a> {
    /// Its identifier, which is the name of its folder.
    pub id: &'a str,
    /// Its images in the index; those that the index does not have are missing.
    pub images: Vec<&'a IndexedImage>,
}
