//! Movements compared with limits.

use schemars::JsonSchema;
use serde::Serialize;

use super::{Outcome, RunDifference, images::ImageDifference, movement::ROUNDING, words::quantity};

/// Limits of movements; a missing limit allows any movement.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, JsonSchema)]
pub struct Limits {
    /// Limit for footprints, perspective centres and the ground points of boresights, metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0))]
    pub movement_m: Option<f64>,
    /// Limit for the rotation of the camera, arcseconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0))]
    pub pointing_arcsec: Option<f64>,
}

impl Limits {
    /// The difference with its outcome, and the movements beyond these limits.
    ///
    /// Footprints and samples of one run only have no movement: at a window's edge they come and go. Where
    /// nothing is left to compare, a limit cannot be applied, which is reported as well.
    pub(super) fn judged(&self, mut difference: RunDifference) -> RunDifference {
        let mut beyond = self.footprints(&difference);
        for image in &difference.images {
            beyond.extend(self.image(image));
        }
        if !beyond.is_empty() {
            difference.outcome = Outcome::BeyondLimit;
        } else if difference.moved() {
            difference.outcome = Outcome::Moved;
        }
        difference.beyond_limits = beyond;
        difference
    }

    /// The share of a limit that a movement uses, above 1 (or NaN) beyond it; 0 for rounding.
    #[must_use]
    pub fn share(found: f64, limit: f64) -> f64 {
        if found <= ROUNDING {
            0.0
        } else {
            found / limit
        }
    }

    fn footprints(&self, difference: &RunDifference) -> Vec<String> {
        let footprints = &difference.footprints;
        match (&footprints.movement, self.movement_m) {
            (Some(movement), limit) => {
                let what = || "footprints moved".to_owned();
                beyond(what, movement.distance_m.max, limit, "m")
                    .into_iter()
                    .collect()
            }
            (None, Some(_)) if footprints.only_in_a > 0 => {
                vec!["no footprint of A is in B: the limit cannot be applied".to_owned()]
            }
            _ => Vec::new(),
        }
    }

    fn image(&self, difference: &ImageDifference) -> Vec<String> {
        let image = &difference.image;
        let Some(movement) = &difference.movement else {
            let asked = self.movement_m.or(self.pointing_arcsec).is_some();
            let sentence =
                format!("image {image}: no sample of A is in B: limits cannot be applied");
            return Vec::from_iter((asked && difference.samples_only_in_a > 0).then_some(sentence));
        };
        let ground_m = movement.boresight_ground_m.map_or(0.0, |ground| ground.max);
        let (metres, arcseconds) = (self.movement_m, self.pointing_arcsec);
        [
            beyond(
                || format!("image {image}: the camera moved"),
                movement.distance_m.max,
                metres,
                "m",
            ),
            beyond(
                || format!("image {image}: the boresight's ground point moved"),
                ground_m,
                metres,
                "m",
            ),
            beyond(
                || format!("image {image}: the camera rotated"),
                movement.turn_arcsec.max,
                arcseconds,
                "arcsec",
            ),
        ]
        .into_iter()
        .flatten()
        .collect()
    }
}

/// The sentence for a movement beyond its limit, if any.
fn beyond(what: impl Fn() -> String, found: f64, limit: Option<f64>, unit: &str) -> Option<String> {
    let limit = limit?;
    // Written so that NaN is beyond.
    (!(Limits::share(found, limit) <= 1.0)).then(|| {
        format!(
            "{} by up to {} {unit}, beyond the limit of {limit} {unit}",
            what(),
            quantity(found)
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_keeps_every_limit_and_what_is_no_number_none() {
        let verdict =
            |found: f64, limit: f64| beyond(|| "it moved".to_owned(), found, Some(limit), "m");
        for limit in [0.0, 1e-9, 1e-3] {
            assert_eq!(verdict(0.5e-6, limit), None, "{limit} m");
            assert!(Limits::share(0.5e-6, limit) <= 1.0, "{limit} m");
            let sentence = verdict(2e-3, limit);
            assert!(sentence.is_some_and(|sentence| {
                sentence.starts_with("it moved by up to 0.0020 m, beyond")
            }));
            assert!(Limits::share(2e-3, limit) > 1.0, "{limit} m");
            assert!(verdict(f64::NAN, limit).is_some());
        }
        assert_eq!(verdict(2e-3, 2e-3), None);
    }
}
