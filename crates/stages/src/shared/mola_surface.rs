//! The shots of a site as samples of the ground: control of the adjustment, and reference for heights.

use std::collections::BTreeSet;

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::group_profiles::Profile;
use areograph_base::{altimetry::NO_ATTITUDE, footprints::Footprints, frames::BodyFixed};
use areograph_config::MolaSurfaceConfig;
use areograph_geom::{
    ellipsoid::spherical_to_xyz_m,
    surface::{
        Crossover, LaserSurface, ProfileNet, ProfilePriors, SurfaceError, SurfaceOptions,
        SurfaceShot, crossovers, turned_sigmas_m, with_across_track,
    },
};

/// Shots of the profiles that belong to each other, each once, in their order along the profiles.
#[derive(Debug, Clone)]
pub struct MolaShots {
    pub(crate) shots: Vec<SurfaceShot>,
    /// Standard deviation of the radial error that the shots of a profile share, from crossovers, metres.
    pub(crate) profile_sigma_m: f64,
}

/// The profiles of a site against each other.
#[derive(Debug, Clone)]
pub(crate) struct CrossedProfiles {
    pub(crate) crossovers: Vec<Crossover>,
    pub(crate) net: ProfileNet,
}

impl MolaShots {
    /// Standard deviations of the shift of each profile as recorded, in east, north and height, metres: the values for
    /// all profiles and, off nadir, the attitude error that crossovers leave there.
    #[must_use]
    pub fn profile_sigmas_m(
        footprints: &Footprints<BodyFixed>,
        profiles: &[Profile],
        options: &MolaSurfaceConfig,
    ) -> Vec<Vector3<f64>> {
        let ground_m = |row: u32| {
            let at = row as usize;
            spherical_to_xyz_m(
                footprints.longitude_rad.at(at),
                footprints.latitude_rad.at(at),
                footprints.ground_radius_m(at),
            )
        };
        let of_profile = |profile: &Profile| {
            let (first, last) = (profile.rows[0], profile.rows[profile.rows.len() - 1]);
            let [across_m, up_m] = turned_sigmas_m(profile.off_nadir_rad(footprints));
            let (first_m, last_m) = (ground_m(first), ground_m(last));
            let plan_m = options.profile_plan_sigma_m;
            let own_m = Vector3::new(plan_m, plan_m, options.profile_sigma_m.hypot(up_m));
            with_across_track(own_m, [&first_m, &last_m], across_m)
        };
        profiles.iter().map(of_profile).collect()
    }

    /// The shots of those `profiles` that belong to each other by their crossovers; a shot in two windows belongs to
    /// the first.
    #[must_use]
    pub fn of(
        footprints: &Footprints<BodyFixed>,
        profiles: &[Profile],
        options: &SurfaceOptions,
    ) -> Self {
        Self::crossed(footprints, profiles, options).0
    }

    /// These shots, with the crossovers.
    pub(crate) fn crossed(
        footprints: &Footprints<BodyFixed>,
        profiles: &[Profile],
        options: &SurfaceOptions,
    ) -> (Self, CrossedProfiles) {
        let mut shots = Self::all(footprints, profiles);
        let crossovers = crossovers(&shots, options);
        let priors = ProfilePriors {
            radial_sigma_m: options.profile_sigma_m,
            plan_sigma_m: options.profile_plan_sigma_m,
        };
        let net = ProfileNet::of(&crossovers, &priors);
        let left_out: BTreeSet<usize> = net.left_out.iter().map(|of| of.profile).collect();
        shots.retain(|shot| !left_out.contains(&shot.profile));
        let belonging = Self {
            shots,
            profile_sigma_m: net.radial_sigma_m,
        };
        (belonging, CrossedProfiles { crossovers, net })
    }

    fn all(footprints: &Footprints<BodyFixed>, profiles: &[Profile]) -> Vec<SurfaceShot> {
        let mut is_used = vec![false; footprints.len()];
        let mut used = Vec::new();
        for (index, profile) in (0_u32..).zip(profiles) {
            for row in profile.rows.iter().copied() {
                if !std::mem::replace(&mut is_used[row as usize], true) {
                    used.push((index, row));
                }
            }
        }
        let shot = |(profile, row): (u32, u32)| {
            let at = row as usize;
            SurfaceShot {
                ground_m: spherical_to_xyz_m(
                    footprints.longitude_rad.at(at),
                    footprints.latitude_rad.at(at),
                    footprints.ground_radius_m(at),
                ),
                profile: profile as usize,
                attitude_known: footprints.attitude_flag.at(at) < NO_ATTITUDE,
                off_nadir_rad: footprints.off_nadir_rad.at(at),
            }
        };
        used.into_par_iter().map(shot).collect()
    }

    /// `options` with the radial error of profiles from crossovers.
    pub(crate) fn options(&self, options: &SurfaceOptions) -> SurfaceOptions {
        SurfaceOptions {
            profile_sigma_m: self.profile_sigma_m,
            ..*options
        }
    }

    /// The surface of all shots, for heights near the places `around`.
    ///
    /// # Errors
    /// Too few shots.
    pub fn surface(
        &self,
        around: &[Vector3<f64>],
        options: &SurfaceOptions,
    ) -> Result<LaserSurface, SurfaceError> {
        LaserSurface::new(&self.shots, around, &self.options(options))
    }

    /// The same without the shifts in plan that `crossed` shows.
    ///
    /// # Errors
    /// Too few shots.
    pub(crate) fn shifted_surface(
        &self,
        crossed: &CrossedProfiles,
        around: &[Vector3<f64>],
        options: &SurfaceOptions,
    ) -> Result<LaserSurface, SurfaceError> {
        let plan_m = options.profile_plan_sigma_m;
        let shifts = crossed.net.plan_shifts(&crossed.crossovers, plan_m);
        let shifts = shifts.unwrap_or_default();
        LaserSurface::with_plan_shifts(&self.shots, around, &self.options(options), &shifts)
    }

    /// Every profile separately, with its index, those with most shots first.
    #[must_use]
    pub fn by_profile(&self) -> Vec<(usize, Self)> {
        let mut profiles: Vec<(usize, Self)> = Vec::new();
        for shot in &self.shots {
            let mut known = profiles.iter_mut();
            match known.find(|(index, _)| *index == shot.profile) {
                Some((_, own)) => own.shots.push(*shot),
                None => profiles.push((
                    shot.profile,
                    Self {
                        shots: vec![*shot],
                        profile_sigma_m: self.profile_sigma_m,
                    },
                )),
            }
        }
        profiles.sort_by_key(|(_, shots)| std::cmp::Reverse(shots.shots.len()));
        profiles
    }
}
