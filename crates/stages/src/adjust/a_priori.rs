//! For which images the a priori accuracy of orbit and attitude is known.

use crate::tag_times::ImageTimes;
use areograph_base::{
    constants::{SPACECRAFT, Spacecraft},
    footprints::AdjustmentModel,
};
use areograph_config::{SiteConfig, usual_altimeter};

/// Reason for withholding a site's absolute accuracies: images of support data from an unknown spacecraft are given the
/// standard deviations of the default one. `None` where the spacecraft of each image is known, or the site states its
/// values.
///
/// Stated position accuracies are the a priori ones, and stated height accuracies contain them on slopes.
pub fn accuracy_withheld<'a>(
    site: &SiteConfig,
    images: impl IntoIterator<Item = &'a ImageTimes>,
) -> Option<String> {
    let config = &site.adjustment;
    let is_configured = config.position_sigma_m.is_some() && config.rotation_sigma_rad.is_some();
    if config.model == AdjustmentModel::Published || is_configured {
        return None;
    }
    let is_known = |times: &ImageTimes| {
        times.support.as_ref().is_none_or(|support| {
            Spacecraft::of_label_name(&support.platform).is_some()
                || (support.has_laser && site.altimeter.id == usual_altimeter().id)
        })
    };
    let has_own = |times: &ImageTimes| {
        let own = config.images.iter().find(|own| own.id == times.id);
        own.is_some_and(|own| own.position_m.is_some() && own.rotation_rad.is_some())
    };
    let images = images.into_iter();
    let assumed = images.filter(|times| !is_known(times) && !has_own(times));
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
