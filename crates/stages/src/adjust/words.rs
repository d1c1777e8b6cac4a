//! Parts, unknowns and faults of a network by the identifiers of the site.

use super::{
    error::AdjustError,
    input::AdjustImage,
    network::{Assembled, Named},
    points::PointKind,
};
use areograph_base::{footprints::AdjustmentModel, units::RADIANS_PER_ARCSECOND};
use areograph_config::AdjustmentConfig;
use areograph_geom::bundle::{BundleError, Part, Unknown};

/// The error with identifiers in place of indices.
pub(super) fn in_words<M>(
    error: BundleError,
    images: &[AdjustImage<M>],
    assembled: &Assembled<&M>,
    config: &AdjustmentConfig,
) -> AdjustError {
    match error {
        BundleError::NotConverged {
            steps,
            weighted_squares,
        } => AdjustError::NotConverged {
            steps,
            weighted_squares,
            held_by: held_by(config, images),
        },
        BundleError::Singular { unknowns } => {
            let words: Vec<String> = unknowns
                .iter()
                .map(|unknown| unknown_in_words(*unknown, images, &assembled.profiles))
                .collect();
            AdjustError::Singular(words.join(", "))
        }
        BundleError::Value {
            part,
            what,
            value,
            expected,
        } => AdjustError::Value {
            what: format!("the {what} of {}", part_in_words(part, images, assembled)),
            value,
            expected,
        },
        _ => AdjustError::Network(error),
    }
}

/// The keys that constrain orientations, with their values.
fn held_by<M>(config: &AdjustmentConfig, images: &[AdjustImage<M>]) -> String {
    let of_model = match config.model {
        AdjustmentModel::MolaSurface => {
            // Of the first image, where its spacecraft determines them.
            let [position, rotation] = [0, 9].map(|first| {
                let sigmas = images.first().map(|image| &image.sigmas[first..first + 3]);
                sigmas.map_or([0.0; 3], |sigmas| [0, 1, 2].map(|power| sigmas[power]))
            });
            let position_m = config.position_sigma_m.unwrap_or(position);
            // Rounded as one would write them.
            let arcsec = config
                .rotation_sigma_rad
                .unwrap_or(rotation)
                .map(|sigma_rad| (sigma_rad / RADIANS_PER_ARCSECOND * 1e6).round() / 1e6);
            format!(
                "adjustment.position_sigma_m = {position_m:?} and rotation_sigma_arcsec = {arcsec:?}"
            )
        }
        AdjustmentModel::Published => {
            let [nadir_m, off_nadir_m] = config.published_sigmas_m();
            format!(
                "adjustment.position_sigma_nadir_m = {nadir_m} and position_sigma_off_nadir_m = {off_nadir_m}"
            )
        }
    };
    if config.images.is_empty() {
        of_model
    } else {
        format!("{of_model}, and the values of adjustment.images")
    }
}

/// A part of the network by its identifiers.
fn part_in_words<M>(part: Part, images: &[AdjustImage<M>], assembled: &Assembled<&M>) -> String {
    let image = |index: usize| format!("image {}", images[index].oriented_camera.id);
    let point = |index: usize| {
        let kind = match assembled.kind(index) {
            PointKind::Shot => "shot",
            PointKind::Tie => "tie point",
        };
        format!("{kind} {}", assembled.points[index].name)
    };
    match part {
        Part::Image(index) => image(index),
        Part::Point(index) => point(index),
        Part::View(index) => {
            let view = &assembled.network.views[index];
            format!("{} in {}", point(view.point), image(view.image))
        }
        Part::Range(index) => {
            let range = &assembled.network.ranges[index];
            format!("the range of {}", point(range.point))
        }
        Part::Profile(index) => format!("profile {}", assembled.profiles[index].name),
        Part::Spot(index) => {
            let bus = assembled.network.common_bus.as_ref();
            let spot = bus.map(|bus| point(bus.spots[index].view.point));
            format!("the spot of {}", spot.unwrap_or_else(|| part.to_string()))
        }
        Part::Images => part.to_string(),
    }
}

/// An unknown as a surveyor names it.
pub(super) fn unknown_in_words<M>(
    unknown: Unknown,
    images: &[AdjustImage<M>],
    profiles: &[Named],
) -> String {
    let owner = match unknown {
        Unknown::Orientation { image, .. }
        | Unknown::TimeBias { image }
        | Unknown::LineTime { image } => format!("image {}", images[image].oriented_camera.id),
        Unknown::RangeBias { profile } | Unknown::ProfileShift { profile, .. } => {
            format!("profile {}", profiles[profile].name)
        }
        Unknown::AttitudeClock | Unknown::Boresight { .. } => unknown.part().to_string(),
    };
    format!("the {} of {owner}", unknown.quantity())
}
