//! The 776 bytes of a frame, field by field.

use zerocopy::{
    FromBytes, Immutable, IntoBytes, KnownLayout, Unaligned,
    byteorder::big_endian::{F64, I16, I32, U16, U32},
};

use super::SHOTS;

/// Bytes of a record; label records have the same length.
pub const RECORD_BYTES: usize = 776;

/// A record as stored in the file: big-endian integers in the file's own units.
///
/// Bytes of unpublished meaning are kept, so that reading and writing preserve them.
/// "Over the frame" means from its first edge to its last: shot `k` of 1 to 20 lies at `(k − 10.5)/20` of it.
/// The layout follows SIS 2.7 and later; before, `parallax_*`, `crossover_residual_cm` and the
/// spacecraft's changes were Cartesian coordinates.
#[derive(
    Debug, Clone, Copy, PartialEq, FromBytes, IntoBytes, KnownLayout, Immutable, Unaligned,
)]
#[repr(C)]
pub struct Record {
    /// Mid-point of the frame, whole seconds past J2000.
    pub time_whole_s: I32,
    /// Microseconds to add to the whole seconds, of either sign.
    pub time_fraction_us: I32,
    /// Orbit number.
    pub orbit: U32,
    /// Areocentric latitude of the spacecraft's centre of mass.
    pub spacecraft_latitude_microdegrees: I32,
    /// East longitude of the spacecraft's centre of mass.
    pub spacecraft_longitude_microdegrees: I32,
    /// Distance of the spacecraft's centre of mass from the centre of Mars.
    pub spacecraft_radius_cm: U32,
    /// Range at mid-point.
    pub mid_range_cm: I32,
    /// One bit per shot, 1 = bad; order of bits not published.
    pub bad_shot_bits: [u8; 4],
    /// Quality flags; meaning not published.
    pub quality_bits: [u8; 16],
    /// Planetary radius per shot before the crossover correction.
    pub shot_radius_cm: [I32; SHOTS],
    /// Planetary radius at mid-point.
    pub mid_radius_cm: I32,
    /// Right ascension, declination and twist of the pointing; scale not published.
    pub pointing: [I32; 3],
    /// Received pulse energy, corrected (femtojoules by the name that `pedr2tab` gives it).
    pub received_energy: [I16; SHOTS],
    /// Surface reflectivity times transmissivity, 0.001 per cent.
    pub reflectivity_millipercent: [U16; SHOTS],
    /// Trigger channel, 1 to 4; a damaged record may contain any value, so never index by it.
    pub channel: [u8; SHOTS],
    /// Pulse width at threshold crossing, 0.1 ns.
    pub pulse_width: [I16; SHOTS],
    /// Optical pulse width sigma, 0.1 ns.
    pub optical_width: [I16; SHOTS],
    /// Change of ground latitude per metre of radius, 1e-9 degrees.
    pub parallax_latitude_nanodegrees_per_m: I32,
    /// Change of ground longitude per metre of radius, 1e-9 degrees.
    pub parallax_longitude_nanodegrees_per_m: I32,
    /// Crossover residual at mid-point, to be subtracted from radii.
    pub crossover_residual_cm: I32,
    /// Ground areocentric latitude at mid-point.
    pub ground_latitude_microdegrees: I32,
    /// Ground east longitude at mid-point.
    pub ground_longitude_microdegrees: I32,
    /// Laser transmit energy, 0.01 mJ.
    pub transmit_energy: [I16; SHOTS],
    /// Classification: 1 ground, 0 cloud or noise.
    pub class: [I16; SHOTS],
    /// Background noise counts by half-frame (shots 1–10, 11–20) and channel.
    pub background_counts: [[I32; 4]; 2],
    /// Range gate delay.
    pub range_delay_cm: I32,
    /// Range window width.
    pub range_window_cm: I32,
    /// Threshold settings by half-frame and channel, counts.
    pub threshold_counts: [[I16; 4]; 2],
    /// Engineering, not published.
    pub engineering_480: [u8; 10],
    /// Place of the frame in its telemetry packet, 1 to 7.
    pub frame_index: U16,
    /// Engineering, not published.
    pub engineering_492: [u8; 2],
    /// Packet number in the low 14 bits; the upper two belong to the packet header.
    pub packet: U16,
    /// Engineering, not published; bytes 501 to 528 have one of seven layouts by `frame_index`.
    pub engineering_496: [u8; 40],
    /// 0: orbit from JPL; 1 or more: from the MOLA team, number of its gravity model.
    pub orbit_quality: U16,
    /// 3: no attitude for the frame, 2: none for part of it; the footprint then assumes nadir.
    pub attitude_flag: U16,
    /// Longitude of the frame minus longitude of the subsolar point, 1e-4 rad.
    pub local_time: I16,
    /// Angle at the centre of Mars between spacecraft and Sun, 1e-4 rad.
    pub phase_angle: U16,
    /// Solar incidence angle, 1e-4 rad.
    pub solar_incidence: U16,
    /// Emission angle, 1e-4 rad.
    pub emission_angle: U16,
    /// Atmospheric opacity, 1e-6; nominally 0.5.
    pub opacity: U32,
    /// Mid-point of the frame, seconds past J2000.
    pub time_s: F64,
    /// Received energy, raw counts.
    pub received_energy_counts: [u8; SHOTS],
    /// Pulse width, raw counts.
    pub pulse_width_counts: [u8; SHOTS],
    /// Change of the spacecraft's latitude over the frame.
    pub spacecraft_latitude_change_microdegrees: I32,
    /// Change of the spacecraft's longitude over the frame.
    pub spacecraft_longitude_change_microdegrees: I32,
    /// Change of the spacecraft's distance over the frame.
    pub spacecraft_radius_change_cm: I32,
    /// Areoid radius at mid-point.
    pub areoid_radius_cm: U32,
    /// Off-nadir angle of the laser.
    pub off_nadir_microdegrees: I32,
    /// Named by no public source.
    pub unnamed_620: [u8; 20],
    /// Change of the areoid radius over the frame.
    pub areoid_radius_change_cm: I32,
    /// Frequency of the MOLA clock, near 100 MHz.
    pub clock_frequency_hz: U32,
    /// One-way range per shot to the spacecraft's centre of mass; 0 or less: no return.
    pub range_cm: [I32; SHOTS],
    /// Range walk correction per shot; whether `range_cm` includes it is not published.
    pub range_correction_cm: [I16; SHOTS],
    /// Change of ground latitude over the frame.
    pub ground_latitude_change_microdegrees: I32,
    /// Change of ground longitude over the frame.
    pub ground_longitude_change_microdegrees: I32,
}

const _: () = assert!(size_of::<Record>() == RECORD_BYTES);

impl Record {
    /// The record in these bytes.
    #[must_use]
    pub fn from_bytes(bytes: &[u8; RECORD_BYTES]) -> Self {
        zerocopy::transmute!(*bytes)
    }

    /// The bytes of the record.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; RECORD_BYTES] {
        zerocopy::transmute!(*self)
    }

    /// The records in `bytes`, without a copy; bytes after the last complete record are ignored.
    #[must_use]
    pub fn slice_of(bytes: &[u8]) -> &[Self] {
        // Any bytes form a record and records need no alignment, so the prefix of complete records always exists.
        let whole = bytes.len() - bytes.len() % RECORD_BYTES;
        <[Self]>::ref_from_bytes(&bytes[..whole]).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::mem::offset_of;

    proptest! {
        #[test]
        fn any_bytes_read_and_written_stay_the_same(
            bytes in proptest::collection::vec(any::<u8>(), RECORD_BYTES)
        ) {
            let bytes: [u8; RECORD_BYTES] = bytes.try_into().unwrap();
            prop_assert_eq!(Record::from_bytes(&bytes).to_bytes(), bytes);
            prop_assert_eq!(Record::slice_of(&bytes)[0].to_bytes(), bytes);
        }
    }

    #[test]
    fn fields_start_where_the_published_layout_has_them() {
        let offsets = [
            (offset_of!(Record, spacecraft_radius_cm), 20),
            (offset_of!(Record, shot_radius_cm), 48),
            (offset_of!(Record, mid_radius_cm), 128),
            (offset_of!(Record, received_energy), 144),
            (offset_of!(Record, reflectivity_millipercent), 184),
            (offset_of!(Record, channel), 224),
            (offset_of!(Record, pulse_width), 244),
            (offset_of!(Record, optical_width), 284),
            (offset_of!(Record, parallax_latitude_nanodegrees_per_m), 324),
            (offset_of!(Record, crossover_residual_cm), 332),
            (offset_of!(Record, ground_latitude_microdegrees), 336),
            (offset_of!(Record, transmit_energy), 344),
            (offset_of!(Record, class), 384),
            (offset_of!(Record, background_counts), 424),
            (offset_of!(Record, range_delay_cm), 456),
            (offset_of!(Record, threshold_counts), 464),
            (offset_of!(Record, frame_index), 490),
            (offset_of!(Record, packet), 494),
            (offset_of!(Record, orbit_quality), 536),
            (offset_of!(Record, attitude_flag), 538),
            (offset_of!(Record, opacity), 548),
            (offset_of!(Record, time_s), 552),
            (offset_of!(Record, received_energy_counts), 560),
            (offset_of!(Record, pulse_width_counts), 580),
            (
                offset_of!(Record, spacecraft_latitude_change_microdegrees),
                600,
            ),
            (offset_of!(Record, areoid_radius_cm), 612),
            (offset_of!(Record, off_nadir_microdegrees), 616),
            (offset_of!(Record, areoid_radius_change_cm), 640),
            (offset_of!(Record, clock_frequency_hz), 644),
            (offset_of!(Record, range_cm), 648),
            (offset_of!(Record, range_correction_cm), 728),
            (offset_of!(Record, ground_latitude_change_microdegrees), 768),
            (
                offset_of!(Record, ground_longitude_change_microdegrees),
                772,
            ),
        ];
        for (index, (found, published)) in offsets.into_iter().enumerate() {
            assert_eq!(found, published, "entry {index}");
        }
    }
}
