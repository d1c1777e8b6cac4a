//! An image at full size and repeatedly halved, with access to windows. It is kept in a temporary file, so that memory
//! holds only a strip and some lines of each level.

use std::{fs::File, io, ops::Range, os::unix::fs::FileExt as _};

use super::PixelFile;
use crate::image_file::LineState;
use areograph_base::error::{IoError, Result};
use areograph_geom::imaging::Patch;

/// Halvings of an image: a pixel of the last level is 64 of the first along each axis.
const LEVELS: usize = 7;

/// Pixels between two lines of a window that cost less to read than a further call of the system.
const READ_AT_ONCE: usize = 2_048;

/// An image with its halvings.
#[derive(Debug)]
pub struct Pyramid {
    file: File,
    levels: Vec<Level>,
    /// Whether a pixel of 0 is missing.
    zero_is_none: bool,
}

/// The image at one size.
#[derive(Debug)]
struct Level {
    /// Start of its pixels in the file.
    at: u64,
    size: [usize; 2],
    /// Whether each line is as transmitted.
    is_good: Vec<bool>,
    /// The line that waits for the next one.
    waiting: Option<(Vec<u8>, bool)>,
    lines_written: usize,
}

impl Pyramid {
    /// Decodes all of an image. Missing or suspect lines are treated as missing, and 0 is a number only in archived
    /// files.
    ///
    /// # Errors
    /// The image cannot be read, or a temporary file cannot be written.
    pub fn of(image: &PixelFile) -> Result<Self> {
        let mut strips = image.strips()?;
        let size = [image.lines() as usize, image.samples() as usize];
        let file = tempfile::tempfile().map_err(IoError::on("make a temporary file"))?;
        let mut pyramid = Self {
            file,
            levels: levels(size),
            zero_is_none: image.archive().is_none(),
        };
        while let Some(strip) = strips.next_strip()? {
            for (pixels, state) in strip.lines() {
                let is_good = *state == LineState::Good;
                pyramid
                    .add(0, pixels, is_good)
                    .map_err(IoError::on("write a temporary file"))?;
            }
        }
        Ok(pyramid)
    }

    /// Adds a line to a level, and the mean of two to the next one.
    fn add(&mut self, number: usize, pixels: &[u8], is_good: bool) -> io::Result<()> {
        let Some(level) = self.levels.get_mut(number) else {
            return Ok(());
        };
        if level.lines_written == level.size[0] {
            return Ok(());
        }
        let pixels = &pixels[..level.size[1].min(pixels.len())];
        let at = level.at + (level.lines_written * level.size[1]) as u64;
        self.file.write_all_at(pixels, at)?;
        level.is_good[level.lines_written] = is_good;
        level.lines_written += 1;
        match level.waiting.take() {
            None => {
                level.waiting = Some((pixels.to_vec(), is_good));
                Ok(())
            }
            Some((above, above_is_good)) => {
                let zero_is_none = self.zero_is_none;
                let halved: Vec<u8> = above
                    .chunks_exact(2)
                    .zip(pixels.chunks_exact(2))
                    .map(|(above, below)| {
                        let four = || above.iter().chain(below).copied();
                        if zero_is_none && four().any(|pixel| pixel == 0) {
                            return 0;
                        }
                        let sum: u16 = four().map(u16::from).sum();
                        u8::try_from((sum + 2) / 4).unwrap_or(u8::MAX)
                    })
                    .collect();
                self.add(number + 1, &halved, is_good && above_is_good)
            }
        }
    }

    /// Number of halvings of the image.
    #[must_use]
    pub fn halvings(&self) -> usize {
        self.levels.len() - 1
    }

    /// Lines and samples at a level; level 0 is the image itself, each further one half as large.
    #[must_use]
    pub fn size(&self, level: usize) -> [usize; 2] {
        self.levels[level.min(self.halvings())].size
    }

    /// The longest run without a missing line among these lines of the image.
    #[must_use]
    pub fn longest_good(&self, lines: Range<usize>) -> Range<usize> {
        let is_good = &self.levels[0].is_good;
        let end = lines.end.min(is_good.len());
        let (mut longest, mut start) = (lines.start..lines.start, lines.start);
        let known = is_good.iter().enumerate().take(end).skip(lines.start);
        for (line, is_good) in known {
            if !is_good {
                start = line + 1;
            } else if line + 1 - start > longest.len() {
                longest = start..line + 1;
            }
        }
        longest
    }

    /// The rectangle of a level with this first line and sample; the part beyond the image is left out. `None` if it is
    /// empty, or if lines or pixels are missing.
    ///
    /// # Errors
    /// The temporary file cannot be read.
    pub fn window(&self, level: usize, first: [i64; 2], size: [usize; 2]) -> Result<Option<Patch>> {
        let level = &self.levels[level.min(self.halvings())];
        let span = |axis: usize| -> Option<(usize, usize)> {
            let end = first[axis].checked_add_unsigned(size[axis] as u64)?;
            let end = usize::try_from(end).ok()?.min(level.size[axis]);
            let start = usize::try_from(first[axis].max(0)).ok()?;
            (start < end).then_some((start, end))
        };
        let (Some((top, bottom)), Some((left, right))) = (span(0), span(1)) else {
            return Ok(None);
        };
        if !level.is_good[top..bottom].iter().all(|is_good| *is_good) {
            return Ok(None);
        }
        let bytes = self.bytes(level, [&(top..bottom), &(left..right)])?;
        if self.zero_is_none && bytes.contains(&0) {
            return Ok(None);
        }
        Ok(Some(Patch {
            first: [top, left].map(|first| i64::try_from(first).unwrap_or(i64::MAX)),
            size: [bottom - top, right - left],
            values: bytes.into_iter().map(f32::from).collect(),
        }))
    }

    /// These lines and samples of a level, with NaN where lines or pixels are missing.
    ///
    /// # Errors
    /// The temporary file cannot be read.
    pub fn window_with_gaps(&self, level: usize, spans: [&Range<usize>; 2]) -> Result<Patch> {
        let level = &self.levels[level.min(self.halvings())];
        let [lines, samples] = [0, 1].map(|axis| {
            let end = spans[axis].end.min(level.size[axis]);
            spans[axis].start.min(end)..end
        });
        let bytes = self.bytes(level, [&lines, &samples])?;
        let mut values = Vec::with_capacity(bytes.len());
        let rows = bytes.chunks_exact(samples.len().max(1));
        for (line, row) in lines.clone().zip(rows) {
            let is_good = level.is_good[line];
            values.extend(row.iter().map(|byte| match *byte {
                0 if self.zero_is_none => f32::NAN,
                byte if is_good => f32::from(byte),
                _ => f32::NAN,
            }));
        }
        Ok(Patch {
            first: [&lines, &samples].map(|span| i64::try_from(span.start).unwrap_or(i64::MAX)),
            size: [lines.len(), samples.len()],
            values,
        })
    }

    /// Pixels of existing lines and samples.
    fn bytes(&self, level: &Level, [lines, samples]: [&Range<usize>; 2]) -> Result<Vec<u8>> {
        let width = level.size[1];
        let at = |line: usize| level.at + (line * width + samples.start) as u64;
        let read = |bytes: &mut [u8], line: usize| {
            let read = self.file.read_exact_at(bytes, at(line));
            read.map_err(IoError::on("read a temporary file"))
        };
        let Some(between) = lines.len().checked_sub(1) else {
            return Ok(Vec::new());
        };
        if width - samples.len() <= READ_AT_ONCE {
            let mut bytes = vec![0; between * width + samples.len()];
            read(&mut bytes, lines.start)?;
            for line in 1..lines.len() {
                bytes.copy_within(
                    line * width..line * width + samples.len(),
                    line * samples.len(),
                );
            }
            bytes.truncate(lines.len() * samples.len());
            return Ok(bytes);
        }
        let mut bytes = vec![0; lines.len() * samples.len()];
        let rows = bytes.chunks_exact_mut(samples.len().max(1));
        for (line, row) in lines.clone().zip(rows) {
            read(row, line)?;
        }
        Ok(bytes)
    }
}

fn levels(mut size: [usize; 2]) -> Vec<Level> {
    let mut levels: Vec<Level> = Vec::new();
    let mut at = 0;
    while levels.len() < LEVELS && size.iter().all(|length| *length > 0) {
        levels.push(Level {
            at,
            size,
            is_good: vec![false; size[0]],
            waiting: None,
            lines_written: 0,
        });
        at += (size[0] * size[1]) as u64;
        size = size.map(|length| length / 2);
    }
    levels
}
