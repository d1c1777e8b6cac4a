//! Ranges, the file's own orbit and the kernels' orbit compared shot by shot.
//!
//! Geometric states only: the range is to the spacecraft's centre of mass.

use nalgebra::{Matrix3, Vector3};

use super::{
    body_rotation::body_rotation, ellipsoid::spherical_to_xyz_m, nearby_angle::NearbyAngle,
    orbit_axes::radial_along_cross,
};
use areograph_base::{
    body::Body,
    footprints::{Footprint, Footprints},
    frames::{BodyFixed, Frame, J2000, Position},
    time::Et,
};

/// Position of the spacecraft according to the kernels at one instant, and the axes of its orbit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpacecraftState {
    /// Position.
    pub position: Position<BodyFixed>,
    /// Radial, along-track and cross-track unit vectors as columns, in IAU 2000.
    pub axes: Matrix3<f64>,
}

impl SpacecraftState {
    /// The state of position and velocity (metres per second) in J2000 at `at`.
    #[must_use]
    pub fn of(at: Et, position: &Position<J2000>, velocity_m_s: &Vector3<f64>) -> Self {
        let to_mars = body_rotation(Body::Mars, at);
        Self {
            position: to_mars.apply(position),
            axes: to_mars.matrix() * radial_along_cross(&position.xyz_m, velocity_m_s),
        }
    }
}

/// Residuals of one shot, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RangeResiduals {
    /// Range − |SPK spacecraft − raw footprint|.
    pub range_minus_distance_m: f64,
    /// Range − |SPK spacecraft − crossover-corrected footprint|.
    pub range_minus_distance_crossover_m: f64,
    /// Range − |PEDR spacecraft − raw footprint|; NaN where the file has no spacecraft.
    pub decoding_m: f64,
    /// PEDR spacecraft − SPK spacecraft along radial, along-track and cross-track axes; NaN as well.
    pub spacecraft_m: Vector3<f64>,
}

impl RangeResiduals {
    /// The residuals of a shot in IAU 2000.
    #[must_use]
    pub fn of(shot: &Footprint, spacecraft: &SpacecraftState) -> Self {
        let ground = spherical_to_xyz_m(shot.longitude_rad, shot.latitude_rad, 1.0);
        Self::with(shot, spacecraft, &ground, own_spacecraft(shot))
    }

    /// With the direction of the footprint and the position of the spacecraft in the file.
    fn with(
        shot: &Footprint,
        spacecraft: &SpacecraftState,
        ground: &Vector3<f64>,
        own: Position<BodyFixed>,
    ) -> Self {
        let raw = Position::new(shot.radius_m * ground);
        let crossover = Position::new(shot.radius_crossover_m * ground);
        let craft = &spacecraft.position;
        let difference_m = own.xyz_m - craft.xyz_m;
        Self {
            range_minus_distance_m: range_residual_m(shot.range_m, craft, &raw),
            range_minus_distance_crossover_m: range_residual_m(shot.range_m, craft, &crossover),
            decoding_m: range_residual_m(shot.range_m, &own, &raw),
            spacecraft_m: spacecraft.axes.tr_mul(&difference_m),
        }
    }
}

/// Longitude and latitude of a footprint and of its spacecraft, for shots close to it.
#[derive(Debug, Clone, Copy)]
pub struct NearbyShot {
    ground: [NearbyAngle; 2],
    spacecraft: [NearbyAngle; 2],
}

impl NearbyShot {
    /// Shots close to this one.
    #[must_use]
    pub fn new(shot: &Footprint) -> Self {
        let ground = [shot.longitude_rad, shot.latitude_rad];
        let spacecraft = [shot.spacecraft_longitude_rad, shot.spacecraft_latitude_rad];
        Self {
            ground: ground.map(NearbyAngle::new),
            spacecraft: spacecraft.map(NearbyAngle::new),
        }
    }

    /// [`RangeResiduals::of`] within rounding.
    #[must_use]
    pub fn residuals(&self, shot: &Footprint, spacecraft: &SpacecraftState) -> RangeResiduals {
        let ground = direction(&self.ground, shot.longitude_rad, shot.latitude_rad);
        let own = direction(
            &self.spacecraft,
            shot.spacecraft_longitude_rad,
            shot.spacecraft_latitude_rad,
        );
        let own = Position::new(shot.spacecraft_radius_m * own);
        RangeResiduals::with(shot, spacecraft, &ground, own)
    }
}

fn direction(near: &[NearbyAngle; 2], longitude_rad: f64, latitude_rad: f64) -> Vector3<f64> {
    let (sin_longitude, cos_longitude) = near[0].sin_cos(longitude_rad);
    let (sin_latitude, cos_latitude) = near[1].sin_cos(latitude_rad);
    Vector3::new(
        cos_latitude * cos_longitude,
        cos_latitude * sin_longitude,
        sin_latitude,
    )
}

impl RangeResiduals {
    /// Leaves out what depends on the spacecraft of the file, where it has none.
    pub fn forget_own(&mut self) {
        self.decoding_m = f64::NAN;
        self.spacecraft_m.fill(f64::NAN);
    }
}

/// Measured range minus the geometric distance of spacecraft and footprint, metres.
///
/// Any frame common to both positions serves; the sign follows Shan et al. 2005, Table 3.
#[must_use]
pub fn range_residual_m<F: Frame>(
    range_m: f64,
    spacecraft: &Position<F>,
    footprint: &Position<F>,
) -> f64 {
    range_m - spacecraft.distance_m(footprint)
}

/// The footprint with this radius, metres.
#[must_use]
pub fn footprint(shot: &Footprint, radius_m: f64) -> Position<BodyFixed> {
    Position::new(spherical_to_xyz_m(
        shot.longitude_rad,
        shot.latitude_rad,
        radius_m,
    ))
}

/// A spacecraft this close to the radius through the footprint, radians (4 mm), and to its end at the range, metres (half
/// a digit of tables in centimetres, and rounding), was put there: no laser is pointed and no range measured so well.
const BY_RANGE_RAD: f64 = 1e-9;
const BY_RANGE_M: f64 = 0.006;

/// Whether the file of the shot in `row` states where the spacecraft was.
///
/// A PEDR file always does: at nadir its spacecraft lies on the radius through the footprint. A table without positions
/// has the spacecraft on that radius at the range ("nadir by range"): its distance from the footprint is then the range,
/// and tests nothing.
#[must_use]
pub fn states_spacecraft<F>(footprints: &Footprints<F>, row: usize) -> bool {
    let shot = footprints.row(row);
    let file = footprints.files.get(usize::from(shot.file));
    file.is_some_and(|file| !file.is_table) || has_own_spacecraft(&shot)
}

/// Whether the spacecraft of a shot of a table is not the one that follows from footprint and range.
fn has_own_spacecraft(shot: &Footprint) -> bool {
    let beside_m = shot.spacecraft_radius_m - (shot.radius_m + shot.range_m);
    if beside_m.abs() > BY_RANGE_M {
        return true;
    }
    let along = |longitude_rad, latitude_rad| spherical_to_xyz_m(longitude_rad, latitude_rad, 1.0);
    let up = along(shot.longitude_rad, shot.latitude_rad);
    let own = along(shot.spacecraft_longitude_rad, shot.spacecraft_latitude_rad);
    (own - up).norm() > BY_RANGE_RAD
}

/// The position of the spacecraft in the PEDR file.
#[must_use]
pub fn own_spacecraft(shot: &Footprint) -> Position<BodyFixed> {
    Position::new(spherical_to_xyz_m(
        shot.spacecraft_longitude_rad,
        shot.spacecraft_latitude_rad,
        shot.spacecraft_radius_m,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use areograph_base::{body::Datum, footprints::SourceFile};

    /// Whether a shot at nadir whose spacecraft is `beside_m` from footprint and range has an own spacecraft.
    fn is_stated(is_table: bool, beside_m: f64) -> bool {
        let mut footprints = Footprints::<BodyFixed>::new(vec![SourceFile {
            name: "shots".to_owned(),
            // The letter is in the name of a file, and states nothing about its content.
            version: None,
            datum: Datum::Iau2000,
            blake3: String::new(),
            is_table,
        }]);
        footprints.push(&Footprint {
            et_tag_s: 0.0,
            et_s: 0.0,
            orbit: 1,
            file: 0,
            record: 1,
            shot: 1,
            longitude_rad: 1.0,
            latitude_rad: 0.2,
            radius_m: 3_394_000.0,
            radius_crossover_m: 3_394_000.0,
            areoid_radius_m: 3_396_000.0,
            range_m: 380_000.0,
            spacecraft_longitude_rad: 1.0,
            spacecraft_latitude_rad: 0.2,
            spacecraft_radius_m: 3_774_000.0 + beside_m,
            off_nadir_rad: 0.0,
            channel: 1,
            class: 1,
            attitude_flag: 0,
            orbit_quality: 1,
            windows: 1,
        });
        states_spacecraft(&footprints, 0)
    }

    #[test]
    fn only_tables_have_shots_at_nadir_by_range() {
        // A spacecraft at the range above its footprint: of a PEDR file it is a position, of a table it follows from the range.
        assert!(is_stated(false, 0.0));
        assert!(!is_stated(true, 0.0));
        // Metres: a digit of a table in centimetres, and a residual.
        assert!(!is_stated(true, 0.005));
        assert!(is_stated(true, 1.5));
    }
}
