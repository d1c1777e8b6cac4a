//! Exposure times of the lines of an image: a table of pieces, each with its line period.
//!
//! A line coordinate counts lines from the top edge of the first line, so that the centre of line `i` (from 0) is at
//! `i + 0.5`. The sensor models of Shan et al. measure time in a different unit: [`LineTimes::offset`], seconds from
//! the middle of the exposure over the mean line period. In an image of one piece this is the line coordinate less half
//! the number of lines. If the exposure changes inside an image the two differ, but positions and attitudes are as
//! smooth over the offset as over time.
//!
//! A file whose rows have times (`ImageLabel::lines`) gives the pieces itself. Only `OrientedCamera` and `register`
//! convert a line coordinate into an offset and back.
//!
//! ```
//! use areograph_base::{line_times::LineTimes, time::Et};
//!
//! // 1000 lines of 1 ms, then 500 of 2 ms.
//! let times = LineTimes::continuous(Et::from_seconds(0.0), &[(1000, 1e-3), (500, 2e-3)])?;
//! assert!((times.et(1250.0).seconds() - 1.5).abs() < 1e-12);
//! assert!((times.line(Et::from_seconds(1.5)) - 1250.0).abs() < 1e-9);
//! // The middle of the exposure is the end of the first piece, not the middle line.
//! assert!(times.offset_of_line(1000.0).abs() < 1e-9);
//! # Ok::<(), areograph_base::line_times::LineTimesError>(())
//! ```

use serde::{Deserialize, Serialize};

use crate::{
    error::Cause,
    time::{Et, Interval},
};

/// A piece that begins within this time of the end of the preceding one follows it directly, seconds: ET of the
/// mission is rounded to 1.2e-7 s, published pieces overlap by up to 4e-7 s, and a microsecond is a five hundredth of
/// the shortest line.
const TOUCHING_S: f64 = 1e-6;

/// Consecutive lines with one period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinePiece {
    /// Its first line, counted from 0.
    pub first_line: u32,
    /// Start (top edge) of that line.
    pub start: Et,
    /// Time between two lines, seconds.
    pub period_s: f64,
}

/// Times of the lines of an image, in pieces that follow each other directly or after a gap.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LineTimes {
    start: Et,
    lines: u32,
    /// Mean time from line to line, gaps included, seconds; for one piece its period.
    mean_period_s: f64,
    /// From the start of the first line to the end of the last, seconds.
    duration_s: f64,
    pieces: Vec<Piece>,
}

/// A piece relative to the start of the image, which avoids the rounding of ET.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Piece {
    first_line: u32,
    lines: u32,
    after_s: f64,
    period_s: f64,
}

/// Pieces that do not form a table of line times.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error, Cause)]
#[cause(Input: "check the first lines, start times and line periods in the image label")]
pub enum LineTimesError {
    /// No pieces.
    #[error("the table of line times has no pieces; expected one or more")]
    NoPieces,
    /// The first piece does not begin with line 0.
    #[error("the first piece of the line times begins with line {first_line}; expected line 0")]
    FirstLine {
        /// Its first line.
        first_line: u32,
    },
    /// A piece has no lines.
    #[error(
        "piece {piece} of the line times begins with line {first_line} and ends before line {next}; expected one line \
             or more"
    )]
    NoLines {
        /// The piece, counted from 1.
        piece: usize,
        /// Its first line.
        first_line: u32,
        /// First line of the next one, or the number of lines.
        next: u32,
    },
    /// An invalid period.
    #[error(
        "piece {piece} of the line times has a line period of {period_s} s; expected a number above 0"
    )]
    Period {
        /// The piece, counted from 1.
        piece: usize,
        /// Its period, seconds.
        period_s: f64,
    },
    /// A piece begins before the preceding one has ended, or its start is not finite.
    #[error(
        "piece {piece} of the line times begins {overlap_s} s before the last line of the preceding piece ends; expected pieces \
         that do not overlap"
    )]
    Overlap {
        /// The piece, counted from 1.
        piece: usize,
        /// Overlap, seconds.
        overlap_s: f64,
    },
}

impl Piece {
    fn first(&self) -> f64 {
        f64::from(self.first_line)
    }

    fn end_s(&self) -> f64 {
        self.after_s + f64::from(self.lines) * self.period_s
    }
}

impl LineTimes {
    /// An image of `lines` lines of one period.
    ///
    /// # Errors
    /// [`LineTimesError::NoLines`], [`LineTimesError::Period`].
    pub fn even(start: Et, lines: u32, period_s: f64) -> Result<Self, LineTimesError> {
        Self::continuous(start, &[(lines, period_s)])
    }

    /// An image whose pieces, numbers of lines with periods in seconds, follow each other directly.
    ///
    /// # Errors
    /// [`LineTimesError::NoPieces`], [`LineTimesError::NoLines`], [`LineTimesError::Period`].
    pub fn continuous(start: Et, pieces: &[(u32, f64)]) -> Result<Self, LineTimesError> {
        let (mut line, mut after_s) = (0, 0.0);
        let pieces = pieces.iter().map(|(lines, period_s)| {
            let begin = (line, after_s);
            line += lines;
            after_s += f64::from(*lines) * period_s;
            (begin.0, begin.1, *period_s)
        });
        let pieces: Vec<_> = pieces.collect();
        Self::relative(start, line, &pieces)
    }

    /// An image of `lines` lines with the `pieces` of a label, in order; gaps between pieces are permitted.
    ///
    /// # Errors
    /// As [`Self::continuous`], and [`LineTimesError::FirstLine`], [`LineTimesError::Overlap`].
    pub fn of_pieces(lines: u32, pieces: &[LinePiece]) -> Result<Self, LineTimesError> {
        let start = pieces.first().ok_or(LineTimesError::NoPieces)?.start;
        let pieces = pieces
            .iter()
            .map(|piece| (piece.first_line, piece.start.since(start), piece.period_s));
        let pieces: Vec<_> = pieces.collect();
        Self::relative(start, lines, &pieces)
    }

    /// Pieces with first line, seconds after the start, and period.
    fn relative(start: Et, lines: u32, table: &[(u32, f64, f64)]) -> Result<Self, LineTimesError> {
        let [(first_line, ..), ..] = table else {
            return Err(LineTimesError::NoPieces);
        };
        if *first_line != 0 {
            let first_line = *first_line;
            return Err(LineTimesError::FirstLine { first_line });
        }
        let mut pieces: Vec<Piece> = Vec::with_capacity(table.len());
        for (index, (first_line, after_s, period_s)) in table.iter().copied().enumerate() {
            let piece = index + 1;
            let next = table.get(piece).map_or(lines, |next| next.0);
            if next <= first_line {
                return Err(LineTimesError::NoLines {
                    piece,
                    first_line,
                    next,
                });
            }
            // This form also refuses NaN, here and below.
            if !(period_s > 0.0 && period_s.is_finite()) {
                return Err(LineTimesError::Period { piece, period_s });
            }
            let before_s = pieces.last().map_or(0.0, Piece::end_s);
            if !(after_s >= before_s - TOUCHING_S && after_s.is_finite()) {
                let overlap_s = before_s - after_s;
                return Err(LineTimesError::Overlap { piece, overlap_s });
            }
            // The preceding piece ends where this one begins: if this one were moved instead, the rounding errors of
            // many pieces would accumulate.
            if let Some(before) = pieces.last_mut()
                && after_s - before_s <= TOUCHING_S
                && after_s.to_bits() != before_s.to_bits()
            {
                before.period_s = (after_s - before.after_s) / f64::from(before.lines);
            }
            pieces.push(Piece {
                first_line,
                lines: next - first_line,
                after_s,
                period_s,
            });
        }
        let duration_s = pieces.last().map_or(0.0, Piece::end_s);
        // The mean is the first period plus the mean excess of the others, so that for one piece it is exactly that
        // period.
        let first_s = pieces[0].period_s;
        let more_s: f64 = match pieces.len() {
            1 => 0.0,
            _ => duration_s - f64::from(lines) * first_s,
        };
        Ok(Self {
            start,
            lines,
            mean_period_s: first_s + more_s / f64::from(lines),
            duration_s,
            pieces,
        })
    }

    /// Start of the first line.
    #[must_use]
    pub const fn start(&self) -> Et {
        self.start
    }

    /// Number of lines.
    #[must_use]
    pub const fn lines(&self) -> u32 {
        self.lines
    }

    /// Mean time from line to line, seconds: the unit of [`Self::offset`]. For an image of one piece, its line
    /// period.
    #[must_use]
    pub const fn mean_period_s(&self) -> f64 {
        self.mean_period_s
    }

    /// From the start of the first line to the end of the last, seconds.
    #[must_use]
    pub const fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// From the start of the first line to the end of the last.
    #[must_use]
    pub fn interval(&self) -> Interval {
        Interval::new(self.start, self.start.plus(self.duration_s))
    }

    /// Middle of the exposure, the origin of the sensor models.
    #[must_use]
    pub fn middle(&self) -> Et {
        self.start.plus(0.5 * self.duration_s)
    }

    /// The pieces, in order.
    #[must_use]
    pub fn pieces(&self) -> impl ExactSizeIterator<Item = LinePiece> + '_ {
        self.pieces.iter().map(|piece| LinePiece {
            first_line: piece.first_line,
            start: self.start.plus(piece.after_s),
            period_s: piece.period_s,
        })
    }

    /// Seconds from the start of the image to a line coordinate; outside the image the first and the last piece are
    /// extrapolated. At the end of a piece that is followed by a gap, it is the start of the next piece.
    #[must_use]
    pub fn seconds(&self, line: f64) -> f64 {
        let piece = self.piece(|piece| piece.first() <= line);
        piece.after_s + (line - piece.first()) * piece.period_s
    }

    /// The line coordinate that is exposed `after_s` seconds after the start; within a gap, the coordinate of its ends.
    /// The inverse of [`Self::seconds`] to 1e-9 lines.
    #[must_use]
    pub fn line_at(&self, after_s: f64) -> f64 {
        let piece = self.piece(|piece| piece.after_s <= after_s);
        self.held(
            piece,
            piece.first() + (after_s - piece.after_s) / piece.period_s,
        )
    }

    /// The instant of a line coordinate, with the rounding of ET.
    #[must_use]
    pub fn et(&self, line: f64) -> Et {
        self.start.plus(self.seconds(line))
    }

    /// The line coordinate of an instant, see [`Self::line_at`].
    #[must_use]
    pub fn line(&self, instant: Et) -> f64 {
        self.line_at(instant.since(self.start))
    }

    /// Time in the unit of the sensor models: mean line periods from the middle of the exposure.
    ///
    /// # Source
    /// Shan et al. 2005: `x = (t − t_mid) / τ`; line `i` from 0 of `n` has `x = i − (n − 1)/2`.
    #[must_use]
    pub fn offset(&self, instant: Et) -> f64 {
        instant.since(self.middle()) / self.mean_period_s
    }

    /// The offset of a line coordinate, without the rounding of ET.
    #[must_use]
    pub fn offset_of_line(&self, line: f64) -> f64 {
        let piece = self.piece(|piece| piece.first() <= line);
        self.first_offset(piece) + (line - piece.first()) * (piece.period_s / self.mean_period_s)
    }

    /// The line coordinate of a time in the unit of the sensor models; within a gap, the coordinate of its ends.
    #[must_use]
    pub fn line_of_offset(&self, offset: f64) -> f64 {
        let piece = self.piece(|piece| self.first_offset(piece) <= offset);
        let after = (offset - self.first_offset(piece)) * (self.mean_period_s / piece.period_s);
        self.held(piece, piece.first() + after)
    }

    /// Whether a time in the unit of the sensor models lies between two pieces, where no line is exposed.
    #[must_use]
    pub fn in_gap(&self, offset: f64) -> bool {
        let after_s = (offset + 0.5 * f64::from(self.lines)) * self.mean_period_s;
        let ends = self.pieces.iter().map(Piece::end_s);
        let begins = self.pieces.iter().skip(1).map(|piece| piece.after_s);
        ends.zip(begins)
            .any(|(end_s, begin_s)| end_s < after_s && after_s < begin_s)
    }

    /// Duration, in that unit, of the line that is exposed at `offset`: its period over the mean.
    #[must_use]
    pub fn offsets_per_line(&self, offset: f64) -> f64 {
        let piece = self.piece(|piece| self.first_offset(piece) <= offset);
        piece.period_s / self.mean_period_s
    }

    fn first_offset(&self, piece: &Piece) -> f64 {
        piece.after_s / self.mean_period_s - 0.5 * f64::from(self.lines)
    }

    /// The last piece for which `begins` holds, or the first one.
    fn piece(&self, begins: impl Fn(&Piece) -> bool) -> &Piece {
        let after = self.pieces.partition_point(begins);
        &self.pieces[after.saturating_sub(1)]
    }

    /// `line` of `piece`, limited to its end if another piece follows.
    fn held(&self, piece: &Piece, line: f64) -> f64 {
        let end = piece.first_line + piece.lines;
        if end < self.lines {
            line.min(f64::from(end))
        } else {
            line
        }
    }
}
