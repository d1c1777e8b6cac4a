//! Spoiling small binary kernels (NAIF, DAF Required Reading), little-endian as the scene writes them.

use super::case::Case;

fn integer(bytes: &[u8], at: usize) -> usize {
    let bytes = bytes[at..at + 4].try_into().unwrap();
    usize::try_from(i32::from_le_bytes(bytes)).unwrap()
}

fn double(bytes: &[u8], at: usize) -> f64 {
    f64::from_le_bytes(bytes[at..at + 8].try_into().unwrap())
}

/// A count, which binary kernels hold as a double.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a small whole number"
)]
fn count(bytes: &[u8], at: usize) -> usize {
    double(bytes, at) as usize
}

/// Where the segment summaries of a small binary kernel begin.
pub(crate) fn summaries(bytes: &[u8]) -> Vec<usize> {
    let record = 1024 * (integer(bytes, 76) - 1);
    let segments = 0..count(bytes, record + 16);
    segments.map(|index| record + 24 + 40 * index).collect()
}

/// First and last word of each segment, counted from 1.
pub(crate) fn segment_words(bytes: &[u8]) -> Vec<(usize, usize)> {
    let words = |summary| (integer(bytes, summary + 32), integer(bytes, summary + 36));
    summaries(bytes).into_iter().map(words).collect()
}

/// A word, counted from 1.
pub(crate) fn word(bytes: &[u8], word: usize) -> f64 {
    double(bytes, 8 * (word - 1))
}

/// Puts another number in its place.
pub(crate) fn set_word(bytes: &mut [u8], word: usize, value: f64) {
    bytes[8 * (word - 1)..8 * word].copy_from_slice(&value.to_le_bytes());
}

/// A C-kernel of type 3 whose segments have no angular rates: shorter ones, at their old places.
pub(crate) fn without_rates(mut bytes: Vec<u8>) -> Vec<u8> {
    for summary in summaries(&bytes) {
        let [first, last] = [32, 36].map(|at| integer(&bytes, summary + at) - 1);
        let packets = count(&bytes, 8 * last);
        for packet in 0..packets {
            let from = 8 * (first + 7 * packet);
            bytes.copy_within(from..from + 32, 8 * (first + 4 * packet));
        }
        bytes.copy_within(
            8 * (first + 7 * packets)..8 * (last + 1),
            8 * (first + 4 * packets),
        );
        let last = i32::try_from(last + 1 - 3 * packets).unwrap();
        bytes[summary + 28..summary + 32].fill(0);
        bytes[summary + 36..summary + 40].copy_from_slice(&last.to_le_bytes());
    }
    bytes
}

/// Changes every packet of `words` doubles of every segment (SPK type 13, CK type 3).
pub(crate) fn change_packets(case: &Case, kernel: &str, words: usize, change: impl Fn(&mut [f64])) {
    let mut bytes = case.read(kernel);
    for summary in summaries(&bytes) {
        let [first, last] = [32, 36].map(|at| integer(&bytes, summary + at) - 1);
        let packets = count(&bytes, 8 * last);
        for packet in 0..packets {
            let at = |word: usize| 8 * (first + words * packet + word);
            let mut values: Vec<f64> = (0..words).map(|word| double(&bytes, at(word))).collect();
            change(&mut values);
            for (word, value) in values.into_iter().enumerate() {
                bytes[at(word)..at(word) + 8].copy_from_slice(&value.to_le_bytes());
            }
        }
    }
    case.write(kernel, bytes);
}
