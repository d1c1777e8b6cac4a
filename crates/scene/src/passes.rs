//! Laser passes in two directions over one site, as PEDR files.

use std::path::Path;

use nalgebra::Vector3;

use super::{
    arc::{Beam, Flight},
    error_sources::{Roughness, SceneErrors},
    laser::LaserErrors,
    orbit::Orbit,
    pedr::{PedrRequest, frame_tags, write_pedr},
    profile_shift::ProfileShift,
    random::{Random, mix},
    terrain::Terrain,
};
use areograph_base::{
    body::{Datum, MARS_IAU2000},
    error::Result,
    time::{Et, Interval},
    units::wrap_pi,
};
use areograph_geom::{
    body_rotation::body_matrix,
    ellipsoid::{Spherical, spherical_to_xyz_m},
};

/// The first pass, ET seconds: 1999-03-01; the others follow by days.
const START_S: f64 = -26_570_000.0;
const APART_S: f64 = 86_400.0;
/// Sphere on which passes are distributed over their width, metres.
const RADIUS_M: f64 = 3_396_190.0;

/// Passes over a site, the first half of them northbound, the others southbound.
pub(super) struct Passes {
    /// East longitude and latitude.
    pub(super) longitude_rad: f64,
    pub(super) latitude_rad: f64,
    /// Passes in each of two directions.
    pub(super) of_direction: u32,
    /// Half the width over which they are distributed, metres.
    pub(super) half_width_m: f64,
    /// Half their length, seconds.
    pub(super) half_s: f64,
    /// Number of the orbit of the first pass.
    pub(super) first_orbit: u32,
    /// Standard deviations of the shift of a pass in its file, metres: towards the east and the north each, and radially; 0 if
    /// passes are exact.
    pub(super) shift_sigma_m: [f64; 2],
}

impl Passes {
    /// Number of passes.
    pub(super) const fn count(&self) -> u32 {
        2 * self.of_direction
    }

    /// Writes a file of every pass into `folder`.
    ///
    /// # Errors
    /// A beam that misses Mars; errors of writing.
    pub(super) fn write(&self, folder: &Path, terrain: &Terrain, seed: u64) -> Result<()> {
        (0..self.count()).try_for_each(|number| self.write_pass(folder, terrain, number, seed))
    }

    fn write_pass(&self, folder: &Path, terrain: &Terrain, number: u32, seed: u64) -> Result<()> {
        let et = Et::from_seconds(START_S + APART_S * f64::from(number));
        let of_direction = self.of_direction;
        let share = (f64::from(number % of_direction) + 0.5) / f64::from(of_direction);
        let aside_m = self.half_width_m * (2.0 * share - 1.0);
        let longitude_rad = self.longitude_rad + aside_m / (RADIUS_M * self.latitude_rad.cos());
        let northwards = number < of_direction;
        let pass = Pass::over(et, longitude_rad, self.latitude_rad, northwards);
        let tags = frame_tags(Interval::new(et.plus(-self.half_s), et.plus(self.half_s)));
        let orbit = self.first_orbit + number;
        let request = PedrRequest {
            name: &format!("ap{:05}l.b", 10_000 + orbit),
            tags: &tags,
            datum: Datum::Iau2000,
            orbit: &|_| orbit,
            seed: mix(seed ^ u64::from(number)),
            errors: LaserErrors {
                altimeter: SceneErrors::realistic(Roughness::Rough).altimeter,
                shift: self.shift(seed, number),
            },
        };
        write_pedr(folder, &pass, terrain, &request, |_| false).map(|_| ())
    }

    /// The shift of a pass in its file.
    fn shift(&self, seed: u64, number: u32) -> ProfileShift {
        let [plan_m, radial_m] = self.shift_sigma_m;
        if plan_m.max(radial_m) <= 0.0 {
            return ProfileShift::none();
        }
        let mut random = Random::new(seed, &format!("shift of pass {number}"));
        let [east, north, up] = [0; 3].map(|_| random.normal());
        let site = spherical_to_xyz_m(self.longitude_rad, self.latitude_rad, 1.0);
        ProfileShift::near(&site, [plan_m * east, plan_m * north, radial_m * up])
    }
}

/// A pass with nadir pointing.
#[derive(Debug)]
pub(super) struct Pass(Orbit);

impl Flight for Pass {
    fn beam(&self, et: Et) -> Result<Beam> {
        let spacecraft_m = self.0.state(et).position_m;
        let direction = -spacecraft_m.normalize();
        Ok(Beam {
            spacecraft_m,
            position_error_m: Vector3::zeros(),
            direction,
            steady_direction: direction,
        })
    }
}

impl Pass {
    /// Its orbit.
    pub(super) const fn orbit(&self) -> &Orbit {
        &self.0
    }

    /// Height above the sphere of passes at `et`, metres.
    pub(super) fn height_m(&self, et: Et) -> f64 {
        self.0.state(et).position_m.norm() - RADIUS_M
    }

    /// The northbound or southbound pass that is over a site at `et`.
    pub(super) fn over(et: Et, longitude_rad: f64, latitude_rad: f64, northwards: bool) -> Self {
        /// Steps of its solution: each leaves a fiftieth, the eccentricity's share.
        const STEPS: usize = 8;
        let sense = if northwards { 1.0 } else { -1.0 };
        let from_node_rad = if northwards {
            latitude_rad
        } else {
            std::f64::consts::PI - latitude_rad
        };
        let mut node_rad = longitude_rad;
        let mut anomaly_rad = from_node_rad + std::f64::consts::FRAC_PI_2;
        let mut orbit = Orbit::new(et, node_rad, anomaly_rad);
        for _ in 0..STEPS {
            let place = body_matrix(&MARS_IAU2000, et) * orbit.state(et).position_m;
            let place = Spherical::from_xyz_m(&place);
            node_rad += wrap_pi(longitude_rad - place.longitude_rad);
            anomaly_rad += sense * (latitude_rad - place.latitude.0);
            orbit = Orbit::new(et, node_rad, anomaly_rad);
        }
        Self(orbit)
    }
}
