//! A priori boresight of a laser on the bus of the cameras: a standard deviation, or statements of other sites.

use std::collections::BTreeSet;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::{
    error::AdjustError,
    input::{AdjustImage, LaserShots},
};
use areograph_config::{AdjustmentConfig, BoresightOfSite};
use areograph_geom::{
    boresight::{BoresightAngles, PooledBoresight, pooled},
    bundle::Spot,
};

/// Largest angle between the beam in a camera and the mounting that statements of sites refer to, radians: rounding of kernels, far
/// below what sites determine.
const SAME_MOUNTING_RAD: f64 = 1e-6;

/// A priori boresight angles, and the sites that they come from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BoresightPrior {
    /// The angles.
    pub angles: BoresightAngles,
    /// Sites whose statements they contain; empty without `adjustment.boresight`.
    pub sites: Vec<String>,
    /// Sites of that file that share an image or an orbit with this one.
    pub left_out: Vec<String>,
    /// Sites of that file that contradict the others.
    pub contradicting: Vec<String>,
}

impl BoresightPrior {
    /// A remark on the sites that positions depend on; `None` without such sites in the configuration.
    #[must_use]
    pub fn remark(&self) -> Option<String> {
        let named = |names: &[String], reason: &str| {
            let is_named = !names.is_empty();
            is_named.then(|| format!("; {} {reason}", names.join(", ")))
        };
        if self.sites.is_empty() && self.left_out.is_empty() && self.contradicting.is_empty() {
            return None;
        }
        let sites = match self.sites.len() {
            0 => "no site states the boresight of the laser, and its a priori standard deviation applies".to_owned(),
            1 => "1 site states the boresight of the laser".to_owned(),
            count => format!("{count} sites state the boresight of the laser"),
        };
        let left_out = named(
            &self.left_out,
            "left out, because of a common image or orbit",
        );
        let contradicting = match self.contradicting.len() {
            1 => "withheld: contradicts the other sites",
            _ => "withheld: contradict the other sites",
        };
        let contradicting = named(&self.contradicting, contradicting);
        Some(format!(
            "across-track positions depend on adjustment.boresight: {sites}{}{}",
            left_out.unwrap_or_default(),
            contradicting.unwrap_or_default()
        ))
    }
}

/// A priori boresight of the laser, which has these `spots` of `shots` in `images`. Images without spots may have another mounting.
///
/// # Errors
/// Statements of sites about another mounting.
pub(super) fn prior_of<M>(
    images: &[AdjustImage<M>],
    shots: &LaserShots,
    spots: &[Spot],
    config: &AdjustmentConfig,
) -> Result<BoresightPrior, AdjustError> {
    let Some(statements) = &config.boresight else {
        return Ok(BoresightPrior {
            angles: BoresightAngles::of_sigma(config.boresight_sigma_rad),
            sites: Vec::new(),
            left_out: Vec::new(),
            contradicting: Vec::new(),
        });
    };
    let mountings = &statements.mountings;
    let with_spots: BTreeSet<usize> = spots.iter().map(|spot| spot.view.image).collect();
    for image in with_spots.into_iter().map(|index| &images[index]) {
        let Some(beam) = image.beam() else { continue };
        let apart_rad = |of: &[f64; 3]| beam.angle(&Vector3::from(*of));
        let least_rad = mountings
            .iter()
            .map(|of| apart_rad(&of.beam))
            .fold(f64::INFINITY, f64::min);
        // Written so that NaN is refused.
        if !(least_rad <= SAME_MOUNTING_RAD) {
            let known = mountings.iter();
            let known: Vec<String> = known
                .map(|of| format!("{} of {}", of.camera, of.spacecraft))
                .collect();
            return Err(AdjustError::OtherMounting {
                image: image.oriented_camera.id.clone(),
                known: known.join(", "),
            });
        }
    }
    let own: Vec<String> = images
        .iter()
        .map(|image| image.oriented_camera.id.clone())
        .collect();
    let orbits = shots.profiles.iter();
    let orbits: Vec<String> = orbits.map(|of| orbit_of(of).to_owned()).collect();
    let (left_out, used): (Vec<&BoresightOfSite>, Vec<_>) = statements
        .sites
        .iter()
        .partition(|site| site.shares(&own, &orbits));
    let information: Vec<_> = used.iter().map(|site| site.information()).collect();
    let PooledBoresight {
        angles,
        contradicting,
        ..
    } = pooled(&information, statements.prior_sigma_rad);
    let is_used = |place: &usize| !contradicting.contains(place);
    let names = |places: &dyn Fn(&usize) -> bool| -> Vec<String> {
        let places = (0..used.len()).filter(places);
        places.map(|place| used[place].site.clone()).collect()
    };
    Ok(BoresightPrior {
        angles,
        sites: names(&is_used),
        contradicting: names(&|place| !is_used(place)),
        left_out: left_out.iter().map(|site| site.site.clone()).collect(),
    })
}

/// The orbit in the name of a profile: `<window>/<orbit>`, with `.2`, `.3` … where the orbit crosses the window again.
fn orbit_of(profile: &str) -> &str {
    let crossing = profile.rsplit('/').next().unwrap_or(profile);
    crossing.split('.').next().unwrap_or(crossing)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_crossing_of_a_window_has_the_number_of_its_orbit() {
        for profile in ["window/9044", "window/9044.2", "9044"] {
            assert_eq!(orbit_of(profile), "9044");
        }
    }

    #[test]
    fn a_remark_names_the_sites_that_are_not_used() {
        let remark = |contradicting: &[&str]| {
            let prior = BoresightPrior {
                angles: BoresightAngles::of_sigma(1e-4),
                sites: vec!["eos".to_owned()],
                left_out: Vec::new(),
                contradicting: contradicting.iter().map(|of| (*of).to_owned()).collect(),
            };
            prior.remark().unwrap()
        };
        assert!(remark(&["isidis"]).ends_with("; isidis withheld: contradicts the other sites"));
        let both = remark(&["isidis", "gusev"]);
        assert!(
            both.ends_with("; isidis, gusev withheld: contradict the other sites"),
            "{both}"
        );
    }
}
