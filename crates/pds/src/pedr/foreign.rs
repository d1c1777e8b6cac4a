//! Files that resemble a PEDR: compressed, byte-swapped, text; and the start of records.

use std::fmt;

use super::{FieldGuard, LABEL_RECORDS, RECORD_BYTES, Record};

/// Actual kind of a file without a valid record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Foreign {
    /// Compressed by gzip.
    Gzip,
    /// Integers with the least significant byte first.
    LittleEndian,
    /// Text in place of records.
    Text,
}

impl Foreign {
    /// The kind of a file by its first bytes and its first data record.
    pub(super) fn of(bytes: &[u8], first: Option<&Record>) -> Option<Self> {
        if bytes.starts_with(&[0x1f, 0x8b]) {
            return Some(Self::Gzip);
        }
        let bytes = first?.to_bytes();
        if is_swapped(&bytes) {
            return Some(Self::LittleEndian);
        }
        let text = |byte: &u8| matches!(byte, b' '..=b'~' | b'\r' | b'\n' | b'\t');
        let blank = bytes.iter().all(u8::is_ascii_whitespace);
        (bytes.iter().all(text) && !blank).then_some(Self::Text)
    }

    /// Advice for the user.
    pub(super) const fn advice(self) -> &'static str {
        match self {
            Self::Gzip => "decompress it (gunzip), and name the resulting file",
            Self::LittleEndian => {
                "fetch the archive file: PEDR records are big-endian, but a program swapped the bytes of this file"
            }
            Self::Text => "fetch the binary PEDR (AP#####v.B) of the same orbits",
        }
    }
}

impl fmt::Display for Foreign {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Gzip => "the file is compressed with gzip; expected records of 776 bytes",
            Self::LittleEndian => "the records are little-endian; expected big-endian records",
            Self::Text => "the file contains text, like an ASCII PEDR; expected binary records",
        })
    }
}

/// Whether both times and the clock frequency of a record are plausible with swapped bytes.
fn is_swapped(bytes: &[u8; RECORD_BYTES]) -> bool {
    let field = |at: usize| {
        let mut four = [0; 4];
        four.copy_from_slice(&bytes[at..at + 4]);
        four
    };
    let mut eight = [0; 8];
    eight.copy_from_slice(&bytes[552..560]);
    let mut swapped = Record::from_bytes(&[0; RECORD_BYTES]);
    swapped.time_whole_s.set(i32::from_le_bytes(field(0)));
    swapped.time_fraction_us.set(i32::from_le_bytes(field(4)));
    swapped.time_s.set(f64::from_le_bytes(eight));
    swapped
        .clock_frequency_hz
        .set(u32::from_le_bytes(field(644)));
    swapped.check_time().is_ok()
}

/// Records of the label: ten, unless valid records begin earlier, where the label states or at the start.
pub(super) fn label_records(
    bytes: &[u8],
    stated: Option<usize>,
    mapping: bool,
    guard: FieldGuard,
) -> usize {
    let records = Record::slice_of(bytes);
    let begins_at = |records_of_label: &usize| {
        let first = records.get(*records_of_label);
        first.is_some_and(|record| record.check(mapping, guard).is_ok())
    };
    let earlier = stated.filter(|stated| *stated < LABEL_RECORDS);
    [Some(0), earlier]
        .into_iter()
        .flatten()
        .find(begins_at)
        .unwrap_or(LABEL_RECORDS)
}
