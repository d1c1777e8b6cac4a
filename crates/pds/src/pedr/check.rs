//! Impossible values: those that no valid record contains, independent of its neighbours.

use zerocopy::byteorder::big_endian::I32;

use super::{
    FieldGuard, Record, RecordError,
    bounds::{
        AREOID_CHANGE_MAX_CM, AREOID_M, CLIMB_MAX_CM, CROSSOVER_MAX_CM, EARLIER_ORBIT_CM,
        FLIGHT_MAX_M, FREQUENCY_HZ, LATITUDE, LONGITUDE, MAPPING_ORBIT_CM, MISSION_S, OFF_NADIR,
        RADIUS_CM, TIMES_AGREE_S, TRACK_MAX_M,
    },
};
use areograph_base::{
    body::MARS_IAU2000,
    units::{METRES_PER_CM, RADIANS_PER_MICRODEGREE},
};

impl Record {
    /// Whether shot `shot` (0 to 19) has a return.
    #[must_use]
    pub fn returned(&self, shot: usize) -> bool {
        self.range_cm[shot].get() > 0
    }

    /// Whether laser shot `shot` (0 to 19) and the mid-point to which its parallax refers have possible radii of a
    /// return.
    #[must_use]
    pub fn radius_is_possible(&self, shot: usize) -> bool {
        [self.shot_radius_cm[shot], self.mid_radius_cm]
            .iter()
            .all(|radius_cm| RADIUS_CM.contains(&radius_cm.get()))
    }

    /// Checks values that make the entire frame unusable if wrong.
    ///
    /// # Errors
    /// The first impossible value.
    pub(super) fn check(&self, mapping_orbit: bool, guard: FieldGuard) -> Result<(), RecordError> {
        self.check_time()?;
        for (whose, latitude, longitude) in [
            (
                "ground",
                self.ground_latitude_microdegrees,
                self.ground_longitude_microdegrees,
            ),
            (
                "spacecraft",
                self.spacecraft_latitude_microdegrees,
                self.spacecraft_longitude_microdegrees,
            ),
        ] {
            let microdegrees = latitude.get();
            if !LATITUDE.contains(&microdegrees) {
                return Err(RecordError::Latitude {
                    whose,
                    microdegrees,
                });
            }
            let microdegrees = longitude.get();
            if !LONGITUDE.contains(&microdegrees) {
                return Err(RecordError::Longitude {
                    whose,
                    microdegrees,
                });
            }
        }
        self.check_orbit(mapping_orbit)?;
        self.check_ways()?;
        self.check_areoid()?;
        let residual_cm = self.crossover_residual_cm.get();
        let has_residual = guard.crossover_m(self).is_some();
        if has_residual && !(-CROSSOVER_MAX_CM..=CROSSOVER_MAX_CM).contains(&residual_cm) {
            return Err(RecordError::Crossover(residual_cm));
        }
        let off_nadir = self.off_nadir_microdegrees.get();
        if !OFF_NADIR.contains(&off_nadir) {
            return Err(RecordError::OffNadir(off_nadir));
        }
        Ok(())
    }

    pub(super) fn check_time(&self) -> Result<(), RecordError> {
        let time_s = self.time_s.get();
        if !time_s.is_finite() {
            return Err(RecordError::NoTime(time_s));
        }
        let fraction_s = f64::from(self.time_fraction_us.get()) * 1e-6;
        let integers_s = f64::from(self.time_whole_s.get()) + fraction_s;
        if (time_s - integers_s).abs() > TIMES_AGREE_S {
            return Err(RecordError::TwoTimes { time_s, integers_s });
        }
        if !MISSION_S.contains(&time_s) {
            return Err(RecordError::OutsideMission(time_s));
        }
        let frequency_hz = self.clock_frequency_hz.get();
        if !FREQUENCY_HZ.contains(&frequency_hz) {
            return Err(RecordError::Frequency(frequency_hz));
        }
        Ok(())
    }

    fn check_orbit(&self, mapping_orbit: bool) -> Result<(), RecordError> {
        let orbit_cm = if mapping_orbit {
            MAPPING_ORBIT_CM
        } else {
            EARLIER_ORBIT_CM
        };
        let radius_cm = self.spacecraft_radius_cm.get();
        if !orbit_cm.contains(&radius_cm) {
            return Err(RecordError::SpacecraftRadius(radius_cm, mapping_orbit));
        }
        let climb_cm = self.spacecraft_radius_change_cm.get();
        if !(-CLIMB_MAX_CM..=CLIMB_MAX_CM).contains(&climb_cm) {
            return Err(RecordError::Climb(climb_cm));
        }
        Ok(())
    }

    fn check_ways(&self) -> Result<(), RecordError> {
        for (whose, latitude, changes, radius_m, limit_m) in [
            (
                "the ground track",
                self.ground_latitude_microdegrees,
                [
                    self.ground_longitude_change_microdegrees,
                    self.ground_latitude_change_microdegrees,
                ],
                MARS_IAU2000.equatorial_radius_m,
                TRACK_MAX_M,
            ),
            (
                "the spacecraft",
                self.spacecraft_latitude_microdegrees,
                [
                    self.spacecraft_longitude_change_microdegrees,
                    self.spacecraft_latitude_change_microdegrees,
                ],
                f64::from(self.spacecraft_radius_cm.get()) * METRES_PER_CM,
                FLIGHT_MAX_M,
            ),
        ] {
            let changes = changes.map(I32::get);
            let [east_rad, north_rad] =
                changes.map(|change| f64::from(change) * RADIANS_PER_MICRODEGREE);
            let latitude_rad = f64::from(latitude.get()) * RADIANS_PER_MICRODEGREE;
            // The displacement is shortest on the parallel nearest to the pole over the frame.
            let parallel = (latitude_rad.abs() + 0.5 * north_rad.abs()).cos().max(0.0);
            let metres = radius_m * (east_rad * parallel).hypot(north_rad);
            let [longitude_microdegrees, latitude_microdegrees] = changes;
            if metres > limit_m || !LONGITUDE.contains(&longitude_microdegrees) {
                return Err(RecordError::Track {
                    whose,
                    longitude_microdegrees,
                    latitude_microdegrees,
                    metres,
                    limit_m,
                });
            }
        }
        Ok(())
    }

    fn check_areoid(&self) -> Result<(), RecordError> {
        let latitude_rad =
            f64::from(self.ground_latitude_microdegrees.get()) * RADIANS_PER_MICRODEGREE;
        let ellipsoid_m = ellipsoid_radius_m(latitude_rad);
        let expected_cm = [ellipsoid_m - AREOID_M, ellipsoid_m + AREOID_M].map(to_cm);
        let centimetres = self.areoid_radius_cm.get();
        if !(expected_cm[0]..=expected_cm[1]).contains(&centimetres) {
            return Err(RecordError::AreoidRadius {
                centimetres,
                expected_cm,
            });
        }
        let change_cm = self.areoid_radius_change_cm.get();
        if !(-AREOID_CHANGE_MAX_CM..=AREOID_CHANGE_MAX_CM).contains(&change_cm) {
            return Err(RecordError::AreoidChange(change_cm));
        }
        Ok(())
    }
}

/// Radius of the ellipsoid at an areocentric latitude, metres.
fn ellipsoid_radius_m(latitude_rad: f64) -> f64 {
    let (sin, cos) = latitude_rad.sin_cos();
    let (equatorial_m, polar_m) = (
        MARS_IAU2000.equatorial_radius_m,
        MARS_IAU2000.polar_radius_m,
    );
    (cos / equatorial_m).hypot(sin / polar_m).recip()
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "radii of Mars in centimetres fit into 32 bits"
)]
fn to_cm(metres: f64) -> u32 {
    (metres / METRES_PER_CM).round() as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pedr::{FrameValues, Reason};

    const GUARD: Option<f64> = Some(7.25);

    type Spoil = fn(&mut Record);

    fn good() -> Record {
        Record::from_frame(&FrameValues {
            time_s: 38_000_000.25,
            clock_frequency_hz: 1e8,
            spacecraft_radius_m: 3.78e6,
            areoid_radius_m: 3.396e6,
            mid_radius_m: 3.39e6,
            shot_radius_m: [3.39e6; 20],
            range_m: [3.9e5; 20],
            frame_index: 1,
            orbit_quality: 3,
            ..FrameValues::default()
        })
        .unwrap()
    }

    /// Damages a valid record and returns the resulting message.
    fn said(spoil: impl Fn(&mut Record)) -> (Reason, String) {
        let mut record = good();
        spoil(&mut record);
        let error = record.check(true, FieldGuard::new(GUARD)).unwrap_err();
        (error.reason(), error.to_string())
    }

    #[test]
    fn each_impossible_value_is_named() {
        assert_eq!(good().check(true, FieldGuard::new(GUARD)), Ok(()));
        let cases: [(Spoil, Reason, &str); 14] = [
            (
                |record| record.time_s.set(f64::NAN),
                Reason::Time,
                "time is NaN; expected seconds past J2000",
            ),
            (
                |record| record.time_fraction_us.set(250_003),
                Reason::Time,
                "the times of the record are 38000000.25 s and 38000000.250003 s; expected agreement within 1e-6 s",
            ),
            (
                |record| {
                    record.time_s.set(5.5e8);
                    record.time_whole_s.set(550_000_000);
                    record.time_fraction_us.set(0);
                },
                Reason::Time,
                "time is ET 550000000 s; expected -72705600 to 215784000 s, the time of the mission at Mars",
            ),
            (
                |record| record.clock_frequency_hz.set(50),
                Reason::Frequency,
                "clock frequency is 50 Hz; expected 1e8 Hz within 1 %",
            ),
            (
                |record| record.ground_latitude_microdegrees.set(90_000_001),
                Reason::Latitude,
                "ground latitude is 90000001 microdegrees; expected -90 to 90 degrees",
            ),
            (
                |record| record.spacecraft_longitude_microdegrees.set(1 << 30),
                Reason::Longitude,
                "spacecraft longitude is 1073741824 microdegrees; expected -360 to 360 degrees",
            ),
            (
                |record| record.ground_longitude_change_microdegrees.set(1 << 20),
                Reason::Track,
                "the ground track moves by 1048576 microdegrees in longitude and 0 in latitude over the frame (62154 \
                 m); expected at most 50000 m",
            ),
            (
                |record| record.spacecraft_radius_cm.set(420_000_001),
                Reason::SpacecraftRadius,
                "the spacecraft is 420000001 cm from the centre of Mars; expected 340000000 to 420000000 cm",
            ),
            (
                |record| record.spacecraft_radius_change_cm.set(-600_001),
                Reason::SpacecraftRadius,
                "the spacecraft rises by -600001 cm over the frame; expected a change of at most 600000 cm",
            ),
            (
                |record| record.areoid_radius_cm.set(339_119_000 - 1),
                Reason::Areoid,
                "areoid radius is 339118999 cm; expected 339119000 to 340119000 cm at this latitude",
            ),
            (
                |record| record.areoid_radius_change_cm.set(50_001),
                Reason::Areoid,
                "the areoid rises by 50001 cm over the frame; expected a change of at most 50000 cm",
            ),
            (
                |record| record.crossover_residual_cm.set(i32::MIN),
                Reason::Crossover,
                "crossover residual is -2147483648 cm; expected a magnitude of at most 100000 cm",
            ),
            (
                |record| record.off_nadir_microdegrees.set(-90_000_001),
                Reason::OffNadir,
                "off-nadir angle is -90000001 microdegrees; expected at most 90 degrees",
            ),
            (
                |record| record.spacecraft_latitude_change_microdegrees.set(1 << 18),
                Reason::Track,
                "the spacecraft moves by 0 microdegrees in longitude and 262144 in latitude over the frame (17295 m); \
                 expected at most 15000 m",
            ),
        ];
        for (spoil, expected_reason, expected_text) in cases {
            let (reason, text) = said(spoil);
            assert_eq!((reason, text.as_str()), (expected_reason, expected_text));
        }
    }

    #[test]
    fn a_residual_that_older_software_did_not_write_is_not_judged() {
        let mut record = good();
        record.crossover_residual_cm.set(i32::MAX);
        assert_eq!(record.check(true, FieldGuard::new(Some(6.5))), Ok(()));
    }

    #[test]
    fn orbits_before_mapping_may_be_high() {
        let mut record = good();
        record.spacecraft_radius_cm.set(2_000_000_000);
        let guard = FieldGuard::new(GUARD);
        assert!(record.check(true, guard).is_err() && record.check(false, guard).is_ok());
    }
}
