//! Selection of positions with enough texture for matching.

use super::Patch;

/// A position with texture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Texture {
    /// Line and sample of its pixel, counted from 0.
    pub at: [i64; 2],
    /// Standard deviation of the position in its worst direction from the image's noise only, pixels.
    pub sigma_px: f64,
}

/// Noise of a pixel by the operator of Immerkær 1996: second differences along and across, which suppress straight
/// edges and slopes; the median is robust against the few corners.
#[must_use]
pub fn noise_dn(patch: &Patch) -> Option<f64> {
    const SIGMA_OF_MEDIAN: f64 = 1.482_602_218_505_602;
    let mut found = Vec::new();
    for line in 1..patch.size[0].saturating_sub(1) {
        for sample in 1..patch.size[1].saturating_sub(1) {
            let row = |line: usize| {
                patch.at(line, sample - 1) - 2.0 * patch.at(line, sample)
                    + patch.at(line, sample + 1)
            };
            let bend = f64::from(row(line - 1) - 2.0 * row(line) + row(line + 1));
            // The weights' squares add up to 36.
            found.push(bend.abs() / 6.0);
        }
    }
    let middle = found.len() / 2;
    if found.is_empty() {
        return None;
    }
    let (_, median, _) = found.select_nth_unstable_by(middle, f64::total_cmp);
    Some(SIGMA_OF_MEDIAN * *median)
}

/// The position of `patch` with the most texture in a square of `2 half + 1` pixels around it.
///
/// `noise_dn` is the standard deviation of a pixel; its contribution to the slopes is removed. Returns `None` where
/// noise alone explains the slopes.
///
/// # Source
/// Förstner & Gülch 1987: the smallest eigenvalue of the normal equations of a shift.
#[must_use]
pub fn texture(patch: &Patch, half: usize, noise_dn: f64) -> Option<Texture> {
    let size = patch.size.map(|length| length.saturating_sub(2));
    let edge = 2 * half + 1;
    if size.iter().any(|length| *length < edge) {
        return None;
    }
    let sums = products(patch, size);
    let width = size[1] + 1;
    let variance = noise_dn * noise_dn;
    // A slope is half a difference of two pixels.
    let of_noise = 0.5 * variance * (edge * edge) as f64;
    let mut best: Option<([usize; 2], f64)> = None;
    for line in 0..=size[0] - edge {
        for sample in 0..=size[1] - edge {
            let corner = |down: usize, right: usize| sums[(line + down) * width + sample + right];
            let [ll, ls, ss] = [0, 1, 2].map(|of| {
                corner(edge, edge)[of] - corner(0, edge)[of] - corner(edge, 0)[of]
                    + corner(0, 0)[of]
            });
            let smallest = 0.5 * (ll + ss - (ll - ss).hypot(2.0 * ls)) - of_noise;
            if best.is_none_or(|(_, known)| smallest > known) {
                best = Some(([line, sample], smallest));
            }
        }
    }
    let (at, smallest) = best.filter(|(_, smallest)| *smallest > 0.0)?;
    let pixel = |axis: usize| patch.first[axis] + i64::try_from(at[axis] + half + 1).unwrap_or(0);
    Some(Texture {
        at: [pixel(0), pixel(1)],
        // Both images have noise.
        sigma_px: (2.0 * variance / smallest).sqrt(),
    })
}

/// Sums of the products of slopes from the first pixel on.
fn products(patch: &Patch, size: [usize; 2]) -> Vec<[f64; 3]> {
    let width = size[1] + 1;
    let mut sums = vec![[0.0; 3]; width * (size[0] + 1)];
    for line in 0..size[0] {
        let mut row = [0.0; 3];
        for sample in 0..size[1] {
            let down = 0.5 * f64::from(patch.at(line + 2, sample + 1) - patch.at(line, sample + 1));
            let right =
                0.5 * f64::from(patch.at(line + 1, sample + 2) - patch.at(line + 1, sample));
            for (sum, product) in row
                .iter_mut()
                .zip([down * down, down * right, right * right])
            {
                *sum += product;
            }
            let above = sums[line * width + sample + 1];
            sums[(line + 1) * width + sample + 1] = [0, 1, 2].map(|of| above[of] + row[of]);
        }
    }
    sums
}
