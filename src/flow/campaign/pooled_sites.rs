//! The sites of a campaign for its results: images, failures, and the keys that their products must follow from.

use std::{collections::BTreeMap, path::Path};

use super::{CampaignSite, ended::SiteEnd, selection::Campaign};
use crate::{error::Result, pds::image_index::IndexedImage};

impl Campaign {
    /// The sites whose results the campaign pools, and those that are left out, as rows with the reason.
    ///
    /// * `ended` – sites that have just run
    ///
    /// # Errors
    /// The folder of the site files cannot be found.
    pub fn results_of(&self, ended: &[SiteEnd], out: &Path) -> Result<Vec<CampaignSite<'_>>> {
        let failures: BTreeMap<&str, &String> =
            ended.iter().filter_map(SiteEnd::failed_with).collect();
        let images = |numbers: &[usize]| -> Vec<&IndexedImage> {
            let numbers = numbers.iter();
            numbers.map(|number| &self.images[*number].image).collect()
        };
        let mut sites = Vec::with_capacity(self.sites.len() + self.left_out.len());
        for site in &self.sites {
            sites.push(CampaignSite {
                id: &site.id,
                images: images(&site.images),
                failure: failures.get(&*site.id).map(|text| (*text).clone()),
                configuration_blake3: self.template.hash_of_site_file(&self.text_of(site, out)?),
            });
        }
        sites.extend(self.left_out.iter().map(|site| CampaignSite {
            id: &site.site,
            images: images(&site.images),
            failure: Some(format!("left out: {}", site.lack)),
            configuration_blake3: None,
        }));
        sites.sort_by(|a, b| a.id.cmp(b.id));
        Ok(sites)
    }
}
