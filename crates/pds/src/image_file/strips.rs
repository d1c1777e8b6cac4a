//! The lines of an image in order, a strip at a time, each with its state.

use std::{collections::VecDeque, fs::File, io};

use super::{
    coding::Coding,
    complaint::{Complaint, Complaints, Fault},
    fragment::{FULL, Fragment, Fragments, Layout},
    placed::Placed,
    predictive::BLOCK_LINES,
    stream::{Piece, Stream},
    strip::{LineState, Strip},
    transform::{AREA, EDGE, Fragment as Decoded, TransformCoder},
    walk::HEADER,
};

/// Largest accepted number of blocks in a transform fragment: on board there were at most 1024.
const TRANSFORM_BLOCKS_MAX: usize = 1 << 14;
/// Largest accepted number of data bytes of a transform fragment.
const TRANSFORM_BYTES_MAX: u64 = 1 << 22;

/// Source and coding of the data.
#[derive(Debug)]
enum Source {
    /// One byte a pixel.
    Rows,
    Blocks(Box<Placed>),
    Transform {
        coder: TransformCoder,
        fragments: VecDeque<Fragment>,
    },
}

/// Reads an image from its first line to its last.
#[derive(Debug)]
pub struct Strips {
    layout: Layout,
    stream: Stream,
    source: Source,
    line: u32,
    is_done: bool,
    complaints: Complaints,
}

impl Strips {
    pub(super) fn new(
        file: File,
        layout: Layout,
        [start, end]: [u64; 2],
        fragments: Option<&Fragments>,
    ) -> io::Result<Self> {
        let plain = Piece {
            at: Some(start),
            bytes: end - start,
            fragment: None,
            is_sound: true,
        };
        let all = fragments.map_or(&[][..], |fragments| &fragments.all);
        let pieces = match fragments {
            None => vec![plain],
            Some(_) => pieces(all, layout.coding == Some(Coding::Raw)),
        };
        let mut stream = Stream::new(file, pieces);
        let source = match layout.coding {
            None | Some(Coding::Raw) => Source::Rows,
            Some(Coding::Predictive { predictor, table }) => {
                let Some(fragments) = fragments else {
                    return Err(io::ErrorKind::InvalidData.into());
                };
                let coding = (predictor, table);
                let placed = Placed::new(&mut stream, fragments, layout, coding)?;
                Source::Blocks(Box::new(placed))
            }
            Some(Coding::Transform {
                transform,
                groups,
                spacing,
            }) => Source::Transform {
                coder: TransformCoder {
                    transform,
                    groups,
                    spacing,
                    width: layout.samples as usize,
                },
                fragments: all.iter().copied().collect(),
            },
        };
        Ok(Self {
            layout,
            stream,
            source,
            line: 0,
            is_done: false,
            complaints: Complaints::default(),
        })
    }

    /// The next lines; `None` after the last one.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn next_strip(&mut self) -> io::Result<Option<Strip>> {
        while !self.is_done {
            let strip = match &mut self.source {
                Source::Rows => rows(&mut self.stream, self.layout, self.line)?,
                Source::Blocks(placed) => placed.strip(
                    &mut self.stream,
                    self.layout,
                    self.line,
                    &mut self.complaints,
                )?,
                Source::Transform { coder, fragments } => transformed(
                    &mut self.stream,
                    coder,
                    fragments,
                    self.line,
                    &mut self.complaints,
                )?,
            };
            match strip {
                Some(mut strip) => {
                    let room = self.layout.lines - self.line;
                    strip.states.truncate(room as usize);
                    strip
                        .pixels
                        .truncate(strip.states.len() * self.layout.samples as usize);
                    self.line += u32::try_from(strip.states.len()).unwrap_or(room);
                    if !strip.states.is_empty() {
                        return Ok(Some(strip));
                    }
                    self.is_done = self.line == self.layout.lines;
                }
                None => self.is_done = true,
            }
            if self.is_done && self.line < self.layout.lines {
                let (fragment, offset) = self.stream.locate(self.stream.len());
                self.complaints.push(Complaint {
                    fragment,
                    offset,
                    line: Some(self.line),
                    what: Fault::Lines {
                        found: self.line,
                        header: self.layout.lines,
                    },
                });
            }
        }
        Ok(None)
    }

    /// Faults found while decoding so far.
    #[must_use]
    pub const fn complaints(&self) -> &Complaints {
        &self.complaints
    }
}

/// The data of fragments as pieces of a stream. Every byte of a raster has a fixed place, so zeros replace missing
/// data.
fn pieces(fragments: &[Fragment], is_raster: bool) -> Vec<Piece> {
    let lost = |bytes| Piece {
        at: None,
        bytes,
        fragment: None,
        is_sound: false,
    };
    let mut pieces = Vec::with_capacity(fragments.len());
    for (number, fragment) in fragments.iter().enumerate() {
        if is_raster && fragment.lost_before > 0 {
            pieces.push(lost(FULL * u64::from(fragment.lost_before)));
        }
        let is_full = is_raster && !fragment.is_sound && number + 1 < fragments.len();
        let bytes = if is_full {
            fragment.data_bytes.min(FULL)
        } else {
            fragment.data_bytes
        };
        pieces.push(Piece {
            at: Some(fragment.at + HEADER as u64),
            bytes,
            fragment: Some(fragment.number),
            is_sound: fragment.is_sound,
        });
        if is_full && bytes < FULL {
            pieces.push(lost(FULL - bytes));
        }
    }
    pieces
}

/// Lines of a raster.
fn rows(stream: &mut Stream, layout: Layout, line: u32) -> io::Result<Option<Strip>> {
    let samples = layout.samples as usize;
    let lines = BLOCK_LINES.min(layout.lines - line) as usize;
    let at = u64::from(line) * u64::from(layout.samples);
    let bytes = stream.window(at, lines * samples)?;
    let pixels = bytes[..bytes.len() / samples * samples].to_vec();
    let state = |row: usize| {
        let from = at + (row * samples) as u64;
        let mut state = LineState::Good;
        for (_, piece) in stream.pieces(from, from + u64::from(layout.samples)) {
            state = match (piece.at, piece.is_sound) {
                (None, _) => return LineState::Missing,
                (Some(_), false) => LineState::Suspect,
                (Some(_), true) => state,
            };
        }
        state
    };
    let states: Vec<_> = (0..pixels.len() / samples).map(state).collect();
    Ok((!states.is_empty()).then_some(Strip {
        first_line: line,
        samples: layout.samples,
        pixels,
        states,
    }))
}

/// The lines of the next fragment, or some of the missing lines before it.
fn transformed(
    stream: &mut Stream,
    coder: &TransformCoder,
    fragments: &mut VecDeque<Fragment>,
    line: u32,
    complaints: &mut Complaints,
) -> io::Result<Option<Strip>> {
    let Some(fragment) = fragments.front().copied() else {
        return Ok(None);
    };
    let samples = u32::try_from(coder.width).unwrap_or_default();
    // A damaged header does not identify its lines.
    if (fragment.is_sound || fragment.lost_before > 0) && fragment.first_line > line {
        let lines = BLOCK_LINES.min(fragment.first_line - line);
        return Ok(Some(Strip::missing(line, lines, samples)));
    }
    fragments.pop_front();
    let mut complain = |what| {
        complaints.push(Complaint {
            fragment: Some(fragment.number),
            offset: fragment.at,
            line: Some(line),
            what,
        });
    };
    // Nor their number, which a sound header after it determines.
    let next = fragments
        .front()
        .filter(|next| !fragment.is_sound && next.is_sound);
    let room = next.map_or(u32::MAX, |next| next.first_line.saturating_sub(line));
    let lines = fragment.lines.min(room) as usize;
    let blocks = coder.width * lines / AREA;
    // A block takes at least three bits.
    let bytes_min = (blocks * 3 / 8) as u64;
    if blocks > TRANSFORM_BLOCKS_MAX
        || fragment.data_bytes > TRANSFORM_BYTES_MAX
        || fragment.data_bytes < bytes_min
        || lines < EDGE
    {
        complain(Fault::TooLarge);
        let lines =
            u32::try_from(lines.min(TRANSFORM_BLOCKS_MAX * AREA / coder.width)).unwrap_or_default();
        return Ok(Some(Strip::missing(line, lines, samples)));
    }
    let at = stream.start_of(fragment.number);
    let data_bytes = usize::try_from(fragment.data_bytes).unwrap_or_default();
    let data = stream.window(at, data_bytes)?;
    let (pixels, is_whole) = match coder.decode(data, lines) {
        Decoded::Pixels(pixels, is_whole) => (pixels, is_whole),
        Decoded::WrongGroup => {
            complain(Fault::Group);
            let lines = u32::try_from(lines).unwrap_or_default();
            return Ok(Some(Strip::missing(line, lines, samples)));
        }
    };
    if !is_whole {
        complain(Fault::Short);
    }
    let is_in_place = fragment.first_line == line;
    let state = if is_whole && fragment.is_sound && is_in_place {
        LineState::Good
    } else {
        LineState::Suspect
    };
    Ok(Some(Strip {
        first_line: line,
        samples,
        pixels,
        states: vec![state; lines],
    }))
}
