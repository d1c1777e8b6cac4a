//! Places of blocks of the predictive coder in an image that may lack data.

use std::{collections::VecDeque, io, ops::Range};

use super::{
    coding::Predictor,
    complaint::{Complaint, Complaints, Fault},
    fragment::{Fragments, Layout},
    predictive::{BLOCK_LINES, Block, Blocks},
    stream::{Piece, Stream},
    strip::{LineState, Strip},
};

/// Blocks of lines with their places in the image.
#[derive(Debug)]
pub(super) struct Placed {
    blocks: Blocks,
    /// A decoded block whose reliability depends on what follows.
    waiting: Option<Block>,
    /// Number of lines missing before the block with this number.
    missing: Option<(usize, u32)>,
    /// Numbers of blocks whose place is unknown.
    adrift: Range<usize>,
    /// Number of the next block.
    number: usize,
}

impl Placed {
    /// The blocks of a stream whose fragments may be damaged or missing.
    pub(super) fn new(
        stream: &mut Stream,
        fragments: &Fragments,
        layout: Layout,
        (predictor, table): (Predictor, u8),
    ) -> io::Result<Self> {
        let blocks = || Blocks::new(predictor, table, layout.samples, layout.lines);
        let mut placed = Self {
            blocks: blocks(),
            waiting: None,
            missing: None,
            adrift: 0..0,
            number: 0,
        };
        if !fragments.are_sound() {
            placed.find_places(stream, layout.lines, fragments)?;
            placed.blocks = blocks();
        }
        placed.waiting = placed.blocks.next(stream)?;
        Ok(placed)
    }

    /// Decodes the complete image once to locate missing lines.
    ///
    /// The last fragment gives the number of lines; missing ones can be located if there is one gap.
    fn find_places(
        &mut self,
        stream: &mut Stream,
        lines: u32,
        fragments: &Fragments,
    ) -> io::Result<()> {
        let (mut breaks, mut found, mut number) = (Vec::new(), 0, 0_usize);
        let mut gaps = Gaps::new(fragments);
        while let Some(block) = self.blocks.next(stream)? {
            // Both are evaluated, so that a gap is reported once.
            if gaps.is_before(block.mark) | block.due.is_some() {
                breaks.push(number);
            }
            number += 1;
            found += u32::try_from(block.ends.len()).unwrap_or_default();
        }
        // A gap in the last block found.
        if gaps.is_before(u64::MAX) {
            breaks.push(number);
        }
        let missing = lines - found;
        // Lines are counted only if the end of the image is complete: its last fragment exists, and no data are left
        // over.
        let last = fragments.all.last().filter(|_| fragments.has_last);
        let is_counted = last.is_some_and(|last| last.is_sound)
            && lines == fragments.first.total_lines()
            && missing.is_multiple_of(BLOCK_LINES)
            && self.blocks.due() + END_BYTES >= stream.len();
        match *breaks {
            [place] if is_counted && missing > 0 => self.missing = Some((place, missing)),
            [first, .., last] if is_counted && missing > 0 => {
                self.missing = Some((last, missing));
                self.adrift = first..last;
            }
            [first, ..] if !is_counted => self.adrift = first..usize::MAX,
            _ => {}
        }
        Ok(())
    }

    /// The next lines; `None` at the end.
    pub(super) fn strip(
        &mut self,
        stream: &mut Stream,
        layout: Layout,
        line: u32,
        complaints: &mut Complaints,
    ) -> io::Result<Option<Strip>> {
        if let Some((place, lines)) = self.missing
            && place == self.number
        {
            let lines_now = lines.min(BLOCK_LINES);
            self.missing = (lines > lines_now).then_some((place, lines - lines_now));
            return Ok(Some(Strip::missing(line, lines_now, layout.samples)));
        }
        let Some(block) = self.waiting.take() else {
            return Ok(None);
        };
        self.waiting = self.blocks.next(stream)?;
        let (due, next) = match &self.waiting {
            Some(next) => (next.due, Some(next.mark)),
            None => ((!self.blocks.are_all()).then(|| self.blocks.due()), None),
        };
        let lines = u32::try_from(block.ends.len()).unwrap_or(BLOCK_LINES);
        // At the end of the data only the final mark is due.
        let is_broken = due.is_some_and(|due| next.is_some() || due + 2 < stream.len());
        if is_broken && let Some(due) = due {
            let (fragment, offset) = stream.locate(due);
            let what = Fault::LostSync {
                next: next.map(|mark| stream.locate(mark).1),
            };
            complaints.push(Complaint {
                fragment,
                offset,
                line: Some(line + lines),
                what,
            });
        }
        let mut states = states(&block, stream);
        let has_gap = states.contains(&LineState::Suspect);
        if is_broken && !has_gap {
            states[1..].fill(LineState::Suspect);
        }
        if self.adrift.contains(&self.number) {
            states.fill(LineState::Suspect);
        }
        self.number += 1;
        Ok(Some(Strip {
            first_line: line,
            samples: layout.samples,
            pixels: block.pixels,
            states,
        }))
    }
}

/// States of a block's lines by the fragments that contain them: a damaged fragment, or one out of sequence, spoils the
/// rest of the block.
fn states(block: &Block, stream: &Stream) -> Vec<LineState> {
    let end = block.ends.last().copied().unwrap_or(block.mark);
    let mut good_until = u64::MAX;
    let mut before: Option<&Piece> = None;
    for (start, piece) in stream.pieces(block.mark, end) {
        let follows = |before: &Piece| {
            let numbers = before.fragment.zip(piece.fragment);
            numbers.is_none_or(|(before, this)| before.checked_add(1) == Some(this))
        };
        if !piece.is_sound || !before.is_none_or(follows) {
            good_until = block.mark.max(*start);
            break;
        }
        before = Some(piece);
    }
    let state = |end: &u64| {
        if *end <= good_until {
            LineState::Good
        } else {
            LineState::Suspect
        }
    };
    block.ends.iter().map(state).collect()
}

/// Bytes after the last line of an image: one for alignment to an even position, and a mark.
const END_BYTES: u64 = 3;

/// Positions in the stream before which fragments are missing.
struct Gaps {
    places: VecDeque<u64>,
}

impl Gaps {
    fn new(fragments: &Fragments) -> Self {
        let (mut at, mut places) = (0, VecDeque::new());
        for fragment in &fragments.all {
            if fragment.lost_before > 0 {
                places.push_back(at);
            }
            at += fragment.data_bytes;
        }
        Self { places }
    }

    /// Whether there is an unreported gap before `at`; it and all gaps before `at` then count as reported.
    fn is_before(&mut self, at: u64) -> bool {
        let mut found = false;
        while self.places.front().is_some_and(|gap| *gap <= at) {
            self.places.pop_front();
            found = true;
        }
        found
    }
}
