//! Location of the rows of an image in its file, and the storage of their samples.

use std::{fs::File, io, os::unix::fs::FileExt as _};

use super::error::HrscError;
use crate::{
    image_label::known,
    label::{Entry, Label},
};
use areograph_base::error::{IoError, Result};

/// Bytes of a prefix that are read: time and exposure of the line.
pub(super) const PREFIX_BYTES_MIN: usize = 12;
/// Largest accepted prefix; the archive has 68 bytes.
const PREFIX_BYTES_MAX: u64 = 4_096;
/// Largest accepted number of samples: the pixels of the detector, including the covered ones.
const SAMPLES_MAX: u64 = 5_272;
/// Largest accepted number of lines, as for all images.
const LINES_MAX: u64 = 1_000_000;
/// Largest number of rows by which the byte order is confirmed.
const ROWS_COMPARED: u32 = 32;
/// The byte order is wrong if adjacent samples differ this many times more than in the other order.
const ROUGHER: f64 = 4.0;

/// Storage type of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Number {
    /// 8 bits.
    Byte,
    /// 16 bits with a sign.
    Signed,
    /// 16 bits without one.
    Unsigned,
}

impl Number {
    pub(crate) const fn bytes(self) -> usize {
        match self {
            Self::Byte => 1,
            Self::Signed | Self::Unsigned => 2,
        }
    }
}

/// Rows of one size, each with a prefix before its samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Raster {
    /// First byte of the first row.
    start: u64,
    prefix_bytes: u64,
    pub(crate) lines: u32,
    pub(crate) samples: u32,
    pub(crate) number: Number,
    /// Whether samples have their least significant byte first; prefixes always do.
    pub(crate) is_lsb: bool,
}

impl Raster {
    /// The rows after a label, in a file of this number of bytes; `None` for a detached label, or one that points to
    /// another file.
    ///
    /// # Errors
    /// Missing keywords; values that do not describe such rows; a file that is shorter or longer than they state.
    pub(super) fn of(label: &Label, bytes: u64) -> std::result::Result<Option<Self>, HrscError> {
        let Some(pointer) = label.find("^IMAGE") else {
            return Ok(None);
        };
        // Rows of another file.
        if !pointer
            .value
            .starts_with(|first: char| first.is_ascii_digit())
        {
            return Ok(None);
        }
        let record_bytes = whole(label, "RECORD_BYTES", [1, 1 << 20], "a number of bytes")?;
        let records = |key| whole(label, key, [1, 1 << 32], "a number of records");
        if bytes <= records("LABEL_RECORDS")? * record_bytes {
            return Ok(None);
        }
        let expected = records("FILE_RECORDS")? * record_bytes;
        if bytes != expected {
            return Err(HrscError::Size {
                found: bytes,
                expected,
            });
        }
        let (number, is_lsb) = number(label)?;
        for (key, right) in [("LINE_SUFFIX_BYTES", "0"), ("BANDS", "1")] {
            if let Some(entry) = of_rows(label, key).filter(|entry| entry.value != right) {
                return Err(refused(key, entry, right));
            }
        }
        let prefix = [PREFIX_BYTES_MIN as u64, PREFIX_BYTES_MAX];
        let raster = Self {
            start: start(pointer, record_bytes, bytes)?,
            prefix_bytes: whole(label, "LINE_PREFIX_BYTES", prefix, "68, or at least 12")?,
            lines: short(whole(label, "LINES", [1, LINES_MAX], "a number of lines")?),
            samples: short(whole(
                label,
                "LINE_SAMPLES",
                [1, SAMPLES_MAX],
                "the number of samples per line",
            )?),
            number,
            is_lsb,
        };
        if raster.row_bytes() != record_bytes {
            return Err(HrscError::Raster {
                key: "RECORD_BYTES",
                value: record_bytes.to_string(),
                expected: format!(
                    "{} ({} bytes of prefix and {} samples)",
                    raster.row_bytes(),
                    raster.prefix_bytes,
                    raster.samples
                ),
            });
        }
        let end = raster.row(raster.lines);
        if end != bytes {
            return Err(HrscError::Rows {
                lines: raster.lines,
                row_bytes: raster.row_bytes(),
                start: raster.start,
                end,
                bytes,
            });
        }
        Ok(Some(raster))
    }

    /// Bytes of a row with its prefix.
    pub(super) fn row_bytes(&self) -> u64 {
        self.prefix_bytes + u64::from(self.samples) * self.number.bytes() as u64
    }

    pub(super) const fn prefix_bytes(&self) -> u64 {
        self.prefix_bytes
    }

    /// First byte of a row, which is the first of its prefix.
    pub(super) fn row(&self, line: u32) -> u64 {
        self.start + u64::from(line) * self.row_bytes()
    }

    /// The samples of these lines.
    ///
    /// # Errors
    /// The file cannot be read.
    pub(crate) fn samples_of(
        &self,
        file: &File,
        first_line: u32,
        lines: u32,
    ) -> io::Result<Vec<f64>> {
        let row_bytes = short(self.row_bytes()) as usize;
        let mut buffer = vec![0; lines as usize * row_bytes];
        file.read_exact_at(&mut buffer, self.row(first_line))?;
        let rows = buffer.chunks_exact(row_bytes);
        let samples = rows.flat_map(|row| {
            let samples = &row[short(self.prefix_bytes) as usize..];
            samples.chunks_exact(self.number.bytes())
        });
        Ok(samples.map(|bytes| self.value(bytes)).collect())
    }

    fn value(&self, bytes: &[u8]) -> f64 {
        let word = match (bytes, self.is_lsb) {
            ([low, high], true) | ([high, low], false) => u16::from_le_bytes([*low, *high]),
            (bytes, _) => bytes.first().copied().map_or(0, u16::from),
        };
        match self.number {
            Number::Signed => f64::from(word.cast_signed()),
            Number::Byte | Number::Unsigned => f64::from(word),
        }
    }

    /// Checks that samples of 16 bits are in the byte order that the label states: by their minimum and maximum, where
    /// the label has these and they are decisive; otherwise by the similarity of adjacent samples.
    ///
    /// # Errors
    /// The file cannot be read; samples in the other order.
    pub(super) fn confirm_byte_order(&self, label: &Label, file: &File) -> Result<()> {
        if self.number == Number::Byte {
            return Ok(());
        }
        let other = Self {
            is_lsb: !self.is_lsb,
            ..*self
        };
        let mut orders = [Order::default(), Order::default()];
        let ends = ["MINIMUM", "MAXIMUM"].map(|key| {
            let entry = label.only_in("IMAGE", key).ok()??;
            entry.value.parse::<f64>().ok()
        });
        let rows = self.lines.min(ROWS_COMPARED);
        for row in 0..rows {
            let line = u64::from(row) * u64::from(self.lines) / u64::from(rows);
            for (order, raster) in orders.iter_mut().zip([self, &other]) {
                let samples = raster.samples_of(file, short(line), 1);
                order.add(&samples.map_err(IoError::on("read"))?, ends);
            }
        }
        let [stated, other] = orders;
        let because = match ends {
            [Some(low), Some(high)] if stated.outside == 0 || other.outside == 0 => {
                (stated.outside > 0).then(|| {
                    format!("only the other byte order gives samples from {low} to {high} (MINIMUM, MAXIMUM)")
                })
            }
            _ => (stated.rough > ROUGHER * other.rough).then(|| {
                let times = stated.rough / other.rough.max(f64::MIN_POSITIVE);
                format!("differences of adjacent samples are {times:.0} times as large as in the other byte order")
            }),
        };
        match because {
            None => Ok(()),
            Some(because) => {
                let stated = label.find("SAMPLE_TYPE").map(Entry::written);
                let stated = stated.unwrap_or_default();
                Err(HrscError::ByteOrder { stated, because }.into())
            }
        }
    }
}

/// Statistics of samples in a byte order; zero samples are ignored.
#[derive(Debug, Default, Clone, Copy)]
struct Order {
    /// Samples outside of the label's range.
    outside: u64,
    /// Sum of the differences between neighbours.
    rough: f64,
}

impl Order {
    fn add(&mut self, samples: &[f64], ends: [Option<f64>; 2]) {
        let is_there = |sample: &f64| sample.to_bits() != 0;
        let [low, high] = [ends[0].unwrap_or(f64::MIN), ends[1].unwrap_or(f64::MAX)];
        let outside = samples
            .iter()
            .filter(|sample| is_there(sample) && !(low..=high).contains(*sample));
        self.outside += outside.count() as u64;
        for [sample, next] in samples.array_windows() {
            if is_there(sample) && is_there(next) {
                self.rough += (next - sample).abs();
            }
        }
    }
}

/// First byte of the rows in the file.
fn start(pointer: &Entry, record_bytes: u64, bytes: u64) -> std::result::Result<u64, HrscError> {
    let unit = match pointer.unit.as_deref() {
        Some("bytes") => 1,
        _ => record_bytes,
    };
    let number = pointer.value.parse::<u64>().ok();
    let start = number.and_then(|number| number.checked_sub(1)?.checked_mul(unit));
    start
        .filter(|start| (1..bytes).contains(start))
        .ok_or_else(|| {
            let expected = format!("a record or byte of this file, which has {bytes} bytes");
            refused("^IMAGE", pointer, &expected)
        })
}

/// Storage type of samples, and whether their least significant byte comes first.
fn number(label: &Label) -> std::result::Result<(Number, bool), HrscError> {
    let bits = whole(label, "SAMPLE_BITS", [8, 16], "8 or 16")?;
    let entry = of_rows(label, "SAMPLE_TYPE").ok_or(HrscError::Lacking {
        key: "SAMPLE_TYPE",
        expected: "the type of samples with 8 or 16 bits",
    })?;
    match (bits, &*entry.value.to_ascii_uppercase()) {
        (8, "UNSIGNED_INTEGER" | "MSB_UNSIGNED_INTEGER" | "LSB_UNSIGNED_INTEGER") => {
            Ok((Number::Byte, false))
        }
        (16, "MSB_INTEGER") => Ok((Number::Signed, false)),
        (16, "LSB_INTEGER") => Ok((Number::Signed, true)),
        (16, "MSB_UNSIGNED_INTEGER") => Ok((Number::Unsigned, false)),
        (16, "LSB_UNSIGNED_INTEGER") => Ok((Number::Unsigned, true)),
        _ => {
            let expected =
                format!("MSB_INTEGER, LSB_INTEGER or UNSIGNED_INTEGER for samples of {bits} bits");
            Err(refused("SAMPLE_TYPE", entry, &expected))
        }
    }
}

fn refused(key: &'static str, entry: &Entry, expected: &str) -> HrscError {
    HrscError::Raster {
        key,
        value: entry.written(),
        expected: expected.to_owned(),
    }
}

/// A keyword of the rows: in the object of the image, or outside of all objects.
fn of_rows<'a>(label: &'a Label, key: &str) -> Option<&'a Entry> {
    let mut entries = label.entries.iter();
    entries.find(|entry| matches!(&*entry.group, "" | "IMAGE") && entry.key == key)
}

/// A whole number between two limits, inclusive.
fn whole(
    label: &Label,
    key: &'static str,
    [least, largest]: [u64; 2],
    expected: &'static str,
) -> std::result::Result<u64, HrscError> {
    let entry = of_rows(label, key)
        .filter(|entry| known(entry))
        .ok_or(HrscError::Lacking { key, expected })?;
    let number = entry.value.parse::<u64>().ok();
    number
        .filter(|number| (least..=largest).contains(number))
        .ok_or_else(|| refused(key, entry, expected))
}

/// Conversion of a number that was checked to be small.
fn short(number: u64) -> u32 {
    u32::try_from(number).unwrap_or(u32::MAX)
}
