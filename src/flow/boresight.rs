//! Boresight of the laser by the statements of published sites.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

use serde_json::{Value, json};

use super::readings::site_folders;
use crate::{
    capabilities::declarations,
    config::{AdjustmentConfig, BoresightOfSite, BoresightStatements, LaserMounting},
    error::{Cause, Kind, Result},
    geom::boresight::{PooledBoresight, pooled},
    products::{PageData, SiteProducts},
    stages::adjust::BoresightSummary,
    store::published::{read_published_by_this_version, still_published},
};

/// Largest angle between the mountings of one camera in different sites, radians: rounding of kernels.
const SAME_MOUNTING_RAD: f64 = 1e-6;

/// Reasons why no boresight is estimated.
#[derive(Debug, thiserror::Error, Cause)]
enum BoresightError {
    /// No site states anything of it.
    #[error("no site determines the boresight of the laser; {0}")]
    #[cause(Input: "name products of valid sites with adjustment.common_bus = \"yes\" and profiles simultaneous with the images")]
    NoSites(String),
    /// Sites whose angles refer to different directions.
    #[error("the laser is mounted differently in {camera} in the sites {first} and {second}")]
    #[cause(Configuration: "name products of sites with the same altimeter file and frame kernels")]
    SeveralMountings {
        /// The camera.
        camera: String,
        /// A site.
        first: String,
        /// Another site.
        second: String,
    },
}

/// The boresight of a laser by several sites.
#[derive(Debug, Clone, PartialEq)]
pub struct EstimatedBoresight {
    /// Statements of the sites: the file that sites may name.
    pub statements: BoresightStatements,
    /// The result.
    pub pooled: PooledBoresight,
    /// Sites that are not used, each with the reason.
    pub not_used: Vec<(String, String)>,
}

/// A priori standard deviation of a boresight angle by default, radians.
#[must_use]
pub fn usual_boresight_sigma_rad() -> f64 {
    AdjustmentConfig::default().boresight_sigma_rad
}

impl EstimatedBoresight {
    /// Sites in the result.
    fn sites(&self) -> usize {
        self.statements.sites.len() - self.pooled.contradicting.len()
    }

    /// The result, one sentence each.
    #[must_use]
    pub fn sentences(&self) -> Vec<String> {
        let sites = match self.sites() {
            1 => "1 site".to_owned(),
            count => format!("{count} sites"),
        };
        let angles = &self.pooled.angles;
        let sigmas_rad = angles.sigmas_rad();
        let axis = |axis: usize, name: &str| {
            let [value, sigma] = [angles.angles_rad[axis], sigmas_rad[axis]].map(|of| 1e3 * of);
            format!("{value:+.3} ± {sigma:.3} mrad towards {name}")
        };
        let mut sentences = vec![
            format!(
                "Boresight of the laser by {sites}: {}, {} of the bus.",
                axis(0, "X"),
                axis(1, "Y")
            ),
            "Orientations and profile positions of different sites are assumed to be in error independently; an error common to all \
             sites (alignment of the cameras, frame of the laser) is not included."
                .to_owned(),
        ];
        if self.pooled.freedom > 0.0 {
            let effect = if self.pooled.scatter > 1.0 {
                "the standard deviations contain this factor"
            } else {
                "the standard deviations remain as stated"
            };
            sentences.push(format!(
                "The statements scatter {:.2} times as much as their standard deviations (degrees of freedom {:.1}); {effect}.",
                self.pooled.scatter, self.pooled.freedom
            ));
        }
        for (name, is_beyond) in ["X", "Y"].iter().zip(self.pooled.contradicts_prior) {
            if is_beyond {
                sentences.push(format!(
                    "The angle towards {name} contradicts its a priori standard deviation of {:.3} mrad, which is not used; check the \
                     altimeter file and the frame kernels.",
                    1e3 * self.statements.prior_sigma_rad
                ));
            }
        }
        sentences
    }

    /// The answer for scripts.
    #[must_use]
    pub fn answer(&self) -> Value {
        let sites = self.statements.sites.iter().enumerate();
        let sites = sites.map(|(place, site)| {
            let mut of_site = json!(site);
            of_site["contradicts_others"] = json!(self.pooled.contradicting.contains(&place));
            of_site
        });
        let not_used = self.not_used.iter();
        let not_used = not_used.map(|(what, reason)| json!({"what": what, "reason": reason}));
        let angles = &self.pooled.angles;
        let covariance: [[f64; 2]; 2] = angles.covariance_rad2.into();
        json!({
            "angles_rad": [angles.angles_rad[0], angles.angles_rad[1]],
            "sigma_rad": angles.sigmas_rad(),
            "covariance_rad2": covariance,
            "prior_sigma_rad": self.statements.prior_sigma_rad,
            "contradicts_prior": self.pooled.contradicts_prior,
            "scatter": self.pooled.scatter,
            "degrees_of_freedom": self.pooled.freedom,
            "mountings": self.statements.mountings,
            "sites": sites.collect::<Vec<_>>(),
            "not_used": not_used.collect::<Vec<_>>(),
            "areograph": env!("CARGO_PKG_VERSION"),
        })
    }
}

/// Estimates the boresight from the sites whose products are in `folders`, each of one site or of several.
///
/// * `prior_sigma_rad` – a priori standard deviation of each angle, radians, above 0
///
/// # Errors
/// A folder without products; no site that determines the boresight; different mountings.
pub fn estimate_boresight(folders: &[PathBuf], prior_sigma_rad: f64) -> Result<EstimatedBoresight> {
    let mut statements = BoresightStatements {
        prior_sigma_rad,
        mountings: Vec::new(),
        sites: Vec::new(),
    };
    // The site that stated each mounting first.
    let mut first_sites: Vec<String> = Vec::new();
    let mut not_used = Vec::new();
    for folder in site_folders(folders)? {
        let (site, found) = match read_site(&folder) {
            Ok(read) => read,
            // A site that failed does not prevent the use of the others.
            Err(error) if error.cause.kind() == Kind::Input => {
                let reason = error.cause.to_string();
                not_used.push((folder.display().to_string(), reason));
                continue;
            }
            Err(error) => return Err(error),
        };
        let (of_site, mountings) = match found {
            Ok(found) => found,
            Err(reason) => {
                not_used.push((site, reason));
                continue;
            }
        };
        let mut earlier = statements.sites.iter();
        if let Some(other) = earlier.find(|of| of.shares(&of_site.images, &of_site.orbits)) {
            let reason = format!("shares an image or an orbit with {}", other.site);
            not_used.push((site, reason));
            continue;
        }
        for mounting in mountings {
            let is_same = |of: &LaserMounting| {
                of.camera == mounting.camera && of.spacecraft == mounting.spacecraft
            };
            let Some(place) = statements.mountings.iter().position(is_same) else {
                statements.mountings.push(mounting);
                first_sites.push(site.clone());
                continue;
            };
            if apart_rad(&statements.mountings[place].beam, &mounting.beam) > SAME_MOUNTING_RAD {
                return Err(BoresightError::SeveralMountings {
                    camera: mounting.camera,
                    first: first_sites[place].clone(),
                    second: site,
                }
                .into());
            }
        }
        statements.sites.push(of_site);
    }
    if statements.sites.is_empty() {
        let (site, reason) = not_used.first().cloned().unwrap_or_default();
        return Err(BoresightError::NoSites(format!("{site}: {reason}")).into());
    }
    let information: Vec<_> = statements
        .sites
        .iter()
        .map(BoresightOfSite::information)
        .collect();
    let pooled = pooled(&information, prior_sigma_rad);
    for place in &pooled.contradicting {
        let site = statements.sites[*place].site.clone();
        not_used.push((site, "contradicts the other sites".to_owned()));
    }
    Ok(EstimatedBoresight {
        statements,
        pooled,
        not_used,
    })
}

/// Angle between two directions of length 1, radians.
fn apart_rad(one: &[f64; 3], other: &[f64; 3]) -> f64 {
    let squares = one
        .iter()
        .zip(other)
        .map(|(one, other)| (one - other).powi(2));
    squares.sum::<f64>().sqrt()
}

/// What a site states, with its mountings, or why it states nothing.
type Stated = std::result::Result<(BoresightOfSite, Vec<LaserMounting>), String>;

/// The site whose products are in `folder`.
fn read_site(folder: &Path) -> Result<(String, Stated)> {
    let manifest = read_published_by_this_version(folder, |_| false)?;
    let data = PageData::without_tables(folder)?;
    still_published(folder, &manifest)?;
    data.with(declarations(), |products| {
        let site = manifest.site.clone();
        let stated = stated(&site, products);
        Ok((site, stated))
    })
}

fn stated(site: &str, products: &SiteProducts<'_>) -> Stated {
    let geometric = products.geometric.as_ref();
    let adjustment = geometric.and_then(|geometric| geometric.adjustment.as_ref());
    let found = adjustment.and_then(|adjustment| adjustment.adjusted.boresight.as_ref());
    let found = found.ok_or("adjustment.common_bus is not used")?;
    let found = found.as_ref().map_err(Clone::clone)?;
    if !products.verdict.valid {
        return Err("the site is not valid".to_owned());
    }
    let information = found
        .information
        .ok_or("its boresight angles are held by boresight_sigma_arcsec = 0")?;
    // All of them: tie points and surface are observations too.
    let images = products.images.iter();
    let orbits: BTreeSet<u32> = products.profiles.iter().map(|of| of.orbit).collect();
    let of_site = BoresightOfSite {
        site: site.to_owned(),
        images: images.map(|image| image.times.id.clone()).collect(),
        orbits: orbits.iter().map(u32::to_string).collect(),
        matrix: information.matrix_terms(),
        vector: information.vector.into(),
    };
    Ok((of_site, mountings(products, found)))
}

/// Mounting of each camera of the images with spots.
fn mountings(products: &SiteProducts<'_>, found: &BoresightSummary) -> Vec<LaserMounting> {
    let of_image = |beam: [f64; 3], id: &str| {
        let image = products.images.iter().find(|image| image.times.id == id)?;
        Some(LaserMounting {
            spacecraft: image.times.spacecraft_name(),
            camera: image.times.instrument.id.clone(),
            beam,
        })
    };
    let all = found.images.iter();
    all.filter_map(|image| of_image(image.beam, &image.image))
        .collect()
}
