//! Many interpolated values at once.

use super::Patch;

/// Places whose pixels and fractions are computed together.
const TOGETHER: usize = 16;

impl Patch {
    /// The values at positions by the rule of [`Self::between`]: NaN where one of the 16 pixels around a position is
    /// missing. Lines and samples count from the middle of the first pixel of the patch.
    pub fn numbers(&self, [lines, samples]: [&[f32]; 2], numbers: &mut [f32]) {
        let places = lines.chunks(TOGETHER).zip(samples.chunks(TOGETHER));
        for ((lines, samples), numbers) in places.zip(numbers.chunks_mut(TOGETHER)) {
            let mut near = [Near::default(); TOGETHER];
            for (near, (line, sample)) in near.iter_mut().zip(lines.iter().zip(samples)) {
                *near = self.near(*line, *sample);
            }
            for (number, near) in numbers.iter_mut().zip(&near) {
                *number = self.number(near);
            }
        }
    }

    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "patches have few pixels, and the place is compared with their size"
    )]
    fn near(&self, line: f32, sample: f32) -> Near {
        let end = self.size.map(|length| length as f32 - 2.0);
        // NaN is not inside.
        let is_inside = (line >= 1.0) & (line < end[0]) & (sample >= 1.0) & (sample < end[1]);
        let [row, column] = [line, sample].map(|of| of as i32);
        let first = (row - 1)
            .wrapping_mul(self.size[1] as i32)
            .wrapping_add(column - 1);
        Near {
            first: if is_inside { first as u32 } else { u32::MAX },
            down: line - row as f32,
            right: sample - column as f32,
        }
    }

    fn number(&self, near: &Near) -> f32 {
        let (start, width) = (near.first as usize, self.size[1]);
        let Some(pixels) = self.values.get(start..start + 3 * width + 4) else {
            return f32::NAN;
        };
        let [lines, samples] = [near.down, near.right].map(cubic);
        let mut sums = [0.0_f32; 4];
        for (line, weight) in lines.iter().enumerate() {
            let row = &pixels[line * width..line * width + 4];
            for (sum, pixel) in sums.iter_mut().zip(row) {
                *sum += weight * pixel;
            }
        }
        let [a, b, c, d]: [f32; 4] = std::array::from_fn(|at| sums[at] * samples[at]);
        (a + b) + (c + d)
    }
}

/// The pixels around a place.
#[derive(Debug, Clone, Copy, Default)]
struct Near {
    /// The first of the 16; `u32::MAX` where the patch lacks one of them.
    first: u32,
    /// Distances of the place behind the second line and sample.
    down: f32,
    right: f32,
}

/// Weights of four equally spaced values for one between the second and the third, `t` behind the second.
fn cubic(t: f32) -> [f32; 4] {
    const POWERS: [[f32; 4]; 4] = [
        [0.0, 1.0, 0.0, 0.0],
        [-0.5, 0.0, 0.5, 0.0],
        [1.0, -2.5, 2.0, -0.5],
        [-0.5, 1.5, -1.5, 0.5],
    ];
    std::array::from_fn(|at| {
        POWERS[0][at] + t * (POWERS[1][at] + t * (POWERS[2][at] + t * POWERS[3][at]))
    })
}
