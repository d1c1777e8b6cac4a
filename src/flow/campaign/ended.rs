//! One site of a campaign, from its site file to its end, in a form that processes exchange.

use std::{
    path::{Path, PathBuf},
    time::Instant,
};

use serde::{Deserialize, Serialize};

use super::costs::Costs;
use crate::{
    config::{Document as _, SiteConfig},
    error::{Error, Locate as _, Result},
    flow::{Ending, RunOptions, check_out, run_site},
    store::lock::Busy,
};

/// How a site ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SiteEnd {
    /// Identifier.
    pub site: String,
    /// Its end.
    pub end: End,
}

/// End of a site.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum End {
    /// There are products.
    Products {
        /// Whether they are valid.
        valid: bool,
        /// Whether nothing had changed since an earlier run.
        unchanged: bool,
        /// Reasons why they are invalid.
        reasons: Vec<String>,
        /// Costs of the run.
        costs: Costs,
    },
    /// The run failed; earlier products remain.
    Failed {
        /// The failure with its place and advice.
        text: String,
        /// Exit code of its kind.
        exit_code: u8,
        /// Whether another process was working on the site.
        is_busy: bool,
    },
}

impl SiteEnd {
    /// A site that failed.
    #[must_use]
    pub fn failed(site: &str, failure: &Error) -> Self {
        Self {
            site: site.to_owned(),
            end: End::Failed {
                text: failure.to_string(),
                exit_code: failure.kind().exit_code(),
                is_busy: Busy::is_cause_of(failure),
            },
        }
    }

    /// Whether there are valid products.
    #[must_use]
    pub const fn is_valid(&self) -> bool {
        matches!(self.end, End::Products { valid: true, .. })
    }

    /// The site and its failure, if it failed.
    #[must_use]
    pub fn failed_with(&self) -> Option<(&str, &String)> {
        match &self.end {
            End::Failed { text, .. } => Some((&self.site, text)),
            End::Products { .. } => None,
        }
    }

    /// Exit code of the failure, if the site failed.
    #[must_use]
    pub const fn failure(&self) -> Option<u8> {
        match self.end {
            End::Failed { exit_code, .. } => Some(exit_code),
            End::Products { .. } => None,
        }
    }

    /// Costs of the run, if it processed something.
    #[must_use]
    pub const fn costs(&self) -> Option<Costs> {
        match self.end {
            End::Products {
                unchanged: false,
                costs,
                ..
            } => Some(costs),
            _ => None,
        }
    }
}

/// Runs the site of a site file that a campaign wrote.
#[must_use]
pub fn run_site_file(path: &Path, options: &RunOptions<'_>) -> SiteEnd {
    let site = path.file_stem().unwrap_or_default().to_string_lossy();
    match products(path, options).in_site(&site) {
        Ok(end) => SiteEnd {
            site: site.into_owned(),
            end,
        },
        Err(failure) => SiteEnd::failed(&site, &failure),
    }
}

fn products(path: &Path, options: &RunOptions<'_>) -> Result<End> {
    let begun = Instant::now();
    let loaded = SiteConfig::load(path)?;
    for warning in loaded.warnings {
        tracing::debug!("{warning}");
    }
    let config = loaded.config;
    check_out(&options.out, std::slice::from_ref(&config))?;
    let outcome = run_site(&config, options)?;
    let manifest = outcome.manifest();
    let verdict = manifest.map(|manifest| &manifest.verdict);
    let products = manifest.into_iter().flat_map(|manifest| &manifest.products);
    let footprints = manifest.and_then(|manifest| manifest.counts.get("footprints").copied());
    Ok(End::Products {
        valid: verdict.is_some_and(|verdict| verdict.valid),
        unchanged: matches!(outcome.ending, Ending::Unchanged(_)),
        reasons: verdict.map_or_else(Vec::new, |verdict| verdict.reasons.clone()),
        costs: Costs {
            images: config.images.len() as u64,
            seconds: begun.elapsed().as_secs_f64(),
            bytes: products.map(|product| product.bytes).sum(),
            footprints: footprints.unwrap_or(0),
        },
    })
}

/// Some sites of a campaign as a task for another process: its input file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SiteTask {
    /// Site files.
    pub site_files: Vec<PathBuf>,
    /// Folder of the products.
    pub out: PathBuf,
}
