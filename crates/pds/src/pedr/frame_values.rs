//! Physical values of a frame, as input of a writer.

use super::SHOTS;
use areograph_base::error::Cause;

/// A value does not fit its field of the record.
#[derive(Debug, Clone, PartialEq, thiserror::Error, Cause)]
#[error("{field} is {value}; expected {expected}")]
#[cause(Input: "check the unit of the value: records are written from values in metres, radians and seconds")]
pub struct EncodeError {
    /// The field.
    pub field: &'static str,
    /// Its value in SI units.
    pub value: f64,
    /// Expected value.
    pub expected: String,
}

/// A frame in metres, radians and seconds, for [`super::Record::from_frame`].
///
/// `*_change*` is the change over the full frame of 20 shots; arrays run over shots 1 to 20.
/// Fields left at their defaults become zero in the record.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FrameValues {
    /// Mid-point of the frame, ET seconds.
    pub time_s: f64,
    /// Orbit number.
    pub orbit: u32,
    /// Frequency of the MOLA clock, hertz.
    pub clock_frequency_hz: f64,
    /// East longitude of the spacecraft at mid-point, radians, any turn.
    pub spacecraft_longitude_rad: f64,
    /// Its change over the frame, radians.
    pub spacecraft_longitude_change_rad: f64,
    /// Areocentric latitude of the spacecraft at mid-point, radians.
    pub spacecraft_latitude_rad: f64,
    /// Its change over the frame, radians.
    pub spacecraft_latitude_change_rad: f64,
    /// Distance of the spacecraft from the centre of Mars at mid-point, metres.
    pub spacecraft_radius_m: f64,
    /// Its change over the frame, metres.
    pub spacecraft_radius_change_m: f64,
    /// Ground east longitude at mid-point, radians, any turn.
    pub ground_longitude_rad: f64,
    /// Its change over the frame, radians.
    pub ground_longitude_change_rad: f64,
    /// Ground areocentric latitude at mid-point, radians.
    pub ground_latitude_rad: f64,
    /// Its change over the frame, radians.
    pub ground_latitude_change_rad: f64,
    /// Change of ground longitude per metre of radius, radians per metre.
    pub parallax_longitude_rad_per_m: f64,
    /// Change of ground latitude per metre of radius, radians per metre.
    pub parallax_latitude_rad_per_m: f64,
    /// Areoid radius at mid-point, metres.
    pub areoid_radius_m: f64,
    /// Its change over the frame, metres.
    pub areoid_radius_change_m: f64,
    /// Crossover residual at mid-point, metres, to be subtracted from radii.
    pub crossover_residual_m: f64,
    /// Planetary radius at mid-point, metres; parallax refers to it.
    pub mid_radius_m: f64,
    /// Range at mid-point, metres.
    pub mid_range_m: f64,
    /// Planetary radius per shot before the crossover correction, metres.
    pub shot_radius_m: [f64; SHOTS],
    /// One-way range per shot, metres; 0: no return.
    pub range_m: [f64; SHOTS],
    /// Range walk correction per shot, metres.
    pub range_correction_m: [f64; SHOTS],
    /// Classification per shot: 1 ground, 0 cloud or noise.
    pub class: [i16; SHOTS],
    /// Trigger channel per shot, 1 to 4.
    pub channel: [u8; SHOTS],
    /// Place of the frame in its telemetry packet, 1 to 7.
    pub frame_index: u16,
    /// Packet number, up to 16383.
    pub packet: u16,
    /// 3: no attitude, 2: partly, 0: attitude known.
    pub attitude_flag: u16,
    /// 0: orbit from JPL; 1 or more: MOLA team; from 3 on parallax and crossover are valid in every version.
    pub orbit_quality: u16,
    /// Off-nadir angle of the laser, radians.
    pub off_nadir_rad: f64,
    /// Longitude minus subsolar longitude, radians, `-π..π`.
    pub local_time_rad: f64,
    /// Angle at the centre of Mars between spacecraft and Sun, radians.
    pub phase_angle_rad: f64,
    /// Solar incidence angle, radians.
    pub solar_incidence_rad: f64,
    /// Emission angle, radians.
    pub emission_angle_rad: f64,
    /// Atmospheric opacity.
    pub opacity: f64,
    /// Laser transmit energy per shot, millijoules.
    pub transmit_energy_mj: [f64; SHOTS],
    /// Received pulse energy per shot, femtojoules.
    pub received_energy_fj: [f64; SHOTS],
}
