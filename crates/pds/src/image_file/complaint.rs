//! What is wrong with an image file, and where.

use std::fmt;

/// One thing that is wrong; the rest of the image is read all the same.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Complaint {
    /// Number of the fragment, counted from 0 as its header does; none of a label or a plain raster.
    pub fragment: Option<u16>,
    /// Byte of the file, counted from 0.
    pub offset: u64,
    /// First image line that it concerns, counted from 0, where that is known.
    pub line: Option<u32>,
    /// What it is.
    pub what: Fault,
}

/// What can be wrong.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Fault {
    /// Bytes of the object do not add up to the label's CHECKSUM.
    LabelChecksum {
        /// What the label says.
        label: u32,
        /// Their sum, each byte unsigned.
        sum: u32,
    },
    /// Label and fragments do not say the same: the label is of another image, or the fragments are.
    Contradiction {
        /// Keyword of the label.
        key: &'static str,
        /// What the label says.
        label: String,
        /// What the fragments say.
        fragment: String,
    },
    /// Header, data and checksum byte of a fragment do not add up.
    FragmentChecksum,
    /// A header that is none, or of another image.
    Header {
        /// Bytes up to the next header that is one.
        skipped: u64,
    },
    /// Fragments that are not in the file.
    Lost {
        /// How many.
        fragments: u16,
    },
    /// A fragment that stood in the file before.
    Repeated,
    /// The file ends within the fragment.
    CutOff {
        /// Data bytes that are not there.
        lacking: u64,
    },
    /// No fragment says that it is the last.
    NoLast,
    /// The line that should stand here uncompressed does not.
    LostSync {
        /// Byte of the file where the next one was found; none when there is none.
        next: Option<u64>,
    },
    /// More fragments than their numbers can count.
    TooMany,
    /// More lines than what is there can be a part of.
    TooManyLines {
        /// Lines of the header.
        header: u32,
        /// Lines that are believed.
        possible: u32,
    },
    /// The header of a fragment tells of more pixels than its data can hold.
    TooLarge,
    /// A block of the transform coder of a group that there is not.
    Group,
    /// The data of a transform fragment end before its blocks do.
    Short,
    /// Fewer lines than the header tells.
    Lines {
        /// Lines found.
        found: u32,
        /// Lines of the header.
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
            Self::FragmentChecksum => {
                formatter.write_str("the checksum byte is wrong; its lines may be wrong too")
            }
            Self::Header { skipped } => write!(
                formatter,
                "no fragment header of this image; {skipped} bytes were skipped"
            ),
            Self::Lost { fragments: 1 } => formatter.write_str("the preceding fragment is missing"),
            Self::Lost { fragments } => {
                write!(formatter, "the {fragments} preceding fragments are missing")
            }
            Self::Repeated => formatter.write_str("this fragment is a duplicate; it is ignored"),
            Self::CutOff { lacking } => write!(
                formatter,
                "the file ends within the fragment; {lacking} bytes are missing"
            ),
            Self::NoLast => {
                formatter.write_str("the file ends here, and no fragment is marked as the last")
            }
            Self::LostSync { next: Some(next) } => write!(
                formatter,
                "no uncompressed line where one is expected; the next one is at byte {next}"
            ),
            Self::LostSync { next: None } => formatter.write_str(
                "no uncompressed line where one is expected, nor later; the image ends here",
            ),
            Self::TooMany => formatter.write_str("more than 65536 fragments; the rest is ignored"),
            Self::TooManyLines { header, possible } => write!(
                formatter,
                "{header} lines in the header, more than the data can hold; {possible} are used"
            ),
            Self::TooLarge => {
                formatter.write_str("more pixels than the data can hold; the fragment is ignored")
            }
            Self::Group => formatter
                .write_str("a block of a group that does not exist; the fragment is ignored"),
            Self::Short => formatter.write_str("the data end before the last block"),
            Self::Lines { found, header } => {
                write!(formatter, "{found} lines found; the header states {header}")
            }
        }
    }
}

/// Complaints that are kept with their place; all are counted.
const KEPT: usize = 1_000;

/// Complaints of a file, as many as anybody reads.
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

    /// The first thousand.
    #[must_use]
    pub fn kept(&self) -> &[Complaint] {
        &self.kept
    }

    /// How many there are in all.
    #[must_use]
    pub const fn count(&self) -> u64 {
        self.count
    }
}
