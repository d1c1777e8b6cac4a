//! Checks of the shots of a frame against its own positions: range, radius, parallax. No kernels are required.

use super::{
    Frame, RecordError, SHOTS,
    bounds::{MID_RADIUS_M, RADIUS_CM},
};
use areograph_base::{
    altimetry::NO_ATTITUDE,
    units::{METRES_PER_CM, RADIANS_PER_MICRODEGREE},
};
use areograph_geom::ellipsoid::{local_axes, spherical_to_xyz_m};

/// Range and distance between spacecraft and footprint come from one orbit and agree to about a metre; this tolerance,
/// metres, allows for undocumented differences.
const DISTANCE_M: f64 = 10.0;
/// Error of the straight ground track of a frame, metres: irregular rotation of the beam over 2 s, and 0.117 s of
/// motion where position and time belong to clocks with that offset.
const UNSTEADY_M: f64 = 400.0;
/// Tolerance of parallax against the direction of the beam, metres on the ground per metre of radius, plus a tenth of
/// its value: 1.1° of the beam.
const PARALLAX: f64 = 0.02;
/// Limits do not widen for off-nadir angles with a larger tangent.
const TANGENT_MAX: f64 = 10.0;
/// Nearer to a pole than this, a frame that is straight in longitude and latitude has no direction, radians.
const POLE_RAD: f64 = 0.5e6 * RADIANS_PER_MICRODEGREE;

/// Shots of a frame that contradict the record.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SpoiledShots {
    bits: u32,
    first: Option<RecordError>,
}

impl SpoiledShots {
    /// Whether shot `shot`, counted from 1, is one of them.
    #[must_use]
    pub const fn contains(&self, shot: u8) -> bool {
        shot >= 1 && shot <= 20 && self.bits & (1 << (shot - 1)) != 0
    }

    /// The fault of the first of them.
    #[must_use]
    pub const fn error(&self) -> Option<&RecordError> {
        self.first.as_ref()
    }

    fn add(&mut self, shots: u32, error: RecordError) {
        if shots != 0 {
            self.bits |= shots;
            self.first = self.first.or(Some(error));
        }
    }
}

impl Frame<'_> {
    /// Measured range minus the distance from the file's own spacecraft to the raw footprint, metres; `None` without a
    /// return.
    #[must_use]
    pub fn range_minus_distance_m(&self, shot: u8) -> Option<f64> {
        let footprint = self
            .shot(shot)
            .filter(|footprint| footprint.range_m > 0.0)?;
        let ground_m = spherical_to_xyz_m(
            footprint.longitude_rad,
            footprint.latitude_rad,
            footprint.radius_m,
        );
        let spacecraft_m = spherical_to_xyz_m(
            footprint.spacecraft_longitude_rad,
            footprint.spacecraft_latitude_rad,
            footprint.spacecraft_radius_m,
        );
        Some(footprint.range_m - (spacecraft_m - ground_m).norm())
    }

    /// The returned shots whose values contradict each other.
    #[must_use]
    pub fn spoiled_shots(&self) -> SpoiledShots {
        self.spoiled_by(|shot| self.range_minus_distance_m(shot))
    }

    /// The returned shots with contradictory values, for a known
    /// [`range_minus_distance_m`](Self::range_minus_distance_m) of each shot.
    #[must_use]
    pub fn spoiled_by(&self, range_minus_distance_m: impl Fn(u8) -> Option<f64>) -> SpoiledShots {
        let record = self.record();
        let returned = (0..SHOTS)
            .filter(|shot| record.returned(*shot))
            .fold(0, |bits, shot| bits | 1_u32 << shot);
        let mut spoiled = SpoiledShots::default();
        if returned == 0 {
            return spoiled;
        }
        self.check_radii(returned, &mut spoiled);
        if record.attitude_flag.get() < NO_ATTITUDE {
            let beam = Beam::of(self);
            if let Some(error) = beam.parallax_error(self) {
                spoiled.add(returned, error);
            }
            self.check_distances(&beam, range_minus_distance_m, &mut spoiled);
        }
        spoiled
    }

    /// Wrong radii affect only their shots, a wrong mid-point radius all of them.
    fn check_radii(&self, returned: u32, spoiled: &mut SpoiledShots) {
        let record = self.record();
        let mid_cm = record.mid_radius_cm.get();
        let mut nearest_cm = i64::MAX;
        for (shot, radius_cm) in (1_u8..).zip(record.shot_radius_cm) {
            let (bit, centimetres) = (1_u32 << (shot - 1), radius_cm.get());
            if returned & bit == 0 {
                continue;
            }
            if RADIUS_CM.contains(&centimetres) {
                nearest_cm = nearest_cm.min((i64::from(centimetres) - i64::from(mid_cm)).abs());
            } else {
                spoiled.add(bit, RecordError::Radius { shot, centimetres });
            }
        }
        let centimetres = mid_cm;
        let apart_m = nearest_cm as f64 * METRES_PER_CM;
        if !RADIUS_CM.contains(&centimetres) {
            spoiled.add(
                returned,
                RecordError::Radius {
                    shot: 0,
                    centimetres,
                },
            );
        } else if nearest_cm != i64::MAX && apart_m > MID_RADIUS_M {
            spoiled.add(
                returned,
                RecordError::MidRadius {
                    centimetres,
                    apart_m,
                },
            );
        }
    }

    fn check_distances(
        &self,
        beam: &Beam,
        range_minus_distance_m: impl Fn(u8) -> Option<f64>,
        spoiled: &mut SpoiledShots,
    ) {
        let record = self.record();
        let (mut bits, mut first) = (0_u32, None);
        for (index, shot) in (1_u8..).take(SHOTS).enumerate() {
            let Some(difference_m) = range_minus_distance_m(shot) else {
                continue;
            };
            // Whether the range includes its walk correction is not published.
            let walk_m = f64::from(record.range_correction_cm[index].get()).abs() * METRES_PER_CM;
            let limit_m = beam.distance_limit_m + walk_m;
            if difference_m.abs() <= limit_m || spoiled.contains(shot) {
                continue;
            }
            bits |= 1 << index;
            let range_m = f64::from(record.range_cm[index].get()) * METRES_PER_CM;
            first = first.or(Some((shot, range_m, range_m - difference_m, limit_m)));
        }
        if let Some((shot, range_m, distance_m, limit_m)) = first {
            let shots = u8::try_from(bits.count_ones()).unwrap_or(u8::MAX);
            let error = RecordError::Distance {
                shot,
                range_m,
                distance_m,
                limit_m,
                shots,
            };
            spoiled.add(bits, error);
        }
    }
}

/// The beam at the mid-point of a frame, from the record's own positions.
struct Beam {
    /// Tangent of the angle between beam and nadir.
    tangent: f64,
    /// Metres east and north on the ground per metre of radius.
    east_north: [f64; 2],
    distance_limit_m: f64,
}

impl Beam {
    fn of(frame: &Frame<'_>) -> Self {
        let record = frame.record();
        let (longitude_rad, latitude_rad) = frame.mid_point();
        let radians = |microdegrees: i32| f64::from(microdegrees) * RADIANS_PER_MICRODEGREE;
        let mid_radius_m = f64::from(record.mid_radius_cm.get()) * METRES_PER_CM;
        let spacecraft_radius_m = f64::from(record.spacecraft_radius_cm.get()) * METRES_PER_CM;
        let spacecraft_latitude_rad = radians(record.spacecraft_latitude_microdegrees.get());
        let ground_m = spherical_to_xyz_m(longitude_rad, latitude_rad, mid_radius_m);
        let spacecraft_m = spherical_to_xyz_m(
            radians(record.spacecraft_longitude_microdegrees.get()),
            spacecraft_latitude_rad,
            spacecraft_radius_m,
        );
        let beam = local_axes(&ground_m) * (ground_m - spacecraft_m);
        let down = (spacecraft_m - ground_m).dot(&spacecraft_m) / spacecraft_radius_m;
        let across = (spacecraft_m - ground_m).cross(&spacecraft_m).norm() / spacecraft_radius_m;
        let tangent = if down > 0.0 {
            (across / down).min(TANGENT_MAX)
        } else {
            TANGENT_MAX
        };
        // A path that is straight in longitude and latitude stays on its parallel; the true one is a great circle.
        let bulge_m = |radius_m: f64, latitude_rad: f64, change: i32| {
            radius_m * latitude_rad.cos() * (1.0 - (0.5 * radians(change)).cos())
        };
        let bulges_m = bulge_m(
            mid_radius_m,
            latitude_rad,
            record.ground_longitude_change_microdegrees.get(),
        ) + bulge_m(
            spacecraft_radius_m,
            spacecraft_latitude_rad,
            record.spacecraft_longitude_change_microdegrees.get(),
        );
        Self {
            tangent,
            east_north: [beam.x / beam.z, beam.y / beam.z],
            distance_limit_m: DISTANCE_M + (UNSTEADY_M + bulges_m) * tangent,
        }
    }

    /// Parallax that does not follow the beam.
    fn parallax_error(&self, frame: &Frame<'_>) -> Option<RecordError> {
        let (_, latitude_rad) = frame.mid_point();
        if latitude_rad.abs() > std::f64::consts::FRAC_PI_2 - POLE_RAD {
            return None;
        }
        let radius_m = f64::from(frame.record().mid_radius_cm.get()) * METRES_PER_CM;
        let [longitude_rad_per_m, latitude_rad_per_m] = frame.parallax_rad_per_m()?;
        let limit = PARALLAX + 0.1 * self.tangent;
        let [east, north] = self.east_north;
        let of_longitude = longitude_rad_per_m * radius_m * latitude_rad.cos();
        [
            ("longitude", of_longitude, east),
            ("latitude", latitude_rad_per_m * radius_m, north),
        ]
        .into_iter()
        .find(|(_, found, expected)| !((found - expected).abs() <= limit))
        .map(|(whose, found, expected)| RecordError::Parallax {
            whose,
            found,
            expected,
            limit,
        })
    }
}
