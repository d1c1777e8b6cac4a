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
    geom::readings::{AlongTrack, DECISIVE_ODDS, PairDisagreement, ReadingSigmas, compare},
    products::PageData,
    report::{ReadPair, Readings},
    store::published::{is_site_folder, read_published_by_this_version, still_published},
};

/// Reasons why nothing is compared.
#[derive(Debug, thiserror::Error, Cause)]
enum ReadingsError {
    /// No site has a pair that shows a displacement along the track.
    #[error(
        "no pair of images in {0} shows a cause; expected two images with common tie points, taken in the same flight \
         direction and separated across the track"
    )]
    #[cause(Input: "name products of sites with such pairs")]
    NoPairs(String),
    /// Spacecraft have clocks of their own.
    #[error("the images are of several spacecraft: {0}; expected those of one")]
    #[cause(Configuration: "name products of one mission")]
    SeveralSpacecraft(String),
    /// A standard deviation is far beyond its usual size.
    #[error("the pairs and the standard deviations do not determine probabilities")]
    #[cause(Configuration: "give standard deviations similar to their defaults")]
    NotANumber,
}

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

/// The result as site files name it.
#[must_use]
pub fn readings_decision(readings: &Readings) -> ReadingsDecision {
    let compared = &readings.compared;
    ReadingsDecision {
        pairs: i32::try_from(readings.pairs.len()).unwrap_or(i32::MAX),
        supported: compared.supported(),
        log_odds: [compared.log_odds_of_clock(), compared.log_odds_of_images()],
        attitude_clock_s: compared.clock_s,
        attitude_clock_sigma_s: compared.clock_sigma_s,
    }
}

/// The answer for scripts.
#[must_use]
pub fn readings_answer(readings: &Readings) -> Value {
    let Readings {
        pairs,
        not_used,
        sigmas,
        compared,
    } = readings;
    let pairs = pairs.iter().zip(&compared.left_m);
    let pairs = pairs.map(|(pair, left_m)| {
        let mut of_pair = json!(pair.disagreement.along_track);
        of_pair["site"] = json!(pair.site);
        of_pair["images"] = json!(pair.disagreement.images);
        of_pair["left_by_clock_m"] = json!(left_m);
        of_pair
    });
    let not_used = not_used.iter();
    let not_used = not_used.map(|(what, reason)| json!({"what": what, "reason": reason}));
    let [large, large_with, small, small_with] = compared.log_likelihoods;
    json!({
        "supported": readings_decision(readings).word(),
        "log_odds_of_clock": compared.log_odds_of_clock(),
        "log_odds_of_images": compared.log_odds_of_images(),
        "decisive_log_odds": DECISIVE_ODDS.ln(),
        "log_likelihoods": {
            "large_errors_of_images": large,
            "large_errors_of_images_and_offset": large_with,
            "small_errors_of_images": small,
            "small_errors_of_images_and_offset": small_with,
        },
        "attitude_clock_s": compared.clock_s,
        "attitude_clock_sigma_s": compared.clock_sigma_s,
        "a_priori_sigma": {
            "line_time_s": sigmas.line_time_s,
            "rotation_rad": sigmas.rotation_rad,
            "attitude_clock_s": sigmas.clock_s,
        },
        "pairs": pairs.collect::<Vec<_>>(),
        "not_used": not_used.collect::<Vec<_>>(),
        "areograph": env!("CARGO_PKG_VERSION"),
    })
}

/// Folders of the sites whose products are in `folders`, each of one site or of several.
///
/// # Errors
/// A folder without products.
pub(super) fn site_folders(folders: &[PathBuf]) -> Result<Vec<PathBuf>> {
    let mut of_sites = Vec::new();
    for folder in folders {
        if is_site_folder(folder) {
            of_sites.push(folder.clone());
        } else {
            of_sites.extend(sites(folder)?.into_values());
        }
    }
    Ok(of_sites)
}

/// Compares the causes over the pairs of the sites whose products are in `folders`, each of one site or of several, with the
/// orientation from the kernels.
///
/// # Errors
/// Products that are missing, damaged or of a different version; no pair of images; images of several spacecraft.
pub fn compare_readings(folders: &[PathBuf], sigmas: ReadingSigmas) -> Result<Readings> {
    let of_sites = site_folders(folders)?;
    let (mut pairs, mut not_used) = (Vec::new(), Vec::new());
    let (mut seen, mut spacecraft) = (BTreeSet::new(), BTreeSet::new());
    for folder in &of_sites {
        let of_site = SitePairs::of(folder)?;
        let site = of_site.site;
        if of_site.pairs.is_empty() {
            not_used.push((site.clone(), "no two images with common tie points"));
        } else {
            spacecraft.extend(of_site.spacecraft);
        }
        for (images, along_track) in of_site.pairs {
            // The same images in two sites are one observation.
            let mut both = images.clone();
            both.sort_unstable();
            let is_new = seen.insert(both);
            let reason = match along_track {
                Some(along_track) if is_new => {
                    pairs.push(ReadPair {
                        site: site.clone(),
                        disagreement: PairDisagreement {
                            images,
                            along_track,
                        },
                    });
                    continue;
                }
                Some(_) => "also in an earlier site",
                None => "not taken in the same flight direction, or not separated across the track",
            };
            not_used.push((format!("{site}, {}", images.join(" and ")), reason));
        }
    }
    if pairs.is_empty() {
        let sites = match of_sites.len() {
            1 => "1 site".to_owned(),
            count => format!("{count} sites"),
        };
        return Err(ReadingsError::NoPairs(sites).into());
    }
    if spacecraft.len() > 1 {
        let names: Vec<String> = spacecraft.into_iter().collect();
        return Err(ReadingsError::SeveralSpacecraft(names.join(", ")).into());
    }
    let disagreements: Vec<_> = pairs.iter().map(|pair| pair.disagreement.clone()).collect();
    let compared = compare(&disagreements, &sigmas).ok_or(ReadingsError::NotANumber)?;
    Ok(Readings {
        pairs,
        not_used,
        sigmas,
        compared,
    })
}

/// The pairs of a site.
struct SitePairs {
    site: String,
    /// Names of the spacecraft of its images.
    spacecraft: Vec<String>,
    /// Identifiers of the images, and their displacement where it shows a cause.
    pairs: Vec<([String; 2], Option<AlongTrack>)>,
}

impl SitePairs {
    /// The pairs of the site whose products are in `folder`.
    fn of(folder: &Path) -> Result<Self> {
        let manifest = read_published_by_this_version(folder, |_| false)?;
        let data = PageData::without_tables(folder)?;
        still_published(folder, &manifest)?;
        data.with(declarations(), |products| {
            let geometric = products.geometric.iter();
            let pairs = geometric.flat_map(|geometric| geometric.pairs);
            let images = products.images.iter();
            Ok(Self {
                site: manifest.site.clone(),
                spacecraft: images.map(|image| image.times.spacecraft_name()).collect(),
                pairs: pairs
                    .map(|pair| (pair.images.clone(), pair.along_track))
                    .collect(),
            })
        })
    }
}
