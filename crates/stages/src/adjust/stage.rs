//! The combined adjustment as a stage.

use std::{collections::BTreeMap, sync::atomic::AtomicBool};

use nalgebra::Vector3;

use super::{Adjusted, Candidate, adjust, by_relief::adjusted_by, prepare_adjustment};
use crate::{
    check_ranges::RangeCheck,
    compare_pairs::PairComparison,
    convert_datum::Converted,
    group_profiles::Profile,
    intersect::IntersectedTies,
    mola_surface::{CrossedProfiles, MolaShots},
    read_ties::Ties,
    site_image::SiteImages,
};
use areograph_base::{
    error::Result,
    footprints::{AdjustmentModel, Footprints},
    frames::BodyFixed,
    instruments::Altimeter,
    watch::Watch,
};
use areograph_config::{AdjustmentConfig, MolaSurfaceConfig, ReliefForPlan};
use areograph_geom::surface::{LaserSurface, SurfaceOptions};
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
    const METHOD: u32 = 21;
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
        let (footprints, profiles) = (&self.converted.value()?.footprints, self.profiles.value()?);
        let (ties, starts) = (&self.ties.value()?.points, self.intersected.value()?);
        let profile_sigmas_m =
            MolaShots::profile_sigmas_m(footprints, profiles, self.laser_surface);
        let pairs = self.pairs.value()?.iter();
        let disagreements_m = pairs.map(|pair| pair.along_track_parallax_m);
        let largest_m = disagreements_m.fold(0.0, f64::max);
        let ground = Ground::of(self, footprints, profiles, starts);
        let with = |plan_sigma_m: Option<f64>| {
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
            let (images, mut shots) = prepare_adjustment(
                candidates.collect::<Result<Vec<_>>>()?,
                footprints,
                profiles,
                ground.surface(plan_sigma_m),
                self.altimeter,
                self.adjustment,
            );
            shots.profile_sigmas_m.clone_from(&profile_sigmas_m);
            adjust(
                &images,
                &shots,
                ties,
                starts,
                largest_m,
                self.adjustment,
                watch,
            )
        };
        let relief = match self.adjustment.model {
            AdjustmentModel::MolaSurface => self.adjustment.relief_for_plan,
            AdjustmentModel::Published => ReliefForPlan::No,
        };
        adjusted_by(relief, self.laser_surface.profile_plan_sigma_m, with)
    }
}

/// Shots that control heights, and their crossovers; `shots` is `None` in the published model.
struct Ground {
    shots: Option<(MolaShots, CrossedProfiles)>,
    around_m: Vec<Vector3<f64>>,
    options: SurfaceOptions,
    /// Shifts of profiles are unknowns of the laser on the common bus, and independent of each other.
    has_bus: bool,
}

impl Ground {
    fn of(
        stage: &Adjust<'_>,
        footprints: &Footprints<BodyFixed>,
        profiles: &[Profile],
        starts: &IntersectedTies,
    ) -> Self {
        let options = stage.laser_surface.options(footprints.body);
        let controls = stage.adjustment.model == AdjustmentModel::MolaSurface;
        Self {
            shots: controls.then(|| MolaShots::crossed(footprints, profiles, &options)),
            around_m: starts
                .points
                .iter()
                .map(|point| point.ground.xyz_m)
                .collect(),
            options,
            has_bus: stage.adjustment.common_bus,
        }
    }

    /// The surface; where relief determines the position, shifts of profiles in plan have the standard deviation `plan_sigma_m`.
    /// `None` without enough shots: heights then follow from the orientations.
    fn surface(&self, plan_sigma_m: Option<f64>) -> Option<LaserSurface> {
        let (shots, crossed) = self.shots.as_ref()?;
        let Some(profile_plan_sigma_m) = plan_sigma_m else {
            return shots.surface(&self.around_m, &self.options).ok();
        };
        let options = SurfaceOptions {
            uses_relief: true,
            profile_plan_sigma_m,
            ..self.options
        };
        if self.has_bus {
            shots.surface(&self.around_m, &options).ok()
        } else {
            shots
                .shifted_surface(crossed, &self.around_m, &options)
                .ok()
        }
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
