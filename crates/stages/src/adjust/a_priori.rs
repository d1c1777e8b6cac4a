//! For which images the default accuracy of orbit and attitude holds.

use crate::tag_times::ImageTimes;
use areograph_base::{constants::SPACECRAFT, footprints::AdjustmentModel};
use areograph_config::{AdjustmentConfig, SiteConfig, usual_altimeter};

/// Reason for withholding a site's absolute accuracies: the default standard deviations of its orientations apply to
/// one spacecraft, and these images are not known to be from it. `None` where each image is, or has its own values.
///
/// Stated position accuracies are the a priori ones, and stated height accuracies contain them on slopes.
pub fn accuracy_withheld<'a>(
    site: &SiteConfig,
    images: impl IntoIterator<Item = &'a ImageTimes>,
) -> Option<String> {
    let config = &site.adjustment;
    if config.model == AdjustmentModel::Published || is_configured(config) {
        return None;
    }
    let is_of_it = |times: &ImageTimes| match &times.support {
        Some(support) => {
            let platform = support.platform.replace('_', " ");
            platform.eq_ignore_ascii_case(&SPACECRAFT.label_name)
                || (support.has_laser && site.altimeter.id == usual_altimeter().id)
        }
        None => times.instrument.spacecraft.has_laser(),
    };
    let has_own = |times: &ImageTimes| {
        let own = config.images.iter().find(|own| own.id == times.id);
        own.is_some_and(|own| own.position_m.is_some() && own.rotation_rad.is_some())
    };
    let images = images.into_iter();
    let assumed = images.filter(|times| !is_of_it(times) && !has_own(times));
    let assumed: Vec<&str> = assumed.map(|times| &*times.id).collect();
    (!assumed.is_empty()).then(|| {
        format!(
            "adjustment.position_sigma_m and rotation_sigma_arcsec have their default values, which apply to the orbit \
             and attitude of {}, not of {}: absolute accuracies are withheld, and standard deviations in the products \
             depend on these values; set both keys",
            SPACECRAFT.full_name,
            assumed.join(", ")
        )
    })
}

/// Whether the site has its own standard deviations.
fn is_configured(config: &AdjustmentConfig) -> bool {
    let defaults = AdjustmentConfig::default();
    let differ = |own: &[f64], default: &[f64]| {
        own.iter()
            .zip(default)
            .any(|(own, default)| own.to_bits() != default.to_bits())
    };
    differ(&config.position_sigma_m, &defaults.position_sigma_m)
        && differ(&config.rotation_sigma_rad, &defaults.rotation_sigma_rad)
}
