//! Encoder of the transform coder: blocks of pixels to quantised cosine coefficients.

use std::collections::BTreeMap;

use super::{
    bits::BitWriter,
    codes::{COEFFICIENTS, Code, LARGE_NEGATIVE, LARGE_POSITIVE},
    transform::{AREA, COSINES, EDGE, ORDER},
};

/// Bits after the escape word of a coefficient without a code word.
const ESCAPED: u32 = 15;

/// A block: its mean in units of the first coefficient, the others in steps of the quantiser in the order of the stream.
struct Block {
    mean: f64,
    steps: [i32; AREA],
}

/// The data of a fragment that holds these lines; both sizes are multiples of 16.
pub(super) fn encode_blocks(pixels: &[u8], width: usize, groups: u8, spacing: u16) -> Vec<u8> {
    let rows = pixels.len() / width / EDGE;
    let blocks: Vec<Block> = (0..width / EDGE * rows)
        .map(|number| {
            let corner = number % rows * EDGE * width + number / rows * EDGE;
            let lines = (0..EDGE).map(|row| &pixels[corner + row * width..][..EDGE]);
            transformed(lines, spacing)
        })
        .collect();
    let groups = grouped(&blocks, usize::from(groups));
    let mut out = BitWriter::default();
    for group in &groups {
        out.push(u32::from(*group), 3);
    }
    for level in 0..8 {
        let of_level = blocks
            .iter()
            .zip(&groups)
            .filter(|(_, group)| **group == level);
        let of_level: Vec<&Block> = of_level.map(|(block, _)| block).collect();
        if !of_level.is_empty() {
            encode_group(&of_level, &mut out);
        }
    }
    out.finish()
}

/// Groups blocks of similar activity.
fn grouped(blocks: &[Block], groups: usize) -> Vec<u8> {
    let activity = |block: &Block| {
        block.steps[1..]
            .iter()
            .map(|step| step.unsigned_abs())
            .sum::<u32>()
    };
    let mut order: Vec<usize> = (0..blocks.len()).collect();
    order.sort_by_key(|number| activity(&blocks[*number]));
    let mut group_of = vec![0; blocks.len()];
    let size = blocks.len().div_ceil(groups);
    for (group, numbers) in (0..).zip(order.chunks(size)) {
        for number in numbers {
            group_of[*number] = group;
        }
    }
    group_of
}

fn encode_group(blocks: &[&Block], out: &mut BitWriter) {
    let means = || blocks.iter().map(|block| block.mean);
    let least = means().fold(f64::INFINITY, f64::min).floor();
    let range = means().fold(0.0, f64::max).ceil() - least;
    out.push(whole(least), 16);
    out.push(whole(least + range), 16);
    let tables: Vec<usize> = (1..AREA).map(|number| shortest(blocks, number)).collect();
    for table in &tables {
        out.push(u32::try_from(*table).unwrap_or_default(), 3);
    }
    for block in blocks {
        let fraction = if range > 0.0 {
            (block.mean - least) / range
        } else {
            0.0
        };
        out.push(whole(fraction * 255.0), 8);
        let last = block.steps.iter().rposition(|step| *step != 0).unwrap_or(0);
        out.push(u32::try_from(AREA - 1 - last).unwrap_or_default(), 8);
        for (step, table) in block.steps[1..=last].iter().zip(&tables) {
            for (bits, length) in words(&COEFFICIENTS[*table], *step).into_iter().flatten() {
                out.push(bits, length);
            }
        }
    }
}

/// The code with the fewest bits for a coefficient of these blocks.
fn shortest(blocks: &[&Block], number: usize) -> usize {
    let mut counts: BTreeMap<i32, u32> = BTreeMap::new();
    for block in blocks {
        *counts.entry(block.steps[number]).or_default() += 1;
    }
    let bits = |table: &usize| {
        let of_step = |(step, count): (&i32, &u32)| -> u32 {
            let words = words(&COEFFICIENTS[*table], *step).into_iter().flatten();
            count * words.map(|(_, length)| length).sum::<u32>()
        };
        counts.iter().map(of_step).sum::<u32>()
    };
    (0..COEFFICIENTS.len()).min_by_key(bits).unwrap_or_default()
}

/// The code word of a step, or the escape and its bits.
fn words(code: &Code, step: i32) -> [Option<(u32, u32)>; 2] {
    let own = i16::try_from(step).ok().and_then(|step| code.word(step));
    if own.is_some() {
        return [own, None];
    }
    let (escape, rest) = if step < 0 {
        (LARGE_NEGATIVE, step + 32_768)
    } else {
        (LARGE_POSITIVE, step)
    };
    [code.word(escape), Some((rest.unsigned_abs(), ESCAPED))]
}

#[allow(
    clippy::cast_possible_truncation,
    reason = "the product of step and spacing stays within 16 bits"
)]
fn transformed<'a>(lines: impl Iterator<Item = &'a [u8]>, spacing: u16) -> Block {
    let mut sums = [[0.0; EDGE]; EDGE];
    for (y, line) in lines.enumerate() {
        for (u, cosines) in COSINES.iter().enumerate() {
            let along: f64 = line
                .iter()
                .zip(cosines)
                .map(|(pixel, cosine)| f64::from(*pixel) * cosine)
                .sum();
            for (v, row) in sums.iter_mut().enumerate() {
                row[u] += along * COSINES[v][y];
            }
        }
    }
    // The squares of each cosine add up to 8, and the decoder divides by 127.
    let coefficient = |place: usize| sums[place / EDGE][place % EDGE] * 127.0 / 64.0;
    let step_max = (f64::from(i16::MAX) / f64::from(spacing)).floor();
    let mut steps = [0; AREA];
    for (place, number) in ORDER.iter().enumerate().skip(1) {
        let step = (coefficient(place) / f64::from(spacing)).round();
        steps[*number] = step.clamp(-step_max, step_max) as i32;
    }
    Block {
        mean: coefficient(0),
        steps,
    }
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "means of bytes times 254, or a fraction of 255"
)]
fn whole(value: f64) -> u32 {
    value.round() as u32
}
