//! `images.exposures`: when lines were exposed, piece by piece.

use serde::{Deserialize, Serialize};
use toml::Value;

use super::{
    declare::{Form, Found, ValueKind},
    forms::{Number, Several, from_to, several},
    problems::Review,
};
use areograph_base::{
    line_times::{LinePiece, LineTimes, LineTimesError},
    time::Et,
    units::SECONDS_PER_MS,
};

/// Instants in ET seconds; the range also covers the other numbers of a row.
const NUMBERS: Number = from_to(-2e9, 2e9);
/// One row.
const ROW: Several<Number, 3> = several(
    NUMBERS,
    "3 numbers: first line, its start in ET seconds, line period in milliseconds",
);
/// More lines than any image has; it limits the duration of a run.
pub(super) const LINES_MAX: u32 = 1_000_000;
/// Longest exposure or line period, milliseconds: a hundred times the cameras' values.
pub(super) const MILLISECONDS_MAX: f64 = 1_000.0;

/// Lines of an image that follow each other with one period.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ExposurePiece {
    /// Its first line, counted from 0.
    pub first_line: u32,
    /// Start (top edge) of that line, ET seconds.
    pub start_et_s: f64,
    /// Time between two lines, seconds.
    pub line_period_s: f64,
}

/// The line times of an image of `lines` lines that was exposed in `pieces`.
///
/// # Errors
/// Pieces that do not begin with line 0, or do not follow each other.
pub fn line_times_of(pieces: &[ExposurePiece], lines: u32) -> Result<LineTimes, LineTimesError> {
    let pieces = pieces.iter().map(|piece| LinePiece {
        first_line: piece.first_line,
        start: Et::from_seconds(piece.start_et_s),
        period_s: piece.line_period_s,
    });
    LineTimes::of_pieces(lines, &pieces.collect::<Vec<_>>())
}

/// Rows of three numbers, one or more.
pub(super) struct ExposureRows;

impl ExposureRows {
    const EXPECTED: &'static str =
        "rows [first line, its start in ET seconds, line period in milliseconds]";

    /// The piece of a row, or `None` after a problem was reported.
    fn piece(found: &Found<'_>, review: &mut Review<'_>) -> Option<ExposurePiece> {
        let [first_line, start_et_s, period_ms] = ROW.read(found, review)?;
        if !(first_line.fract() == 0.0 && (0.0..f64::from(LINES_MAX)).contains(&first_line)) {
            found.refuse(
                review,
                format!(
                    "a row whose first number is a line: a whole number from 0 to {}",
                    LINES_MAX - 1
                ),
            );
            return None;
        }
        if !(period_ms > 0.0 && period_ms <= MILLISECONDS_MAX) {
            let expected = format!(
                "a row whose third number is a line period: above 0, at most {MILLISECONDS_MAX} milliseconds"
            );
            found.refuse(review, expected);
            return None;
        }
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a whole number within the lines of an image, as checked above"
        )]
        let first_line = first_line as u32;
        Some(ExposurePiece {
            first_line,
            start_et_s,
            line_period_s: period_ms * SECONDS_PER_MS,
        })
    }
}

impl Form for ExposureRows {
    type Value = Vec<ExposurePiece>;

    fn kind(&self) -> ValueKind {
        ValueKind::List {
            expected: Self::EXPECTED.to_owned(),
            of: Box::new(ROW.kind()),
            count: None,
            empty: false,
            distinct: true,
        }
    }

    fn read(&self, found: &Found<'_>, review: &mut Review<'_>) -> Option<Vec<ExposurePiece>> {
        let rows = found.value.get_ref().as_array();
        let Some(rows) = rows.filter(|rows| !rows.is_empty()) else {
            found.refuse(review, Self::EXPECTED);
            return None;
        };
        let pieces = rows.iter().map(|value| {
            let key = found.key.clone();
            Self::piece(&Found { key, value }, review)
        });
        // Every row is read, so that all problems are found in one pass.
        let pieces: Vec<Option<ExposurePiece>> = pieces.collect();
        pieces.into_iter().collect()
    }

    fn written(&self, pieces: &Vec<ExposurePiece>) -> Value {
        let rows = pieces.iter().map(|piece| {
            let period_ms = piece.line_period_s / SECONDS_PER_MS;
            let row = [f64::from(piece.first_line), piece.start_et_s, period_ms];
            Value::Array(row.map(Value::Float).to_vec())
        });
        Value::Array(rows.collect())
    }
}
