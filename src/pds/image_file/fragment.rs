//! On-board fragments of a `.imq` file: their headers, and what is left of them in a damaged file.

use std::{fs::File, io, os::unix::fs::FileExt as _};

use super::complaint::{Complaint, Complaints, Fault};

/// Bytes of a header.
pub(super) const HEADER: usize = 62;
/// Data bytes of a full fragment: the on-board buffer is cut so.
pub(super) const FULL: u64 = 245_760;
/// Fragments that their 16-bit numbers can count.
const MOST: usize = 1 << 16;
/// Bytes read at a time.
const CHUNK: usize = 1 << 16;

/// How the first header says that pixels are coded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coding {
    /// One byte a pixel.
    Raw,
    /// Residuals from a predicted pixel, in a prefix code.
    Predictive {
        /// What predicts a pixel.
        predictor: Predictor,
        /// Code of the residuals, 0 to 7.
        table: u8,
    },
    /// Quantised coefficients of blocks of 16 × 16 pixels.
    Transform {
        /// Which transform.
        transform: Transform,
        /// Groups of blocks with tables of their own, 1 to 8.
        groups: u8,
        /// Step of the quantiser.
        spacing: u16,
    },
}

/// What predicts a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Predictor {
    /// The pixel to its left.
    X,
    /// The pixel above.
    Y,
    /// The pixel above, and the difference of those to the left.
    Xy,
}

/// A transform of blocks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Transform {
    /// Walsh–Hadamard.
    Walsh,
    /// Cosines.
    Cosine,
}

/// Size and coding of an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    /// Lines that were exposed, as the first header says; of a plain raster those of the label.
    pub lines: u32,
    /// Samples of a line.
    pub samples: u32,
    /// How pixels are coded; none of a plain raster without fragments.
    pub coding: Option<Coding>,
    /// Fragments in the file.
    pub fragments: u32,
}

/// What a header says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Header {
    bytes: [u8; HEADER],
}

impl Header {
    pub(super) const fn new(bytes: [u8; HEADER]) -> Self {
        Self { bytes }
    }

    const fn two(&self, at: usize) -> u16 {
        u16::from_le_bytes([self.bytes[at], self.bytes[at + 1]])
    }

    const fn number(&self) -> u16 {
        self.two(2)
    }

    /// Lines of the whole image.
    pub(super) fn total_lines(&self) -> u32 {
        u32::from(self.two(40)) * 16
    }

    /// Samples of a line.
    pub(super) fn width(&self) -> u32 {
        u32::from(self.bytes[43]) * 16
    }

    const fn data_bytes(&self) -> u32 {
        u32::from_le_bytes([
            self.bytes[58],
            self.bytes[59],
            self.bytes[60],
            self.bytes[61],
        ])
    }

    /// `None` for a predictor and a transform at once, or a transform that there is not.
    pub(super) const fn coding(&self) -> Option<Coding> {
        let (kind, table) = (self.bytes[44], self.bytes[45]);
        let predictor = match kind & 3 {
            0 => None,
            1 => Some(Predictor::X),
            2 => Some(Predictor::Y),
            _ => Some(Predictor::Xy),
        };
        let transform = match kind >> 2 & 3 {
            0 => None,
            1 => Some(Transform::Walsh),
            2 => Some(Transform::Cosine),
            _ => return None,
        };
        match (predictor, transform) {
            (None, None) => Some(Coding::Raw),
            (Some(predictor), None) if table & 15 < 8 => Some(Coding::Predictive {
                predictor,
                table: table & 15,
            }),
            (None, Some(transform)) => Some(Coding::Transform {
                transform,
                groups: (table >> 5) + 1,
                spacing: self.two(48),
            }),
            _ => None,
        }
    }

    fn is_possible(&self) -> bool {
        self.width() > 0
            && self.total_lines() > 0
            && self.data_bytes() > 0
            && self.coding().is_some()
    }

    /// What all fragments of an image have in common: identifier, clock, size and coding.
    fn is_of_image(&self, first: &Self) -> bool {
        [0..2, 8..13, 40..50]
            .into_iter()
            .all(|range| self.bytes[range.clone()] == first.bytes[range])
            && self.data_bytes() > 0
    }
}

/// What the label tells of the headers.
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
            && self.clock.is_none_or(|clock| header.bytes[8..13] == clock)
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
    /// Data bytes behind the header, those that are there.
    pub(super) data_bytes: u64,
    /// First line and number of lines, true of transform fragments.
    pub(super) first_line: u32,
    pub(super) lines: u32,
    /// Whether everything adds up.
    pub(super) is_sound: bool,
    /// Fragments that are lost before it.
    pub(super) lost_before: u16,
}

/// The fragments of a file.
#[derive(Debug)]
pub(super) struct Fragments {
    pub(super) first: Header,
    pub(super) all: Vec<Fragment>,
    /// Whether the last one is there.
    pub(super) has_last: bool,
}

/// A file that is walked through.
struct Walk<'a> {
    file: &'a File,
    end: u64,
}

impl Walk<'_> {
    fn header(&self, at: u64) -> io::Result<Option<Header>> {
        let mut bytes = [0; HEADER];
        if at + HEADER as u64 > self.end {
            return Ok(None);
        }
        self.file.read_exact_at(&mut bytes, at)?;
        Ok(Some(Header::new(bytes)))
    }

    /// The first header from `from` on that is as wanted.
    fn find(&self, from: u64, wanted: &dyn Fn(&Header) -> bool) -> io::Result<Option<u64>> {
        let mut bytes = vec![0; CHUNK + HEADER];
        let mut at = from;
        while at + (HEADER as u64) <= self.end {
            let length = usize::try_from(self.end - at).unwrap_or(usize::MAX);
            let length = length.min(bytes.len());
            self.file.read_exact_at(&mut bytes[..length], at)?;
            let mut places = bytes[..length].windows(HEADER);
            let is_wanted = |window: &[u8]| {
                // No image has clock seconds of zero: padding is passed over quickly.
                window[9..13] != [0; 4]
                    && window
                        .try_into()
                        .is_ok_and(|bytes| wanted(&Header::new(bytes)))
            };
            if let Some(place) = places.position(is_wanted) {
                return Ok(Some(at + place as u64));
            }
            at += (length - HEADER + 1) as u64;
        }
        Ok(None)
    }

    /// Whether `bytes` from `at` on add up to all ones, carries added at the low end.
    fn adds_up(&self, at: u64, bytes: u64) -> io::Result<bool> {
        let (sum, _) = byte_sum(self.file, at, bytes)?;
        Ok(sum > 0 && sum % 255 == 0)
    }

    /// Whether a fragment that ends at `at` may end there.
    fn may_end(&self, at: u64, first: &Header) -> io::Result<bool> {
        Ok(match self.header(at)? {
            Some(next) => next.is_of_image(first) || next.bytes == [0; HEADER],
            None => at <= self.end,
        })
    }
}

/// The sum of bytes, each unsigned, and how many are 128 or more.
pub(super) fn byte_sum(file: &File, at: u64, bytes: u64) -> io::Result<(u64, u64)> {
    let mut chunk = vec![0; CHUNK];
    let (mut sum, mut high, mut done) = (0, 0, 0);
    while done < bytes {
        let length = usize::try_from(bytes - done).map_or(CHUNK, |rest| rest.min(CHUNK));
        file.read_exact_at(&mut chunk[..length], at + done)?;
        // A chunk of 2^16 bytes stays below 2^24.
        let of_chunk: u32 = chunk[..length].iter().map(|byte| u32::from(*byte)).sum();
        let high_of_chunk: u32 = chunk[..length]
            .iter()
            .map(|byte| u32::from(byte >> 7))
            .sum();
        sum += u64::from(of_chunk);
        high += u64::from(high_of_chunk);
        done += length as u64;
    }
    Ok((sum, high))
}

impl Fragments {
    /// Walks through the fragments between bytes `start` and `end`; `None` when there is not even one.
    pub(super) fn find(
        file: &File,
        [start, end]: [u64; 2],
        expected: Expected,
        complaints: &mut Complaints,
    ) -> io::Result<Option<Self>> {
        let walk = Walk { file, end };
        let Some(at) = first(&walk, start, expected)? else {
            return Ok(None);
        };
        let Some(first) = walk.header(at)? else {
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
        };
        fragments.walk(&walk, at, complaints)?;
        Ok(Some(fragments))
    }

    fn walk(&mut self, walk: &Walk<'_>, start: u64, complaints: &mut Complaints) -> io::Result<()> {
        let mut at = start;
        while let Some(header) = walk.header(at)? {
            let after = at + (HEADER as u64) + u64::from(header.data_bytes()) + 1;
            if !header.is_of_image(&self.first)
                && (header.data_bytes() == 0 || !walk.may_end(after, &self.first)?)
            {
                let next = walk.find(at, &|header| header.is_of_image(&self.first))?;
                let Some(next) = next else {
                    break;
                };
                let skipped = next - at;
                complaints.push(complaint(None, at, Fault::Header { skipped }));
                at = next;
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

    /// Takes the fragment at `at`; where the next one begins, and whether this is the last.
    fn take(
        &mut self,
        walk: &Walk<'_>,
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
        let is_whole = data + stated < walk.end;
        // A sum alone is right by chance once in 255 times.
        let is_sound = is_whole
            && walk.adds_up(at, HEADER as u64 + stated + 1)?
            && walk.may_end(data + stated + 1, &self.first)?;
        let mut number = header.number();
        let mut next = data + stated + 1;
        if !is_sound {
            number = expected;
            if !walk.may_end(next, &self.first)? {
                // Its length is wrong, or the file ends here.
                let found = walk.find(data, &|header| header.is_of_image(&self.first))?;
                next = found.unwrap_or(walk.end.min(next));
                if found.is_none() && !is_whole {
                    let lacking = data + stated + 1 - walk.end;
                    complaints.push(complaint(Some(number), at, Fault::CutOff { lacking }));
                }
            }
            if is_whole {
                complaints.push(complaint(Some(number), at, Fault::FragmentChecksum));
            }
        }
        let is_last = header.bytes[13] & 2 != 0
            && (is_sound
                || !walk
                    .header(next)?
                    .is_some_and(|next| next.is_of_image(&self.first)));
        if number < expected {
            complaints.push(complaint(Some(number), at, Fault::Repeated));
            return Ok((next, false));
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

    /// Whether anything is wrong with them.
    pub(super) fn are_sound(&self) -> bool {
        self.has_last
            && self
                .all
                .iter()
                .all(|fragment| fragment.is_sound && fragment.lost_before == 0)
    }
}

/// Where the first header stands that can be believed.
fn first(walk: &Walk<'_>, start: u64, expected: Expected) -> io::Result<Option<u64>> {
    if let Some(header) = walk.header(start)?
        && header.is_possible()
    {
        let bytes = HEADER as u64 + u64::from(header.data_bytes()) + 1;
        if expected.holds(&header) || (start + bytes <= walk.end && walk.adds_up(start, bytes)?) {
            return Ok(Some(start));
        }
    }
    walk.find(start, &|header| expected.holds(header))
}

fn complaint(fragment: Option<u16>, offset: u64, what: Fault) -> Complaint {
    Complaint {
        fragment,
        offset,
        line: None,
        what,
    }
}
