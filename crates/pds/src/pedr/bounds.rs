//! Bounds of record values that follow from the format or from physics, with their reasons. `docs/records.md` tabulates
//! them.

use std::ops::RangeInclusive;

use areograph_base::units::METRES_PER_CM;

/// The mission at Mars, ET seconds: from the day of orbit insertion, 1997-09-12, to the day of the last contact, 2006-11-02.
pub(super) const MISSION_S: RangeInclusive<f64> = -72_705_600.0..=215_784_000.0;
/// Possible radii of laser returns on Mars, centimetres: Hellas is near 3.38e6 m, Olympus Mons near 3.42e6 m; clouds
/// and noise stay within the range gate.
pub(super) const RADIUS_CM: RangeInclusive<i32> = 330_000_000..=345_000_000;
/// Largest difference between two possible radii, metres.
pub(super) const RELIEF_MAX_M: f64 = (*RADIUS_CM.end() - *RADIUS_CM.start()) as f64 * METRES_PER_CM;
/// Distance of the spacecraft from the centre of Mars in mapping orbit, centimetres.
pub(super) const MAPPING_ORBIT_CM: RangeInclusive<u32> = 340_000_000..=420_000_000;
/// Distance of the spacecraft from the centre of Mars before mapping, when the orbit was elliptical, centimetres.
pub(super) const EARLIER_ORBIT_CM: RangeInclusive<u32> = 340_000_000..=2_200_000_000;
/// Largest change of that distance over a frame, centimetres: 3 km/s, more than the radial part of the 4.7 km/s at the
/// periapsis of the first, longest orbits.
pub(super) const CLIMB_MAX_CM: i32 = 600_000;
/// Clock frequencies, hertz: one per cent about the nominal 100 MHz.
pub(super) const FREQUENCY_HZ: RangeInclusive<u32> = 99_000_000..=101_000_000;
/// Latitudes, microdegrees.
pub(super) const LATITUDE: RangeInclusive<i32> = -90_000_000..=90_000_000;
/// Longitudes, microdegrees: of one turn east, or of one turn west, as accepted by readers.
pub(super) const LONGITUDE: RangeInclusive<i32> = -360_000_000..=360_000_000;
/// Largest displacement of the spacecraft over a frame, metres: 7.5 km/s; its speed was at most 4.7 km/s.
pub(super) const FLIGHT_MAX_M: f64 = 15_000.0;
/// Largest displacement of the ground track over a frame, metres: 25 km/s. The spacecraft moves at 3 km/s, the rest is
/// a beam that rotates by several degrees per second, faster than the spacecraft ever did.
pub(super) const TRACK_MAX_M: f64 = 50_000.0;
/// Largest distance of the areoid from the ellipsoid, metres: it rises 2 km above it at Tharsis, and the radii of older
/// ellipsoids differ by 3 km.
pub(super) const AREOID_M: f64 = 5_000.0;
/// Largest change of the areoid over a frame, centimetres: one per cent of the longest displacement; the flattening of
/// Mars causes 0.6 %.
pub(super) const AREOID_CHANGE_MAX_CM: i32 = 50_000;
/// Largest crossover residual, centimetres: radial errors of orbits before the adjustment were tens of metres, of the
/// worst orbits hundreds.
pub(super) const CROSSOVER_MAX_CM: i32 = 100_000;
/// Off-nadir angles, microdegrees.
pub(super) const OFF_NADIR: RangeInclusive<i32> = -90_000_000..=90_000_000;
/// Largest difference between the two times of a record, seconds: the last digit of the integers, and
/// room for the rounding of the double.
pub(super) const TIMES_AGREE_S: f64 = 1.1e-6;
/// Largest difference between the radii of the mid-point and of the nearest return, metres: more than any slope
/// of Mars over the 6 km of a frame.
pub(super) const MID_RADIUS_M: f64 = 10_000.0;
/// Frames whose mid-points are closer than this share a shot, seconds: a frame is 20 shots of 0.1 s, less one.
pub(super) const APART_S: f64 = 1.9;
