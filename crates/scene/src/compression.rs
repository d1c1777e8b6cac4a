//! Loss by compression: the coefficients of the discrete cosine transform of blocks, rounded to steps.

use nalgebra::SMatrix;

/// Pixels of a block.
const BLOCK: usize = 8;
/// Steps of a coefficient: of the mean, and more for each half wave along either axis. These are about half of those for luminance in
/// ITU-T T.81, Table K.1.
const STEP: [f64; 2] = [5.0, 2.5];
/// The middle of the range of a pixel.
const MIDDLE_DN: f64 = 128.0;

type Block = SMatrix<f64, BLOCK, BLOCK>;

/// Pixels after compression and decompression, at least 1. Blocks at the right and lower edge repeat the last samples and lines.
///
/// * `pixels` – line by line
pub(super) fn compressed(pixels: &[u8], samples: usize) -> Vec<u8> {
    let mut out = pixels.to_vec();
    if samples == 0 {
        return out;
    }
    let lines = pixels.len() / samples;
    let waves = waves();
    for line in (0..lines).step_by(BLOCK) {
        for sample in (0..samples).step_by(BLOCK) {
            let at = |row: usize, column: usize| {
                let [row, column] = [
                    (line + row).min(lines - 1),
                    (sample + column).min(samples - 1),
                ];
                row * samples + column
            };
            let block =
                Block::from_fn(|row, column| f64::from(pixels[at(row, column)]) - MIDDLE_DN);
            let coefficients = waves * block * waves.transpose();
            let kept = Block::from_fn(|row, column| {
                let step = STEP[0] + STEP[1] * (row + column) as f64;
                step * (coefficients[(row, column)] / step).round()
            });
            let block = waves.tr_mul(&kept) * waves;
            for row in 0..BLOCK.min(lines - line) {
                for column in 0..BLOCK.min(samples - sample) {
                    let dn = block[(row, column)] + MIDDLE_DN;
                    #[allow(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "clamped to the range of a byte before; 0 means no pixel"
                    )]
                    let dn = dn.round().clamp(1.0, 255.0) as u8;
                    out[at(row, column)] = dn;
                }
            }
        }
    }
    out
}

/// The orthogonal matrix of the transform: a wave in each row.
fn waves() -> Block {
    let count = BLOCK as f64;
    Block::from_fn(|wave, at| {
        let amplitude = if wave == 0 { 1.0 } else { 2.0 };
        let phase = std::f64::consts::PI * wave as f64 * (at as f64 + 0.5) / count;
        (amplitude / count).sqrt() * phase.cos()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waves_are_orthogonal() {
        let unit = waves() * waves().transpose();
        assert!((unit - Block::identity()).norm() < 1e-12);
    }

    #[test]
    fn even_areas_stay_and_noise_is_lost() {
        let even = vec![100; 13 * 20];
        // The mean has steps of 5 over 8.
        assert!(compressed(&even, 20).iter().all(|dn| dn.abs_diff(100) <= 1));
        // A faint chequerboard, of half the last step, disappears; a strong one stays.
        let board = |dn: u8| -> Vec<u8> {
            let at = |at: usize| {
                if (at / 16 + at % 16).is_multiple_of(2) {
                    120 + dn
                } else {
                    120 - dn
                }
            };
            (0..256).map(at).collect()
        };
        let range = |of: &[u8]| of.iter().max().unwrap() - of.iter().min().unwrap();
        assert!(range(&compressed(&board(2), 16)) <= 2);
        assert!(range(&compressed(&board(60), 16)) > 80);
    }
}
