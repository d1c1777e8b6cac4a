//! Echo data of the instrument: channels, energies, pulse widths, thresholds, background, range gate.
//!
//! No mission file was available: the fields are those that `pedr2tab` writes; sizes are plausible choices for an
//! altimeter, with consistent physics. A weak echo has little energy, a slope widens the pulse, the Sun contributes
//! background. None of these moves a footprint.

use zerocopy::byteorder::big_endian::{I16, I32, U16};

use super::random::{mix, unit_of};
use areograph_pds::pedr::{Record, SHOTS};

/// Range at which echoes have their nominal energy, centimetres.
const USUAL_RANGE_CM: f64 = 3.85e7;
/// Millivolts per count of a threshold, channels 1 to 4. Source: `pedr2tab`.
const MV_PER_COUNT: [f64; 4] = [2.29, 1.32, 0.763, 0.440];
/// Width of the range window, centimetres.
const WINDOW_CM: i32 = 1_200_000;
/// Share of ground echoes, and of cloud echoes, that trigger in channels 1 to 3; the others trigger in channel 4, which
/// the MOLA team's own grids exclude.
const GROUND_CHANNELS: [f64; 3] = [0.80, 0.95, 0.99];
const CLOUD_CHANNELS: [f64; 3] = [0.30, 0.50, 0.70];

/// The channel in which an echo triggers, by a random number `0 <= chance < 1`.
pub(super) fn channel(is_ground: bool, chance: f64) -> u8 {
    let until = if is_ground {
        GROUND_CHANNELS
    } else {
        CLOUD_CHANNELS
    };
    (1..)
        .zip(until)
        .find(|(_, until)| chance < *until)
        .map_or(4, |(channel, _)| channel)
}

/// Enters the echo data into a record whose ranges, classes and angles are known.
pub(super) fn enter(record: &mut Record, seed: u64) {
    let chance = |purpose: u64, number: usize| unit_of(mix(mix(seed ^ purpose) ^ number as u64));
    for shot in 0..SHOTS {
        let is_ground = record.class[shot].get() == 1;
        record.channel[shot] = channel(is_ground, chance(11, shot));
        let transmitted_mj = 40.0 + 4.0 * chance(12, shot);
        record.transmit_energy[shot] = counts(transmitted_mj / 0.01);
        if !record.returned(shot) {
            record.received_energy[shot] = I16::new(0);
            record.reflectivity_millipercent[shot] = U16::new(0);
            continue;
        }
        let reflectivity_percent = 8.0 + 14.0 * chance(13, shot);
        let range = f64::from(record.range_cm[shot].get()) / USUAL_RANGE_CM;
        let energy = 25.0 * reflectivity_percent * (transmitted_mj / 42.0) / (range * range);
        // The spot of a beam at oblique incidence is deep: 130 m of it, 6.7 ns a metre two-way.
        let off_nadir_rad = 1e-6 * f64::from(record.off_nadir_microdegrees.get()).to_radians();
        let sigma_ns = (4.0 + 12.0 * chance(14, shot).powi(2)).hypot(200.0 * off_nadir_rad.tan());
        record.received_energy[shot] = counts(energy);
        let reflectivity = (1e3 * reflectivity_percent).round().clamp(0.0, 65_535.0);
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to the field"
        )]
        record.reflectivity_millipercent[shot].set(reflectivity as u16);
        record.optical_width[shot] = counts(sigma_ns / 0.1);
        record.pulse_width[shot] = counts(2.4 * sigma_ns / 0.1);
        record.received_energy_counts[shot] = byte(energy / 4.0);
        record.pulse_width_counts[shot] = byte(2.4 * sigma_ns / 3.0);
    }
    enter_receiver(record, &chance);
}

/// Thresholds, background and range gate.
fn enter_receiver(record: &mut Record, chance: &impl Fn(u64, usize) -> f64) {
    let sun = (1e-4 * f64::from(record.solar_incidence.get()))
        .cos()
        .max(0.0);
    for half in 0..2 {
        for (channel, mv_per_count) in MV_PER_COUNT.iter().enumerate() {
            let noise = chance(15, 4 * half + channel);
            let threshold_mv = 35.0 + 90.0 * sun.sqrt() + 8.0 * noise;
            record.threshold_counts[half][channel] = counts(threshold_mv / mv_per_count);
            let background = (2.0 + 60.0 * sun) * (0.9 + 0.2 * noise);
            record.background_counts[half][channel] = I32::from(counts(background));
        }
    }
    let delay_cm = record.mid_range_cm.get() - WINDOW_CM / 2;
    record.range_delay_cm = I32::new(delay_cm.max(0));
    record.range_window_cm = I32::new(WINDOW_CM);
}

#[allow(clippy::cast_possible_truncation, reason = "clamped to the field")]
fn counts(value: f64) -> I16 {
    I16::new(value.round().clamp(0.0, f64::from(i16::MAX)) as i16)
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to the field"
)]
fn byte(value: f64) -> u8 {
    value.round().clamp(0.0, 255.0) as u8
}
