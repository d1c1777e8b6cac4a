//! The attitude clock of a network, as an unknown or not.

use super::{common_pass::common_passes, input::AdjustImage};
use areograph_config::AdjustmentConfig;
use areograph_geom::{
    bundle::{AttitudeClock, Network, ORIENTATION_UNKNOWNS},
    pushbroom::ExteriorOrientation,
};

/// Attributes the disagreement of images to the attitude clock.
pub(super) fn by_attitude_clock<'a, M: ExteriorOrientation>(
    network: &mut Network<&'a M>,
    images: &'a [AdjustImage<M>],
    config: &AdjustmentConfig,
) {
    for image in &mut network.images {
        for constant in constant_rotations() {
            let sigma = &mut image.sigmas[constant];
            *sigma = sigma.min(config.attitude_clock_rotation_sigma_rad);
        }
    }
    network.attitude_clock = Some(AttitudeClock {
        sigma_s: config.attitude_clock_sigma_s,
        turns_rad_s: images.iter().map(|image| image.turn_rad_s).collect(),
    });
    // By the attitude clock, line times are right.
    network.passes = common_passes(&network.images, images, 0.0);
}

/// Takes all images as equally likely to be wrong.
pub(super) fn evenly<'a, M: ExteriorOrientation>(
    network: &mut Network<&'a M>,
    images: &'a [AdjustImage<M>],
    config: &AdjustmentConfig,
) {
    for (image, of_site) in network.images.iter_mut().zip(images) {
        image.sigmas = of_site.sigmas;
    }
    network.attitude_clock = None;
    network.passes = common_passes(&network.images, images, config.line_time_sigma_s);
}

/// Coefficients of the constant rotations about x, y and z.
fn constant_rotations() -> impl Iterator<Item = usize> {
    (ORIENTATION_UNKNOWNS / 2..ORIENTATION_UNKNOWNS).step_by(3)
}

/// A priori standard deviations of the corrections of an image's orientation: its own, and the contribution of the
/// attitude clock.
pub(super) fn prior_sigmas<M>(network: &Network<M>, image: usize) -> [f64; ORIENTATION_UNKNOWNS] {
    let mut sigmas = network.images[image].sigmas;
    if let Some(clock) = &network.attitude_clock {
        let turn_rad_s = &clock.turns_rad_s[image];
        for (constant, turn_rad_s) in constant_rotations().zip(turn_rad_s) {
            sigmas[constant] = sigmas[constant].hypot(turn_rad_s * clock.sigma_s);
        }
    }
    sigmas
}
