//! An open image file: its label, location and coding of its pixels.

use std::{
    fs::File,
    io::{self, Read as _},
    path::{Path, PathBuf},
};

use super::{
    complaint::{Complaint, Complaints, Fault},
    contradiction::{clock_bytes, contradictions},
    fragment::{Expected, Fragments, Layout},
    strips::Strips,
    walk::byte_sum,
};
use crate::{
    image_label::ImageLabel,
    label::{LABEL_BYTES_MAX, Label, LabelError, parse},
    moc::image_label,
};
use areograph_base::{
    error::{Cause, IoError, Locate as _, Result},
    instruments::Instrument,
};

/// A file without a readable image.
#[derive(Debug, thiserror::Error, Cause)]
#[non_exhaustive]
#[cause(Input)]
pub enum ImageFileError {
    /// A label without an image, or of another object.
    #[error("the label describes no image in this file: {lacking} is missing")]
    #[cause("give an .imq or .img archive file, which contains label and pixels")]
    NoImage {
        /// The missing part.
        lacking: &'static str,
    },
    /// A pointer beyond the file.
    #[error(
        "^IMAGE is {pointer:?}; expected a record or byte of this file, which has {bytes} bytes"
    )]
    #[cause("fetch the file again: it is truncated or damaged")]
    Pointer {
        /// As it was written.
        pointer: String,
        /// Size of the file.
        bytes: u64,
    },
    /// A raster of a different kind.
    #[error("{key} is {value:?}; expected {expected}")]
    #[cause("give an .imq or .img archive file with 8 bits per pixel")]
    Raster {
        /// The keyword.
        key: &'static str,
        /// Its value.
        value: String,
        /// Expected value.
        expected: &'static str,
    },
    /// No fragment.
    #[error("no fragment of this image at byte {offset} or later")]
    #[cause(like = Pointer)]
    NoFragment {
        /// Expected location of the first one.
        offset: u64,
    },
}

/// An image file whose label has been read and whose fragments have been found.
#[derive(Debug)]
pub struct ImageFile {
    path: PathBuf,
    entries: Label,
    label: ImageLabel,
    layout: Layout,
    /// First byte of the pixels or fragments, and the end of the file.
    span: [u64; 2],
    fragments: Option<Fragments>,
    contradictions: Vec<Complaint>,
    complaints: Complaints,
}

impl ImageFile {
    /// Opens a `.imq` or `.img` file of one of `cameras`.
    ///
    /// # Errors
    /// The file cannot be read; a label that is missing, truncated, of another instrument, or without an image in this
    /// file; no fragment.
    pub fn open(path: &Path, cameras: &[Instrument]) -> Result<Self> {
        let mut file = File::open(path)
            .map_err(IoError::on("open"))
            .in_file(path)?;
        let mut bytes = Vec::new();
        let mut start = (&mut file).take(LABEL_BYTES_MAX as u64);
        start
            .read_to_end(&mut bytes)
            .map_err(IoError::on("read"))
            .in_file(path)?;
        let entries = parse(&bytes).in_file(path)?;
        if !entries.ended {
            return Err(LabelError::NoEnd).in_file(path);
        }
        let label = image_label(&entries, cameras).in_file(path)?;
        let end = file
            .metadata()
            .map_err(IoError::on("read"))
            .in_file(path)?
            .len();
        let span = [start_of_image(&entries, end).in_file(path)?, end];
        let mut complaints = Complaints::default();
        let sum = check_sum(&file, &entries, span, &mut complaints);
        sum.map_err(IoError::on("read")).in_file(path)?;
        let mut image = Self {
            path: path.to_owned(),
            layout: plain_layout(&entries, &label).in_file(path)?,
            entries,
            label,
            span,
            fragments: None,
            contradictions: Vec::new(),
            complaints,
        };
        if image.value("ENCODING_TYPE").is_some() {
            image.find_fragments(&file).in_file(path)?;
        }
        Ok(image)
    }

    fn find_fragments(&mut self, file: &File) -> Result<()> {
        let clock = self.label.fields.sclk_start.as_deref();
        let expected = Expected {
            clock: clock.and_then(clock_bytes),
            width: self.label.fields.samples,
        };
        let found = Fragments::find(file, self.span, expected, &mut self.complaints);
        let fragments = found.map_err(IoError::on("read"))?;
        let offset = self.span[0];
        let fragments = fragments.ok_or(ImageFileError::NoFragment { offset })?;
        self.contradictions = contradictions(&self.label, &fragments);
        for contradiction in &self.contradictions {
            self.complaints.push(contradiction.clone());
        }
        let header = fragments.first.total_lines();
        let possible = fragments.lines_possible();
        if let Some(possible) = possible {
            self.complaints.push(Complaint {
                fragment: None,
                offset,
                line: None,
                what: Fault::TooManyLines { header, possible },
            });
        }
        self.layout = Layout {
            lines: possible.unwrap_or(header),
            samples: fragments.first.width(),
            coding: fragments.first.coding(),
            fragments: u32::try_from(fragments.all.len()).unwrap_or(u32::MAX),
            gain_changes: fragments.first.gain_changes(),
        };
        self.fragments = Some(fragments);
        Ok(())
    }

    /// Path of the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Times, size and camera from the label.
    #[must_use]
    pub const fn label(&self) -> &ImageLabel {
        &self.label
    }

    /// The value of a keyword (upper case) of the label, in any object.
    #[must_use]
    pub fn value(&self, key: &str) -> Option<&str> {
        self.entries.find(key).map(|entry| entry.value.as_str())
    }

    /// Size and coding.
    #[must_use]
    pub const fn layout(&self) -> Layout {
        self.layout
    }

    /// Contradictions between label and fragments; these are also complaints.
    #[must_use]
    pub fn contradictions(&self) -> &[Complaint] {
        &self.contradictions
    }

    /// Whether the file has fragments and none of them is missing; they may be damaged.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.fragments.as_ref().is_some_and(Fragments::are_complete)
    }

    /// Faults found before any pixel was decoded.
    #[must_use]
    pub const fn complaints(&self) -> &Complaints {
        &self.complaints
    }

    /// The image from its first line on, in strips.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn strips(&self) -> Result<Strips> {
        let open = || {
            let file = File::open(&self.path).map_err(IoError::on("open"))?;
            Strips::new(file, self.layout, self.span, self.fragments.as_ref())
                .map_err(IoError::on("read"))
        };
        open().in_file(&self.path)
    }
}

/// Byte of the file where pixels or fragments begin.
fn start_of_image(label: &Label, end: u64) -> std::result::Result<u64, ImageFileError> {
    let lacking = |lacking| ImageFileError::NoImage { lacking };
    let pointer = label.find("^IMAGE").ok_or(lacking("^IMAGE"))?;
    let wrong = || ImageFileError::Pointer {
        pointer: pointer.written(),
        bytes: end,
    };
    let number: u64 = pointer.value.parse().map_err(|_| wrong())?;
    let record_bytes = if pointer.unit.as_deref() == Some("bytes") {
        1
    } else {
        let entry = label.find("RECORD_BYTES").ok_or(lacking("RECORD_BYTES"))?;
        entry.value.parse().map_err(|_| ImageFileError::Raster {
            key: "RECORD_BYTES",
            value: entry.written(),
            expected: "a number of bytes",
        })?
    };
    let start = number
        .checked_sub(1)
        .and_then(|before| before.checked_mul(record_bytes));
    start
        .filter(|start| (1..end).contains(start))
        .ok_or_else(wrong)
}

/// The size in the label; checks that pixels are bytes.
fn plain_layout(label: &Label, image: &ImageLabel) -> std::result::Result<Layout, ImageFileError> {
    for (key, is_right, expected) in [
        ("SAMPLE_BITS", "8", "8"),
        ("LINE_PREFIX_BYTES", "0", "0"),
        ("LINE_SUFFIX_BYTES", "0", "0"),
    ] {
        if let Some(entry) = label.find(key)
            && entry.value != is_right
        {
            let value = entry.written();
            return Err(ImageFileError::Raster {
                key,
                value,
                expected,
            });
        }
    }
    let lacking = |lacking| ImageFileError::NoImage { lacking };
    Ok(Layout {
        lines: image.fields.lines_header.ok_or(lacking("LINES"))?,
        samples: image.fields.samples.ok_or(lacking("LINE_SAMPLES"))?,
        coding: None,
        fragments: 0,
        gain_changes: 0,
    })
}

/// Compares the bytes of the image with the label's CHECKSUM: their sum modulo 2^32, each byte signed or (in older
/// labels) unsigned.
fn check_sum(
    file: &File,
    label: &Label,
    [start, end]: [u64; 2],
    complaints: &mut Complaints,
) -> io::Result<()> {
    let stated = label.find("CHECKSUM").and_then(|entry| {
        let digits = entry.value.strip_prefix("16#")?.strip_suffix('#')?;
        u32::from_str_radix(digits, 16).ok()
    });
    let Some(stated) = stated else {
        return Ok(());
    };
    let (sum, high) = byte_sum(file, start, end - start)?;
    // As a signed number, a byte of 128 or more is 256 less.
    let signed = sum.wrapping_sub(high << 8);
    let low = |sum: u64| u32::try_from(sum & 0xFFFF_FFFF).unwrap_or_default();
    if stated != low(sum) && stated != low(signed) {
        complaints.push(Complaint {
            fragment: None,
            offset: start,
            line: None,
            what: Fault::LabelChecksum {
                label: stated,
                sum: low(sum),
            },
        });
    }
    Ok(())
}
