//! From a record to its shots.

use std::f64::consts::{FRAC_PI_2, PI};

use zerocopy::byteorder::big_endian::I32;

use super::{PARALLAX_UNIT_RAD_PER_M, Record, SHOTS};
use areograph_base::{
    footprints::Footprint,
    units::{METRES_PER_CM, RADIANS_PER_MICRODEGREE, wrap_two_pi},
};

/// Clock cycles between two shots.
const CYCLES_PER_SHOT: f64 = 1e7;
/// Middle of the shots counted from 0: the mid-point of the frame.
const MIDDLE: f64 = 9.5;

/// Whether fields introduced by later software versions contain the values that their names state.
///
/// # Source
/// `pedr2tab`: no crossover residual below version 7.125; parallax and crossover only with an orbit
/// quality of at least 2, and of at least 3 for version 7.0 and older.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldGuard {
    version: f64,
}

impl FieldGuard {
    /// The guard of a software version; an unknown version counts as new, as in every version-L file.
    #[must_use]
    pub fn new(software_version: Option<f64>) -> Self {
        Self {
            version: software_version.unwrap_or(f64::INFINITY),
        }
    }

    /// Whether the record has parallax.
    #[must_use]
    pub fn parallax_holds(self, record: &Record) -> bool {
        record.orbit_quality.get() >= if self.version <= 7.0 { 3 } else { 2 }
    }

    fn crossover_holds(self, record: &Record) -> bool {
        self.version >= 7.125 && self.parallax_holds(record)
    }

    /// Crossover residual at mid-point, metres, when the record has one.
    #[must_use]
    pub fn crossover_m(self, record: &Record) -> Option<f64> {
        self.crossover_holds(record)
            .then(|| metres(record.crossover_residual_cm))
    }
}

/// A quantity that changes linearly over the frame.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Linear {
    mid: f64,
    change: f64,
}

impl Linear {
    /// The value at share `x` of the frame, −0.475 to 0.475 for shots 1 to 20.
    fn at(self, x: f64) -> f64 {
        self.mid + x * self.change
    }
}

/// A frame in metres, radians and seconds.
#[derive(Debug, Clone, Copy)]
pub struct Frame<'a> {
    record: &'a Record,
    time_s: f64,
    spacing_s: f64,
    longitude: Linear,
    latitude: Linear,
    mid_radius_m: f64,
    has_parallax: bool,
    parallax_longitude_rad_per_m: f64,
    parallax_latitude_rad_per_m: f64,
    crossover: Linear,
}

impl<'a> Frame<'a> {
    /// The frame of a record that passed its checks.
    ///
    /// A frame without a residual is not corrected, whatever precedes it.
    ///
    /// * `crossover_before_m` – residual of the preceding frame, metres; for the first frame of a file the residual of
    ///   the mirrored next one; `None` if there is none, in which case the residual is constant
    #[must_use]
    pub fn new(record: &'a Record, guard: FieldGuard, crossover_before_m: Option<f64>) -> Self {
        let parallax = |field: I32| {
            if guard.parallax_holds(record) {
                f64::from(field.get()) * PARALLAX_UNIT_RAD_PER_M
            } else {
                0.0
            }
        };
        let crossover_m = guard.crossover_m(record);
        let before_m = crossover_m.and(crossover_before_m).or(crossover_m);
        Self {
            record,
            time_s: record.time_s.get(),
            spacing_s: CYCLES_PER_SHOT / f64::from(record.clock_frequency_hz.get()),
            longitude: Linear {
                mid: radians(record.ground_longitude_microdegrees),
                change: radians(record.ground_longitude_change_microdegrees),
            },
            latitude: Linear {
                mid: radians(record.ground_latitude_microdegrees),
                change: radians(record.ground_latitude_change_microdegrees),
            },
            mid_radius_m: metres(record.mid_radius_cm),
            has_parallax: guard.parallax_holds(record),
            parallax_longitude_rad_per_m: parallax(record.parallax_longitude_nanodegrees_per_m),
            parallax_latitude_rad_per_m: parallax(record.parallax_latitude_nanodegrees_per_m),
            crossover: Linear {
                mid: crossover_m.unwrap_or(0.0),
                change: crossover_m.unwrap_or(0.0) - before_m.unwrap_or(0.0),
            },
        }
    }

    /// The record of the frame.
    #[must_use]
    pub const fn record(&self) -> &'a Record {
        self.record
    }

    /// East longitude and areocentric latitude of the ground at mid-point, radians.
    #[must_use]
    pub const fn mid_point(&self) -> (f64, f64) {
        (self.longitude.mid, self.latitude.mid)
    }

    /// Change of the crossover residual over the frame, metres.
    #[must_use]
    pub const fn crossover_change_m(&self) -> f64 {
        self.crossover.change
    }

    /// Change of longitude and latitude with radius, radians per metre; `None` in records without parallax.
    pub(super) fn parallax_rad_per_m(&self) -> Option<[f64; 2]> {
        let parallax = [
            self.parallax_longitude_rad_per_m,
            self.parallax_latitude_rad_per_m,
        ];
        self.has_parallax.then_some(parallax)
    }

    /// Largest great-circle distance of a shot from the mid-point, radians.
    ///
    /// The sum of the steps in latitude and longitude is never shorter than the great circle.
    #[must_use]
    pub fn reach_rad(&self) -> f64 {
        let relief_m = (0..SHOTS)
            .map(|shot| self.relief_m(shot).abs())
            .fold(0.0, f64::max);
        0.5 * (self.longitude.change.abs() + self.latitude.change.abs())
            + relief_m
                * (self.parallax_longitude_rad_per_m.abs() + self.parallax_latitude_rad_per_m.abs())
    }

    /// Height of a returned shot (counted from 0) above the radius to which parallax refers, metres; 0 for a shot
    /// without a return or with an impossible radius.
    fn relief_m(&self, shot: usize) -> f64 {
        if self.record.returned(shot) && self.record.radius_is_possible(shot) {
            metres(self.record.shot_radius_cm[shot]) - self.mid_radius_m
        } else {
            0.0
        }
    }

    /// Shot `shot`, counted from 1 to 20; `None` outside.
    ///
    /// Its `file`, `record` and `windows` are 0 and its `et_s` is the tag; the caller sets them.
    #[must_use]
    pub fn shot(&self, shot: u8) -> Option<Footprint> {
        let index = usize::from(shot)
            .checked_sub(1)
            .filter(|index| *index < SHOTS)?;
        let record = self.record;
        let from_middle = index as f64 - MIDDLE;
        let x = from_middle / SHOTS as f64;
        let relief_m = self.relief_m(index);
        let (longitude_rad, latitude_rad) = on_the_sphere(
            self.longitude.at(x) + self.parallax_longitude_rad_per_m * relief_m,
            self.latitude.at(x) + self.parallax_latitude_rad_per_m * relief_m,
        );
        let (spacecraft_longitude_rad, spacecraft_latitude_rad) = on_the_sphere(
            radians(record.spacecraft_longitude_microdegrees)
                + x * radians(record.spacecraft_longitude_change_microdegrees),
            radians(record.spacecraft_latitude_microdegrees)
                + x * radians(record.spacecraft_latitude_change_microdegrees),
        );
        let et_tag_s = self.time_s + from_middle * self.spacing_s;
        let radius_m = metres(record.shot_radius_cm[index]);
        Some(Footprint {
            et_tag_s,
            et_s: et_tag_s,
            orbit: record.orbit.get(),
            file: 0,
            record: 0,
            shot,
            longitude_rad,
            latitude_rad,
            radius_m,
            radius_crossover_m: radius_m - self.crossover.at(x),
            areoid_radius_m: f64::from(record.areoid_radius_cm.get()) * METRES_PER_CM
                + x * metres(record.areoid_radius_change_cm),
            range_m: metres(record.range_cm[index]),
            spacecraft_longitude_rad,
            spacecraft_latitude_rad,
            spacecraft_radius_m: f64::from(record.spacecraft_radius_cm.get()) * METRES_PER_CM
                + x * metres(record.spacecraft_radius_change_cm),
            off_nadir_rad: radians(record.off_nadir_microdegrees),
            channel: record.channel[index],
            class: record.class[index].get(),
            attitude_flag: record.attitude_flag.get(),
            orbit_quality: record.orbit_quality.get(),
            windows: 0,
        })
    }
}

fn radians(microdegrees: I32) -> f64 {
    f64::from(microdegrees.get()) * RADIANS_PER_MICRODEGREE
}

fn metres(centimetres: I32) -> f64 {
    f64::from(centimetres.get()) * METRES_PER_CM
}

/// The direction with longitude in `0..2π`; a latitude beyond a pole is folded back.
fn on_the_sphere(longitude_rad: f64, latitude_rad: f64) -> (f64, f64) {
    if latitude_rad.abs() <= FRAC_PI_2 {
        return (wrap_two_pi(longitude_rad), latitude_rad);
    }
    let (sin, cos) = latitude_rad.sin_cos();
    let turn = if cos < 0.0 { PI } else { 0.0 };
    (wrap_two_pi(longitude_rad + turn), sin.atan2(cos.abs()))
}
