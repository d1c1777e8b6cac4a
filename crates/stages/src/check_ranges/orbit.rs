//! Spacecraft positions of the file and of the kernels: whether both belong to one orbit, one clock and one datum.
//!
//! Both hold for the same shots, so their difference is not noise. Independent orbits differ by tens of metres, a
//! different clock correction shifts the spacecraft along the track by its speed times the change, and a different
//! datum shifts it by kilometres.

use crate::group_profiles::Profile;
use areograph_base::{
    altimetry::MolaClock,
    body::{Body, Datum},
    footprints::Footprints,
    frames::BodyFixed,
    minus::signed,
};
use areograph_geom::{
    body_rotation::{body_matrix, body_rotation},
    orbit_axes::radial_along_cross,
    range_residuals::own_spacecraft,
};
use areograph_spice::Trajectory;

/// The likely cause of their difference in the middle of the profile: a different datum, a different clock correction,
/// or neither.
pub(super) fn cause(
    footprints: &Footprints<BodyFixed>,
    profile: &Profile,
    trajectory: &Trajectory,
    clock: &MolaClock,
    limit_m: f64,
) -> String {
    together(footprints, profile, trajectory, clock, limit_m)
        .unwrap_or_else(|| "the orbit in the kernels differs from the orbit in the file".to_owned())
}

fn together(
    footprints: &Footprints<BodyFixed>,
    profile: &Profile,
    trajectory: &Trajectory,
    clock: &MolaClock,
    limit_m: f64,
) -> Option<String> {
    let shot = footprints.row(*profile.rows.get(profile.rows.len() / 2)? as usize);
    let at = clock.spacecraft_time(shot.et_tag_s);
    let (position, velocity_m_s) = (trajectory.position(at)?, trajectory.velocity_m_s(at)?);
    let to_mars = *body_rotation(Body::Mars, at).matrix();
    let datum = footprints.files.get(usize::from(shot.file))?.datum;
    let own_m = to_mars.tr_mul(&own_spacecraft(&shot).xyz_m);
    for other in [Datum::Iau1991, Datum::Iau1994, Datum::Iau2000] {
        // Back into the file's coordinates, and out of them as if they belonged to the other datum.
        let coordinates_m = body_matrix(datum.model(), at) * own_m;
        let moved_m = body_matrix(other.model(), at).tr_mul(&coordinates_m);
        if other != datum && (moved_m - position.xyz_m).norm() <= limit_m {
            return Some(format!(
                "the positions agree if the coordinates of the file refer to {other} instead of {datum} (pedr.datum)"
            ));
        }
    }
    let difference_m =
        radial_along_cross(&position.xyz_m, &velocity_m_s).tr_mul(&(own_m - position.xyz_m));
    let [radial, along, cross] = [difference_m.x, difference_m.y, difference_m.z];
    if radial.hypot(cross) > limit_m {
        return None;
    }
    let used_s = if clock.moves_spacecraft() {
        clock.correction_s()
    } else {
        0.0
    };
    Some(format!(
        "the positions agree if time tags are corrected by {} s instead of {} s (altimeter_clock); otherwise the \
         kernels contain a different orbit",
        signed(used_s + along / velocity_m_s.norm(), 3),
        signed(used_s, 3)
    ))
}
