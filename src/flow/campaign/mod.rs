//! Campaigns: many sites, and the results over all of them.
//!
//! `results.rs` reads the published products of every site, one by one (`site_rows.rs` turns a site into rows), pools them
//! (`stages::pool_sites`), and publishes tables, summary and page to the folder `campaign` beside the sites.

mod results;
mod site_rows;

use crate::pds::image_index::IndexedImage;

pub(in crate::flow) use results::is_of_campaign;
pub use results::{CAMPAIGN, CampaignAnswer, publish_results};

/// A site of a campaign.
#[derive(Debug, Clone)]
pub struct CampaignSite<'a> {
    /// Its identifier, which is the name of its folder.
    pub id: &'a str,
    /// Its images in the index; those that the index does not have are missing.
    pub images: Vec<&'a IndexedImage>,
}
