//! Approximate position of a frame from a few of its fields, sufficient to exclude it from distant windows.

use zerocopy::byteorder::big_endian::I32;

use super::{PARALLAX_UNIT_RAD_PER_M, Record, bounds::RELIEF_MAX_M};
use areograph_base::units::RADIANS_PER_MICRODEGREE;

/// The ground at the mid-point of a frame, and its extent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MidPoint {
    /// East longitude, radians of any turn.
    pub longitude_rad: f64,
    /// Areocentric latitude, radians; beyond a pole in a damaged record.
    pub latitude_rad: f64,
    /// Largest great-circle distance of a shot from the mid-point, radians: at least
    /// [`Frame::reach_rad`](super::Frame::reach_rad), but computed without the shots.
    pub reach_rad: f64,
}

impl Record {
    /// The mid-point of the record's frame.
    #[must_use]
    pub fn mid_point(&self) -> MidPoint {
        let whole = |field: I32| f64::from(field.get());
        let change = whole(self.ground_longitude_change_microdegrees).abs()
            + whole(self.ground_latitude_change_microdegrees).abs();
        let parallax = whole(self.parallax_longitude_nanodegrees_per_m).abs()
            + whole(self.parallax_latitude_nanodegrees_per_m).abs();
        // Larger by the rounding of the sum.
        let reach_rad = 0.5 * change * RADIANS_PER_MICRODEGREE
            + RELIEF_MAX_M * parallax * PARALLAX_UNIT_RAD_PER_M;
        MidPoint {
            longitude_rad: whole(self.ground_longitude_microdegrees) * RADIANS_PER_MICRODEGREE,
            latitude_rad: whole(self.ground_latitude_microdegrees) * RADIANS_PER_MICRODEGREE,
            reach_rad: reach_rad * (1.0 + 1e-12),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pedr::{FieldGuard, Frame, RECORD_BYTES};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_bound_is_never_less_than_the_reach(
            bytes in proptest::collection::vec(any::<u8>(), RECORD_BYTES),
            software in proptest::option::of(0.0..9.0_f64),
            // For any content of a damaged record, and possible radii of returns.
            radii in proptest::option::of(proptest::collection::vec(330_000_000..=345_000_000, 21)),
        ) {
            let bytes: [u8; RECORD_BYTES] = bytes.try_into().unwrap();
            let mut record = Record::from_bytes(&bytes);
            if let Some(radii) = radii {
                record.mid_radius_cm.set(radii[20]);
                for (radius_cm, possible) in record.shot_radius_cm.iter_mut().zip(radii) {
                    radius_cm.set(possible);
                }
            }
            let frame = Frame::new(&record, FieldGuard::new(software), None);
            let mid = record.mid_point();
            prop_assert!(frame.reach_rad() <= mid.reach_rad);
            prop_assert_eq!(frame.mid_point(), (mid.longitude_rad, mid.latitude_rad));
        }
    }
}
