//! One image day: an orbit and an attitude that show the planned site at the planned time.

use nalgebra::{Matrix3, Vector3};

use super::{
    attitude::{Attitude, Hold, bus_to_camera, rolled_attitude},
    error::SceneError,
    orbit::{Orbit, OrbitState},
    plan::{Look, PlannedImage},
};
use areograph_base::{
    body::Body,
    body::MARS_IAU2000,
    error::Result,
    frames::{BodyFixed, Position},
    time::{Et, Interval},
    units::{RADIANS_PER_DEGREE, wrap_pi},
};
use areograph_config::usual_instrument;
use areograph_geom::{
    body_rotation::body_matrix,
    ellipsoid::{Spherical, ray_meets_ellipsoid},
};

/// Kernels reach this far beyond the frames, seconds.
pub(super) const KERNEL_MARGIN_S: f64 = 60.0;
/// Maximum number of Newton steps.
const ITERATIONS_MAX: u32 = 40;
/// A Newton step below this ends the iteration, radians: 0.4 µm on the ground.
const STEP_MAX_RAD: f64 = 1e-13;

/// Position of the spacecraft and direction of the laser.
#[derive(Debug, Clone, Copy)]
pub(super) struct Beam {
    /// Spacecraft from the centre of Mars by the orbit, J2000, metres.
    pub spacecraft_m: Vector3<f64>,
    /// True minus this position, IAU 2000, metres.
    pub position_error_m: Vector3<f64>,
    /// Direction of the laser (+Z of the bus plus its boresight error), J2000, unit length.
    pub direction: Vector3<f64>,
    /// The direction without jitter, as in the altimeter's products.
    pub steady_direction: Vector3<f64>,
}

/// A flight, which gives its beam at any time.
pub(super) trait Flight {
    /// The beam at the true time `et`.
    ///
    /// # Errors
    /// When the flight does not cover this time.
    fn beam(&self, et: Et) -> Result<Beam>;
}

/// The flight of one image day according to its kernels.
#[derive(Debug, Clone)]
pub(super) struct Arc<'a> {
    /// The image.
    pub image: &'a PlannedImage<'a>,
    /// Time of its exposure.
    pub exposed: Interval,
    /// Interval that contains the frames of the day's PEDR file.
    pub frames: Interval,
    /// The orbit `gsfc`.
    pub orbit: Orbit,
    /// The attitude, over the frames and a margin.
    pub attitude: Attitude,
}

impl<'a> Arc<'a> {
    /// The day of `image`, whose first line begins at `start`; its PEDR file holds `duration_s` of frames.
    ///
    /// # Errors
    /// [`SceneError::NoOrbit`].
    pub(super) fn new(image: &'a PlannedImage<'a>, start: Et, duration_s: f64) -> Result<Self> {
        let exposed = image.exposed(start);
        let middle = exposed.start.plus(exposed.duration_s() / 2.0);
        let frames = Interval::new(
            middle.plus(-duration_s / 2.0),
            middle.plus(duration_s / 2.0),
        );
        let geometry = solve(image, middle)?;
        let orbit = geometry.orbit(middle);
        let hold = matches!(image.look, Look::Roll { .. }).then(|| Hold {
            image: exposed,
            attitude: rolled_attitude(&orbit.state(middle), geometry.0.z),
        });
        let attitude = Attitude::new(&orbit, hold.as_ref(), frames.padded(KERNEL_MARGIN_S));
        Ok(Self {
            image,
            exposed,
            frames,
            orbit,
            attitude,
        })
    }

    /// Matrix from the camera to Mars (IAU 2000) at `et`, according to the kernels.
    pub(super) fn camera_to_mars(&self, et: Et) -> Matrix3<f64> {
        let j2000_to_camera = bus_to_camera(usual_instrument()) * self.attitude.j2000_to_bus(et);
        body_matrix(&MARS_IAU2000, et) * j2000_to_camera.transpose()
    }

    /// The times that the kernels cover.
    pub(super) fn kernel_span(&self) -> Interval {
        self.frames.padded(KERNEL_MARGIN_S)
    }
}

/// Longitude of the node, mean anomaly and roll, radians, at the middle of the image.
#[derive(Debug, Clone, Copy)]
struct Geometry(Vector3<f64>);

impl Geometry {
    fn orbit(self, middle: Et) -> Orbit {
        Orbit::new(middle, self.0.x, self.0.y)
    }

    /// The site at nadir from a circular orbit.
    fn first_guess(image: &PlannedImage) -> Self {
        let latitude_rad = image.site.latitude_deg * RADIANS_PER_DEGREE;
        let longitude_rad = image.site.longitude_deg * RADIANS_PER_DEGREE;
        let anomaly_rad = latitude_rad + std::f64::consts::FRAC_PI_2;
        Self(Vector3::new(longitude_rad, anomaly_rad, 0.0))
    }

    /// Remaining error: longitude, latitude and emission (or roll, for nadir), radians.
    fn miss(self, image: &PlannedImage, middle: Et) -> Option<Vector3<f64>> {
        let state: OrbitState = self.orbit(middle).state(middle);
        let mars = body_matrix(&MARS_IAU2000, middle);
        let camera = bus_to_camera(usual_instrument()) * rolled_attitude(&state, self.0.z);
        let spacecraft = Position::<BodyFixed>::new(mars * state.position_m);
        let boresight = mars * camera.row(2).transpose();
        let hit = ray_meets_ellipsoid(Body::Mars.model(), &spacecraft, &boresight)?;
        let ground = Spherical::from_xyz_m(&hit.xyz_m);
        let angle_missed = match image.look {
            Look::Nadir => self.0.z,
            Look::Roll {
                emission_deg, east, ..
            } => {
                let emission_rad = hit.xyz_m.angle(&-boresight);
                // The sign makes the angle smooth through nadir, where Newton's method starts.
                let seen_east = hit.xyz_m.cross(&spacecraft.xyz_m).z < 0.0;
                let side = |is_east: bool| if is_east { 1.0 } else { -1.0 };
                side(seen_east) * emission_rad - side(east) * emission_deg * RADIANS_PER_DEGREE
            }
        };
        Some(Vector3::new(
            wrap_pi(ground.longitude_rad - image.site.longitude_deg * RADIANS_PER_DEGREE),
            ground.latitude.0 - image.site.latitude_deg * RADIANS_PER_DEGREE,
            angle_missed,
        ))
    }
}

/// Newton's method with a Jacobian of central differences.
fn solve(image: &PlannedImage, middle: Et) -> Result<Geometry> {
    const DIFFERENCE_RAD: f64 = 1e-6;
    let mut geometry = Geometry::first_guess(image);
    let mut last_step_rad = f64::INFINITY;
    for _ in 0..ITERATIONS_MAX {
        let columns: Option<Vec<Vector3<f64>>> = (0..3)
            .map(|axis| {
                let aside = DIFFERENCE_RAD * Vector3::ith(axis, 1.0);
                let more = Geometry(geometry.0 + aside).miss(image, middle)?;
                let less = Geometry(geometry.0 - aside).miss(image, middle)?;
                Some((more - less) / (2.0 * DIFFERENCE_RAD))
            })
            .collect();
        let step = columns
            .and_then(|columns| Matrix3::from_columns(&columns).try_inverse())
            .zip(geometry.miss(image, middle))
            .map(|(inverse, miss)| inverse * miss);
        let Some(step) = step else { break };
        geometry.0 -= step;
        last_step_rad = step.norm();
        if last_step_rad < STEP_MAX_RAD {
            return Ok(geometry);
        }
    }
    Err(SceneError::NoOrbit {
        image: image.id.to_owned(),
        step: last_step_rad,
        iterations: ITERATIONS_MAX,
    }
    .into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::IMAGES;

    #[test]
    fn every_image_shows_its_site_from_the_planned_side() {
        for image in &IMAGES {
            let arc = Arc::new(image, Et::from_seconds(3.9e7), 1_200.0).unwrap();
            let middle = arc.exposed.start.plus(arc.exposed.duration_s() / 2.0);
            let spacecraft =
                body_matrix(&MARS_IAU2000, middle) * arc.orbit.state(middle).position_m;
            let boresight = arc.camera_to_mars(middle) * Vector3::z();
            let hit = ray_meets_ellipsoid(
                Body::Mars.model(),
                &Position::<BodyFixed>::new(spacecraft),
                &boresight,
            )
            .unwrap();
            // 1e-9 of the radius is 3 mm on the ground; the attitude rotates uniformly between its samples.
            assert!(
                (hit.xyz_m.normalize() - image.site.direction()).norm() < 3e-8,
                "{}",
                image.id
            );
            let emission_deg = hit.xyz_m.angle(&-boresight) / RADIANS_PER_DEGREE;
            let expected_deg = match image.look {
                Look::Nadir => 0.15, // 0.135° of mounting, seen from the ground
                Look::Roll { emission_deg, .. } => emission_deg,
            };
            assert!(
                (emission_deg - expected_deg).abs() < 0.01,
                "{} {emission_deg}",
                image.id
            );
            let velocity =
                body_matrix(&MARS_IAU2000, middle) * arc.orbit.state(middle).velocity_m_s;
            assert!(velocity.z > 3e3, "{} flies north", image.id);
            if let Look::Roll { east, .. } = image.look {
                let west_of_site = spacecraft.cross(&hit.xyz_m).z > 0.0;
                assert_eq!(west_of_site, east, "{}", image.id);
            }
        }
    }
}
