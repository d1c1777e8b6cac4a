//! The images of a site with one orientation: sensor models and footprints of each.

use super::{
    driver::{Driver, Flow},
    outputs::Shots,
};
use crate::{
    config::{ImageConfig, SiteConfig},
    stage::{Output, Round},
    stages::{
        fit_sensor_model::FitSensorModel, orientation::Orientation, register::Register,
        site_image::SiteImage, tag_times::ImageTimes,
    },
};

/// Every image with its orientation, sensor models and footprints.
pub(super) fn registered<D: Driver>(
    flow: &mut D,
    config: &SiteConfig,
    round: Round,
    times: &[Output<ImageTimes>],
    orientations: Vec<Output<Orientation>>,
    (converted, profiles): Shots,
) -> Flow<Vec<SiteImage>> {
    let oriented = config.images.iter().zip(times).zip(orientations);
    let register = |((image, times), orientation): ((&ImageConfig, &Output<_>), _)| {
        let image = &*image.id;
        let model = flow.stage(&FitSensorModel {
            image,
            round,
            samples: &orientation,
            orientation: &config.orientation,
            registration_model: &config.registration.model,
        })?;
        let registration = flow.stage(&Register {
            image,
            round,
            times,
            orientation: &orientation,
            model: &model,
            converted,
            profiles,
            registration: &config.registration,
        })?;
        Ok(SiteImage {
            times: times.clone(),
            orientation,
            model,
            registration,
        })
    };
    oriented.map(register).collect()
}
