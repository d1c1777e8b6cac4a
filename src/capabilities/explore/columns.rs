//! Columns of values as the page stores them: whole numbers of the last digit that it shows, as base64.

use base64::{Engine as _, engine::general_purpose::STANDARD};
use serde::Serialize;

use crate::products::SiteProducts;

/// Marks a missing value.
const MISSING: i32 = i32::MIN;

/// Whether a site has something to show on a map.
pub(super) fn has_places(site: &SiteProducts) -> bool {
    !site.footprints.is_empty() || !site.images.is_empty()
}

/// A column of whole numbers of 32 bits, little-endian; empty if all are missing.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Packed {
    /// Number of decimals of a value: 1234 with 2 decimals is 12.34.
    decimals: i32,
    base64: String,
}

impl Packed {
    /// Values, of which some may be missing, with so many decimals.
    pub(super) fn of(decimals: i32, values: impl Iterator<Item = Option<f64>>) -> Self {
        let scale = 10_f64.powi(decimals);
        let whole = |value: Option<f64>| {
            let value = value.filter(|value| value.is_finite());
            #[allow(
                clippy::cast_possible_truncation,
                reason = "casts saturate; a radius in centimetres and a longitude in millionths of a degree have room"
            )]
            value.map_or(MISSING, |value| (value * scale).round() as i32)
        };
        let mut numbers: Vec<i32> = values.map(whole).collect();
        if numbers.iter().all(|number| *number == MISSING) {
            numbers.clear();
        }
        let bytes: Vec<u8> = numbers.into_iter().flat_map(i32::to_le_bytes).collect();
        Self {
            decimals,
            base64: STANDARD.encode(bytes),
        }
    }

    /// Whole numbers.
    pub(super) fn whole(values: impl Iterator<Item = u32>) -> Self {
        Self::of(0, values.map(|value| Some(f64::from(value))))
    }
}

/// Instants in microseconds since 1970, as base64 of 64 bits each.
pub(super) fn instants(microseconds: impl Iterator<Item = i64>) -> String {
    let bytes: Vec<u8> = microseconds.flat_map(i64::to_le_bytes).collect();
    STANDARD.encode(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_rounded_once_and_missing_ones_are_marked() {
        let packed = Packed::of(
            2,
            [Some(-1.005e3), Some(0.126), None, Some(f64::NAN)].into_iter(),
        );
        let bytes = STANDARD.decode(packed.base64).unwrap();
        let numbers: Vec<i32> = bytes
            .chunks_exact(4)
            .map(|bytes| i32::from_le_bytes(bytes.try_into().unwrap()))
            .collect();
        assert_eq!(numbers, [-100_500, 13, MISSING, MISSING]);
    }
}
