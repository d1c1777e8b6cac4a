//! Errors drawn for the day of one image, and the flight with them.

use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

use super::{
    arc::{Arc, Beam, Flight},
    attitude::bus_to_camera,
    error_sources::{
        AttitudeErrors, CameraErrors, Jitter, Misregistration, PositionErrors, SceneErrors,
    },
    profile_shift::ProfileShift,
    random::Random,
};
use areograph_base::{body::MARS_IAU2000, error::Result, instruments::Instrument, time::Et};
use areograph_geom::{
    attitude::matrix_of_rotation_vector, body_rotation::body_matrix,
    orbit_axes::radial_along_cross, pushbroom::Pose,
};

/// The polynomial of an attitude error is held constant beyond this many half images from the middle: shots of the
/// window are nearer, and it does not grow over the day.
const POLYNOMIAL_REACH: f64 = 4.0;

/// Errors of the day of one image.
#[derive(Debug, Clone, Serialize)]
pub(super) struct DayErrors {
    /// Lines by which all lines were exposed later than in the label.
    pub time_bias_lines: f64,
    /// Seconds by which the attitude of the C-kernel is late: the true attitude at `t` is the C-kernel's at `t` + this.
    pub attitude_clock_s: f64,
    /// Position of bus, camera and laser minus the orbit `gsfc`, IAU 2000, metres.
    pub bus_position_m: Vector3<f64>,
    /// Position of the camera minus position of the bus, IAU 2000, metres.
    pub camera_position_m: Vector3<f64>,
    /// Rotation of the bus.
    pub attitude: Option<AttitudeError>,
    /// Angles between the laser and +Z of the bus towards its X and Y, radians: the same on all days.
    pub boresight_rad: [f64; 2],
    /// Shift of the day's profile in the PEDR file.
    pub profile_shift: ProfileShift,
    /// Errors of the camera: the same on all days.
    pub camera: CameraError,
}

/// Errors of the camera against its calibration.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct CameraError {
    /// Pixels of the detector by which the ends of its line lie before the middle, along the track.
    pub bend_px: f64,
    /// True focal length over the focal length of the calibration.
    pub focal_length_ratio: f64,
}

impl CameraError {
    fn draw(sizes: &CameraErrors, seed: u64) -> Self {
        let mut random = Random::new(seed, "camera errors");
        Self {
            bend_px: sizes.bend_sigma_px * random.normal(),
            focal_length_ratio: 1.0 + sizes.focal_length_sigma * random.normal(),
        }
    }
}

/// Rotation of the bus against the C-kernel: its true matrix from J2000 was `exp([e]×)` times the C-kernel's.
#[derive(Debug, Clone, Serialize)]
pub(super) struct AttitudeError {
    /// Instant at which `x` is 0.
    middle_et_s: f64,
    /// Time from there to `x` = 1, seconds.
    half_image_s: f64,
    /// Terms of `e` in `x`, about the axes of the bus (roll, pitch, yaw), radians.
    constant_rad: Vector3<f64>,
    linear_rad: Vector3<f64>,
    quadratic_rad: Vector3<f64>,
    /// Added to `e`.
    jitter: Vec<Sinusoid>,
}

/// `amplitude sin(2π (t − middle) / period + phase)` about one axis.
#[derive(Debug, Clone, Serialize)]
struct Sinusoid {
    /// 0 roll, 1 pitch.
    axis: usize,
    amplitude_rad: f64,
    period_s: f64,
    phase_rad: f64,
}

impl AttitudeError {
    fn draw(sizes: &AttitudeErrors, arc: &Arc, random: &mut Random) -> Self {
        let half_image_s = 0.5 * arc.exposed.duration_s();
        let mut normal = || Vector3::from_fn(|_axis, _column| random.normal());
        let constant_rad = Vector3::from(sizes.constant_sigma_rad).component_mul(&normal());
        let linear_rad = sizes.linear_sigma_rad * normal();
        let quadratic_rad = sizes.quadratic_sigma_rad * normal();
        Self {
            middle_et_s: arc.exposed.start.plus(half_image_s).seconds(),
            half_image_s,
            constant_rad,
            linear_rad,
            quadratic_rad,
            jitter: [&sizes.jitter, &sizes.slow_jitter]
                .into_iter()
                .flat_map(|sizes| sinusoids(sizes, random))
                .collect(),
        }
    }

    /// Rotation at `et` without jitter, radians about the axes of the bus.
    pub(super) fn steady_at(&self, et: Et) -> Vector3<f64> {
        let late_s = et.since(Et::from_seconds(self.middle_et_s));
        let x = (late_s / self.half_image_s).clamp(-POLYNOMIAL_REACH, POLYNOMIAL_REACH);
        self.constant_rad + x * (self.linear_rad + x * self.quadratic_rad)
    }

    /// Rotation at `et`, radians about the axes of the bus.
    fn at(&self, et: Et) -> Vector3<f64> {
        let late_s = et.since(Et::from_seconds(self.middle_et_s));
        let mut turn_rad = self.steady_at(et);
        for sinusoid in &self.jitter {
            let angle_rad = std::f64::consts::TAU * late_s / sinusoid.period_s + sinusoid.phase_rad;
            turn_rad[sinusoid.axis] += sinusoid.amplitude_rad * angle_rad.sin();
        }
        turn_rad
    }
}

fn sinusoids(sizes: &Jitter, random: &mut Random) -> Vec<Sinusoid> {
    let axes = (0..sizes.sinusoids).flat_map(|_| [0, 1]);
    axes.map(|axis| Sinusoid {
        axis,
        amplitude_rad: random.between_log(sizes.amplitude_rad[0], sizes.amplitude_rad[1]),
        period_s: random.between_log(sizes.period_s[0], sizes.period_s[1]),
        phase_rad: random.between(0.0, std::f64::consts::TAU),
    })
    .collect()
}

impl DayErrors {
    /// No errors.
    pub(super) fn none() -> Self {
        Self {
            time_bias_lines: 0.0,
            attitude_clock_s: 0.0,
            bus_position_m: Vector3::zeros(),
            camera_position_m: Vector3::zeros(),
            attitude: None,
            boresight_rad: [0.0; 2],
            profile_shift: ProfileShift::none(),
            camera: CameraError {
                bend_px: 0.0,
                focal_length_ratio: 1.0,
            },
        }
    }

    /// Draws the errors of the day of `arc`.
    pub(super) fn draw(errors: &SceneErrors, arc: &Arc, seed: u64) -> Self {
        let id = arc.image.id;
        let stream = |of: &str| Random::new(seed, &format!("{of} {id}"));
        let (time_bias_lines, attitude_clock_s) = match errors.misregistration {
            Misregistration::Published => (arc.image.time_bias_lines, 0.0),
            Misregistration::LineTimes { sigma_lines } => {
                (sigma_lines * stream("line times").normal(), 0.0)
            }
            Misregistration::AttitudeClock { sigma_s } => {
                (0.0, sigma_s * Random::new(seed, "attitude clock").normal())
            }
            Misregistration::AttitudeClockOffset { offset_s } => (0.0, offset_s),
        };
        let normal = |random: &mut Random| Vector3::from_fn(|_axis, _column| random.normal());
        let none = Vector3::zeros();
        let (bus_position_m, camera_position_m) = match errors.position {
            PositionErrors::Camera { sigma_m } => (none, sigma_m * normal(&mut stream("camera"))),
            PositionErrors::Bus {
                sigma_radial_along_cross_m,
            } => {
                let sigma_m = Vector3::from(sigma_radial_along_cross_m);
                let off_m = sigma_m.component_mul(&normal(&mut stream("orbit")));
                (orbit_axes(arc) * off_m, none)
            }
        };
        let sizes = &errors.attitude;
        let constant = sizes.constant_sigma_rad.iter();
        let is_turned =
            constant.fold(0.0_f64, |a, b| a.max(*b)) > 0.0 || sizes.jitter.sinusoids > 0;
        let attitude = is_turned.then(|| AttitudeError::draw(sizes, arc, &mut stream("attitude")));
        let turn_rad = attitude
            .as_ref()
            .map_or_else(Vector3::zeros, |of| of.constant_rad);
        let mut boresight = Random::new(seed, "boresight");
        let drawn_rad = [0, 1].map(|_| errors.altimeter.boresight_sigma_rad * boresight.normal());
        let boresight_rad = errors.altimeter.boresight_rad.unwrap_or(drawn_rad);
        Self {
            time_bias_lines,
            attitude_clock_s,
            bus_position_m,
            camera_position_m,
            boresight_rad,
            attitude,
            profile_shift: ProfileShift::draw(&errors.altimeter, arc, turn_rad, seed),
            camera: CameraError::draw(&errors.camera, seed),
        }
    }

    /// Whether the attitude has jitter.
    pub(super) fn has_jitter(&self) -> bool {
        let jitter = self.attitude.as_ref().map(|attitude| &attitude.jitter);
        jitter.is_some_and(|sinusoids| !sinusoids.is_empty())
    }
}

/// Radial, along-track and cross-track axes of the orbit at the middle of the image, in IAU 2000.
pub(super) fn orbit_axes(arc: &Arc) -> Matrix3<f64> {
    let middle = arc.exposed.start.plus(0.5 * arc.exposed.duration_s());
    let state = arc.orbit.state(middle);
    body_matrix(&MARS_IAU2000, middle) * radial_along_cross(&state.position_m, &state.velocity_m_s)
}

/// The true flight of an image day: the arc of the kernels plus the errors.
#[derive(Debug)]
pub(super) struct Flown<'a> {
    /// The arc of the kernels.
    pub arc: Arc<'a>,
    /// Errors of the kernels.
    pub errors: DayErrors,
}

impl Flown<'_> {
    /// True position of the bus, IAU 2000, metres.
    pub(super) fn bus_position_m(&self, et: Et) -> Vector3<f64> {
        body_matrix(&MARS_IAU2000, et) * self.arc.orbit.state(et).position_m
            + self.errors.bus_position_m
    }

    /// True matrix from J2000 to the bus.
    pub(super) fn j2000_to_bus(&self, et: Et) -> Matrix3<f64> {
        self.turned_by(AttitudeError::at, et)
    }

    /// The C-kernel's matrix at `et`, rotated by the attitude error `turn`.
    pub(super) fn turned_by(
        &self,
        turn: impl Fn(&AttitudeError, Et) -> Vector3<f64>,
        et: Et,
    ) -> Matrix3<f64> {
        let read = et.plus(self.errors.attitude_clock_s);
        let told = self.arc.attitude.j2000_to_bus(read);
        match &self.errors.attitude {
            None => told,
            Some(error) => matrix_of_rotation_vector(&turn(error, et)) * told,
        }
    }

    /// Origin of the straight rays of `camera` at `exposure`, and its axes: the bus and Mars at the instant when the
    /// light left the ground, `light_time_s` earlier, the attitude of the exposure. Without light time the true pose.
    pub(super) fn camera_pose(&self, camera: &Instrument, exposure: Et, light_time_s: f64) -> Pose {
        let left = exposure.plus(-light_time_s);
        let j2000_to_camera = bus_to_camera(camera) * self.j2000_to_bus(exposure);
        Pose {
            position_m: self.bus_position_m(left),
            mars_to_camera: j2000_to_camera * body_matrix(&MARS_IAU2000, left).transpose(),
        }
    }
}

impl Flight for Flown<'_> {
    fn beam(&self, et: Et) -> Result<Beam> {
        let [towards_x, towards_y] = self.errors.boresight_rad;
        let beam = Vector3::new(towards_x, towards_y, 1.0).normalize();
        Ok(Beam {
            spacecraft_m: self.arc.orbit.state(et).position_m,
            position_error_m: self.errors.bus_position_m,
            direction: self.j2000_to_bus(et).tr_mul(&beam),
            steady_direction: self.turned_by(AttitudeError::steady_at, et).tr_mul(&beam),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        error_sources::Roughness,
        plan::{IMAGES, PlannedImage},
    };
    use areograph_base::constants::SPEED_OF_LIGHT_M_S;
    use areograph_config::usual_instrument;
    use areograph_geom::light_time::light_time_s;

    fn arc(image: &'static PlannedImage) -> Arc<'static> {
        Arc::new(image, Et::from_seconds(3.9e7), 600.0).unwrap()
    }

    #[test]
    fn draws_have_the_sizes_of_their_sources() {
        const SEEDS: u64 = 600;
        let errors = SceneErrors::realistic(Roughness::Plains);
        let arc = arc(&IMAGES[0]);
        let axes = orbit_axes(&arc);
        let mut squares = [0.0; 9];
        for seed in 0..SEEDS {
            let drawn = DayErrors::draw(&errors, &arc, seed);
            let attitude = drawn.attitude.unwrap();
            let off_m = axes.tr_mul(&drawn.bus_position_m);
            let [east_m, _, radial_m] = drawn.profile_shift.east_north_radial_m;
            let shares = [
                drawn.time_bias_lines / 30.0,
                off_m.x / 5.2,
                off_m.y / 24.8,
                off_m.z / 8.6,
                attitude.constant_rad.x / 4e-4,
                attitude.constant_rad.y / 1.5e-4,
                attitude.linear_rad.x / 1e-5,
                east_m / 70.0,
                radial_m / 1.0,
            ];
            for (sum, share) in squares.iter_mut().zip(shares) {
                *sum += share * share / SEEDS as f64;
            }
            for sinusoid in &attitude.jitter {
                assert!((1e-6..=5e-6).contains(&sinusoid.amplitude_rad));
                assert!((0.1..=2.0).contains(&sinusoid.period_s) && sinusoid.axis < 2);
            }
        }
        for square in squares {
            // A variance of 600 draws: 6 %, times four.
            assert!((square - 1.0).abs() < 0.24, "{squares:?}");
        }
    }

    #[test]
    fn sizes_of_errors_are_drawn_for_every_seed() {
        let realistic = SceneErrors::realistic(Roughness::Plains);
        let sizes: Vec<f64> = (0..40)
            .map(|seed| realistic.with_drawn_sizes(seed).altimeter.plan_sigma_m)
            .collect();
        assert!(sizes.iter().all(|size_m| (50.0..100.0).contains(size_m)));
        // Half of 40 draws, to three standard deviations of 3.2.
        let larger = sizes.iter().filter(|size_m| **size_m > 70.7).count();
        assert!((10..=30).contains(&larger), "{larger}");
        assert_eq!(realistic.with_drawn_sizes(7), realistic.with_drawn_sizes(7));
    }

    #[test]
    fn a_clock_offset_is_that_of_all_images() {
        let errors = SceneErrors::realistic(Roughness::Plains).with_attitude_clock(None);
        let [first, second] = [0, 3].map(|image| DayErrors::draw(&errors, &arc(&IMAGES[image]), 5));
        assert_eq!(
            first.attitude_clock_s.to_bits(),
            second.attitude_clock_s.to_bits()
        );
        assert!(first.attitude_clock_s.abs() > 0.0 && first.time_bias_lines.abs() <= 0.0);
        assert!((first.bus_position_m - second.bus_position_m).norm() > 1.0);
    }

    #[test]
    fn the_laser_points_elsewhere_by_the_same_angles_on_all_days() {
        let errors = SceneErrors::realistic(Roughness::Plains);
        let flown = [0, 3].map(|image| {
            let arc = arc(&IMAGES[image]);
            let errors = DayErrors::draw(&errors, &arc, 5);
            Flown { arc, errors }
        });
        let [first, second] = &flown;
        assert!((first.errors.boresight_rad[0] - second.errors.boresight_rad[0]).abs() <= 0.0);
        for flown in &flown {
            let et = flown.arc.exposed.start;
            let [towards_x, towards_y] = flown.errors.boresight_rad;
            assert!(towards_x.abs().max(towards_y.abs()) < 5e-4);
            let in_bus = flown.j2000_to_bus(et) * flown.beam(et).unwrap().direction;
            let expected = Vector3::new(towards_x, towards_y, 1.0);
            assert!((in_bus - expected).norm() < 1e-6); // squares of 0.5 mrad
        }
        let mut errors = errors;
        errors.altimeter.boresight_rad = Some([2e-4, -5e-4]);
        for image in &IMAGES {
            let drawn = DayErrors::draw(&errors, &arc(image), 2);
            let [towards_x, towards_y] = drawn.boresight_rad;
            assert!((towards_x - 2e-4).abs() < 1e-12 && (towards_y + 5e-4).abs() < 1e-12);
        }
    }

    #[test]
    fn the_demo_has_no_errors_but_those_of_its_cameras() {
        for image in &IMAGES {
            let drawn = DayErrors::draw(&SceneErrors::demo(), &arc(image), 1);
            assert!(drawn.attitude.is_none() && !drawn.has_jitter());
            assert!(drawn.bus_position_m.norm() <= 0.0 && drawn.camera_position_m.norm() > 1.0);
            assert!(drawn.attitude_clock_s.abs() <= 0.0);
            assert!(drawn.boresight_rad.iter().all(|angle| angle.abs() <= 0.0));
            assert!((drawn.time_bias_lines - image.time_bias_lines).abs() <= 0.0);
            assert_eq!(drawn.profile_shift.rotation(), &Matrix3::identity());
        }
    }

    /// A photon is followed from the ground to the camera in axes that neither rotate nor move with Mars; in axes of
    /// the camera, the camera's velocity is subtracted from its own.
    #[test]
    fn rays_are_straight_from_where_the_camera_stood_when_the_light_left() {
        for image in &IMAGES {
            let arc = arc(image);
            let exposure = arc.exposed.start.plus(3.0);
            let errors = DayErrors::draw(&SceneErrors::demo(), &arc, 1);
            let flown = Flown { arc, errors };
            let camera = usual_instrument();
            let at_once = flown.camera_pose(camera, exposure, 0.0);
            for look in [[0.0, 0.0], [0.002, 0.004], [-0.001, -0.004]] {
                let look = Vector3::new(look[0], look[1], 1.0);
                let ground_m = at_once.position_m + 4.1e5 * at_once.mars_to_camera.tr_mul(&look);
                let orbit = |et: Et| flown.arc.orbit.state(et);
                // For the true orbit only: the demo has no errors of the bus.
                let there_m = |light_time_s: f64| {
                    let left = exposure.plus(-light_time_s);
                    body_matrix(&MARS_IAU2000, left).tr_mul(&ground_m)
                };
                let here = orbit(exposure);
                let mut late_s = 0.0;
                for _ in 0..4 {
                    late_s = light_time_s((here.position_m - there_m(late_s)).norm());
                }
                let photon_m_s =
                    SPEED_OF_LIGHT_M_S * (here.position_m - there_m(late_s)).normalize();
                let arriving = here.velocity_m_s - photon_m_s;
                let axes = super::bus_to_camera(camera) * flown.j2000_to_bus(exposure);
                let seen = (axes * arriving).normalize();
                let pose = flown.camera_pose(camera, exposure, late_s);
                let straight = pose.camera_vector_m(&ground_m).normalize();
                // Second order of v/c: 1e-10 rad, 0.04 mm on the ground. The instants are rounded to 7e-9 s: 0.03 mm.
                assert!((seen - straight).norm() < 3e-10, "{}", image.id);
                let geometric = at_once.camera_vector_m(&ground_m).normalize();
                let share = (seen - geometric).norm();
                assert!((0.9e-5..1.3e-5).contains(&share), "{}: {share}", image.id); // v/c of 3.4 km/s
            }
        }
    }
}
