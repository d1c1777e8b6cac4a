//! The combined adjustment as a stage.

use std::sync::atomic::AtomicBool;

use super::{
    AdjustImage, Adjusted, Candidate, LaserShots, adjust, prepare_adjustment,
    reading::{CLOCK_SIGMA_S, is_disputed, other_reading},
};
use crate::{
    config::{AdjustmentConfig, MolaSurfaceConfig},
    error::Result,
    footprints::AdjustmentModel,
    geom::pushbroom::{CameraModel, ExteriorOrientation},
    stage::{InOrder, Output, Stage},
    stage_inputs,
    stages::{
        convert_datum::Converted, group_profiles::Profile, intersect::IntersectedTies,
        mola_surface::MolaShots, oriented::OrientedImage, read_ties::Ties, site_image::SiteImage,
    },
};

stage_inputs! {
    /// Images, footprints, tie points with their ground points, and the standard deviations.
    pub struct Adjust<'a> {
        /// The images with the orientation of the kernels.
        pub images: InOrder<'a, SiteImage>,
        /// The form of the orientation.
        pub model: &'a CameraModel,
        /// Footprints in IAU 2000.
        pub converted: &'a Output<Converted>,
        /// Profiles.
        pub profiles: &'a Output<Vec<Profile>>,
        /// Tie points.
        pub ties: &'a Output<Ties>,
        /// Their ground points.
        pub intersected: &'a Output<IntersectedTies>,
        /// What is uncertain about the MOLA surface.
        pub mola_surface: &'a MolaSurfaceConfig,
        /// Standard deviations and options.
        pub adjustment: &'a AdjustmentConfig,
    }
}

impl Stage for Adjust<'_> {
    const NAME: &'static str = "adjust";
    const METHOD: u32 = 3;
    type Output = Adjusted;
    stage_inputs!(fingerprint);

    fn run(&self, _stop: &AtomicBool) -> Result<Adjusted> {
        let config = self.adjustment;
        let starts = self.intersected.value()?;
        let oriented = SiteImage::oriented(self.images.0)?;
        let (images, shots) = self.prepare(&oriented, config)?;
        let ties = &self.ties.value()?.points;
        let mut adjusted = adjust(&images, &shots, ties, starts, config)?;
        if config.model == AdjustmentModel::MolaSurface && is_disputed(&images, starts) {
            let attitude_clock = config.attitude_clock_sigma_s <= 0.0;
            let other = AdjustmentConfig {
                attitude_clock_sigma_s: if attitude_clock { CLOCK_SIGMA_S } else { 0.0 },
                ..config.clone()
            };
            let (images, shots) = self.prepare(&oriented, &other)?;
            // What cannot be read in another way needs no second result.
            if let Ok(other) = adjust(&images, &shots, ties, starts, &other) {
                adjusted.other_reading = other_reading(&adjusted, &other, attitude_clock);
            }
        }
        Ok(adjusted)
    }
}

/// An image with its camera in any form.
type Image<'a> = AdjustImage<&'a (dyn ExteriorOrientation + 'static)>;

impl Adjust<'_> {
    /// Images and shots, weighed as `config` says.
    fn prepare<'b>(
        &'b self,
        oriented: &'b [OrientedImage<'b>],
        config: &AdjustmentConfig,
    ) -> Result<(Vec<Image<'b>>, LaserShots)> {
        let candidates = self.images.0.iter().zip(oriented);
        let candidates = candidates.map(|(image, oriented)| {
            Ok(Candidate {
                times: image.times.value()?,
                orientation: image.orientation.value()?,
                oriented_camera: oriented.oriented_camera(*self.model),
                registration: image.registration.value()?,
            })
        });
        let (footprints, profiles) = (&self.converted.value()?.footprints, self.profiles.value()?);
        let surface = match config.model {
            // Without enough shots heights are what the orientations say.
            AdjustmentModel::MolaSurface => {
                let around = self.intersected.value()?.points.iter();
                let around: Vec<_> = around.map(|point| point.ground.xyz_m).collect();
                let shots = MolaShots::of(footprints, profiles);
                shots.surface(&around, &self.mola_surface.options()).ok()
            }
            AdjustmentModel::Published => None,
        };
        Ok(prepare_adjustment(
            candidates.collect::<Result<Vec<_>>>()?,
            footprints,
            profiles,
            surface,
            config,
        ))
    }
}
