//! Segments of binary kernels, checked before CSPICE reads the file: CSPICE trusts the counts of a file, and reads
//! beyond its arrays where a count is wrong.
//!
//! Only the lengths, order and finiteness of segments are checked. This is not a kernel reader: CSPICE is the
//! reference.
//!
//! Source: NAIF, DAF Required Reading: file record, summary records, addresses of 8-byte words.

mod contents;
mod layout;
mod neighbours;
mod problem;

use std::{
    fs::File,
    io::{Read, Seek, SeekFrom},
    path::Path,
};

use super::{error::SpiceError, role::KernelRole};
use areograph_base::error::{IoError, Locate, Result};

/// Increased when [`check_contents`] detects more than before: kernels that passed earlier are checked again.
pub(super) const CHECK: u32 = 1;
/// Bytes of a DAF record.
pub(crate) const RECORD_SIZE: usize = 1_024;
/// Bytes of a DAF word.
const WORD_SIZE: usize = 8;
/// Doubles of a segment summary, in all kernels.
const SUMMARY_DOUBLES: usize = 2;
/// Most integers of a segment summary.
const SUMMARY_INTEGERS_MAX: usize = 6;

/// One segment: SPK integers are target, centre, frame, type and two addresses; CK integers are
/// object, frame, type, whether there are rates, and two addresses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Segment {
    /// First instant: ET seconds in an SPK, encoded clock in a CK.
    pub(super) start: f64,
    /// Last instant.
    pub(super) stop: f64,
    /// Integers of the summary, zeros behind the last one.
    pub(super) integers: [i32; SUMMARY_INTEGERS_MAX],
}

/// The content of a segment by the integers of its summary.
#[derive(Debug, Clone, Copy)]
struct Content {
    body: i32,
    kind: i32,
    rates: bool,
    first_word: u64,
    words: usize,
}

impl Segment {
    /// Its content in a kernel of `role`; its addresses have been checked to rise from 1.
    fn content(&self, role: KernelRole) -> Content {
        let [body, _, third, fourth, fifth, sixth] = self.integers;
        let (kind, begin, end) = match role {
            KernelRole::Pck => (third, fourth, fifth),
            KernelRole::Ck => (third, fifth, sixth),
            _ => (fourth, fifth, sixth),
        };
        Content {
            body,
            kind,
            rates: fourth != 0,
            first_word: u64::from(begin.unsigned_abs()),
            words: end.abs_diff(begin) as usize + 1,
        }
    }
}

/// The segments of a binary kernel, in file order; later ones win.
///
/// # Errors
/// [`SpiceError::DamagedKernel`] when the file is shorter than it states or its list is broken.
pub(super) fn segments(path: &Path) -> Result<Vec<Segment>> {
    let mut reader = Reader::open(path)?;
    reader.segments().in_file(path)
}

/// Checks that the words of every segment agree with the counts of the segment, and are finite and in order.
///
/// # Errors
/// [`SpiceError::DamagedKernel`] with the segment and the problem.
pub(super) fn check_contents(path: &Path, role: KernelRole) -> Result<()> {
    let mut reader = Reader::open(path)?;
    let segments = reader.segments().in_file(path)?;
    for (index, segment) in segments.iter().enumerate() {
        contents::check(&mut reader, role, segment)
            .map_err(|problem| {
                let Content { body, kind, .. } = segment.content(role);
                let segment = format!("segment {} ({role} of {body}, type {kind})", index + 1);
                problem.of(&segment)
            })
            .in_file(path)?;
    }
    Ok(())
}

/// A count, which segments hold as a double.
fn whole(value: f64) -> Option<usize> {
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "whole, positive and below 2^31"
    )]
    (value >= 0.0 && value <= f64::from(i32::MAX) && value.fract().abs() < f64::EPSILON)
        .then_some(value as usize)
}

struct Reader {
    file: File,
    size: u64,
    big_endian: bool,
}

impl Reader {
    fn open(path: &Path) -> Result<Self> {
        let file = File::open(path)
            .map_err(IoError::on("open kernel"))
            .in_file(path)?;
        let size = file
            .metadata()
            .map_err(IoError::on("read size of kernel"))
            .in_file(path)?
            .len();
        Ok(Self {
            file,
            size,
            big_endian: false,
        })
    }

    /// Record `number`, counted from 1.
    fn record(&mut self, number: u64) -> Result<[u8; RECORD_SIZE]> {
        let offset = (number - 1).saturating_mul(RECORD_SIZE as u64);
        if offset.saturating_add(RECORD_SIZE as u64) > self.size {
            return Err(damaged(format!(
                "record {number} lies beyond the end of the file ({} bytes)",
                self.size
            )));
        }
        let mut record = [0; RECORD_SIZE];
        self.file
            .seek(SeekFrom::Start(offset))
            .and_then(|_| self.file.read_exact(&mut record))
            .map_err(IoError::on("read kernel"))?;
        Ok(record)
    }

    /// `count` words from word `first` on, counted from 1.
    fn words(&mut self, first: u64, count: usize) -> Result<Vec<f64>> {
        let mut bytes = vec![0; count * WORD_SIZE];
        self.file
            .seek(SeekFrom::Start((first - 1) * WORD_SIZE as u64))
            .and_then(|_| self.file.read_exact(&mut bytes))
            .map_err(IoError::on("read kernel"))?;
        let (words, _) = bytes.as_chunks::<WORD_SIZE>();
        let double = |word: &[u8; WORD_SIZE]| {
            if self.big_endian {
                f64::from_be_bytes(*word)
            } else {
                f64::from_le_bytes(*word)
            }
        };
        Ok(words.iter().map(double).collect())
    }

    fn integer(&self, record: &[u8; RECORD_SIZE], offset: usize) -> i32 {
        let mut bytes = [0; 4];
        bytes.copy_from_slice(&record[offset..offset + 4]);
        if self.big_endian {
            i32::from_be_bytes(bytes)
        } else {
            i32::from_le_bytes(bytes)
        }
    }

    fn double(&self, record: &[u8; RECORD_SIZE], word: usize) -> f64 {
        let mut bytes = [0; WORD_SIZE];
        bytes.copy_from_slice(&record[word * WORD_SIZE..(word + 1) * WORD_SIZE]);
        if self.big_endian {
            f64::from_be_bytes(bytes)
        } else {
            f64::from_le_bytes(bytes)
        }
    }

    fn segments(&mut self) -> Result<Vec<Segment>> {
        let header = self.record(1)?;
        self.big_endian = match &header[88..96] {
            b"LTL-IEEE" => false,
            b"BIG-IEEE" => true,
            other => {
                let format = String::from_utf8_lossy(other).into_owned();
                return Err(damaged(format!(
                    "number format \"{format}\"; expected LTL-IEEE or BIG-IEEE"
                )));
            }
        };
        let doubles = self.integer(&header, 8);
        let integers = usize::try_from(self.integer(&header, 12)).unwrap_or(0);
        if doubles != 2 || !(5..=SUMMARY_INTEGERS_MAX).contains(&integers) {
            return Err(damaged(format!(
                "segment summaries of {doubles} doubles and {integers} integers; expected 2 doubles and 5 or 6 integers"
            )));
        }
        let first_free_word = i64::from(self.integer(&header, 84));
        let bytes_needed = (first_free_word - 1) * 8;
        if !u64::try_from(bytes_needed).is_ok_and(|needed| needed <= self.size) {
            return Err(damaged(format!(
                "the file has {} bytes; its file record states {bytes_needed} bytes",
                self.size
            )));
        }
        let first_summary_record = self.integer(&header, 76);
        self.walk(first_summary_record, integers, first_free_word)
    }

    /// Follows the chain of summary records, each at most once.
    fn walk(&mut self, first: i32, integers: usize, first_free_word: i64) -> Result<Vec<Segment>> {
        let words_each = SUMMARY_DOUBLES + integers.div_ceil(2);
        let summaries_max = (RECORD_SIZE / WORD_SIZE - 3) / words_each;
        let mut found = Vec::new();
        let mut next = f64::from(first);
        let mut records_left = self.size / RECORD_SIZE as u64;
        // Zero ends the chain; every other number must be a record's.
        while next.abs() > 0.0 || next.is_nan() {
            if !(next >= 1.0 && next.fract().abs() < f64::EPSILON) {
                return Err(damaged(format!(
                    "the summary records continue at record {next}; expected a whole number"
                )));
            }
            if records_left == 0 {
                return Err(damaged("the summary records form a cycle".to_owned()));
            }
            records_left -= 1;
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a whole number from 1; too large a number saturates and lies beyond the end of the file"
            )]
            let record = self.record(next as u64)?;
            let count = self.double(&record, 2);
            if !(0.0..=summaries_max as f64).contains(&count) {
                return Err(damaged(format!(
                    "a summary record states {count} segments; expected at most {summaries_max}"
                )));
            }
            let summaries = (0..summaries_max).take_while(|index| (*index as f64) < count);
            for word in summaries.map(|index| 3 + index * words_each) {
                found.push(self.summary(&record, word, integers, first_free_word)?);
            }
            next = self.double(&record, 0);
        }
        Ok(found)
    }

    fn summary(
        &self,
        record: &[u8; RECORD_SIZE],
        word: usize,
        integers: usize,
        first_free_word: i64,
    ) -> Result<Segment> {
        let mut segment = Segment {
            start: self.double(record, word),
            stop: self.double(record, word + 1),
            integers: [0; SUMMARY_INTEGERS_MAX],
        };
        let first_integer = (word + SUMMARY_DOUBLES) * WORD_SIZE;
        for (index, slot) in segment.integers.iter_mut().take(integers).enumerate() {
            *slot = self.integer(record, first_integer + 4 * index);
        }
        let (begin, end) = (
            segment.integers[integers - 2],
            segment.integers[integers - 1],
        );
        let addresses_fit = 1 <= begin && begin <= end && i64::from(end) < first_free_word;
        // Written so that NaN is rejected too; an infinite time is not a valid end of a segment either.
        let ordered = segment.start <= segment.stop;
        let finite = segment.start.is_finite() && segment.stop.is_finite();
        if !(addresses_fit && ordered && finite) {
            return Err(damaged(format!(
                "a segment from {} to {} at words {begin} to {end}; the first free word is {first_free_word}",
                segment.start, segment.stop
            )));
        }
        Ok(segment)
    }
}

fn damaged(problem: String) -> areograph_base::error::Error {
    SpiceError::DamagedKernel { problem }.into()
}
