//! An image of the site with the outputs of its stages: the input of the stages after the registration.

use super::{orientation::Orientation, oriented::OrientedImage};
use crate::{fit_sensor_model::SensorModel, register::ImageRegistration, tag_times::ImageTimes};
use areograph_base::error::Result;
use areograph_store::{
    book::Book,
    stage::{Input, Inputs, Output, Round},
};

/// Stage outputs of one image, with the orientation from the kernels or the adjusted one.
#[derive(Debug, Clone)]
pub struct SiteImage {
    /// Line times.
    pub times: Output<ImageTimes>,
    /// Orientation samples.
    pub orientation: Output<Orientation>,
    /// Sensor models.
    pub model: Output<SensorModel>,
    /// Image coordinates of the footprints.
    pub registration: Output<ImageRegistration>,
}

impl SiteImage {
    /// The images of a book with the orientation of this round, in the order of the configuration.
    ///
    /// # Errors
    /// A bug in areograph: they were not entered.
    pub fn all(book: &Book, round: Round) -> Result<Vec<Self>> {
        let times = book.outputs(Round::Initial)?.unwrap_or_default().iter();
        let orientations = book.outputs(round)?.unwrap_or_default();
        let models = book.outputs(round)?.unwrap_or_default();
        let registrations = book.outputs(round)?.unwrap_or_default();
        let all = times.zip(orientations).zip(models).zip(registrations);
        let images = all.map(|(((times, orientation), model), registration)| Self {
            times: times.clone(),
            orientation: orientation.clone(),
            model: model.clone(),
            registration: registration.clone(),
        });
        Ok(images.collect())
    }

    /// Enters the outputs of images, except their times, in a book.
    ///
    /// # Errors
    /// A bug in areograph: images with the orientation of this round were entered.
    pub fn enter(book: &mut Book, round: Round, images: &[Self]) -> Result<()> {
        let each = images.iter();
        let orientations = each.clone().map(|image| image.orientation.clone());
        book.enter_parts(round, orientations.collect())?;
        let models = each.clone().map(|image| image.model.clone());
        book.enter_parts(round, models.collect())?;
        let registrations = each.map(|image| image.registration.clone());
        book.enter_parts(round, registrations.collect())
    }
}

/// The images of a site in its order.
#[derive(Debug, Clone, Copy)]
pub struct SiteImages<'a>(pub &'a [SiteImage]);

impl Input for SiteImages<'_> {
    fn add_to(&self, field: &str, inputs: &mut Inputs) {
        let labels: Vec<&str> = self.0.iter().map(|image| image.times.label()).collect();
        inputs.setting(&format!("{field} (order)"), &labels);
        for image in self.0 {
            (&image.times).add_to(field, inputs);
            (&image.orientation).add_to(field, inputs);
            (&image.model).add_to(field, inputs);
            (&image.registration).add_to(field, inputs);
        }
    }
}

impl<'a> SiteImages<'a> {
    /// The images with their orientation in every form.
    ///
    /// # Errors
    /// Samples that do not form an orientation.
    pub fn oriented(self) -> Result<Vec<OrientedImage<'a>>> {
        let oriented = self.0.iter().map(|image| {
            let (times, orientation) = (image.times.value()?, image.orientation.value()?);
            OrientedImage::of(times, orientation, image.model.value()?)
        });
        oriented.collect()
    }
}
