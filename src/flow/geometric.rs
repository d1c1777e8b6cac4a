//! The steps behind the prepared data: tie points, their intersection, the combined adjustment, and what the
//! adjusted orientation makes of footprints and tie points.

use super::{
    Stage, parts,
    results::{Geometric, Intersected, Readjusted, ReadjustedImage},
    steps::{Step, Steps},
};
use crate::{
    error::{Place, Result},
    geom::{pushbroom::ExteriorOrientation, stereo::StereoImage},
    stages::{
        adjust::{Adjusted, Candidate, adjust, prepare_adjustment},
        compare_pairs::compare_pairs,
        convert_datum::Converted,
        fit_sensor_model::{SensorModel, fit_sensor_model},
        group_profiles::Profile,
        intersect::intersect_ties,
        oriented::OrientedImage,
        read_ties::{Ties, read_ties},
        register::{ImageRegistration, register},
        reorient::{LineCorrection, reorient},
        sample_orientation::Orientation,
        tag_times::ImageTimes,
    },
    store::cache::Output,
};

/// Outputs of the earlier steps that the geometric ones take.
pub(super) struct Prepared<'a> {
    pub(super) images: &'a Output<Vec<ImageTimes>>,
    pub(super) converted: &'a Output<Converted>,
    pub(super) profiles: &'a Output<Vec<Profile>>,
    pub(super) orientations: &'a [Output<Orientation>],
    pub(super) models: &'a [Output<SensorModel>],
    pub(super) registrations: &'a [Output<ImageRegistration>],
}

impl Prepared<'_> {
    /// Hashes of the outputs, in the order that [`parts::intersect`] names them in.
    fn hashes(&self) -> parts::Hashes<'_> {
        fn of<T>(outputs: &[Output<T>]) -> Vec<Option<&str>> {
            outputs.iter().map(|output| Some(&*output.blake3)).collect()
        }
        parts::Hashes {
            images: Some(&self.images.blake3),
            converted: Some(&self.converted.blake3),
            profiles: Some(&self.profiles.blake3),
            orientations: of(self.orientations),
            models: of(self.models),
            registrations: of(self.registrations),
        }
    }

    /// The images with their orientation in every form.
    fn oriented(&self) -> Result<Vec<OrientedImage<'_>>> {
        let oriented = self.orientations.iter().zip(self.models);
        let images = self.images.value.iter().zip(oriented);
        images
            .map(|(times, (orientation, model))| {
                OrientedImage::of(times, &orientation.value, &model.value)
            })
            .collect()
    }

    fn registrations(&self) -> Vec<&ImageRegistration> {
        let registrations = self.registrations.iter();
        registrations
            .map(|registration| &registration.value)
            .collect()
    }
}

impl Steps<'_> {
    /// All geometric steps; nothing for a site without tie points.
    pub(super) fn geometric(&self, prepared: &Prepared<'_>) -> Step<Option<Geometric>> {
        let Some(ties) = self.read_ties()? else {
            return Ok(None);
        };
        let intersected = self.intersect(prepared, &ties)?;
        let adjusted = self.adjust(prepared, &ties, &intersected)?;
        let readjusted = self.apply_adjustment(prepared, &ties, &adjusted)?;
        Ok(Some(Geometric {
            ties,
            intersected,
            adjusted,
            readjusted,
        }))
    }

    fn read_ties(&self) -> Step<Option<Output<Ties>>> {
        self.enter(Stage::ReadTies)?;
        let (stage, config) = (Stage::ReadTies.name(), self.config);
        if config.ties.files.is_empty() {
            return Ok(None);
        }
        let hashes = parts::hash_files(&config.ties.files, self.options.stop).in_stage(stage)?;
        let parts = parts::read_ties(config, &hashes);
        let ties = self.cache.stage(stage, parts, || {
            read_ties(&config.ties, &config.images).in_stage(stage)
        })?;
        Ok(Some(ties))
    }

    fn intersect(&self, prepared: &Prepared<'_>, ties: &Output<Ties>) -> Step<Output<Intersected>> {
        self.enter(Stage::Intersect)?;
        let stage = Stage::Intersect.name();
        let parts = parts::intersect(self.config, &prepared.hashes(), Some(&ties.blake3));
        Ok(self.cache.stage(stage, parts, || {
            let images = prepared.oriented().in_stage(stage)?;
            let seen = (&*images, &*prepared.registrations());
            self.intersected(seen, prepared, &ties.value)
                .in_stage(stage)
        })?)
    }

    /// Intersection and comparison of the pairs, as these images with their registrations see.
    fn intersected(
        &self,
        (images, registrations): (&[OrientedImage<'_>], &[&ImageRegistration]),
        prepared: &Prepared<'_>,
        ties: &Ties,
    ) -> Result<Intersected> {
        let images = self.stereo(images);
        let options = (&self.config.intersection).into();
        let found = intersect_ties(&images, &ties.points, &options)?;
        let pairs = compare_pairs(
            &images,
            registrations,
            &ties.points,
            &found,
            &prepared.converted.value.footprints,
            &prepared.profiles.value,
        );
        Ok(Intersected { ties: found, pairs })
    }

    /// The images with the orientation that the configuration asks for.
    fn stereo<'a>(
        &self,
        images: &'a [OrientedImage<'_>],
    ) -> Vec<StereoImage<&'a (dyn ExteriorOrientation + 'static)>> {
        let model = self.config.registration.model;
        images.iter().map(|image| image.stereo(model)).collect()
    }

    fn adjust(
        &self,
        prepared: &Prepared<'_>,
        ties: &Output<Ties>,
        intersected: &Output<Intersected>,
    ) -> Step<Output<Adjusted>> {
        self.enter(Stage::Adjust)?;
        let (stage, config) = (Stage::Adjust.name(), &self.config.adjustment);
        let outputs = [&ties.blake3, &intersected.blake3].map(|hash| Some(&**hash));
        let parts = parts::adjust(self.config, &prepared.hashes(), outputs);
        Ok(self.cache.stage(stage, parts, || {
            let images = prepared.oriented().in_stage(stage)?;
            let oriented = prepared.orientations.iter().zip(prepared.registrations);
            let candidates = self.stereo(&images).into_iter().zip(&prepared.images.value);
            let candidates =
                candidates
                    .zip(oriented)
                    .map(|((stereo, times), (orientation, registration))| Candidate {
                        times,
                        orientation: &orientation.value,
                        stereo,
                        registration: &registration.value,
                    });
            let (images, shots) = prepare_adjustment(
                candidates.collect(),
                &prepared.converted.value.footprints,
                &prepared.profiles.value,
                config,
            );
            let starts = &intersected.value.ties;
            adjust(&images, &shots, &ties.value.points, starts, config).in_stage(stage)
        })?)
    }

    fn apply_adjustment(
        &self,
        prepared: &Prepared<'_>,
        ties: &Output<Ties>,
        adjusted: &Output<Adjusted>,
    ) -> Step<Output<Readjusted>> {
        self.enter(Stage::ApplyAdjustment)?;
        let stage = Stage::ApplyAdjustment.name();
        let outputs = [&ties.blake3, &adjusted.blake3].map(|hash| Some(&**hash));
        let parts = parts::apply_adjustment(self.config, &prepared.hashes(), outputs);
        Ok(self.cache.stage(stage, parts, || {
            self.readjusted(prepared, &ties.value, &adjusted.value)
                .in_stage(stage)
        })?)
    }

    fn readjusted(
        &self,
        prepared: &Prepared<'_>,
        ties: &Ties,
        adjusted: &Adjusted,
    ) -> Result<Readjusted> {
        let times = &prepared.images.value;
        let oriented = prepared.orientations.iter().enumerate().zip(times);
        let images = oriented
            .map(|((index, orientation), times)| {
                self.readjusted_image(prepared, times, &orientation.value, index, adjusted)
            })
            .collect::<Result<Vec<_>>>()?;
        let again = times.iter().zip(&images);
        let oriented = again
            .map(|(times, image)| OrientedImage::of(times, &image.orientation, &image.model))
            .collect::<Result<Vec<_>>>()?;
        let registrations: Vec<_> = images.iter().map(|image| &image.registration).collect();
        let intersected = self.intersected((&oriented, &registrations), prepared, ties)?;
        Ok(Readjusted {
            images,
            intersected,
        })
    }

    fn readjusted_image(
        &self,
        prepared: &Prepared<'_>,
        times: &ImageTimes,
        orientation: &Orientation,
        index: usize,
        adjusted: &Adjusted,
    ) -> Result<ReadjustedImage> {
        let correction = adjusted.correction(index);
        let orientation = reorient(orientation, times, correction.time_shift_lines, |x| {
            LineCorrection {
                position_m: correction.shift_m(x),
                rotation_rad: correction.turn_rad(x),
            }
        })?;
        let model = fit_sensor_model(&orientation, &self.config.orientation)?;
        let registration = register(
            times,
            &orientation,
            &model,
            &prepared.converted.value.footprints,
            &prepared.profiles.value,
            &self.config.registration,
            self.options.stop,
        )?;
        Ok(ReadjustedImage {
            orientation,
            model,
            registration,
        })
    }
}
