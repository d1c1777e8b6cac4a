//! Campaigns: many sites, and the results over all of them.
//!
//! `results.rs` reads the published products of every site, one by one (`site_rows.rs` turns a site into rows), pools them
//! (`stages::pool_sites`), and publishes tables, summary and page to the folder `campaign` beside the sites.

mod results;
mod site_rows;

pub(in crate::flow) use results::is_of_campaign;
pub use results::{CAMPAIGN, CampaignAnswer, CampaignSite, publish_results};
