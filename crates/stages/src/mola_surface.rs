//! The shots of a site as samples of the ground: control of the adjustment, and reference for heights.

use std::collections::BTreeSet;

use nalgebra::Vector3;

use super::group_profiles::Profile;
use areograph_base::{footprints::Footprints, frames::BodyFixed};
use areograph_geom::{
    ellipsoid::spherical_to_xyz_m,
    surface::{LaserSurface, SurfaceError, SurfaceOptions, SurfaceShot},
};

/// Shots of all profiles, each once, in their order along the profiles.
#[derive(Debug, Clone)]
pub struct MolaShots(Vec<SurfaceShot>);

impl MolaShots {
    /// The shots of `profiles`; a shot in two windows belongs to the first.
    #[must_use]
    pub fn of(footprints: &Footprints<BodyFixed>, profiles: &[Profile]) -> Self {
        let mut used = BTreeSet::new();
        let mut shots = Vec::new();
        for (index, profile) in profiles.iter().enumerate() {
            for row in profile.rows.iter().filter(|row| used.insert(**row)) {
                let at = *row as usize;
                shots.push(SurfaceShot {
                    ground_m: spherical_to_xyz_m(
                        footprints.longitude_rad[at],
                        footprints.latitude_rad[at],
                        footprints.radius_m[at],
                    ),
                    profile: index,
                });
            }
        }
        Self(shots)
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
        LaserSurface::new(&self.0, around, options)
    }

    /// Every profile separately, with its index, those with most shots first.
    #[must_use]
    pub fn by_profile(&self) -> Vec<(usize, Self)> {
        let mut profiles: Vec<(usize, Self)> = Vec::new();
        for shot in &self.0 {
            match profiles
                .iter_mut()
                .find(|(index, _)| *index == shot.profile)
            {
                Some((_, own)) => own.0.push(*shot),
                None => profiles.push((shot.profile, Self(vec![*shot]))),
            }
        }
        profiles.sort_by_key(|(_, shots)| std::cmp::Reverse(shots.0.len()));
        profiles
    }
}
