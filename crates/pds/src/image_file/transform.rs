//! The transform coder: blocks of 16 × 16 pixels, their coefficients quantised.

use std::{f64::consts::PI, sync::LazyLock};

use super::{
    bits::Bits,
    codes::{COEFFICIENTS, LARGE_NEGATIVE, LARGE_POSITIVE},
    coding::Transform,
};

/// Edge of a block, pixels.
pub(super) const EDGE: usize = 16;
/// Pixels or coefficients of a block.
pub(super) const AREA: usize = EDGE * EDGE;

/// Position in the stream of each coefficient, by vertical and then horizontal frequency.
pub(super) static ORDER: LazyLock<Vec<usize>> = LazyLock::new(|| {
    let numbers = include_str!("coefficient_order.txt").split_whitespace();
    numbers.filter_map(|number| number.parse().ok()).collect()
});

/// `e(k) cos((2n + 1) k π / 32)`, by frequency and place; `e(0)` is 1/√2, all others 1.
pub(super) static COSINES: LazyLock<[[f64; EDGE]; EDGE]> = LazyLock::new(|| {
    let mut cosines = [[0.0; EDGE]; EDGE];
    for (frequency, row) in cosines.iter_mut().enumerate() {
        let scale = if frequency == 0 { 0.5_f64.sqrt() } else { 1.0 };
        for (place, value) in row.iter_mut().enumerate() {
            let angle = ((2 * place + 1) * frequency) as f64 * PI / 32.0;
            *value = scale * angle.cos();
        }
    }
    cosines
});

/// Walsh functions ordered by their number of sign changes, by that and place.
static WALSH: LazyLock<[[i32; EDGE]; EDGE]> = LazyLock::new(|| {
    let mut functions = [[1; EDGE]; EDGE];
    for (changes, row) in (0_u8..).zip(&mut functions) {
        let gray = (changes ^ (changes >> 1)).reverse_bits() >> 4;
        for (place, value) in (0_u8..).zip(row) {
            if (place & gray).count_ones() % 2 == 1 {
                *value = -1;
            }
        }
    }
    functions
});

/// Coding of the fragments of an image.
#[derive(Debug, Clone, Copy)]
pub(super) struct TransformCoder {
    pub(super) transform: Transform,
    pub(super) groups: u8,
    pub(super) spacing: u16,
    pub(super) width: usize,
}

/// A decoded fragment.
#[derive(Debug)]
pub(super) enum Fragment {
    /// Its pixels, line by line, and whether the data contained all of them.
    Pixels(Vec<u8>, bool),
    /// A block of an undefined group.
    WrongGroup,
}

impl TransformCoder {
    /// Decodes a fragment of `lines` lines, a multiple of 16.
    pub(super) fn decode(&self, data: &[u8], lines: usize) -> Fragment {
        let (columns, rows) = (self.width / EDGE, lines / EDGE);
        let mut bits = Bits::new(data);
        let groups: Vec<u16> = (0..columns * rows).map(|_| bits.number(3)).collect();
        let mut pixels = vec![0; self.width * lines];
        if bits.is_beyond_end() {
            return Fragment::Pixels(pixels, false);
        }
        if groups.iter().any(|group| *group >= u16::from(self.groups)) {
            return Fragment::WrongGroup;
        }
        for level in 0..u16::from(self.groups) {
            if !groups.contains(&level) {
                continue;
            }
            let group = Group::read(&mut bits);
            let of_level = groups
                .iter()
                .enumerate()
                .filter(|(_, group)| **group == level);
            for (number, _) in of_level {
                let block = self.block(&group, &mut bits);
                if bits.is_beyond_end() {
                    return Fragment::Pixels(pixels, false);
                }
                let corner = number % rows * EDGE * self.width + number / rows * EDGE;
                for (row, values) in block.chunks_exact(EDGE).enumerate() {
                    let at = corner + row * self.width;
                    pixels[at..at + EDGE].copy_from_slice(values);
                }
            }
        }
        Fragment::Pixels(pixels, true)
    }

    fn block(&self, group: &Group, bits: &mut Bits<'_>) -> [u8; AREA] {
        let mut in_order = [0_i32; AREA];
        in_order[0] = group.mean(bits.number(8));
        let zeros = usize::from(bits.number(8));
        for (number, value) in in_order.iter_mut().enumerate().take(AREA - zeros).skip(1) {
            let step = match COEFFICIENTS[group.tables[number]].next(bits) {
                LARGE_NEGATIVE => i32::from(bits.number(15)) - 32_768,
                LARGE_POSITIVE => i32::from(bits.number(15)),
                small => i32::from(small),
            };
            // The on-board software used 16-bit numbers.
            let product = step.wrapping_mul(i32::from(self.spacing)).to_le_bytes();
            *value = i32::from(i16::from_le_bytes([product[0], product[1]]));
        }
        let mut coefficients = [0; AREA];
        for (coefficient, number) in coefficients.iter_mut().zip(&*ORDER) {
            *coefficient = in_order[*number];
        }
        match self.transform {
            Transform::Cosine => from_cosines(&coefficients),
            Transform::Walsh => from_walsh(&coefficients),
        }
    }
}

/// Parameters shared by the blocks of a group.
struct Group {
    /// Minimum and maximum mean of a block.
    means: [u16; 2],
    /// Code of each coefficient.
    tables: [usize; AREA],
}

impl Group {
    fn read(bits: &mut Bits<'_>) -> Self {
        let means = [bits.number(16), bits.number(16)];
        let mut tables = [0; AREA];
        for table in &mut tables[1..] {
            *table = usize::from(bits.number(3));
        }
        Self { means, tables }
    }

    /// The mean from its coded value of 0 to 255, in units of the first coefficient.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a 16-bit fraction and a 16-bit number"
    )]
    fn mean(&self, coded: u16) -> i32 {
        let [least, largest] = self.means;
        let range = f64::from(largest.wrapping_sub(least));
        let mean = f64::from(coded) * range / 255.0 + f64::from(least);
        i32::from((mean as u32 & 0xFFFF) as u16)
    }
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to the range of a byte"
)]
fn from_cosines(coefficients: &[i32; AREA]) -> [u8; AREA] {
    let mut rows = [[0.0; EDGE]; EDGE];
    for (row, frequencies) in rows.iter_mut().zip(coefficients.chunks_exact(EDGE)) {
        for (coefficient, cosines) in frequencies.iter().zip(&*COSINES) {
            if *coefficient != 0 {
                let coefficient = f64::from(*coefficient);
                for (sum, cosine) in row.iter_mut().zip(cosines) {
                    *sum += coefficient * cosine;
                }
            }
        }
    }
    let mut pixels = [0; AREA];
    for (y, line) in pixels.chunks_exact_mut(EDGE).enumerate() {
        let mut sums = [0.0; EDGE];
        for (row, cosines) in rows.iter().zip(&*COSINES) {
            for (sum, value) in sums.iter_mut().zip(row) {
                *sum += cosines[y] * value;
            }
        }
        for (pixel, sum) in line.iter_mut().zip(sums) {
            *pixel = (sum / 127.0 + 0.5).clamp(0.0, 255.0) as u8;
        }
    }
    pixels
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to the range of a byte"
)]
fn from_walsh(coefficients: &[i32; AREA]) -> [u8; AREA] {
    let mut rows = [[0; EDGE]; EDGE];
    for (row, frequencies) in rows.iter_mut().zip(coefficients.chunks_exact(EDGE)) {
        for (coefficient, signs) in frequencies.iter().zip(&*WALSH) {
            for (sum, sign) in row.iter_mut().zip(signs) {
                *sum += coefficient * sign;
            }
        }
    }
    let mut pixels = [0; AREA];
    for (y, line) in pixels.chunks_exact_mut(EDGE).enumerate() {
        for (x, pixel) in line.iter_mut().enumerate() {
            let sum: i32 = rows
                .iter()
                .zip(&*WALSH)
                .map(|(row, signs)| row[x] * signs[y])
                .sum();
            *pixel = (sum >> 8).clamp(0, 255) as u8;
        }
    }
    pixels
}
