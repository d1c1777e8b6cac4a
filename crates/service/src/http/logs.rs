//! Logs of attempts.

use std::{
    io::{Read as _, Seek as _, SeekFrom},
    path::Path,
};

use super::problem::Problem;
use crate::contents::open_below;

/// Bytes of a log in one page.
pub(super) const PIECE: u64 = 256 << 10;

/// A page of a log.
#[derive(Debug, Default)]
pub(super) struct LogPiece {
    pub(super) text: String,
    /// Start of the next page, bytes.
    pub(super) next: u64,
    /// Length of the complete log, bytes.
    pub(super) bytes: u64,
}

/// At most `most` bytes of a log below `state`, from byte `after`, or by default its end.
pub(super) fn log_piece(
    state: &Path,
    log: &str,
    after: Option<u64>,
    most: u64,
) -> Result<LogPiece, Problem> {
    let path = Path::new(log);
    let below = path.strip_prefix(state).unwrap_or(path);
    let Some(mut file) = open_below(state, below).map_err(Problem::internal)? else {
        return Ok(LogPiece::default());
    };
    let bytes = file.metadata().map_err(Problem::internal)?.len();
    let start = after
        .unwrap_or_else(|| bytes.saturating_sub(most))
        .min(bytes);
    file.seek(SeekFrom::Start(start))
        .map_err(Problem::internal)?;
    let mut piece = Vec::new();
    file.take(most)
        .read_to_end(&mut piece)
        .map_err(Problem::internal)?;
    // A full page ends with a line, so that no character is split.
    if piece.len() as u64 == most
        && let Some(end) = piece.iter().rposition(|byte| *byte == b'\n')
    {
        piece.truncate(end + 1);
    }
    Ok(LogPiece {
        next: start + piece.len() as u64,
        text: String::from_utf8_lossy(&piece).into_owned(),
        bytes,
    })
}
