//! Faults of an image file, with their location.

use std::fmt;

/// A fault; the rest of the image is read nevertheless.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Complaint {
    /// Number of the fragment, counted from 0 as in its header; `None` for a label or a plain raster.
    pub fragment: Option<u16>,
    /// Byte of the file, counted from 0.
    pub offset: u64,
    /// First affected image line, counted from 0, if known.
    pub line: Option<u32>,
    /// The fault.
    pub what: Fault,
}

/// Kinds of faults.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Fault {
    /// The sum of the object's bytes differs from the label's CHECKSUM.
    LabelChecksum {
        /// Value in the label.
        label: u32,
        /// Their sum, each byte unsigned.
        sum: u32,
    },
    /// Label and fragments disagree: one of them belongs to another image.
    Contradiction {
        /// Keyword of the label.
        key: &'static str,
        /// Value in the label.
        label: String,
        /// Value in the fragments.
        fragment: String,
    },
    /// The checksum of header, data and checksum byte of a fragment is wrong.
    FragmentChecksum,
    /// An invalid header, or one of another image.
    Header {
        /// Bytes up to the next valid header.
        skipped: u64,
    },
    /// Fragments missing in the file.
    Lost {
        /// Number of fragments.
        fragments: u16,
    },
    /// A duplicate of an earlier fragment.
    Repeated,
    /// The file ends within the fragment.
    CutOff {
        /// Missing data bytes.
        lacking: u64,
    },
    /// No fragment is marked as the last.
    NoLast,
    /// The uncompressed line expected here is missing.
    LostSync {
        /// Byte of the file where the next one was found; `None` if there is none.
        next: Option<u64>,
    },
    /// More fragments than 16-bit numbers can count.
    TooMany,
    /// More lines than the data can belong to.
    TooManyLines {
        /// Lines stated in the header.
        header: u32,
        /// Lines used.
        possible: u32,
    },
    /// The header of a fragment states more pixels than its data can hold.
    TooLarge,
    /// A block of the transform coder in an undefined group.
    Group,
    /// The data of a transform fragment end before its last block.
    Short,
    /// Fewer lines than the header states.
    Lines {
        /// Lines found.
        found: u32,
        /// Lines stated in the header.
        header: u32,
    },
}

impl fmt::Display for Complaint {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(fragment) = self.fragment {
            write!(formatter, "fragment {fragment}, ")?;
        }
        write!(formatter, "byte {}", self.offset)?;
        if let Some(line) = self.line {
            write!(formatter, ", line {line}")?;
        }
        write!(formatter, ": {}", self.what)
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::LabelChecksum { label, sum } => write!(
                formatter,
                "the label's CHECKSUM is 16#{label:08X}#; the bytes from here on add up to 16#{sum:08X}# (unsigned)"
            ),
            Self::Contradiction {
                key,
                label,
                fragment,
            } => write!(
                formatter,
                "the label states {key} = {label}; the fragments state {fragment}"
            ),
            Self::FragmentChecksum => formatter
                .write_str("the checksum byte is wrong; lines of the fragment may also be wrong"),
            Self::Header { skipped } => write!(
                formatter,
                "no fragment header of this image; {skipped} bytes were skipped"
            ),
            Self::Lost { fragments: 1 } => formatter.write_str("the preceding fragment is missing"),
            Self::Lost { fragments } => {
                write!(formatter, "the {fragments} preceding fragments are missing")
            }
            Self::Repeated => formatter.write_str("this fragment is a duplicate and is ignored"),
            Self::CutOff { lacking } => write!(
                formatter,
                "the file ends within the fragment; {lacking} bytes are missing"
            ),
            Self::NoLast => {
                formatter.write_str("the file ends here, and no fragment is marked as the last")
            }
            Self::LostSync { next: Some(next) } => write!(
                formatter,
                "expected an uncompressed line here; the next one is at byte {next}"
            ),
            Self::LostSync { next: None } => formatter
                .write_str("expected an uncompressed line here or later; the image ends here"),
            Self::TooMany => {
                formatter.write_str("more than 65536 fragments; the others are ignored")
            }
            Self::TooManyLines { header, possible } => write!(
                formatter,
                "the header states {header} lines, more than the data can contain; {possible} lines are used"
            ),
            Self::TooLarge => formatter.write_str(
                "the header states more pixels than the data can contain; the fragment is ignored",
            ),
            Self::Group => {
                formatter.write_str("a block of an undefined group; the fragment is ignored")
            }
            Self::Short => formatter.write_str("the data end before the last block"),
            Self::Lines { found, header } => {
                write!(formatter, "{found} lines found; the header states {header}")
            }
        }
    }
}

/// Complaints kept with their location; all are counted.
const KEPT: usize = 1_000;

/// Complaints about a file; the first thousand are kept.
#[derive(Debug, Clone, Default)]
pub struct Complaints {
    kept: Vec<Complaint>,
    count: u64,
}

impl Complaints {
    pub(super) fn push(&mut self, complaint: Complaint) {
        self.count += 1;
        if self.kept.len() < KEPT {
            self.kept.push(complaint);
        }
    }

    /// The first thousand complaints.
    #[must_use]
    pub fn kept(&self) -> &[Complaint] {
        &self.kept
    }

    /// Total number of complaints.
    #[must_use]
    pub const fn count(&self) -> u64 {
        self.count
    }
}
