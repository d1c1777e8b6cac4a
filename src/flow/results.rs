//! Everything that the stages before the last one made.

use std::path::Path;

use super::{Stage, choice::KernelChoice, geometric::Geometric};
use crate::{
    config::SiteConfig,
    products::{GeometricProducts, ImageProducts},
    spice::{KernelSet, Wanted},
    stages::{
        check_ranges::RangeCheck, convert_datum::Converted, fit_sensor_model::SensorModel,
        group_profiles::Profile, register::ImageRegistration, sample_orientation::Orientation,
        search_footprints::SearchResult, tag_times::ImageTimes,
    },
    store::cache::Output,
};

/// Outputs of the earlier stages, and what they were made with.
pub(super) struct Results<'a> {
    pub(super) config: &'a SiteConfig,
    pub(super) kernels: &'a KernelSet,
    pub(super) wanted: &'a Wanted,
    pub(super) choice: Option<&'a Output<KernelChoice>>,
    pub(super) images: &'a Output<Vec<ImageTimes>>,
    pub(super) found: &'a Output<SearchResult>,
    pub(super) converted: &'a Output<Converted>,
    pub(super) profiles: &'a Output<Vec<Profile>>,
    pub(super) ranges: &'a Output<RangeCheck>,
    pub(super) orientations: &'a [Output<Orientation>],
    pub(super) models: &'a [Output<SensorModel>],
    pub(super) registrations: &'a [Output<ImageRegistration>],
    /// Nothing for a site without tie points.
    pub(super) geometric: Option<&'a Geometric>,
}

impl Results<'_> {
    /// The images as products want them.
    pub(super) fn image_products(&self) -> Vec<ImageProducts<'_>> {
        let images = self
            .images
            .value
            .iter()
            .zip(self.orientations)
            .zip(self.models)
            .zip(self.registrations);
        images
            .map(
                |(((times, orientation), model), registration)| ImageProducts {
                    times,
                    orientation: &orientation.value,
                    model: &model.value,
                    registration: &registration.value,
                },
            )
            .collect()
    }

    /// The images with their adjusted orientation; none for a site without tie points.
    pub(super) fn adjusted_image_products(&self) -> Vec<ImageProducts<'_>> {
        let adjusted = self.geometric.iter();
        let adjusted = adjusted.flat_map(|geometric| &geometric.readjusted.value.images);
        let images = self.images.value.iter().zip(adjusted);
        images
            .map(|(times, adjusted)| ImageProducts {
                times,
                orientation: &adjusted.orientation,
                model: &adjusted.model,
                registration: &adjusted.registration,
            })
            .collect()
    }

    /// What tie points make of the site in `folder`; `adjusted_images` are [`Self::adjusted_image_products`].
    pub(super) fn geometric_products<'a>(
        &'a self,
        folder: &'a Path,
        adjusted_images: &'a [ImageProducts<'a>],
    ) -> Option<GeometricProducts<'a>> {
        let geometric = self.geometric?;
        let after = &geometric.readjusted.value.intersected;
        Some(GeometricProducts {
            kernels: self.kernels,
            folder,
            ties: &geometric.ties.value,
            intersected: &geometric.intersected.value.ties,
            pairs: &geometric.intersected.value.pairs,
            adjusted: &geometric.adjusted.value,
            adjusted_images,
            adjusted_intersected: &after.ties,
            adjusted_pairs: &after.pairs,
        })
    }

    /// What was wrong with input records, one sentence each.
    pub(super) fn complaints(&self) -> Vec<String> {
        let complaints = self.found.value.complaints.iter();
        let of_ties = self.geometric.iter();
        let of_ties = of_ties.flat_map(|geometric| &geometric.ties.value.complaints);
        complaints
            .map(ToString::to_string)
            .chain(of_ties.cloned())
            .collect()
    }

    pub(super) fn outputs(&self) -> Vec<(String, Option<String>)> {
        self.stages()
            .into_iter()
            .map(|(stage, output, _)| (stage, Some(output)))
            .collect()
    }

    /// Name, output hash and fingerprint of every stage that ran or was kept.
    pub(super) fn stages(&self) -> Vec<(String, String, String)> {
        fn entry<T>(name: String, output: &Output<T>) -> (String, String, String) {
            (name, output.blake3.clone(), output.fingerprint.clone())
        }
        let mut stages = vec![
            entry(Stage::TagTimes.name().to_owned(), self.images),
            entry(Stage::SearchFootprints.name().to_owned(), self.found),
            entry(Stage::ConvertDatum.name().to_owned(), self.converted),
            entry(Stage::GroupProfiles.name().to_owned(), self.profiles),
        ];
        let choice = self.choice.into_iter();
        stages.extend(choice.map(|choice| entry(Stage::ChooseKernels.name().to_owned(), choice)));
        stages.push(entry(Stage::CheckRanges.name().to_owned(), self.ranges));
        for (orientation, model) in self.orientations.iter().zip(self.models) {
            let image = &orientation.value.image;
            stages.push(entry(Stage::SampleOrientation.of_image(image), orientation));
            stages.push(entry(Stage::FitSensorModel.of_image(image), model));
        }
        for registration in self.registrations {
            let stage = Stage::Register.of_image(&registration.value.image);
            stages.push(entry(stage, registration));
        }
        for (stage, output, fingerprint) in self.geometric.iter().flat_map(|of| of.stages()) {
            stages.push((
                stage.name().to_owned(),
                output.to_owned(),
                fingerprint.to_owned(),
            ));
        }
        stages
    }
}
