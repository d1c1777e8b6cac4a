//! Results of a campaign from the published products of its sites.

use std::{
    collections::BTreeMap,
    fmt::Write as _,
    path::{Path, PathBuf},
};

use rayon::prelude::*;
use serde_json::{Value, json};

use super::{
    CampaignSite,
    site_rows::{SiteRows, of_published, without_products},
};
use crate::{
    capabilities::declarations,
    error::{Cause, Error, Result},
    flow::PUBLISH,
    products::{CAMPAIGN_PAGE, CampaignProducts, PageData, write_campaign_products},
    report::campaign_page,
    stages::pool_sites::{CampaignRows, CampaignSummary, SiteState, pool_sites},
    store::{
        lock::SiteLock,
        manifest::{Complaints, ConfigurationEntry, Manifest, StageEntry, Verdict},
        publish::{MANIFEST, entries, has_work, last_failure, publish, staging},
        published::{read_published_by_stored_hashes, still_published},
    },
};

/// Folder of the results, beside the folders of the sites.
pub const CAMPAIGN: &str = "campaign";
/// The only stage; the manifest of the results names it.
const STAGE: &str = "pool_sites";
/// Sites that are read before their rows are put in order.
const SITES_AT_ONCE: usize = 64;

/// What was published.
#[derive(Debug, Clone, PartialEq)]
pub struct CampaignAnswer {
    /// The pooled results.
    pub summary: CampaignSummary,
    /// Folder of the results.
    pub folder: PathBuf,
    /// The page.
    pub page: PathBuf,
}

impl CampaignAnswer {
    /// The answer for scripts.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let tables = ["sites", "images", "pairs", "profiles"];
        let tables = tables.map(|table| (table.to_owned(), json!(self.folder.join(table))));
        json!({
            "campaign": self.summary.campaign,
            "sites": self.summary.sites,
            "images": self.summary.image_rows,
            "pairs": self.summary.pair_rows,
            "profiles": self.summary.profile_rows,
            "tables": serde_json::Map::from_iter(tables),
            "summary": self.folder.join("summary.json"),
            "page": self.page,
        })
    }
}

/// Publishes tables, summary and page over `sites`, whose products are in folders of their names in `out`, to `out/campaign`.
///
/// A site whose last run failed, that has no products, or whose products are damaged or of a different version is a row with
/// the reason. A few sites are in memory at a time, and of the others their rows. The same products give the same bytes,
/// except the time in the manifest.
///
/// # Errors
/// Another process publishes there; files in the place of the results that areograph did not write; errors of writing.
pub fn publish_results(
    out: &Path,
    name: &str,
    sites: &[CampaignSite<'_>],
) -> Result<CampaignAnswer> {
    let folder = out.join(CAMPAIGN);
    let _lock = SiteLock::take(&folder)?;
    let mut rows = rows_of(out, sites);
    rows.mark_repeated();
    let summary = pool_sites(name, &rows);
    let page = campaign_page(&summary, &rows)?;
    let staging = staging(&folder)?;
    let products = CampaignProducts {
        rows: &rows,
        summary: &summary,
        page: &page,
    };
    let written = write_campaign_products(&staging, &products)?.into_iter();
    let files: Vec<(PathBuf, u64)> = written
        .map(|product| (product.path, product.rows))
        .collect();
    let manifest = Manifest {
        products: entries(&staging, &files)?,
        ..manifest(name, &rows)
    };
    publish(&folder, &staging, &manifest)?;
    Ok(CampaignAnswer {
        summary,
        page: folder.join(CAMPAIGN_PAGE),
        folder,
    })
}

/// The products of a site follow from another site file.
#[derive(Debug, thiserror::Error, Cause)]
#[error("the products follow from an earlier campaign file")]
#[cause(Configuration: "run this site again")]
struct OtherConfiguration;

/// Rows of all sites, in their order.
fn rows_of(out: &Path, sites: &[CampaignSite<'_>]) -> CampaignRows {
    let mut rows = CampaignRows::default();
    for some in sites.chunks(SITES_AT_ONCE) {
        let read: Vec<SiteRows> = some
            .par_iter()
            .map(|site| rows_of_site(out, site))
            .collect();
        for site in read {
            rows.sites.push(site.site);
            rows.images.extend(site.images);
            rows.pairs.extend(site.pairs);
            rows.profiles.extend(site.profiles);
        }
    }
    rows
}

/// Rows of a site, whatever the state of its products.
fn rows_of_site(out: &Path, site: &CampaignSite<'_>) -> SiteRows {
    let folder = out.join(site.id);
    let absent = "no run of the site has finished".to_owned();
    if let Some(failure) = site.failure.clone().or_else(|| last_failure(&folder)) {
        return without_products(site, SiteState::Failed, in_one_line(out, &failure));
    }
    if !folder.join(MANIFEST).exists() {
        let state = if has_work(&folder) {
            "no run of the site has finished, although one was begun".to_owned()
        } else {
            absent
        };
        return without_products(site, SiteState::Absent, state);
    }
    match of_folder(&folder, site) {
        Ok(rows) => rows,
        Err(failure) => {
            let text = in_one_line(out, &failure.to_string());
            without_products(site, SiteState::Unusable, text)
        }
    }
}

fn of_folder(folder: &Path, site: &CampaignSite<'_>) -> std::result::Result<SiteRows, Error> {
    let manifest = read_published_by_stored_hashes(folder)?;
    let published = &manifest.configuration.blake3;
    if site
        .configuration_blake3
        .as_ref()
        .is_some_and(|own| own != published)
    {
        return Err(OtherConfiguration.into());
    }
    let data = PageData::read(folder)?;
    let rows = data.with(declarations(), |products| {
        Ok(of_published(site, &manifest, products))
    })?;
    still_published(folder, &manifest)?;
    Ok(rows)
}

/// The first line of a failure, with paths relative to `out`: results in another folder are the same.
fn in_one_line(out: &Path, text: &str) -> String {
    let line = text.lines().next().unwrap_or_default();
    let mut line = line.to_owned();
    let absolute = std::path::absolute(out).unwrap_or_default();
    for prefix in [absolute.as_path(), out] {
        let prefix = format!("{}/", prefix.display());
        if prefix.len() > 1 {
            line = line.replace(&prefix, "");
        }
    }
    line
}

/// The manifest without products.
fn manifest(name: &str, rows: &CampaignRows) -> Manifest {
    let count = |count: usize| count as u64;
    let counts = [
        ("sites", count(rows.sites.len())),
        ("images", count(rows.images.len())),
        ("pairs", count(rows.pairs.len())),
        ("profiles", count(rows.profiles.len())),
    ];
    Manifest {
        tool: "areograph".to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        site: name.to_owned(),
        verdict: Verdict::of(Vec::new(), Vec::new(), Vec::new()),
        configuration: ConfigurationEntry {
            file_name: String::new(),
            blake3: blake3::hash(name.as_bytes()).to_hex().to_string(),
            keys: BTreeMap::new(),
        },
        biases: Vec::new(),
        kernels: Vec::new(),
        kernel_choice: Vec::new(),
        stages: [STAGE, PUBLISH]
            .map(|stage| StageEntry {
                name: stage.to_owned(),
                fingerprint: fingerprint(name, rows),
            })
            .into(),
        products: Vec::new(),
        counts: counts.map(|(name, count)| (name.to_owned(), count)).into(),
        figures: BTreeMap::new(),
        rejected: BTreeMap::new(),
        complaints: Complaints {
            count: 0,
            texts: Vec::new(),
        },
        notes: Vec::new(),
        finished_utc: chrono::Utc::now().format("%Y-%m-%dT%H:%M:%SZ").to_string(),
    }
}

/// Hash over name, state and fingerprint of every site.
fn fingerprint(name: &str, rows: &CampaignRows) -> String {
    let mut text = format!("{name}\n");
    for site in &rows.sites {
        // Writing to a string cannot fail.
        let _infallible = writeln!(
            text,
            "{} {} {}",
            site.site,
            site.state.word(),
            site.fingerprint
        );
    }
    blake3::hash(text.as_bytes()).to_hex().to_string()
}

/// Whether the manifest is of the results of a campaign rather than of a site.
pub(in crate::flow) fn is_of_campaign(manifest: &Manifest) -> bool {
    manifest.stages.iter().any(|stage| stage.name == STAGE)
}
