//! Search margin about an expected place, from the stated uncertainty of the orientations.

use serde::Serialize;

use crate::site_image::SiteImage;
use areograph_base::{
    constants::{GROUND_SPEED_M_S, SPACECRAFT, Spacecraft},
    footprints::AdjustmentModel,
};
use areograph_config::{AdjustmentConfig, SiteConfig};
use areograph_store::stage::Round;

/// Standard deviations of uncertainty that a search covers.
const SIGMAS: f64 = 3.0;
/// Displacement on the ground of nadir images per second of attitude delay, metres: the attitude turns by 0.9 mrad at
/// 380 km.
const ATTITUDE_CLOCK_M_S: f64 = 340.0;

/// Uncertainty of the orientations of images.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Margin {
    /// Standard deviations of each image's position, metres, and pointing, radians.
    images: Vec<[f64; 2]>,
    /// Largest reach of a search, metres: images of a valid site do not disagree by more.
    most_m: f64,
}

impl Margin {
    /// The margin of the site's images with the orientation from the kernels, or with the adjusted one.
    #[must_use]
    pub fn of(site: &SiteConfig, images: &[SiteImage], round: Round) -> Self {
        let config = &site.adjustment;
        let images = site.images.iter().zip(images).map(|(image, of)| {
            // Not known before the times of the image are; it is matched thereafter.
            let times = of.times.get();
            let spacecraft = times.map_or(*SPACECRAFT, |times| times.instrument.spacecraft);
            sigmas(config, &image.id, spacecraft)
        });
        Self {
            images: images.collect(),
            most_m: match round {
                Round::Initial | Round::Matching => site.limits.parallax_before_max_m,
                Round::Adjusted => site.limits.parallax_after_max_m,
            },
        }
    }

    /// One margin for all images, metres.
    pub(super) fn within(images: usize, most_m: f64) -> Self {
        Self {
            images: vec![[most_m, 0.0]; images],
            most_m,
        }
    }

    /// Largest distance of a place from its expected position, for two images at these distances from the ground,
    /// metres.
    pub(super) fn reach_m(&self, images: [usize; 2], ranges_m: [f64; 2]) -> f64 {
        let squares = images.iter().zip(ranges_m).map(|(image, range_m)| {
            let [position_m, pointing_rad] = self.images.get(*image).copied().unwrap_or_default();
            position_m.powi(2) + (pointing_rad * range_m).powi(2)
        });
        (SIGMAS * squares.sum::<f64>().sqrt()).min(self.most_m)
    }
}

/// Standard deviations of an image's position, metres, and of its pointing, radians, over all powers of time.
fn sigmas(config: &AdjustmentConfig, image: &str, spacecraft: &Spacecraft) -> [f64; 2] {
    let norm = |sigmas: &[f64]| sigmas.iter().map(|sigma| sigma * sigma).sum::<f64>().sqrt();
    let clocks_m = ATTITUDE_CLOCK_M_S
        * if config.attitude_clock {
            config.attitude_clock_sigma_s
        } else {
            0.0
        };
    let times_m = GROUND_SPEED_M_S * config.time_bias_sigma_s;
    let [position_m, pointing_rad] = match config.model {
        AdjustmentModel::MolaSurface => [
            norm(&config.position_sigma_m(spacecraft)),
            norm(&config.rotation_sigma_rad(spacecraft)),
        ],
        // Rotations move the ground as far, hence √2.
        AdjustmentModel::Published => {
            let [nadir_m, off_nadir_m] = config.published_sigmas_m();
            [std::f64::consts::SQRT_2 * nadir_m.max(off_nadir_m), 0.0]
        }
    };
    let own = config.images.iter().find(|own| own.id == image);
    // Three of the nine numbers belong to an axis.
    let of_axis = |sigmas: &[f64; 9]| norm(sigmas) / 3.0_f64.sqrt();
    let own_m = own.and_then(|own| own.position_m.as_ref()).map(of_axis);
    let own_rad = own.and_then(|own| own.rotation_rad.as_ref()).map(of_axis);
    [
        own_m.unwrap_or(position_m).hypot(clocks_m).hypot(times_m),
        own_rad.unwrap_or(pointing_rad),
    ]
}
