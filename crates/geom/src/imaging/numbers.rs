//! Many interpolated values at once.

use wide::{f32x4, i32x4};

use super::Patch;

/// Places that are computed together.
const FOUR: usize = 4;

impl Patch {
    /// The values at positions by the rule of [`Self::between`]: NaN where one of the 16 pixels around a position is
    /// missing. Lines and samples count from the middle of the first pixel of the patch.
    pub fn numbers(&self, [lines, samples]: [&[f32]; 2], numbers: &mut [f32]) {
        let (lines, last_lines) = lines.as_chunks::<FOUR>();
        let (samples, last_samples) = samples.as_chunks::<FOUR>();
        let (numbers, last_numbers) = numbers.as_chunks_mut::<FOUR>();
        for (number, (line, sample)) in numbers.iter_mut().zip(lines.iter().zip(samples)) {
            *number = self.four([*line, *sample]);
        }
        let mut last = [[f32::NAN; FOUR]; 2];
        for (last, places) in last.iter_mut().zip([last_lines, last_samples]) {
            for (last, place) in last.iter_mut().zip(places) {
                *last = *place;
            }
        }
        for (number, last) in last_numbers.iter_mut().zip(self.four(last)) {
            *number = last;
        }
    }

    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_possible_wrap,
        clippy::cast_sign_loss,
        reason = "patches have few pixels; a place outside is not used"
    )]
    fn four(&self, places: [[f32; FOUR]; 2]) -> [f32; FOUR] {
        let [lines, samples] = places.map(f32x4::from);
        let [line_end, sample_end] = self.size.map(|length| f32x4::splat(length as f32 - 2.0));
        let first = f32x4::splat(1.0);
        // NaN is not inside.
        let inside = lines.simd_ge(first)
            & lines.simd_lt(line_end)
            & samples.simd_ge(first)
            & samples.simd_lt(sample_end);
        let inside = inside.to_bitmask();
        // Of positive numbers the whole part.
        let [rows, columns] = [lines, samples].map(f32x4::fast_trunc_int);
        let one = i32x4::splat(1);
        let starts = (rows - one) * i32x4::splat(self.size[1] as i32) + (columns - one);
        let starts = starts.to_array();
        let down = (lines - f32x4::from_i32x4(rows)).to_array();
        let right = (samples - f32x4::from_i32x4(columns)).to_array();
        std::array::from_fn(|at| {
            if inside & (1 << at) == 0 {
                f32::NAN
            } else {
                self.number(starts[at] as usize, down[at], right[at])
            }
        })
    }

    /// The value of the place this far behind the second line and sample of 16 pixels.
    fn number(&self, start: usize, down: f32, right: f32) -> f32 {
        let width = self.size[1];
        let lines = cubic(down).to_array();
        let mut sums = f32x4::splat(0.0);
        for (line, weight) in lines.into_iter().enumerate() {
            let pixels = self.values[start + line * width..].first_chunk();
            let Some(pixels) = pixels else {
                return f32::NAN;
            };
            sums += f32x4::from(*pixels) * f32x4::splat(weight);
        }
        let [a, b, c, d] = (sums * cubic(right)).to_array();
        (a + b) + (c + d)
    }
}

/// Weights of four equally spaced values for one between the second and the third, `t` behind the second.
fn cubic(t: f32) -> f32x4 {
    let powers = [
        [0.0, 1.0, 0.0, 0.0],
        [-0.5, 0.0, 0.5, 0.0],
        [1.0, -2.5, 2.0, -0.5],
        [-0.5, 1.5, -1.5, 0.5],
    ];
    let [none, first, second, third] = powers.map(f32x4::from);
    let t = f32x4::splat(t);
    none + t * (first + t * (second + t * third))
}
