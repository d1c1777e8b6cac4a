//! Conversion of the physical values of a frame to a record.

use zerocopy::{
    FromZeros,
    byteorder::big_endian::{F64, I16, I32, U16, U32},
};

use super::{EncodeError, FrameValues, PARALLAX_UNIT_RAD_PER_M, Record, SHOTS};
use areograph_base::units::{METRES_PER_CM, RADIANS_PER_MICRODEGREE};

/// Radians in the angle unit of the illumination fields.
const RADIANS_PER_ANGLE_COUNT: f64 = 1e-4;
/// Microdegrees of a full turn.
const TURN_MICRODEGREES: i32 = 360_000_000;

impl Record {
    /// The record of these values; undocumented bytes and instrument settings are zero.
    ///
    /// Quantisation: 1e-6° (0.06 m on the ground), 0.01 m, 1e-6 s in the integer times.
    ///
    /// # Errors
    /// A value that is not finite or does not fit its field.
    pub fn from_frame(values: &FrameValues) -> Result<Self, EncodeError> {
        let mut record = Self::new_zeroed();
        record.put_time(values)?;
        record.put_positions(values)?;
        record.put_ground(values)?;
        record.put_shots(values)?;
        record.put_flags(values)?;
        Ok(record)
    }

    fn put_time(&mut self, values: &FrameValues) -> Result<(), EncodeError> {
        let time_s = values.time_s;
        // Truncation gives both integers the sign of the time, as the archive has them before J2000.
        let whole_s = time_s.trunc();
        let fraction_us = ((time_s - whole_s) * 1e6).round();
        let carry_s = (fraction_us / 1e6).trunc();
        self.time_whole_s = I32::new(to_i32("time_s", time_s, whole_s + carry_s)?);
        let fraction_us = fraction_us - carry_s * 1e6;
        self.time_fraction_us = I32::new(to_i32("time_s", time_s, fraction_us)?);
        self.time_s = F64::new(time_s);
        self.orbit = U32::new(values.orbit);
        let frequency_hz = values.clock_frequency_hz;
        self.clock_frequency_hz = U32::new(to_u32("clock_frequency_hz", frequency_hz, 1.0)?);
        Ok(())
    }

    fn put_positions(&mut self, values: &FrameValues) -> Result<(), EncodeError> {
        self.spacecraft_longitude_microdegrees =
            longitude("spacecraft_longitude_rad", values.spacecraft_longitude_rad)?;
        self.spacecraft_latitude_microdegrees =
            latitude("spacecraft_latitude_rad", values.spacecraft_latitude_rad)?;
        self.spacecraft_radius_cm = U32::new(to_u32(
            "spacecraft_radius_m",
            values.spacecraft_radius_m,
            METRES_PER_CM,
        )?);
        self.spacecraft_longitude_change_microdegrees = microdegrees(
            "spacecraft_longitude_change_rad",
            values.spacecraft_longitude_change_rad,
        )?;
        self.spacecraft_latitude_change_microdegrees = microdegrees(
            "spacecraft_latitude_change_rad",
            values.spacecraft_latitude_change_rad,
        )?;
        self.spacecraft_radius_change_cm = centimetres(
            "spacecraft_radius_change_m",
            values.spacecraft_radius_change_m,
        )?;
        self.mid_range_cm = centimetres("mid_range_m", values.mid_range_m)?;
        Ok(())
    }

    fn put_ground(&mut self, values: &FrameValues) -> Result<(), EncodeError> {
        self.ground_longitude_microdegrees =
            longitude("ground_longitude_rad", values.ground_longitude_rad)?;
        self.ground_latitude_microdegrees =
            latitude("ground_latitude_rad", values.ground_latitude_rad)?;
        self.ground_longitude_change_microdegrees = microdegrees(
            "ground_longitude_change_rad",
            values.ground_longitude_change_rad,
        )?;
        self.ground_latitude_change_microdegrees = microdegrees(
            "ground_latitude_change_rad",
            values.ground_latitude_change_rad,
        )?;
        self.parallax_longitude_nanodegrees_per_m = I32::new(scaled_i32(
            "parallax_longitude_rad_per_m",
            values.parallax_longitude_rad_per_m,
            PARALLAX_UNIT_RAD_PER_M,
        )?);
        self.parallax_latitude_nanodegrees_per_m = I32::new(scaled_i32(
            "parallax_latitude_rad_per_m",
            values.parallax_latitude_rad_per_m,
            PARALLAX_UNIT_RAD_PER_M,
        )?);
        self.mid_radius_cm = centimetres("mid_radius_m", values.mid_radius_m)?;
        self.crossover_residual_cm =
            centimetres("crossover_residual_m", values.crossover_residual_m)?;
        self.areoid_radius_cm = U32::new(to_u32(
            "areoid_radius_m",
            values.areoid_radius_m,
            METRES_PER_CM,
        )?);
        self.areoid_radius_change_cm =
            centimetres("areoid_radius_change_m", values.areoid_radius_change_m)?;
        Ok(())
    }

    fn put_shots(&mut self, values: &FrameValues) -> Result<(), EncodeError> {
        for shot in 0..SHOTS {
            self.shot_radius_cm[shot] = centimetres("shot_radius_m", values.shot_radius_m[shot])?;
            self.range_cm[shot] = centimetres("range_m", values.range_m[shot])?;
            self.range_correction_cm[shot] = I16::new(to_i16(
                "range_correction_m",
                values.range_correction_m[shot],
                METRES_PER_CM,
            )?);
            self.class[shot] = I16::new(values.class[shot]);
            self.channel[shot] = values.channel[shot];
            self.transmit_energy[shot] = I16::new(to_i16(
                "transmit_energy_mj",
                values.transmit_energy_mj[shot],
                0.01,
            )?);
            self.received_energy[shot] = I16::new(to_i16(
                "received_energy_fj",
                values.received_energy_fj[shot],
                1.0,
            )?);
        }
        Ok(())
    }

    fn put_flags(&mut self, values: &FrameValues) -> Result<(), EncodeError> {
        if !(1..=7).contains(&values.frame_index) {
            let expected = "1 to 7".to_owned();
            return Err(fault(
                "frame_index",
                f64::from(values.frame_index),
                expected,
            ));
        }
        if values.packet > 0x3FFF {
            let expected = "0 to 16383".to_owned();
            return Err(fault("packet", f64::from(values.packet), expected));
        }
        self.frame_index = U16::new(values.frame_index);
        self.packet = U16::new(values.packet);
        self.attitude_flag = U16::new(values.attitude_flag);
        self.orbit_quality = U16::new(values.orbit_quality);
        self.off_nadir_microdegrees = microdegrees("off_nadir_rad", values.off_nadir_rad)?;
        let unit = RADIANS_PER_ANGLE_COUNT;
        self.local_time = I16::new(to_i16("local_time_rad", values.local_time_rad, unit)?);
        self.phase_angle = U16::new(to_u16("phase_angle_rad", values.phase_angle_rad, unit)?);
        self.solar_incidence = U16::new(to_u16(
            "solar_incidence_rad",
            values.solar_incidence_rad,
            unit,
        )?);
        self.emission_angle = U16::new(to_u16(
            "emission_angle_rad",
            values.emission_angle_rad,
            unit,
        )?);
        self.opacity = U32::new(to_u32("opacity", values.opacity, 1e-6)?);
        Ok(())
    }
}

fn fault(field: &'static str, value: f64, expected: String) -> EncodeError {
    EncodeError {
        field,
        value,
        expected,
    }
}

/// `value / unit` rounded, if it is within `least..=most`.
fn counts(
    field: &'static str,
    value: f64,
    unit: f64,
    [least, most]: [f64; 2],
) -> Result<f64, EncodeError> {
    let counts = (value / unit).round();
    if (least..=most).contains(&counts) {
        return Ok(counts);
    }
    Err(fault(
        field,
        value,
        format!("{} to {}", least * unit, most * unit),
    ))
}

#[allow(
    clippy::cast_possible_truncation,
    reason = "counts() checked the range"
)]
fn scaled_i32(field: &'static str, value: f64, unit: f64) -> Result<i32, EncodeError> {
    counts(
        field,
        value,
        unit,
        [f64::from(i32::MIN), f64::from(i32::MAX)],
    )
    .map(|counts| counts as i32)
}

#[allow(
    clippy::cast_possible_truncation,
    reason = "counts() checked the range"
)]
fn to_i16(field: &'static str, value: f64, unit: f64) -> Result<i16, EncodeError> {
    counts(
        field,
        value,
        unit,
        [f64::from(i16::MIN), f64::from(i16::MAX)],
    )
    .map(|counts| counts as i16)
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "counts() checked the range"
)]
fn to_u32(field: &'static str, value: f64, unit: f64) -> Result<u32, EncodeError> {
    counts(field, value, unit, [0.0, f64::from(u32::MAX)]).map(|counts| counts as u32)
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "counts() checked the range"
)]
fn to_u16(field: &'static str, value: f64, unit: f64) -> Result<u16, EncodeError> {
    counts(field, value, unit, [0.0, f64::from(u16::MAX)]).map(|counts| counts as u16)
}

/// An integer that is already in the unit of the file; messages show `value`.
fn to_i32(field: &'static str, value: f64, integer: f64) -> Result<i32, EncodeError> {
    scaled_i32(field, integer, 1.0).map_err(|fault| EncodeError { value, ..fault })
}

fn centimetres(field: &'static str, value_m: f64) -> Result<I32, EncodeError> {
    scaled_i32(field, value_m, METRES_PER_CM).map(I32::new)
}

fn microdegrees(field: &'static str, angle_rad: f64) -> Result<I32, EncodeError> {
    scaled_i32(field, angle_rad, RADIANS_PER_MICRODEGREE).map(I32::new)
}

/// East longitude, wrapped into `0..360` degrees.
fn longitude(field: &'static str, longitude_rad: f64) -> Result<I32, EncodeError> {
    let microdegrees = scaled_i32(field, longitude_rad, RADIANS_PER_MICRODEGREE)?;
    Ok(I32::new(microdegrees.rem_euclid(TURN_MICRODEGREES)))
}

/// Latitude, within 90 degrees of the equator.
fn latitude(field: &'static str, latitude_rad: f64) -> Result<I32, EncodeError> {
    counts(field, latitude_rad, RADIANS_PER_MICRODEGREE, [-9e7, 9e7])?;
    microdegrees(field, latitude_rad)
}

#[cfg(test)]
mod tests {
    use super::*;
    use areograph_base::units::RADIANS_PER_DEGREE;

    fn values() -> FrameValues {
        FrameValues {
            clock_frequency_hz: 1e8,
            frame_index: 1,
            ..FrameValues::default()
        }
    }

    #[test]
    fn integer_times_have_the_sign_of_the_time_and_carry() {
        let cases = [
            (-11_224_002.182_053_3, -11_224_002, -182_053),
            (-2.999_999_7, -3, 0),
            (5.999_999_7, 6, 0),
            (0.25, 0, 250_000),
        ];
        for (time_s, whole_s, fraction_us) in cases {
            let record = Record::from_frame(&FrameValues { time_s, ..values() }).unwrap();
            let found = (record.time_whole_s.get(), record.time_fraction_us.get());
            assert_eq!(found, (whole_s, fraction_us), "{time_s}");
        }
    }

    #[test]
    fn longitudes_are_brought_into_one_turn() {
        for (degrees, expected) in [(-0.000_000_4, 0), (-1.0, 359_000_000), (359.999_999_7, 0)] {
            let ground_longitude_rad = degrees * RADIANS_PER_DEGREE;
            let record = Record::from_frame(&FrameValues {
                ground_longitude_rad,
                ..values()
            });
            let found = record.unwrap().ground_longitude_microdegrees.get();
            assert_eq!(found, expected, "{degrees}");
        }
    }

    #[test]
    fn values_that_do_not_fit_are_refused_by_name() {
        let mut bad = vec![
            FrameValues {
                time_s: f64::NAN,
                ..values()
            },
            FrameValues {
                time_s: 3e9,
                ..values()
            },
            FrameValues {
                ground_latitude_rad: 1.571,
                ..values()
            },
            FrameValues {
                spacecraft_radius_m: -1.0,
                ..values()
            },
            FrameValues {
                mid_range_m: 2.2e7,
                ..values()
            },
            FrameValues {
                phase_angle_rad: 6.6,
                ..values()
            },
            FrameValues {
                local_time_rad: f64::INFINITY,
                ..values()
            },
            FrameValues {
                frame_index: 8,
                ..values()
            },
            FrameValues {
                packet: 0x4000,
                ..values()
            },
        ];
        bad.push(values());
        bad[9].range_correction_m[19] = 400.0;
        let fields: Vec<_> = bad
            .iter()
            .map(|values| Record::from_frame(values).unwrap_err().field)
            .collect();
        assert_eq!(
            fields,
            [
                "time_s",
                "time_s",
                "ground_latitude_rad",
                "spacecraft_radius_m",
                "mid_range_m",
                "phase_angle_rad",
                "local_time_rad",
                "frame_index",
                "packet",
                "range_correction_m"
            ]
        );
    }
}
