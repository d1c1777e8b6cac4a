//! Frames of a synthetic archive: one orbit for the complete mission, a laser near nadir, the file's own orbit and
//! ground a crossover residual too high.
//!
//! The true ground is the file's; ranges are measured to it from the position of the spacecraft in the kernels at the
//! true time. A check of ranges therefore finds the drawn errors: noise, the residual, and the errors of bad orbits.

use std::f64::consts::TAU;

use nalgebra::Vector3;
use serde::Serialize;

use super::{
    error::SceneError,
    laser::{CLOCK_HZ, CLOUD_SHARE, FRAME_S, MISSING_SHARE, SHOT_S, add_orbit_errors, share_of},
    orbit::Orbit,
    random::{mix, normal_of, unit_of},
    sun::mars_from_sun_m,
    telemetry,
    terrain::Terrain,
};
use areograph_base::{
    body::MARS_IAU2000,
    error::{Error, Result},
    time::Et,
    units::{RADIANS_PER_DEGREE, wrap_pi},
};
use areograph_config::usual_altimeter;
use areograph_geom::{
    body_rotation::body_matrix,
    ellipsoid::{Spherical, spherical_to_xyz_m},
    orbit_axes::radial_along_cross,
};
use areograph_pds::pedr::{FrameValues, Record, SHOTS};

/// Standard deviation of a range, metres, and its step, as in [`super::SceneErrors::realistic`].
pub(super) const RANGE_NOISE_M: f64 = 1.0;
pub(super) const RANGE_STEP_M: f64 = 0.375;
/// One of this many revolutions has an off-nadir look, by at most this angle, for this duration, this long after its
/// start.
const ASIDE_EVERY: u32 = 8;
const ASIDE_RAD: f64 = 18.0 * RADIANS_PER_DEGREE;
const ASIDE_S: f64 = 900.0;
const ASIDE_AFTER_S: f64 = 2_000.0;
/// The bus oscillates about nadir by this angle, with this period.
const WANDER_RAD: f64 = 0.2 * RADIANS_PER_DEGREE;
const WANDER_S: f64 = 1_100.0;
/// One of this many revolutions has a stretch without attitude, this long after its start; the file has it at nadir.
const UNKNOWN_EVERY: u32 = 5;
const UNKNOWN_S: [f64; 2] = [5_000.0, 5_060.0];
/// Attitude flag of a frame without attitude.
const NO_ATTITUDE: u16 = 3;
/// The laser looks this far ahead of nadir.
const AHEAD_RAD: f64 = 0.1 * RADIANS_PER_DEGREE;
/// Small-scale relief along the track: length scale in shots, and amplitude in metres.
const ROUGHNESS: [(u64, f64); 3] = [(64, 25.0), (12, 8.0), (1, 1.0)];
/// Half the height interval of the parallax, metres.
const PARALLAX_STEP_M: f64 = 500.0;

/// Error of a complete revolution in its file.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Badness {
    /// Ranges are too long, metres.
    RangeM(f64),
    /// Time tags are late in addition to the clock bias, seconds.
    TimeS(f64),
    /// Ground and spacecraft of the file are too high, metres.
    OrbitM(f64),
}

impl Badness {
    fn range_m(of: Option<Self>) -> f64 {
        match of {
            Some(Self::RangeM(metres)) => metres,
            _ => 0.0,
        }
    }

    /// Seconds by which tags are late in addition to the clock bias.
    pub(super) fn time_s(of: Option<Self>) -> f64 {
        match of {
            Some(Self::TimeS(seconds)) => seconds,
            _ => 0.0,
        }
    }

    fn orbit_m(of: Option<Self>) -> f64 {
        match of {
            Some(Self::OrbitM(metres)) => metres,
            _ => 0.0,
        }
    }
}

/// The frame to compute.
#[derive(Debug, Clone, Copy)]
pub(super) struct ArchiveFrame {
    /// Mid-point as tagged in the file, a whole number of microseconds.
    pub tag: Et,
    /// Number of the frame in its file, from 0.
    pub index: u32,
    /// Orbit number.
    pub orbit: u32,
    /// Its error.
    pub bad: Option<Badness>,
    /// Seed of its file.
    pub seed: u64,
}

/// Position of the spacecraft and direction of the laser, IAU 2000.
struct Look {
    spacecraft_m: Vector3<f64>,
    direction: Vector3<f64>,
    off_nadir_rad: f64,
}

impl Look {
    /// The look at `et`; straight down for a frame without attitude.
    fn at(orbit: &Orbit, et: Et, revolution: u32, has_attitude: bool) -> Self {
        let state = orbit.state(et);
        let mars = body_matrix(&MARS_IAU2000, et);
        let axes = radial_along_cross(&state.position_m, &state.velocity_m_s);
        let look = if has_attitude {
            let roll = roll_rad(orbit, et, revolution).tan();
            Vector3::new(-1.0, AHEAD_RAD.tan(), roll).normalize()
        } else {
            -Vector3::x()
        };
        Self {
            spacecraft_m: mars * state.position_m,
            direction: mars * (axes * look),
            off_nadir_rad: (-look.x).acos(),
        }
    }

    /// Intersection of the beam with the sphere of `radius_m`; for a beam that only grazes it, the nearest point.
    fn at_radius_m(&self, radius_m: f64) -> Vector3<f64> {
        let b = self.spacecraft_m.dot(&self.direction);
        let c = self.spacecraft_m.norm_squared() - radius_m * radius_m;
        self.spacecraft_m + (-b - (b * b - c).max(0.0).sqrt()) * self.direction
    }

    fn place_at(&self, radius_m: f64) -> Spherical {
        Spherical::from_xyz_m(&self.at_radius_m(radius_m))
    }
}

/// Roll of the bus: it oscillates about nadir, and has one off-nadir look in some revolutions.
fn roll_rad(orbit: &Orbit, et: Et, revolution: u32) -> f64 {
    let wander = (TAU * (et.seconds() / WANDER_S).rem_euclid(1.0)).sin();
    let since_s = orbit.since_southernmost_s(et) - ASIDE_AFTER_S;
    if !revolution.is_multiple_of(ASIDE_EVERY) || !(0.0..=ASIDE_S).contains(&since_s) {
        return WANDER_RAD * wander;
    }
    let share = 0.5 * (1.0 - (TAU * since_s / ASIDE_S).cos());
    WANDER_RAD * wander + ASIDE_RAD * share
}

/// The record of a frame.
///
/// # Errors
/// A value that does not fit its field, which is an internal error.
pub(super) fn fly(orbit: &Orbit, terrain: &Terrain, frame: &ArchiveFrame) -> Result<Record> {
    let late_s = usual_altimeter().clock_bias_s + Badness::time_s(frame.bad);
    let et = frame.tag.plus(-late_s);
    let since_s = orbit.since_southernmost_s(et);
    let [unknown_from_s, unknown_to_s] = UNKNOWN_S;
    let has_attitude = !frame.orbit.is_multiple_of(UNKNOWN_EVERY)
        || !(unknown_from_s..unknown_to_s).contains(&since_s);
    let looks = [-0.5 * FRAME_S, 0.0, 0.5 * FRAME_S]
        .map(|later_s| Look::at(orbit, et.plus(later_s), frame.orbit, has_attitude));
    let mut values = frame_values(&looks, terrain, frame, et)?;
    values.attitude_flag = if has_attitude { 0 } else { NO_ATTITUDE };
    let radii_m = looks.each_ref().map(|look| {
        let ground = look.at_radius_m(values.mid_radius_m);
        terrain.radius_m(&ground.normalize())
    });
    fly_shots(&looks, radii_m, frame, &mut values);
    add_orbit_errors(&mut values, et, true, Badness::orbit_m(frame.bad));
    let mut record = Record::from_frame(&values).map_err(Error::from)?;
    telemetry::enter(&mut record, mix(frame.seed) ^ u64::from(frame.index) << 8);
    Ok(record)
}

/// The values of a frame except its shots, before the crossover residual.
fn frame_values(
    looks: &[Look; 3],
    terrain: &Terrain,
    frame: &ArchiveFrame,
    et: Et,
) -> Result<FrameValues> {
    let [first, middle, last] = looks;
    let nadir_m = terrain.radius_m(&middle.spacecraft_m.normalize());
    let up = middle.at_radius_m(nadir_m).normalize();
    let mid_radius_m = terrain.radius_m(&up);
    let ground = looks.each_ref().map(|look| look.place_at(mid_radius_m));
    let craft = looks
        .each_ref()
        .map(|look| Spherical::from_xyz_m(&look.spacecraft_m));
    let [lower, upper] =
        [-PARALLAX_STEP_M, PARALLAX_STEP_M].map(|step_m| middle.place_at(mid_radius_m + step_m));
    let areoid_m = |look: &Look| {
        let direction = look.at_radius_m(mid_radius_m).normalize();
        terrain.areoid_radius_m(&direction)
    };
    let sun = body_matrix(&MARS_IAU2000, et) * -mars_from_sun_m(et);
    let distance_m = (middle.spacecraft_m - middle.at_radius_m(mid_radius_m)).norm();
    if !distance_m.is_finite() {
        let et_s = et.seconds();
        return Err(SceneError::BeamMisses { et_s }.into());
    }
    let changes = |of: &[Spherical; 3]| {
        [
            wrap_pi(of[2].longitude_rad - of[0].longitude_rad),
            of[2].latitude.0 - of[0].latitude.0,
        ]
    };
    let [ground_longitude_change_rad, ground_latitude_change_rad] = changes(&ground);
    let [
        spacecraft_longitude_change_rad,
        spacecraft_latitude_change_rad,
    ] = changes(&craft);
    Ok(FrameValues {
        time_s: frame.tag.seconds(),
        orbit: frame.orbit,
        clock_frequency_hz: CLOCK_HZ,
        spacecraft_longitude_rad: craft[1].longitude_rad,
        spacecraft_longitude_change_rad,
        spacecraft_latitude_rad: craft[1].latitude.0,
        spacecraft_latitude_change_rad,
        spacecraft_radius_m: craft[1].radius_m,
        spacecraft_radius_change_m: craft[2].radius_m - craft[0].radius_m,
        ground_longitude_rad: ground[1].longitude_rad,
        ground_longitude_change_rad,
        ground_latitude_rad: ground[1].latitude.0,
        ground_latitude_change_rad,
        parallax_longitude_rad_per_m: wrap_pi(upper.longitude_rad - lower.longitude_rad)
            / (2.0 * PARALLAX_STEP_M),
        parallax_latitude_rad_per_m: (upper.latitude.0 - lower.latitude.0)
            / (2.0 * PARALLAX_STEP_M),
        areoid_radius_m: terrain.areoid_radius_m(&up),
        areoid_radius_change_m: areoid_m(last) - areoid_m(first),
        mid_radius_m,
        mid_range_m: distance_m,
        frame_index: u16::try_from(frame.index % 7 + 1).unwrap_or(1),
        packet: u16::try_from(frame.index / 7 % 0x4000).unwrap_or(0),
        orbit_quality: gravity_model(frame.orbit),
        off_nadir_rad: middle.off_nadir_rad,
        local_time_rad: wrap_pi(up.y.atan2(up.x) - sun.y.atan2(sun.x)),
        phase_angle_rad: middle.spacecraft_m.angle(&sun),
        solar_incidence_rad: up.angle(&sun),
        emission_angle_rad: up.angle(&-middle.direction),
        opacity: 0.5,
        ..FrameValues::default()
    })
}

/// The gravity model of a revolution's orbit: 3 and more, as parallax and crossovers require. It changes every 60
/// revolutions, as if orbits had been recomputed by stretches of the mission.
fn gravity_model(revolution: u32) -> u16 {
    3 + u16::try_from(revolution / 60 % 3).unwrap_or(0)
}

/// Computes the shots of a frame and enters them into its values.
///
/// * `radii_m` – radius of the ground at the frame's first edge, its middle and its last edge
fn fly_shots(looks: &[Look; 3], radii_m: [f64; 3], frame: &ArchiveFrame, values: &mut FrameValues) {
    let chance = |purpose: u64, number: usize| {
        unit_of(mix(mix(frame.seed ^ purpose)
            ^ u64::from(frame.index) << 8
            ^ number as u64))
    };
    let is_cloudy = [0, 1].map(|half| chance(2, half) < CLOUD_SHARE);
    for shot in 0..SHOTS {
        let late_s = (shot as f64 - 9.5) * SHOT_S;
        // The parabola through both edges and the middle: within 0.2 mm of the orbit.
        let weights = [
            0.5 * late_s * (late_s - 1.0),
            1.0 - late_s * late_s,
            0.5 * late_s * (late_s + 1.0),
        ];
        let spacecraft_m: Vector3<f64> = looks
            .iter()
            .zip(weights)
            .map(|(look, weight)| weight * look.spacecraft_m)
            .sum();
        let smooth_m: f64 = radii_m.iter().zip(weights).map(|(m, w)| m * w).sum();
        let number = u64::from(frame.index) * SHOTS as u64 + shot as u64;
        let ground_radius_m = smooth_m + roughness_m(frame.seed, number);
        let is_cloud = is_cloudy[shot / 10];
        let higher_m = if is_cloud {
            3_000.0 + 5_000.0 * chance(3, shot)
        } else {
            0.0
        };
        if chance(1, shot) < MISSING_SHARE {
            continue;
        }
        let radius_m = ground_radius_m + higher_m;
        let share = share_of(shot);
        let relief_m = radius_m - values.mid_radius_m;
        let echo_m = spherical_to_xyz_m(
            values.ground_longitude_rad
                + share * values.ground_longitude_change_rad
                + relief_m * values.parallax_longitude_rad_per_m,
            values.ground_latitude_rad
                + share * values.ground_latitude_change_rad
                + relief_m * values.parallax_latitude_rad_per_m,
            radius_m,
        );
        let noise = normal_of(chance(7, shot), chance(8, shot));
        let measured_m =
            (spacecraft_m - echo_m).norm() + RANGE_NOISE_M * noise + Badness::range_m(frame.bad);
        values.range_m[shot] = (measured_m / RANGE_STEP_M).round() * RANGE_STEP_M;
        values.shot_radius_m[shot] = radius_m;
        values.class[shot] = i16::from(!is_cloud);
    }
}

/// Small relief at a shot of a file, metres: values drawn at intervals of shots, with linear interpolation.
fn roughness_m(seed: u64, number: u64) -> f64 {
    ROUGHNESS
        .iter()
        .map(|(step, size_m)| {
            let drawn = |node: u64| 2.0 * unit_of(mix(mix(seed ^ *step) ^ node)) - 1.0;
            let (node, within) = (number / step, (number % step) as f64 / *step as f64);
            size_m * ((1.0 - within) * drawn(node) + within * drawn(node + 1))
        })
        .sum()
}
