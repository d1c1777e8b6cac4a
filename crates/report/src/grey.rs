//! Brightness as pixels of pictures on the page.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "brightnesses and cells are small numbers, and casts of floats saturate"
)]

/// Share of the darkest and of the brightest cells that are shown as black and as white.
const CLIPPED: f64 = 0.005;

/// The brightness that is shown as black, and as white.
#[must_use]
pub fn stretched(brightness: &[u8]) -> [u8; 2] {
    let mut known: Vec<u8> = brightness.iter().copied().filter(|of| *of > 0).collect();
    known.sort_unstable();
    let at = |share: f64| {
        let place = (share * known.len() as f64) as usize;
        known.get(place.min(known.len().saturating_sub(1))).copied()
    };
    [CLIPPED, 1.0 - CLIPPED].map(|share| at(share).unwrap_or(1))
}

/// Pixels of four bytes, the last of them the opacity.
#[must_use]
pub fn grey(brightness: &[u8], ends: [u8; 2]) -> Vec<u8> {
    let [dark, bright] = ends.map(f64::from);
    let pixel = |brightness: &u8| {
        let share = (f64::from(*brightness) - dark) / (bright - dark).max(1.0);
        let grey = (255.0 * share).round() as u8;
        let opacity = if *brightness > 0 { u8::MAX } else { 0 };
        [grey, grey, grey, opacity]
    };
    brightness.iter().flat_map(pixel).collect()
}
