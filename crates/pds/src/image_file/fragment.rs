//! On-board fragments of a `.imq` file: their headers, and the remaining ones in a damaged file.

use std::{fs::File, io};

use super::{
    coding::Coding,
    complaint::{Complaint, Complaints, Fault},
    header::{Header, Witness},
    walk::{HEADER, Walk},
};

/// Data bytes of a full fragment, the size of the on-board buffer.
pub(super) const FULL: u64 = 245_760;
/// Largest accepted ratio of the size of an image to the size of its remaining data: an archived image has at most
/// about 50 fragments.
const LOST_MAX: u64 = 64;
/// Fragments that their 16-bit numbers can count.
const MOST: usize = 1 << 16;
/// Largest accepted number of data bytes of a fragment; archived ones have 245,760.
const DATA_BYTES_MAX: u64 = 1 << 22;

/// Size and coding of an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    /// Exposed lines, as stated in the first header if its data can belong to that many; for a plain raster the lines
    /// of the label.
    pub lines: u32,
    /// Samples of a line.
    pub samples: u32,
    /// Coding of the pixels; `None` for a plain raster without fragments.
    pub coding: Option<Coding>,
    /// Fragments in the file.
    pub fragments: u32,
    /// Changes of gain and offset within the image, as stated in the first header; 0 for a plain raster, which does not
    /// state them.
    pub gain_changes: u16,
}

/// Header values expected from the label.
#[derive(Debug, Clone, Copy)]
pub(super) struct Expected {
    /// Start of the image: ticks, and seconds least significant byte first.
    pub(super) clock: Option<[u8; 5]>,
    /// Samples of a line.
    pub(super) width: Option<u32>,
}

impl Expected {
    fn holds(&self, header: &Header) -> bool {
        header.is_possible()
            && self.clock.is_none_or(|clock| header.clock() == clock)
            && self.width.is_none_or(|width| header.width() == width)
            && (self.clock.is_some() || self.width.is_some())
    }
}

/// A fragment in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Fragment {
    pub(super) number: u16,
    /// Byte of the file where its header begins.
    pub(super) at: u64,
    /// Number of data bytes that follow the header in the file.
    pub(super) data_bytes: u64,
    /// First line and number of lines; valid for transform fragments.
    pub(super) first_line: u32,
    pub(super) lines: u32,
    /// Whether its checksum is correct.
    pub(super) is_sound: bool,
    /// Missing fragments before it.
    pub(super) lost_before: u16,
}

/// The fragments of a file.
#[derive(Debug)]
pub(super) struct Fragments {
    pub(super) first: Header,
    pub(super) all: Vec<Fragment>,
    /// Whether the last fragment is in the file.
    pub(super) has_last: bool,
    /// The first sound header.
    pub(super) witness: Option<Witness>,
}

impl Fragments {
    /// Walks through the fragments between bytes `start` and `end`; `None` without any fragment.
    pub(super) fn find(
        file: &File,
        [start, end]: [u64; 2],
        expected: Expected,
        complaints: &mut Complaints,
    ) -> io::Result<Option<Self>> {
        let mut walk = Walk::new(file, end);
        let Some(at) = first(&mut walk, start, expected)? else {
            return Ok(None);
        };
        let Some(first) = header(&walk, at)? else {
            return Ok(None);
        };
        if at > start {
            complaints.push(complaint(
                None,
                start,
                Fault::Header {
                    skipped: at - start,
                },
            ));
        }
        let mut fragments = Self {
            first,
            all: Vec::new(),
            has_last: false,
            witness: None,
        };
        fragments.walk(&mut walk, at, complaints)?;
        Ok(Some(fragments))
    }

    fn walk(
        &mut self,
        walk: &mut Walk<'_>,
        start: u64,
        complaints: &mut Complaints,
    ) -> io::Result<()> {
        let mut at = start;
        while let Some(header) = header(walk, at)? {
            let after = at + (HEADER as u64) + u64::from(header.data_bytes()) + 1;
            if !header.is_of_image(&self.first)
                && (header.data_bytes() == 0 || !may_end(walk, after, &self.first)?)
            {
                let first = self.first;
                let next = walk.find(at, &|bytes| Header::new(*bytes).is_of_image(&first))?;
                if next.is_none() && header.bytes == [0; HEADER] {
                    break;
                }
                let skipped = next.unwrap_or(walk.end()) - at;
                complaints.push(complaint(None, at, Fault::Header { skipped }));
                at += skipped;
                continue;
            }
            if self.all.len() == MOST {
                complaints.push(complaint(None, at, Fault::TooMany));
                break;
            }
            let (next, is_end) = self.take(walk, at, &header, complaints)?;
            at = next;
            if is_end {
                self.has_last = true;
                return Ok(());
            }
        }
        complaints.push(complaint(None, at, Fault::NoLast));
        Ok(())
    }

    /// Reads the fragment at `at`; returns the start of the next one, and whether this is the last.
    fn take(
        &mut self,
        walk: &mut Walk<'_>,
        at: u64,
        header: &Header,
        complaints: &mut Complaints,
    ) -> io::Result<(u64, bool)> {
        let data = at + HEADER as u64;
        let stated = u64::from(header.data_bytes());
        let expected = self
            .all
            .last()
            .map_or(0, |before| before.number.wrapping_add(1));
        let is_whole = data + stated < walk.end();
        let mut next = data + stated + 1;
        // A sum is correct by chance once in 255 times. It is tested last, so that summed bytes are not read again.
        let ends_well = stated <= DATA_BYTES_MAX && may_end(walk, next, &self.first)?;
        let is_sound = is_whole && ends_well && walk.adds_up(at, HEADER as u64 + stated + 1)?;
        let mut number = header.number();
        if !is_sound {
            number = expected;
            if !ends_well {
                // Its length is wrong, or the file ends here.
                let first = self.first;
                let found = walk.find(data, &|bytes| Header::new(*bytes).is_of_image(&first))?;
                next = found.unwrap_or(walk.end().min(next));
                if found.is_none() && !is_whole {
                    let lacking = data + stated + 1 - walk.end();
                    complaints.push(complaint(Some(number), at, Fault::CutOff { lacking }));
                }
            }
            if is_whole {
                complaints.push(complaint(Some(number), at, Fault::FragmentChecksum));
            }
        }
        let is_last = header.bytes[13] & 2 != 0
            && (is_sound
                || !self::header(walk, next)?.is_some_and(|next| next.is_of_image(&self.first)));
        if number < expected {
            complaints.push(complaint(Some(number), at, Fault::Repeated));
            return Ok((next, false));
        }
        if is_sound && self.witness.is_none() && header.is_of_image(&self.first) {
            let header = *header;
            self.witness = Some(Witness { number, at, header });
        }
        let lost_before = number - expected;
        if lost_before > 0 {
            let fragments = lost_before;
            complaints.push(complaint(Some(number), at, Fault::Lost { fragments }));
        }
        let there = next.saturating_sub(data);
        self.all.push(Fragment {
            number,
            at,
            data_bytes: if is_whole {
                there.saturating_sub(1)
            } else {
                there
            },
            first_line: u32::from(header.two(4)) * 16,
            lines: u32::from(header.two(6)) * 16,
            is_sound,
            lost_before,
        });
        Ok((next, is_last && is_whole))
    }

    /// Lines to which these fragments can belong if all but one in [`LOST_MAX`] were lost; `None` if that includes the
    /// number in the header.
    pub(super) fn lines_possible(&self) -> Option<u32> {
        let bytes: u64 = self.all.iter().map(|fragment| fragment.data_bytes).sum();
        let of_byte = self.first.coding().map_or(1, Coding::pixels_of_byte);
        let pixels = bytes.saturating_mul(of_byte * LOST_MAX);
        // Whole blocks of the transform coder.
        let lines = 16 * (pixels / u64::from(self.first.width())).div_ceil(16).max(1);
        let lines = u32::try_from(lines).ok();
        lines.filter(|lines| *lines < self.first.total_lines())
    }

    /// Whether no fragment is missing.
    pub(super) fn are_complete(&self) -> bool {
        self.has_last && self.all.iter().all(|fragment| fragment.lost_before == 0)
    }

    /// Whether all fragments are sound.
    pub(super) fn are_sound(&self) -> bool {
        self.are_complete() && self.all.iter().all(|fragment| fragment.is_sound)
    }
}

/// Whether a fragment can end at `at`.
fn may_end(walk: &Walk<'_>, at: u64, first: &Header) -> io::Result<bool> {
    Ok(match header(walk, at)? {
        Some(next) => next.is_of_image(first) || next.bytes == [0; HEADER],
        None => at <= walk.end(),
    })
}

fn header(walk: &Walk<'_>, at: u64) -> io::Result<Option<Header>> {
    Ok(walk.header(at)?.map(Header::new))
}

/// Location of the first plausible header.
fn first(walk: &mut Walk<'_>, start: u64, expected: Expected) -> io::Result<Option<u64>> {
    if let Some(header) = header(walk, start)?
        && header.is_possible()
    {
        let bytes = HEADER as u64 + u64::from(header.data_bytes()) + 1;
        let is_there = bytes <= DATA_BYTES_MAX && start + bytes <= walk.end();
        if expected.holds(&header) || (is_there && walk.adds_up(start, bytes)?) {
            return Ok(Some(start));
        }
    }
    walk.find(start, &|bytes| expected.holds(&Header::new(*bytes)))
}

fn complaint(fragment: Option<u16>, offset: u64, what: Fault) -> Complaint {
    Complaint {
        fragment,
        offset,
        line: None,
        what,
    }
}
