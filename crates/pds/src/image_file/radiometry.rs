//! Conversion of numbers to relative radiance, and the noise of odd and even detectors.
//!
//! The model follows the camera's calibration report of 1997 (M. Malin et al., as ISIS applies it):
//! `dn = a (r t + dc t + g) + z − offset`, with gain `a`, exposure `t` and radiance `r`. Neither `z`, `dc` nor `g` of
//! the narrow-angle and the blue wide-angle camera is public: with 0 in their place radiance is known up to a constant.

use super::{
    opened::ImageFile,
    strip::{LineState, Strip},
};
use areograph_base::{
    error::{Cause, Result},
    units::SECONDS_PER_MS,
};

/// Gains of the narrow-angle camera by code.
const NARROW: [(&str, f64); 16] = [
    ("F2", 1.0),
    ("D2", 1.456),
    ("B2", 2.076),
    ("92", 2.935),
    ("72", 4.150),
    ("52", 5.866),
    ("32", 8.292),
    ("12", 11.73),
    ("EA", 7.968),
    ("CA", 11.673),
    ("AA", 16.542),
    ("8A", 23.386),
    ("6A", 33.067),
    ("4A", 46.740),
    ("2A", 66.071),
    ("0A", 93.465),
];

/// Gains of the wide-angle cameras by code.
const WIDE: [(&str, f64); 20] = [
    ("9A", 1.0),
    ("8A", 1.412),
    ("7A", 2.002),
    ("6A", 2.832),
    ("5A", 4.006),
    ("4A", 5.666),
    ("3A", 8.014),
    ("2A", 11.34),
    ("1A", 16.03),
    ("0A", 22.67),
    ("96", 16.030),
    ("86", 22.634),
    ("76", 32.092),
    ("66", 45.397),
    ("56", 64.216),
    ("46", 90.826),
    ("36", 128.464),
    ("26", 181.780),
    ("16", 256.961),
    ("06", 363.400),
];

/// Steps of the offset code.
const OFFSET_DN: f64 = 5.0;
/// Zero level, dark current and its offset of the red wide-angle camera, from the labels of calibrated cubes.
const RED: [f64; 3] = [27.676_58, 0.001_336_91, 0.123_262];
/// Until this date (UTC), summed pixels of the narrow-angle camera were added up, not averaged.
const MAPPING_BEGAN: &str = "1999-04-03T01:00:40.441";

/// An image that does not state its radiometric parameters.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Input: "extract the image without --calibrate")]
enum NotCalibrated {
    #[error("{key} is {value:?}; expected {expected}")]
    Label {
        key: &'static str,
        value: String,
        expected: &'static str,
    },
    #[error(
        "gain and offset change {changes} times within the image; the label states only the values of the first line"
    )]
    Changes { changes: u16 },
}

/// Radiometric parameters of an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Radiometry {
    gain: f64,
    offset_dn: f64,
    exposure_ms: f64,
    zero_dn: f64,
    dark_dn_per_ms: f64,
    dark_dn: f64,
    /// Whether the zero level is known; otherwise radiance lacks a constant.
    pub knows_zero: bool,
}

impl Radiometry {
    /// From the gain, offset and exposure in an image's label.
    ///
    /// # Errors
    /// A value that is missing or unknown for the camera; gain and offset that change within the image.
    pub fn of(image: &ImageFile) -> Result<Self> {
        let changes = image.layout().gain_changes;
        if changes > 0 {
            return Err(NotCalibrated::Changes { changes }.into());
        }
        let fields = &image.label().fields;
        let names = &image.label().instrument.label;
        let is_narrow = names.instrument.ends_with("-NA");
        let is_red = names.filter.as_deref() == Some("RED");
        let wrong = |key, expected| NotCalibrated::Label {
            key,
            value: image.value(key).unwrap_or_default().to_owned(),
            expected,
        };
        let gains: &[(&str, f64)] = if is_narrow { &NARROW } else { &WIDE };
        let code = image.value("GAIN_MODE_ID").unwrap_or_default();
        let gain = gains
            .iter()
            .find(|(other, _)| other.eq_ignore_ascii_case(code));
        let (_, mut gain) =
            *gain.ok_or_else(|| wrong("GAIN_MODE_ID", "a gain code of the camera"))?;
        let offset = image
            .value("OFFSET_MODE_ID")
            .and_then(|code| code.parse::<u8>().ok());
        let offset = offset.ok_or_else(|| wrong("OFFSET_MODE_ID", "a number from 0 to 255"))?;
        let exposure_s = fields.exposure_s;
        let exposure_s =
            exposure_s.ok_or_else(|| wrong("LINE_EXPOSURE_DURATION", "milliseconds"))?;
        let mut exposure_ms = exposure_s / SECONDS_PER_MS;
        if is_narrow {
            exposure_ms *= f64::from(fields.downtrack_summing.unwrap_or(1));
            let summing = f64::from(fields.crosstrack_summing.unwrap_or(1));
            let is_early = fields
                .utc_start
                .as_deref()
                .is_some_and(|utc| utc < MAPPING_BEGAN);
            if is_early && summing > 1.0 {
                let apart = |other: f64| (other - gain / summing).abs();
                let all = gains.iter().map(|(_, other)| *other);
                gain = all
                    .min_by(|a, b| apart(*a).total_cmp(&apart(*b)))
                    .unwrap_or(gain);
            }
        }
        let [zero_dn, dark_dn_per_ms, dark_dn] = if is_red { RED } else { [0.0; 3] };
        Ok(Self {
            gain,
            offset_dn: OFFSET_DN * f64::from(offset),
            exposure_ms,
            zero_dn,
            dark_dn_per_ms,
            dark_dn,
            knows_zero: is_red,
        })
    }

    /// Radiance of a number, in numbers per millisecond at gain 1.
    #[must_use]
    pub fn dn_per_ms(&self, dn: f64) -> f64 {
        let exposed = (dn - self.zero_dn + self.offset_dn) / self.gain - self.dark_dn;
        exposed / self.exposure_ms - self.dark_dn_per_ms
    }
}

/// Difference between odd and even samples, accumulated over an image.
#[derive(Debug, Clone, Copy, Default)]
pub struct OddEven {
    /// Sum and count of the odd and of the even samples, counted from 1.
    sums: [(u64, u64); 2],
}

impl OddEven {
    /// Adds the good lines of a strip.
    pub fn add(&mut self, strip: &Strip) {
        for (line, _) in strip
            .lines()
            .filter(|(_, state)| **state == LineState::Good)
        {
            for pair in line.chunks_exact(2) {
                for ((sum, count), pixel) in self.sums.iter_mut().zip(pair) {
                    *sum += u64::from(*pixel);
                    *count += 1;
                }
            }
        }
    }

    /// Correction to add to odd samples (counted from 1) and to subtract from even ones; `None` for an image without
    /// good lines.
    #[must_use]
    pub fn correction_dn(&self) -> Option<f64> {
        let [odd, even] = self
            .sums
            .map(|(sum, count)| (count > 0).then(|| sum as f64 / count as f64));
        Some(0.5 * (even? - odd?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worked_case_of_the_red_camera() {
        let [zero_dn, dark_dn_per_ms, dark_dn] = RED;
        let radiometry = Radiometry {
            gain: 5.666,
            offset_dn: 65.0,
            exposure_ms: 80.48,
            zero_dn,
            dark_dn_per_ms,
            dark_dn,
            knows_zero: true,
        };
        // Printed to five digits.
        assert!((radiometry.dn_per_ms(100.0) - 0.298_28).abs() < 5e-6);
    }

    #[test]
    fn odd_samples_gain_what_even_ones_lose() {
        let mut odd_even = OddEven::default();
        assert_eq!(odd_even.correction_dn(), None);
        odd_even.add(&Strip {
            first_line: 0,
            samples: 4,
            pixels: vec![100, 106, 102, 108, 0, 255, 0, 255],
            states: vec![LineState::Good, LineState::Suspect],
        });
        assert_eq!(odd_even.correction_dn(), Some(3.0));
    }
}
