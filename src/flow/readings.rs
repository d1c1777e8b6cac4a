//! Causes of the along-track disagreement of images, compared over the pairs of published sites.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

use serde_json::{Value, json};

use crate::{
    capabilities::declarations,
    config::{AdjustmentConfig, ReadingsDecision},
    difference::sites,
    error::{Cause, Result},
    geom::readings::{CausesCompared, DECISIVE_ODDS, PairDisagreement, ReadingSigmas, compare},
    products::PageData,
    report::{ReadPair, ReadingsReport},
    store::published::{is_site_folder, read_published_by_this_version, still_published},
};

/// Reasons why nothing is compared.
#[derive(Debug, thiserror::Error, Cause)]
enum ReadingsError {
    /// No site has a pair that shows a displacement along the track.
    #[error(
        "no pair of images that shows a cause in {0}; expected two images with common tie points, flown in one direction and apart across the track"
    )]
    #[cause(Input: "name products of sites with such pairs")]
    NoPairs(String),
    /// A standard deviation is far beyond its usual size.
    #[error("the pairs and the standard deviations do not determine probabilities")]
    #[cause(Configuration: "give standard deviations of the size of their defaults")]
    NotANumber,
}

/// A comparison of the two causes.
#[derive(Debug)]
pub struct Readings {
    /// The pairs, in the order of their sites, each once.
    pub pairs: Vec<ReadPair>,
    /// Pairs and sites that are not used, each with the reason.
    pub without: Vec<(String, String)>,
    /// A priori standard deviations.
    pub sigmas: ReadingSigmas,
    /// The result.
    pub compared: CausesCompared,
}

impl Readings {
    /// A priori standard deviations of `[adjustment]` by default.
    #[must_use]
    pub fn usual_sigmas() -> ReadingSigmas {
        let usual = AdjustmentConfig::default();
        ReadingSigmas {
            line_time_s: usual.line_time_sigma_s,
            rotation_rad: usual.attitude_clock_rotation_sigma_rad,
            clock_s: usual.attitude_clock_sigma_s,
        }
    }

    /// Its parts, for the page.
    #[must_use]
    pub fn report(&self) -> ReadingsReport<'_> {
        ReadingsReport {
            pairs: &self.pairs,
            without: &self.without,
            sigmas: &self.sigmas,
            compared: &self.compared,
        }
    }

    /// The result as site files name it.
    #[must_use]
    pub fn decision(&self) -> ReadingsDecision {
        ReadingsDecision {
            pairs: i32::try_from(self.pairs.len()).unwrap_or(i32::MAX),
            supported: self.compared.supported(),
            log_odds: [
                self.compared.log_odds_of_clock(),
                self.compared.log_odds_of_images(),
            ],
            attitude_clock_s: self.compared.clock_s,
            attitude_clock_sigma_s: self.compared.clock_sigma_s,
        }
    }

    /// The answer for scripts.
    #[must_use]
    pub fn answer(&self) -> Value {
        let pairs = self.pairs.iter().zip(&self.compared.left_m);
        let pairs = pairs.map(|(pair, left_m)| {
            json!({
                "site": pair.site,
                "images": pair.disagreement.images,
                "apart_m": pair.disagreement.apart_m,
                "sigma_m": pair.disagreement.sigma_m,
                "clock_m_s": pair.disagreement.clock_m_s,
                "range_m": pair.disagreement.range_m,
                "line_time_m_s": pair.disagreement.line_time_m_s,
                "left_by_clock_m": left_m,
            })
        });
        let without = self.without.iter();
        let without = without.map(|(what, reason)| json!({"what": what, "reason": reason}));
        let [large, large_with, small, small_with] = self.compared.log_likelihoods;
        json!({
            "supported": self.decision().word(),
            "log_odds_of_clock": self.compared.log_odds_of_clock(),
            "log_odds_of_images": self.compared.log_odds_of_images(),
            "decisive_log_odds": DECISIVE_ODDS.ln(),
            "log_likelihoods": {
                "large_errors_of_images": large,
                "large_errors_of_images_and_offset": large_with,
                "small_errors_of_images": small,
                "small_errors_of_images_and_offset": small_with,
            },
            "attitude_clock_s": self.compared.clock_s,
            "attitude_clock_sigma_s": self.compared.clock_sigma_s,
            "a_priori_sigma": {
                "line_time_s": self.sigmas.line_time_s,
                "rotation_rad": self.sigmas.rotation_rad,
                "attitude_clock_s": self.sigmas.clock_s,
            },
            "pairs": pairs.collect::<Vec<_>>(),
            "not_used": without.collect::<Vec<_>>(),
            "areograph": env!("CARGO_PKG_VERSION"),
        })
    }
}

/// Compares the causes over the pairs of the sites whose products are in `folders`, each of one site or of several, with the
/// orientation from the kernels.
///
/// # Errors
/// Products that are missing, damaged or of a different version; no pair of images.
pub fn compare_readings(folders: &[PathBuf], sigmas: ReadingSigmas) -> Result<Readings> {
    let mut of_sites = Vec::new();
    for folder in folders {
        if is_site_folder(folder) {
            of_sites.push(folder.clone());
        } else {
            of_sites.extend(sites(folder)?.into_values());
        }
    }
    let (mut pairs, mut without) = (Vec::new(), Vec::new());
    let mut seen = BTreeSet::new();
    for folder in &of_sites {
        let (site, of_site) = pairs_of(folder)?;
        if of_site.is_empty() {
            without.push((
                site.clone(),
                "no two images with common tie points".to_owned(),
            ));
        }
        for (images, disagreement) in of_site {
            let named = format!("{site}, {}", images.join(" and "));
            let Some(disagreement) = disagreement else {
                let reason = "not flown in one direction, or not apart across the track";
                without.push((named, reason.to_owned()));
                continue;
            };
            // The same images in two sites are one observation.
            let mut both = images;
            both.sort_unstable();
            if seen.insert(both) {
                let site = site.clone();
                pairs.push(ReadPair { site, disagreement });
            } else {
                without.push((named, "in an earlier site as well".to_owned()));
            }
        }
    }
    if pairs.is_empty() {
        let sites = match of_sites.len() {
            1 => "1 site".to_owned(),
            count => format!("{count} sites"),
        };
        return Err(ReadingsError::NoPairs(sites).into());
    }
    let disagreements: Vec<_> = pairs.iter().map(|pair| pair.disagreement.clone()).collect();
    let compared = compare(&disagreements, &sigmas).ok_or(ReadingsError::NotANumber)?;
    Ok(Readings {
        pairs,
        without,
        sigmas,
        compared,
    })
}

/// Identifiers of the images of a pair, and their disagreement where it shows a cause.
type SitePair = ([String; 2], Option<PairDisagreement>);

/// The site of the products in `folder`, and its pairs.
fn pairs_of(folder: &Path) -> Result<(String, Vec<SitePair>)> {
    let manifest = read_published_by_this_version(folder, |_| false)?;
    let data = PageData::without_tables(folder)?;
    still_published(folder, &manifest)?;
    let pairs = data.with(declarations(), |products| {
        let geometric = products.geometric.iter();
        let pairs = geometric.flat_map(|geometric| geometric.pairs);
        let pairs = pairs.map(|pair| {
            let along = pair.along_track.as_ref();
            (
                pair.images.clone(),
                along.map(|along| along.disagreement(pair.images.clone())),
            )
        });
        Ok(pairs.collect())
    })?;
    Ok((manifest.site, pairs))
}
