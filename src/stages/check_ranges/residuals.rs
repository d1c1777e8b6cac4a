//! Range residuals of single shots.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::{
    altimetry::MolaClock,
    footprints::Footprint,
    frames::{Frame, J2000, MarsIau2000, Position},
    geom::{
        ellipsoid::spherical_to_xyz_m, mars_rotation::mars_rotation, orbit_axes::radial_along_cross,
    },
    time::Et,
};

/// Residuals as columns, one entry per shot of a profile, metres.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct ShotResiduals {
    /// Index of the profile.
    pub profile: Vec<u32>,
    /// Row of the footprint.
    pub row: Vec<u32>,
    /// Range − |SPK spacecraft − raw footprint|.
    pub range_minus_distance_m: Vec<f64>,
    /// Range − |SPK spacecraft − crossover-corrected footprint|.
    pub range_minus_distance_crossover_m: Vec<f64>,
    /// Range − |PEDR spacecraft − raw footprint|.
    pub decoding_m: Vec<f64>,
    /// PEDR spacecraft − SPK spacecraft, away from Mars.
    pub spacecraft_radial_m: Vec<f64>,
    /// PEDR spacecraft − SPK spacecraft, along the flight.
    pub spacecraft_along_m: Vec<f64>,
    /// PEDR spacecraft − SPK spacecraft, along the orbit's angular momentum.
    pub spacecraft_cross_m: Vec<f64>,
    /// Whether range − distance is an outlier of its profile.
    pub outlier: Vec<bool>,
}

/// Residuals of one shot, metres.
pub(super) struct Residuals {
    range_minus_distance_m: f64,
    range_minus_distance_crossover_m: f64,
    decoding_m: f64,
    spacecraft_m: Vector3<f64>,
}

impl ShotResiduals {
    /// Number of shots whose residuals are known.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.row.len()
    }

    /// Whether there are none.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.row.is_empty()
    }

    pub(super) fn push(&mut self, profile: u32, row: u32, residuals: &Residuals) {
        self.profile.push(profile);
        self.row.push(row);
        self.range_minus_distance_m
            .push(residuals.range_minus_distance_m);
        self.range_minus_distance_crossover_m
            .push(residuals.range_minus_distance_crossover_m);
        self.decoding_m.push(residuals.decoding_m);
        self.spacecraft_radial_m.push(residuals.spacecraft_m.x);
        self.spacecraft_along_m.push(residuals.spacecraft_m.y);
        self.spacecraft_cross_m.push(residuals.spacecraft_m.z);
    }
}

/// Measured range minus the geometric distance of spacecraft and footprint, metres.
///
/// Any frame will do that both positions share; the sign is that of Shan et al. 2005, Table 3.
#[must_use]
pub fn range_residual_m<F: Frame>(
    range_m: f64,
    spacecraft: &Position<F>,
    footprint: &Position<F>,
) -> f64 {
    range_m - spacecraft.distance_m(footprint)
}

/// The instant at which the spacecraft's position belongs to the shot.
pub(super) fn spacecraft_time(shot: &Footprint, clock: &MolaClock) -> Et {
    Et::from_seconds(if clock.moves_spacecraft() {
        shot.et_s
    } else {
        shot.et_tag_s
    })
}

/// The footprint with its raw radius.
pub(super) fn raw_footprint(shot: &Footprint) -> Position<MarsIau2000> {
    Position::new(spherical_to_xyz_m(
        shot.longitude_rad,
        shot.latitude_rad,
        shot.radius_m,
    ))
}

/// The spacecraft where the PEDR file has it.
pub(super) fn own_spacecraft(shot: &Footprint) -> Position<MarsIau2000> {
    Position::new(spherical_to_xyz_m(
        shot.spacecraft_longitude_rad,
        shot.spacecraft_latitude_rad,
        shot.spacecraft_radius_m,
    ))
}

/// Residuals of one shot, the spacecraft at `position` and `velocity_m_s` (J2000) at `at`.
pub(super) fn residuals(
    shot: &Footprint,
    at: Et,
    position: &Position<J2000>,
    velocity_m_s: &Vector3<f64>,
) -> Residuals {
    let to_mars = mars_rotation::<MarsIau2000>(at);
    let spacecraft = to_mars.apply(position);
    let raw = raw_footprint(shot);
    let crossover = Position::new(spherical_to_xyz_m(
        shot.longitude_rad,
        shot.latitude_rad,
        shot.radius_crossover_m,
    ));
    let own = own_spacecraft(shot);
    let difference = to_mars.matrix().tr_mul(&(own.xyz_m - spacecraft.xyz_m));
    Residuals {
        range_minus_distance_m: range_residual_m(shot.range_m, &spacecraft, &raw),
        range_minus_distance_crossover_m: range_residual_m(shot.range_m, &spacecraft, &crossover),
        decoding_m: range_residual_m(shot.range_m, &own, &raw),
        spacecraft_m: radial_along_cross(&position.xyz_m, velocity_m_s).tr_mul(&difference),
    }
}
