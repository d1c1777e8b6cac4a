//! The combined adjustment as a stage.

use std::{collections::BTreeMap, sync::atomic::AtomicBool};

use nalgebra::Vector3;

use super::{Adjusted, Candidate, adjust, prepare_adjustment};
use crate::{
    check_ranges::RangeCheck, compare_pairs::PairComparison, convert_datum::Converted,
    group_profiles::Profile, intersect::IntersectedTies, mola_surface::MolaShots, read_ties::Ties,
    site_image::SiteImages,
};
use areograph_base::{
    error::Result, footprints::AdjustmentModel, instruments::Altimeter, watch::Watch,
};
use areograph_config::{AdjustmentConfig, MolaSurfaceConfig};
use areograph_geom::surface::SurfaceOptions;
use areograph_store::{
    stage::{Output, Round, Stage},
    stage_inputs,
};

stage_inputs! {
    /// Images, footprints, tie points with their ground points, and the standard deviations.
    pub struct Adjust<'a> {
        /// Purpose of the adjustment.
        pub round: Round,
        /// The images with the orientation from the kernels.
        pub images: SiteImages<'a>,
        /// Footprints in IAU 2000.
        pub converted: &'a Output<Converted>,
        /// Profiles.
        pub profiles: &'a Output<Vec<Profile>>,
        /// Tie points.
        pub ties: &'a Output<Ties>,
        /// Their ground points.
        pub intersected: &'a Output<IntersectedTies>,
        /// Differences between the orbits of the PEDR files and of the kernels.
        pub ranges: &'a Output<RangeCheck>,
        /// The pairs of images.
        pub pairs: &'a Output<Vec<PairComparison>>,
        /// The altimeter.
        pub altimeter: &'a Altimeter,
        /// Uncertainties of the MOLA surface.
        pub laser_surface: &'a MolaSurfaceConfig,
        /// Standard deviations and options.
        pub adjustment: &'a AdjustmentConfig,
    }
}

impl Stage for Adjust<'_> {
    const NAME: &'static str = "adjust";
    const METHOD: u32 = 18;
    type Output = Adjusted;
    stage_inputs!(fingerprint);

    fn part(&self) -> Option<String> {
        self.round.of_adjustment().part()
    }

    fn run(&self, stop: &AtomicBool) -> Result<Adjusted> {
        self.run_watched(stop.into())
    }

    fn run_watched(&self, watch: Watch<'_>) -> Result<Adjusted> {
        let oriented = self.images.oriented()?;
        let orbits_m = self.pedr_orbits_m()?;
        let candidates = self.images.0.iter().zip(&oriented).enumerate();
        let candidates = candidates.map(|(index, (image, oriented))| {
            Ok(Candidate {
                times: image.times.value()?,
                orientation: image.orientation.value()?,
                oriented_camera: oriented.oriented_camera(),
                registration: image.registration.value()?,
                pedr_orbit_m: orbits_m.get(&index).copied(),
            })
        });
        let (footprints, profiles) = (&self.converted.value()?.footprints, self.profiles.value()?);
        let (ties, starts) = (&self.ties.value()?.points, self.intersected.value()?);
        let surface = match self.adjustment.model {
            // Without enough shots, heights follow from the orientations.
            AdjustmentModel::MolaSurface => {
                let around = starts.points.iter().map(|point| point.ground.xyz_m);
                let around: Vec<_> = around.collect();
                let options = SurfaceOptions {
                    uses_relief: self.adjustment.relief_for_plan,
                    ..self.laser_surface.options(footprints.body)
                };
                let shots = MolaShots::of(footprints, profiles, &options);
                shots.surface(&around, &options).ok()
            }
            AdjustmentModel::Published => None,
        };
        let (images, mut shots) = prepare_adjustment(
            candidates.collect::<Result<Vec<_>>>()?,
            footprints,
            profiles,
            surface,
            self.altimeter,
            self.adjustment,
        );
        shots.profile_sigmas_m =
            MolaShots::profile_sigmas_m(footprints, profiles, self.laser_surface);
        let pairs = self.pairs.value()?.iter();
        let disagreements_m = pairs.map(|pair| pair.along_track_parallax_m);
        let largest_m = disagreements_m.fold(0.0, f64::max);
        adjust(
            &images,
            &shots,
            ties,
            starts,
            largest_m,
            self.adjustment,
            watch,
        )
    }
}

impl Adjust<'_> {
    /// Offsets of the spacecraft in the PEDR files from the kernels, radial, along and across the track, metres, by
    /// simultaneous image; of several profiles the first.
    fn pedr_orbits_m(&self) -> Result<BTreeMap<usize, Vector3<f64>>> {
        let checked = self.ranges.value()?.profiles.iter();
        let mut orbits_m = BTreeMap::new();
        for (profile, ranges) in self.profiles.value()?.iter().zip(checked) {
            // Tables may have no positions of it.
            if ranges.spacecraft_m[0].n == 0 {
                continue;
            }
            let off_m = ranges.spacecraft_m.each_ref().map(|axis| axis.mean);
            for image in &profile.simultaneous {
                orbits_m.entry(image.image).or_insert_with(|| off_m.into());
            }
        }
        Ok(orbits_m)
    }
}
