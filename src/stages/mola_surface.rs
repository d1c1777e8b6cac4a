//! The ground between the shots of a site: what the adjustment is controlled by, and what heights are compared with.

use std::collections::BTreeSet;

use nalgebra::Vector3;

use super::group_profiles::Profile;
use crate::{
    footprints::Footprints,
    frames::MarsIau2000,
    geom::{
        ellipsoid::spherical_to_xyz_m,
        surface::{LaserSurface, SurfaceError, SurfaceOptions, SurfaceShot},
    },
};

/// Shots of all profiles, each once, in their order along the profiles; those of profiles that `taken` refuses are
/// left out.
#[must_use]
pub fn surface_shots(
    footprints: &Footprints<MarsIau2000>,
    profiles: &[Profile],
    taken: impl Fn(usize) -> bool,
) -> Vec<SurfaceShot> {
    let mut used = BTreeSet::new();
    let mut shots = Vec::new();
    for (index, profile) in profiles
        .iter()
        .enumerate()
        .filter(|(index, _)| taken(*index))
    {
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
    shots
}

/// The surface of all profiles of a site, for heights near the places `around`.
///
/// # Errors
/// Too few shots.
pub fn mola_surface(
    footprints: &Footprints<MarsIau2000>,
    profiles: &[Profile],
    around: &[Vector3<f64>],
    options: &SurfaceOptions,
) -> Result<LaserSurface, SurfaceError> {
    LaserSurface::new(
        &surface_shots(footprints, profiles, |_| true),
        around,
        options,
    )
}
