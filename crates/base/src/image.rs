//! Image data of labels and configuration, and the limits of an image.

use serde::{Deserialize, Serialize};

/// Data of an image from a label or the configuration; any entry may be missing in either.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct ImageFields {
    /// Spacecraft clock at the start of the first line, for example `619971158:28`.
    pub sclk_start: Option<String>,
    /// UTC at the start of the first line, used if the clock string is missing.
    pub utc_start: Option<String>,
    /// Exposure of one detector line, seconds.
    pub exposure_s: Option<f64>,
    /// Time between two image lines, seconds.
    pub line_period_s: Option<f64>,
    /// Detector lines summed along the track.
    pub downtrack_summing: Option<u32>,
    /// Detector pixels summed across the track.
    pub crosstrack_summing: Option<u32>,
    /// Exposed lines, as in the header; the time model counts these.
    pub lines_header: Option<u32>,
    /// Lines in the delivered file, if fewer.
    pub lines_delivered: Option<u32>,
    /// Samples per line.
    pub samples: Option<u32>,
    /// First detector pixel, counted from 0 (`EDIT_MODE_ID`).
    pub first_detector: Option<u32>,
}

/// Minimum number of lines of an image: orientation is fitted over its length.
pub const IMAGE_LINES_MIN: u32 = 3;

/// Upper limit of the exposure of an image, seconds: the longest of the mission take about a minute, and over minutes
/// the orientation is no longer a polynomial of second order.
pub const IMAGE_DURATION_END_S: f64 = 600.0;

/// Form of a clock string, for messages.
pub const CLOCK_STRING: &str =
    "a spacecraft clock `seconds:ticks` with ticks below 256, such as 619971158:028";

/// Whether `text` is `[1/]seconds:ticks`, the two fields of the MGS clock (32 bits and 1/256 s) in its one partition.
///
/// Without ticks a clock is known only to a second, which is 3 km on the ground.
#[must_use]
pub fn is_clock_string(text: &str) -> bool {
    let (partition, count) = text.split_once('/').unwrap_or(("1", text));
    let below = |part: &str, limit: u64| {
        part.bytes().all(|byte| byte.is_ascii_digit())
            && part.parse::<u64>().is_ok_and(|value| value < limit)
    };
    partition == "1"
        && count
            .split_once([':', '.'])
            .is_some_and(|(seconds, ticks)| below(seconds, 1 << 32) && below(ticks, 256))
}

/// Labels state exposures and periods to 0.0001 ms; half of this is their rounding error, seconds.
const EXPOSURE_ROUNDING_S: f64 = 0.5e-7;

/// Whether a line period is exposure × downtrack summing, within the rounding of stated values.
///
/// The rounding of the exposure counts once for every summed line, the rounding of the period once.
#[must_use]
pub fn line_period_agrees(line_period_s: f64, exposure_s: f64, downtrack_summing: u32) -> bool {
    let summing = f64::from(downtrack_summing);
    (line_period_s - exposure_s * summing).abs() <= EXPOSURE_ROUNDING_S * (summing + 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clock_strings_have_seconds_and_256ths() {
        for good in ["619971158:28", "619971158.028", "1/0844996544.086"] {
            assert!(is_clock_string(good), "{good}");
        }
        for bad in [
            "",
            "619971158",
            "4294967296:0",
            "1:256",
            "0/1:1",
            "2/1:1",
            "1/2/1:1",
            "1:",
            ":1",
            "a:1",
            "1:1:1",
            "-1:1",
            "1:+1",
        ] {
            assert!(!is_clock_string(bad), "{bad}");
        }
    }

    #[test]
    fn periods_agree_within_the_rounding_of_what_labels_print() {
        // (period, exposure) in milliseconds, summing: the limits are 0.00045, 0.0002 and 0.0001 ms.
        for (period_ms, exposure_ms, summing, agrees) in [
            (3.8568, 0.4821, 8, true),
            (3.8572, 0.4821, 8, true),
            (3.8573, 0.4821, 8, false),
            (3.8564, 0.4821, 8, true),
            (3.8563, 0.4821, 8, false),
            (1.4463, 0.482_067, 3, true),
            (1.4465, 0.482_067, 3, false),
            (0.482_19, 0.4821, 1, true),
            (0.482_21, 0.4821, 1, false),
            (0.4821, 0.4821, 8, false),
            (f64::NAN, 0.4821, 8, false),
        ] {
            assert_eq!(
                line_period_agrees(period_ms * 1e-3, exposure_ms * 1e-3, summing),
                agrees,
                "{period_ms} ms of {summing} × {exposure_ms} ms"
            );
        }
    }
}
