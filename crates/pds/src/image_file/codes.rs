//! Prefix codes of the coders: code words of residuals and coefficients.

use std::{collections::BTreeMap, sync::LazyLock};

use super::bits::Bits;

/// Escape of the transform coder: 15 bits of a large negative value follow.
pub(super) const LARGE_NEGATIVE: i16 = i16::MIN;
/// Escape of the transform coder: 15 bits of a large positive value follow.
pub(super) const LARGE_POSITIVE: i16 = i16::MAX;

/// Bits that are looked up at once.
const SHORT: u32 = 10;
/// Bits of the longest code word.
const LONGEST: u32 = 24;

/// Entry of the lookup table.
#[derive(Debug, Clone, Copy)]
enum Short {
    /// A value and the length of its code word.
    Value(i16, u32),
    /// The code word continues at this node.
    Longer(usize),
}

/// Branch of the code tree for one bit.
#[derive(Debug, Clone, Copy)]
enum Branch {
    Node(usize),
    Leaf(i16),
}

/// A complete prefix code.
#[derive(Debug)]
pub(super) struct Code {
    /// Indexed by the next [`SHORT`] bits.
    short: Vec<Short>,
    /// Indexed by the next bit.
    nodes: Vec<[Branch; 2]>,
    /// Code word of each value, first bit least significant, and its length.
    words: BTreeMap<i16, (u32, u32)>,
}

/// Codes 0 to 7 of residuals modulo 256: 0 is 8 plain bits.
pub(super) static RESIDUALS: LazyLock<Vec<Code>> = LazyLock::new(|| {
    let plain = (0..256_u32).map(|value| {
        let value = value.to_le_bytes()[0];
        (i16::from(value), u32::from(value), 8)
    });
    let mut codes = vec![Code::of_words(plain.collect())];
    codes.extend(written(include_str!("residual_codes.txt")));
    codes
});

/// Codes 0 to 7 of quantised coefficients.
pub(super) static COEFFICIENTS: LazyLock<Vec<Code>> =
    LazyLock::new(|| written(include_str!("coefficient_codes.txt")));

/// Parses the codes of a table: `name:` begins a code, `[n]` gives the word length of the following values, and words
/// are consecutive binary fractions.
fn written(table: &str) -> Vec<Code> {
    let codes = table.split(':').skip(1).map(|text| {
        let (mut fraction, mut length, mut words) = (0_u32, 0, Vec::new());
        for token in text.split_whitespace() {
            let number = token.trim_matches(['[', ']']).parse::<i16>().ok();
            match (token, number) {
                (_, Some(number)) if token.starts_with('[') => {
                    length = u32::from(number.unsigned_abs());
                }
                ("N" | "P", _) | (_, Some(_)) => {
                    let value = match token {
                        "N" => LARGE_NEGATIVE,
                        "P" => LARGE_POSITIVE,
                        _ => number.unwrap_or_default(),
                    };
                    let word = (fraction >> (LONGEST - length)).reverse_bits() >> (32 - length);
                    words.push((value, word, length));
                    fraction += 1 << (LONGEST - length);
                }
                // The name of the next code.
                _ => {}
            }
        }
        Code::of_words(words)
    });
    codes.collect()
}

impl Code {
    fn of_words(words: Vec<(i16, u32, u32)>) -> Self {
        let mut nodes = vec![[Branch::Leaf(0); 2]];
        for (value, word, length) in &words {
            let mut node = 0;
            for place in 0..*length {
                let bit = (word >> place & 1) as usize;
                if place + 1 == *length {
                    nodes[node][bit] = Branch::Leaf(*value);
                } else if let Branch::Node(next) = nodes[node][bit] {
                    node = next;
                } else {
                    nodes[node][bit] = Branch::Node(nodes.len());
                    node = nodes.len();
                    nodes.push([Branch::Leaf(0); 2]);
                }
            }
        }
        let walk = |bits: u64| {
            let mut node = 0;
            for length in 1..=SHORT {
                match nodes[node][(bits >> (length - 1) & 1) as usize] {
                    Branch::Leaf(value) => return Short::Value(value, length),
                    Branch::Node(next) => node = next,
                }
            }
            Short::Longer(node)
        };
        let short = (0..1 << SHORT).map(walk).collect();
        let words = words.into_iter();
        Self {
            short,
            nodes,
            words: words
                .map(|(value, word, length)| (value, (word, length)))
                .collect(),
        }
    }

    /// The next value.
    #[inline]
    pub(super) fn next(&self, bits: &mut Bits<'_>) -> i16 {
        let word = bits.peek();
        match self.short[(word & ((1 << SHORT) - 1)) as usize] {
            Short::Value(value, length) => {
                bits.skip(length);
                value
            }
            Short::Longer(node) => self.long(node, word, bits),
        }
    }

    fn long(&self, mut node: usize, word: u64, bits: &mut Bits<'_>) -> i16 {
        for length in SHORT + 1..=LONGEST {
            match self.nodes[node][(word >> (length - 1) & 1) as usize] {
                Branch::Leaf(value) => {
                    bits.skip(length);
                    return value;
                }
                Branch::Node(next) => node = next,
            }
        }
        // A complete code ends within its longest word.
        bits.skip(LONGEST);
        0
    }

    /// Code word of a value, first bit least significant, and its length; `None` for a value without one.
    pub(super) fn word(&self, value: i16) -> Option<(u32, u32)> {
        self.words.get(&value).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image_file::bits::BitWriter;

    /// All codes with their numbers of values.
    fn codes() -> Vec<(&'static Code, usize)> {
        let residuals = RESIDUALS.iter().zip([256, 256, 256, 256, 256, 256, 256, 7]);
        let coefficients = [25, 47, 69, 109, 169, 247, 395, 609];
        residuals
            .chain(COEFFICIENTS.iter().zip(coefficients))
            .collect()
    }

    #[test]
    fn every_code_is_complete_and_reads_what_it_writes() {
        assert_eq!((RESIDUALS.len(), COEFFICIENTS.len()), (8, 8));
        for (code, values) in codes() {
            assert_eq!(code.words.len(), values);
            let filled: u32 = code
                .words
                .values()
                .map(|word| 1 << (LONGEST - word.1))
                .sum();
            assert_eq!(filled, 1 << LONGEST);
            let mut writer = BitWriter::default();
            for value in code.words.keys() {
                let (bits, length) = code.word(*value).unwrap();
                writer.push(bits, length);
            }
            let bytes = writer.finish();
            let mut bits = Bits::new(&bytes);
            for value in code.words.keys() {
                assert_eq!(code.next(&mut bits), *value);
            }
        }
    }

    #[test]
    fn words_begin_with_their_first_branch() {
        let word = |value| RESIDUALS[1].word(value).unwrap();
        assert_eq!((word(0), word(1), word(-1)), ((0, 1), (1, 3), (3, 2)));
    }
}
