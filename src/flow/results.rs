//! Everything that the stages before the last one made.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{Stage, choice::KernelChoice};
use crate::{
    config::SiteConfig,
    products::{GeometricProducts, ImageProducts},
    spice::{KernelSet, Wanted},
    stages::{
        adjust::Adjusted, check_ranges::RangeCheck, compare_pairs::PairComparison,
        convert_datum::Converted, fit_sensor_model::SensorModel, group_profiles::Profile,
        intersect::IntersectedTies, read_ties::Ties, register::ImageRegistration,
        sample_orientation::Orientation, search_footprints::SearchResult, tag_times::ImageTimes,
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

/// Ground points of the tie points, and what every pair of images says of itself.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Intersected {
    pub(super) ties: IntersectedTies,
    pub(super) pairs: Vec<PairComparison>,
}

/// Images, footprints and tie points with the adjusted orientation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Readjusted {
    pub(super) images: Vec<ReadjustedImage>,
    pub(super) intersected: Intersected,
}

/// One image with its adjusted orientation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct ReadjustedImage {
    pub(super) orientation: Orientation,
    pub(super) model: SensorModel,
    pub(super) registration: ImageRegistration,
}

/// What the geometric steps make of a site with tie points.
pub(super) struct Geometric {
    pub(super) ties: Output<Ties>,
    pub(super) intersected: Output<Intersected>,
    pub(super) adjusted: Output<Adjusted>,
    pub(super) readjusted: Output<Readjusted>,
}

impl Geometric {
    /// Name, output hash and fingerprint of every step.
    pub(super) fn stages(&self) -> [(Stage, &str, &str); 4] {
        fn entry<T>(stage: Stage, output: &Output<T>) -> (Stage, &str, &str) {
            (stage, &output.blake3, &output.fingerprint)
        }
        [
            entry(Stage::ReadTies, &self.ties),
            entry(Stage::Intersect, &self.intersected),
            entry(Stage::Adjust, &self.adjusted),
            entry(Stage::ApplyAdjustment, &self.readjusted),
        ]
    }
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

    /// Records of tie point files that were read around.
    pub(super) fn tie_complaints(&self) -> u64 {
        self.geometric
            .map_or(0, |geometric| geometric.ties.value.complaint_count)
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
