//! Laser shots over the synthetic terrain, frame by frame, as in a PEDR file.

use nalgebra::{Matrix3, Vector3};

use super::{
    arc::{Beam, Flight},
    error::SceneError,
    error_sources::AltimeterErrors,
    profile_shift::ProfileShift,
    random::{mix, normal_of, unit_of},
    sun::mars_from_sun_m,
    terrain::Terrain,
};
use areograph_base::{
    body::{Datum, MARS_IAU2000},
    error::Result,
    time::Et,
    units::wrap_pi,
};
use areograph_config::usual_altimeter;
use areograph_geom::{
    body_rotation::body_matrix,
    ellipsoid::{Spherical, spherical_to_xyz_m},
};
use areograph_pds::pedr::{FrameValues, SHOTS};

/// Seconds of a frame of 20 shots.
pub(super) const FRAME_S: f64 = 2.0;
/// Seconds between shots.
pub(super) const SHOT_S: f64 = 0.1;
/// Clock of MOLA, hertz: shots lie exactly 0.1 s apart.
pub(super) const CLOCK_HZ: f64 = 1e8;
/// MOLA's orbit model number; from 3 on readers apply parallax and crossover corrections.
const ORBIT_QUALITY: u16 = 3;
/// Share of half-frames with clouds, and of shots without a return.
pub(super) const CLOUD_SHARE: f64 = 0.02;
pub(super) const MISSING_SHARE: f64 = 0.005;
/// Amplitude, metres, and period, seconds, of the crossover residual.
pub(super) const CROSSOVER_AMPLITUDE_M: f64 = 0.8;
pub(super) const CROSSOVER_PERIOD_S: f64 = 3_000.0;

/// The crossover residual at `et`, metres; smooth, to be subtracted from radii.
fn crossover_residual_m(et: Et) -> f64 {
    let turns = (et.seconds() / CROSSOVER_PERIOD_S).rem_euclid(1.0);
    CROSSOVER_AMPLITUDE_M * (std::f64::consts::TAU * turns).sin()
}

/// Adds errors of the orbit to a file's own ground and spacecraft: the crossover residual at the mid-point, which readers
/// subtract again, interpolated from frame to frame, and a constant `orbit_m`.
///
/// * `has_previous` – whether the file has a frame before this one
pub(super) fn add_orbit_errors(values: &mut FrameValues, et: Et, has_previous: bool, orbit_m: f64) {
    let residual_m = crossover_residual_m(et);
    let change_m = if has_previous {
        residual_m - crossover_residual_m(et.plus(-FRAME_S))
    } else {
        0.0
    };
    values.crossover_residual_m = residual_m;
    for shot in 0..SHOTS {
        if values.range_m[shot] > 0.0 {
            values.shot_radius_m[shot] += residual_m + share_of(shot) * change_m + orbit_m;
        }
    }
    values.mid_radius_m += residual_m + orbit_m;
    values.spacecraft_radius_m += residual_m + orbit_m;
    values.spacecraft_radius_change_m += change_m;
}

/// Position of a shot, counted from 0, in its frame: −0.475 to 0.475.
pub(super) fn share_of(shot: usize) -> f64 {
    (shot as f64 - 9.5) / SHOTS as f64
}

/// Target of a shot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Echo {
    /// The ground.
    Ground,
    /// A cloud above it.
    Cloud,
    /// No return was detected.
    Missing,
}

/// The truth of one shot.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shot {
    /// True time.
    pub et: Et,
    /// Intersection of the beam with the ground, IAU 2000, metres.
    pub ground_m: Vector3<f64>,
    /// Its target.
    pub echo: Echo,
    /// Measured range, metres; 0 without a return.
    pub range_m: f64,
    /// Ground point in the product, IAU 2000, metres, before its rounding and its linear frame.
    pub told_ground_m: Vector3<f64>,
    /// Error of the linear frame of a PEDR at the footprint, before rounding, metres.
    pub frame_error_m: f64,
}

/// One frame: values of the file and true values.
#[derive(Debug, Clone)]
pub(super) struct Frame {
    /// Values of the record.
    pub values: FrameValues,
    /// Shots 1 to 20.
    pub shots: [Shot; SHOTS],
}

/// Errors of the shots of a file.
#[derive(Debug, Clone)]
pub(super) struct LaserErrors {
    /// Sizes of the errors of a single shot.
    pub altimeter: AltimeterErrors,
    /// Shift of the file's coordinates.
    pub shift: ProfileShift,
}

/// The frame to compute.
#[derive(Debug, Clone, Copy)]
pub(super) struct FrameRequest<'a> {
    /// Mid-point as tagged in the file, a whole number of microseconds.
    pub tag: Et,
    /// Number of the frame in its file, from 0.
    pub index: u64,
    /// Orbit number.
    pub orbit: u32,
    /// Datum of the file's coordinates.
    pub datum: Datum,
    /// Seed of clouds, missing returns and noise.
    pub seed: u64,
    /// Errors of the shots.
    pub errors: &'a LaserErrors,
}

/// A position in the file's frame.
#[derive(Debug, Clone, Copy)]
struct FileCoordinates {
    longitude_rad: f64,
    latitude_rad: f64,
    radius_m: f64,
}

impl FileCoordinates {
    fn of(point_m: &Vector3<f64>) -> Self {
        let spherical = Spherical::from_xyz_m(point_m);
        Self {
            longitude_rad: spherical.longitude_rad,
            latitude_rad: spherical.latitude.0,
            radius_m: spherical.radius_m,
        }
    }
}

/// The beam at one instant, in IAU 2000 and in the file's frame.
struct Look {
    et: Et,
    /// Spacecraft by the orbit, and its true position.
    orbit_m: Vector3<f64>,
    spacecraft_m: Vector3<f64>,
    direction: Vector3<f64>,
    /// From IAU 2000 to the file's frame, of the spacecraft and of the ground.
    to_file: Matrix3<f64>,
    ground_to_file: Matrix3<f64>,
}

impl Look {
    fn new(beam: &Beam, direction: &Vector3<f64>, et: Et, request: &FrameRequest<'_>) -> Self {
        let mars = body_matrix(&MARS_IAU2000, et);
        let to_file = match request.datum {
            Datum::Iau2000 => Matrix3::identity(),
            older => body_matrix(older.model(), et) * mars.transpose(),
        };
        let orbit_m = mars * beam.spacecraft_m;
        Self {
            et,
            orbit_m,
            spacecraft_m: orbit_m + beam.position_error_m,
            direction: mars * direction,
            to_file,
            ground_to_file: to_file * request.errors.shift.rotation(),
        }
    }

    /// Position of a ground point in the file, except for the radial shift.
    fn place(&self, ground_m: &Vector3<f64>) -> FileCoordinates {
        FileCoordinates::of(&(self.ground_to_file * ground_m))
    }

    /// Position of the spacecraft in the file: on the orbit, but moved along the beam until ranges of about `range_m`
    /// agree with the ground of the file, as they do in the archive's files.
    fn place_spacecraft(&self, range_m: f64, shift: &ProfileShift) -> FileCoordinates {
        let ground_m = shift.applied(&self.at_range_m(range_m));
        let beam = (ground_m - self.orbit_m).normalize();
        FileCoordinates::of(&(self.to_file * (ground_m - range_m * beam)))
    }

    /// Range to the ground.
    fn range_m(&self, terrain: &Terrain) -> Result<f64> {
        let error = SceneError::BeamMisses {
            et_s: self.et.seconds(),
        };
        Ok(terrain
            .range_m(&self.spacecraft_m, &self.direction)
            .ok_or(error)?)
    }

    fn at_range_m(&self, range_m: f64) -> Vector3<f64> {
        self.spacecraft_m + range_m * self.direction
    }

    /// Intersection of the beam with the sphere of `radius_m`; for a beam that only grazes it, the nearest point.
    fn at_radius(&self, radius_m: f64) -> FileCoordinates {
        let b = self.spacecraft_m.dot(&self.direction);
        let c = self.spacecraft_m.norm_squared() - radius_m * radius_m;
        self.place(&self.at_range_m(-b - (b * b - c).max(0.0).sqrt()))
    }
}

/// Computes one frame.
///
/// The frame's straight track follows the beam, without jitter, on the sphere of the mid-point's radius; each shot
/// is displaced along the beam by the parallax times the difference of its radius from the mid-point's.
///
/// # Errors
/// [`SceneError::BeamMisses`], or an error of `flight`.
pub(super) fn fly_frame(
    flight: &impl Flight,
    terrain: &Terrain,
    request: &FrameRequest<'_>,
) -> Result<Frame> {
    let middle_et = request.tag.plus(-usual_altimeter().clock_bias_s);
    let steady = |et: Et| -> Result<Look> {
        let beam = flight.beam(et)?;
        Ok(Look::new(&beam, &beam.steady_direction, et, request))
    };
    let middle = steady(middle_et)?;
    let first = steady(middle_et.plus(-FRAME_S / 2.0))?;
    let last = steady(middle_et.plus(FRAME_S / 2.0))?;
    let mut values = frame_values(&middle, [&first, &last], terrain, request)?;
    let mut shots = Vec::with_capacity(SHOTS);
    for index in 0..SHOTS {
        let et = middle_et.plus((index as f64 - 9.5) * SHOT_S);
        let beam = flight.beam(et)?;
        let shot_look = Look::new(&beam, &beam.direction, et, request);
        shots.push(fly_shot(&shot_look, index, terrain, request, &mut values)?);
    }
    add_orbit_errors(&mut values, middle_et, request.index > 0, 0.0);
    let mut shots = shots.into_iter();
    let error = SceneError::BeamMisses {
        et_s: middle_et.seconds(),
    };
    let first_shot = shots.next().ok_or(error)?;
    let mut all = [first_shot; SHOTS];
    for (slot, shot) in all.iter_mut().skip(1).zip(shots) {
        *slot = shot;
    }
    Ok(Frame { values, shots: all })
}

/// The values of a frame except its shots.
fn frame_values(
    middle: &Look,
    [first, last]: [&Look; 2],
    terrain: &Terrain,
    request: &FrameRequest<'_>,
) -> Result<FrameValues> {
    /// Half the height interval of the parallax, metres.
    const PARALLAX_STEP_M: f64 = 500.0;
    let mid_range_m = middle.range_m(terrain)?;
    let ground_m = middle.at_range_m(mid_range_m);
    let mid_radius_m = ground_m.norm();
    let up = ground_m / mid_radius_m;

    let ground = middle.place(&ground_m);
    let [ground_first, ground_last] = [first, last].map(|look| look.at_radius(mid_radius_m));
    let shift = &request.errors.shift;
    let spacecraft = middle.place_spacecraft(mid_range_m, shift);
    let [craft_first, craft_last] =
        [first, last].map(|look| look.place_spacecraft(mid_range_m, shift));
    let [lower, upper] =
        [-PARALLAX_STEP_M, PARALLAX_STEP_M].map(|step_m| middle.at_radius(mid_radius_m + step_m));
    let [areoid_first, areoid_last] = [first, last].map(|look| {
        let place = look.at_radius(mid_radius_m);
        let direction = spherical_to_xyz_m(place.longitude_rad, place.latitude_rad, 1.0);
        terrain.areoid_radius_m(&look.ground_to_file.tr_mul(&direction))
    });
    let sun = body_matrix(&MARS_IAU2000, middle.et) * -mars_from_sun_m(middle.et);
    let frame_number = request.index;
    Ok(FrameValues {
        time_s: request.tag.seconds(),
        orbit: request.orbit,
        clock_frequency_hz: CLOCK_HZ,
        spacecraft_longitude_rad: spacecraft.longitude_rad,
        spacecraft_longitude_change_rad: wrap_pi(
            craft_last.longitude_rad - craft_first.longitude_rad,
        ),
        spacecraft_latitude_rad: spacecraft.latitude_rad,
        spacecraft_latitude_change_rad: craft_last.latitude_rad - craft_first.latitude_rad,
        spacecraft_radius_m: spacecraft.radius_m,
        spacecraft_radius_change_m: craft_last.radius_m - craft_first.radius_m,
        ground_longitude_rad: ground.longitude_rad,
        ground_longitude_change_rad: wrap_pi(
            ground_last.longitude_rad - ground_first.longitude_rad,
        ),
        ground_latitude_rad: ground.latitude_rad,
        ground_latitude_change_rad: ground_last.latitude_rad - ground_first.latitude_rad,
        parallax_longitude_rad_per_m: wrap_pi(upper.longitude_rad - lower.longitude_rad)
            / (2.0 * PARALLAX_STEP_M),
        parallax_latitude_rad_per_m: (upper.latitude_rad - lower.latitude_rad)
            / (2.0 * PARALLAX_STEP_M),
        areoid_radius_m: terrain.areoid_radius_m(&up),
        areoid_radius_change_m: areoid_last - areoid_first,
        mid_radius_m: mid_radius_m + shift.radial_m(),
        mid_range_m,
        frame_index: u16::try_from(frame_number % 7 + 1).unwrap_or(1),
        packet: u16::try_from(frame_number / 7 % 0x4000).unwrap_or(0),
        orbit_quality: ORBIT_QUALITY,
        off_nadir_rad: middle.direction.angle(&-middle.spacecraft_m),
        local_time_rad: wrap_pi(up.y.atan2(up.x) - sun.y.atan2(sun.x)),
        phase_angle_rad: middle.spacecraft_m.angle(&sun),
        solar_incidence_rad: up.angle(&sun),
        emission_angle_rad: up.angle(&-middle.direction),
        opacity: 0.5,
        ..FrameValues::default()
    })
}

/// Computes one shot (counted from 0) and enters it into the frame's values.
fn fly_shot(
    look: &Look,
    index: usize,
    terrain: &Terrain,
    request: &FrameRequest<'_>,
    values: &mut FrameValues,
) -> Result<Shot> {
    let chance = |purpose: u64, number: u64| {
        unit_of(mix(mix(request.seed ^ purpose)
            ^ (request.index << 8)
            ^ number))
    };
    let LaserErrors { altimeter, shift } = request.errors;
    let ground_range_m = look.range_m(terrain)?;
    let ground_m = look.at_range_m(ground_range_m);
    let half = (index / 10) as u64;
    let echo = if chance(1, index as u64) < MISSING_SHARE {
        Echo::Missing
    } else if chance(2, half) < CLOUD_SHARE {
        Echo::Cloud
    } else {
        Echo::Ground
    };
    let cloud_height_m = 3_000.0 + 9_000.0 * chance(3, index as u64);
    let noise = normal_of(chance(7, index as u64), chance(8, index as u64));
    let measured_m = measured_range_m(look, terrain, altimeter, ground_range_m, noise);
    let heard_m = look.at_range_m(measured_m);
    let (range_m, radius_m) = match echo {
        Echo::Ground => (measured_m, heard_m.norm()),
        Echo::Cloud => {
            let range_m = ground_range_m - cloud_height_m;
            (range_m, look.at_range_m(range_m).norm())
        }
        Echo::Missing => (0.0, 0.0),
    };
    values.range_m[index] = range_m;
    values.shot_radius_m[index] = match echo {
        Echo::Missing => 0.0,
        Echo::Ground | Echo::Cloud => radius_m + shift.radial_m(),
    };
    values.class[index] = i16::from(echo == Echo::Ground);
    values.channel[index] = match chance(4, index as u64) {
        x if x < 0.80 => 1,
        x if x < 0.95 => 2,
        _ => 3,
    };
    values.transmit_energy_mj[index] = 40.0 + 4.0 * chance(5, index as u64);
    values.received_energy_fj[index] = if echo == Echo::Missing {
        0.0
    } else {
        100.0 + 400.0 * chance(6, index as u64)
    };
    Ok(Shot {
        et: look.et,
        ground_m,
        echo,
        range_m,
        told_ground_m: shift.applied(&heard_m),
        frame_error_m: frame_error_m(look, index, &heard_m, shift, values),
    })
}

/// The measured range: the mean over the spot with noise, in steps.
fn measured_range_m(
    look: &Look,
    terrain: &Terrain,
    errors: &AltimeterErrors,
    ground_range_m: f64,
    noise: f64,
) -> f64 {
    let mut range_m = ground_range_m + errors.shot_noise_m * noise;
    if errors.spot_m > 0.0 {
        let ground_m = look.at_range_m(ground_range_m);
        range_m += terrain.spot_farther_m(&ground_m, &look.direction, errors.spot_m);
    }
    if errors.range_step_m > 0.0 {
        range_m = (range_m / errors.range_step_m).round() * errors.range_step_m;
    }
    range_m
}

/// Distance of a ground shot in the linear frame from its intended position in the file, metres.
fn frame_error_m(
    look: &Look,
    index: usize,
    heard_m: &Vector3<f64>,
    shift: &ProfileShift,
    values: &FrameValues,
) -> f64 {
    let radius_m = heard_m.norm();
    let share = (index as f64 - 9.5) / SHOTS as f64;
    let higher_m = radius_m + shift.radial_m() - values.mid_radius_m;
    let longitude_rad = values.ground_longitude_rad
        + share * values.ground_longitude_change_rad
        + higher_m * values.parallax_longitude_rad_per_m;
    let latitude_rad = values.ground_latitude_rad
        + share * values.ground_latitude_change_rad
        + higher_m * values.parallax_latitude_rad_per_m;
    let placed_m = spherical_to_xyz_m(longitude_rad, latitude_rad, radius_m);
    (placed_m - look.ground_to_file * heard_m).norm()
}
