//! The predictive coder: blocks of 128 lines, the first of each uncompressed after a mark.

use std::io;

use super::{
    bits::Bits,
    codes::{Code, RESIDUALS},
    coding::Predictor,
    stream::Stream,
};

/// Lines of a block.
pub(super) const BLOCK_LINES: u32 = 128;
/// Mark before an uncompressed line.
pub(super) const MARK: [u8; 2] = [0xCA, 0xF0];
/// Largest difference between adjacent pixels of an uncompressed line in a search ...
const STEP_MAX: u8 = 64;
/// ... over this number of pixels.
const STEPS: usize = 31;
/// Bits of the longest code word.
const WORD_BITS: usize = 15;

/// The blocks of a stream, one after the other.
#[derive(Debug)]
pub(super) struct Blocks {
    predictor: Predictor,
    code: &'static Code,
    width: usize,
    lines_max: u32,
    /// Lines decoded so far.
    lines: u32,
    /// Position where the next mark is due.
    due: u64,
    /// Position of the last mark.
    last: Option<u64>,
}

/// Lines from one mark to the next.
#[derive(Debug)]
pub(super) struct Block {
    pub(super) pixels: Vec<u8>,
    /// Position in the stream where each line ends.
    pub(super) ends: Vec<u64>,
    /// Position of its mark, and the position where it was due when it was searched for.
    pub(super) mark: u64,
    pub(super) due: Option<u64>,
}

impl Blocks {
    pub(super) fn new(predictor: Predictor, table: u8, width: u32, lines_max: u32) -> Self {
        Self {
            predictor,
            code: &RESIDUALS[usize::from(table & 7)],
            width: width as usize,
            lines_max,
            lines: 0,
            due: 0,
            last: None,
        }
    }

    /// Position where a mark was due that is neither there nor anywhere later.
    pub(super) const fn due(&self) -> u64 {
        self.due
    }

    /// Whether all lines stated in the header were decoded.
    pub(super) const fn are_all(&self) -> bool {
        self.lines == self.lines_max
    }

    /// The next block; `None` at the end.
    pub(super) fn next(&mut self, stream: &mut Stream) -> io::Result<Option<Block>> {
        if self.are_all() {
            return Ok(None);
        }
        let (mut mark, due) = (self.due, self.due);
        let head = stream.window(due, 2 + self.width)?;
        if head.len() < 2 + self.width || !head.starts_with(&MARK) {
            let from = self.last.map_or(0, |last| last + 2);
            match self.search(stream, from)? {
                Some(found) => mark = found,
                None => return Ok(None),
            }
        }
        let lines = BLOCK_LINES.min(self.lines_max - self.lines) as usize;
        let coded = (lines - 1) * self.width * WORD_BITS / 8 + 8;
        let bytes = stream.window(mark, 2 + self.width + coded)?;
        let mut block = Block {
            pixels: Vec::with_capacity(lines * self.width),
            ends: Vec::with_capacity(lines),
            mark,
            due: (mark != due).then_some(due),
        };
        let (plain, coded) = bytes.split_at(bytes.len().min(2 + self.width));
        block.pixels.extend_from_slice(&plain[2..]);
        let start = mark + plain.len() as u64;
        block.ends.push(start);
        let mut bits = Bits::new(coded);
        for _ in 1..lines {
            self.line(&mut bits, &mut block.pixels);
            if bits.is_beyond_end() {
                break;
            }
            block.ends.push(start + bits.bytes_used() as u64);
        }
        block.pixels.truncate(block.ends.len() * self.width);
        self.lines += u32::try_from(block.ends.len()).unwrap_or(BLOCK_LINES);
        self.last = Some(mark);
        let end = start + bits.bytes_used() as u64;
        self.due = end + (end & 1);
        Ok(Some(block))
    }

    /// Appends a line, predicted from the last one of `pixels`.
    fn line(&self, bits: &mut Bits<'_>, pixels: &mut Vec<u8>) {
        let from = pixels.len();
        pixels.resize(from + self.width, 0);
        let (before, line) = pixels.split_at_mut(from);
        let above = &before[from - self.width..];
        let mut residual = || self.code.next(bits).to_le_bytes()[0];
        match self.predictor {
            Predictor::X => {
                let mut left = 0_u8;
                for pixel in line {
                    left = left.wrapping_add(residual());
                    *pixel = left;
                }
            }
            Predictor::Y => {
                for (pixel, above) in line.iter_mut().zip(above) {
                    *pixel = above.wrapping_add(residual());
                }
            }
            Predictor::Xy => {
                let mut difference = 0_u8;
                for (pixel, above) in line.iter_mut().zip(above) {
                    difference = difference.wrapping_add(residual());
                    *pixel = above.wrapping_add(difference);
                }
            }
        }
    }

    /// The next mark followed by a plausible line.
    fn search(&self, stream: &mut Stream, from: u64) -> io::Result<Option<u64>> {
        const STRIDE: usize = 1 << 16;
        let behind = (2 + self.width).max(2 + STEPS + 1);
        let mut at = from;
        loop {
            let bytes = stream.window(at, STRIDE + behind)?;
            if bytes.len() < behind {
                return Ok(None);
            }
            let places = bytes.len() - behind + 1;
            let found = (0..places).find(|place| {
                bytes[*place..].starts_with(&MARK)
                    && is_smooth(&bytes[place + 2..][..=STEPS.min(self.width - 1)])
            });
            if let Some(place) = found {
                return Ok(Some(at + place as u64));
            }
            at += places as u64;
        }
    }
}

fn is_smooth(pixels: &[u8]) -> bool {
    pixels
        .windows(2)
        .all(|pair| pair[0].abs_diff(pair[1]) <= STEP_MAX)
}
