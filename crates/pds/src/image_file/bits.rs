//! Bits of a byte from the least significant one up, as all coders of the camera pack them.

/// Reads bits in sequence; zeros follow the end.
#[derive(Debug, Clone)]
pub(super) struct Bits<'a> {
    bytes: &'a [u8],
    /// The next bit, counted from the start.
    at: usize,
}

impl<'a> Bits<'a> {
    pub(super) const fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// The next bits, at least 57, without consuming them.
    #[inline]
    pub(super) fn peek(&self) -> u64 {
        let byte = self.at >> 3;
        let whole = self.bytes.get(byte..byte + 8);
        let word = match whole.and_then(|eight| eight.try_into().ok()) {
            Some(eight) => u64::from_le_bytes(eight),
            None => self.last_word(byte),
        };
        word >> (self.at & 7)
    }

    #[cold]
    fn last_word(&self, byte: usize) -> u64 {
        let rest = self.bytes.get(byte..).unwrap_or_default();
        let rest = rest.iter().take(8).rev();
        rest.fold(0, |word, byte| word << 8 | u64::from(*byte))
    }

    #[inline]
    pub(super) const fn skip(&mut self, count: u32) {
        self.at += count as usize;
    }

    /// A number of `count` bits, 16 at most, its least significant bit first.
    #[allow(
        clippy::cast_possible_truncation,
        reason = "the mask leaves at most 16 bits"
    )]
    pub(super) fn number(&mut self, count: u32) -> u16 {
        let value = self.peek() & ((1 << count) - 1);
        self.skip(count);
        value as u16
    }

    /// Bytes consumed, including the current one.
    pub(super) const fn bytes_used(&self) -> usize {
        self.at.div_ceil(8)
    }

    /// Whether more bits were consumed than exist.
    pub(super) const fn is_beyond_end(&self) -> bool {
        self.at > self.bytes.len() * 8
    }
}

/// Writes bits in the order in which [`Bits`] reads them.
#[derive(Debug, Default)]
pub(super) struct BitWriter {
    bytes: Vec<u8>,
    /// Bits not yet in `bytes`, and their number.
    pending: (u64, u32),
}

impl BitWriter {
    /// Appends `count` bits, 32 at most; the least significant goes first.
    pub(super) fn push(&mut self, bits: u32, count: u32) {
        let (word, filled) = self.pending;
        let (mut word, mut filled) = (word | u64::from(bits) << filled, filled + count);
        while filled >= 8 {
            self.bytes.push(word.to_le_bytes()[0]);
            word >>= 8;
            filled -= 8;
        }
        self.pending = (word, filled);
    }

    /// Fills the last byte with zeros.
    pub(super) fn align(&mut self) {
        let (_, filled) = self.pending;
        if filled > 0 {
            self.push(0, 8 - filled);
        }
    }

    /// All bytes, the last one filled with zeros.
    pub(super) fn finish(mut self) -> Vec<u8> {
        self.align();
        self.bytes
    }

    /// The bytes so far, to which whole bytes may be added after [`align`](Self::align).
    pub(super) const fn bytes(&mut self) -> &mut Vec<u8> {
        &mut self.bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_and_zeros_follow() {
        let numbers = [(5, 3), (1, 1), (0xBEEF, 16), (0, 7), (1023, 10)];
        let mut writer = BitWriter::default();
        for (number, count) in numbers {
            writer.push(number, count);
        }
        let bytes = writer.finish();
        let mut bits = Bits::new(&bytes);
        for (number, count) in numbers {
            assert_eq!(u32::from(bits.number(count)), number);
        }
        assert_eq!((bits.bytes_used(), bits.is_beyond_end()), (5, false));
        assert_eq!(bits.number(16), 0);
        assert!(bits.is_beyond_end());
    }
}
