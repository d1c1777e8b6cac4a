//! The data of all fragments as one stream of bytes, of which a window is in memory.

use std::{fs::File, io, os::unix::fs::FileExt as _};

/// A stretch of the stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Piece {
    /// Its position in the file; `None` for missing bytes, which are read as zeros.
    pub(super) at: Option<u64>,
    pub(super) bytes: u64,
    /// Number of its fragment.
    pub(super) fragment: Option<u16>,
    /// Whether it is as transmitted.
    pub(super) is_sound: bool,
}

/// Bytes in stream order, at any position in the file.
#[derive(Debug)]
pub(super) struct Stream {
    file: File,
    /// Pieces with their starting positions in the stream.
    pieces: Vec<(u64, Piece)>,
    length: u64,
    /// Position of the first byte of `held`.
    start: u64,
    held: Vec<u8>,
}

impl Stream {
    pub(super) fn new(file: File, pieces: impl IntoIterator<Item = Piece>) -> Self {
        let mut length = 0;
        let placed = pieces.into_iter().map(|piece| {
            let start = length;
            length += piece.bytes;
            (start, piece)
        });
        Self {
            pieces: placed.collect(),
            file,
            length,
            start: 0,
            held: Vec::new(),
        }
    }

    pub(super) const fn len(&self) -> u64 {
        self.length
    }

    /// The bytes from `at` on, `length` of them or those up to the end.
    pub(super) fn window(&mut self, at: u64, length: usize) -> io::Result<&[u8]> {
        let end = at.saturating_add(length as u64).min(self.length);
        let held_end = self.start + self.held.len() as u64;
        if at < self.start || at > held_end {
            self.held.clear();
            self.start = at;
        } else if end > held_end {
            self.held.drain(..index(at - self.start));
            self.start = at;
        }
        let held_end = self.start + self.held.len() as u64;
        if end > held_end {
            self.read(held_end, end)?;
        }
        let from = index(at - self.start).min(self.held.len());
        let until = index(end.max(at) - self.start).min(self.held.len());
        Ok(&self.held[from..until])
    }

    fn read(&mut self, mut at: u64, end: u64) -> io::Result<()> {
        let mut number = self.number(at);
        while at < end
            && let Some((start, piece)) = self.pieces.get(number)
        {
            let length = (start + piece.bytes).min(end) - at;
            let from = self.held.len();
            self.held.resize(from + index(length), 0);
            if let Some(file_at) = piece.at {
                self.file
                    .read_exact_at(&mut self.held[from..], file_at + (at - start))?;
            }
            at += length;
            number += 1;
        }
        Ok(())
    }

    /// Number of the piece that holds a byte, or the last one.
    fn number(&self, at: u64) -> usize {
        let after = self.pieces.partition_point(|(start, _)| *start <= at);
        after.saturating_sub(1)
    }

    /// The fragment of a byte, and the byte's position in the file.
    pub(super) fn locate(&self, at: u64) -> (Option<u16>, u64) {
        self.pieces
            .get(self.number(at))
            .map_or((None, 0), |(start, piece)| {
                (piece.fragment, piece.at.unwrap_or_default() + (at - start))
            })
    }

    /// The pieces with bytes from `from` up to `until`, each with its starting position.
    pub(super) fn pieces(&self, from: u64, until: u64) -> impl Iterator<Item = &(u64, Piece)> {
        let pieces = self.pieces.get(self.number(from)..).unwrap_or_default();
        let within = move |(start, _): &&(u64, Piece)| *start < until.max(from + 1);
        pieces.iter().take_while(within)
    }

    /// Start of the bytes of a fragment.
    pub(super) fn start_of(&self, fragment: u16) -> u64 {
        let before = |(_, piece): &(u64, Piece)| piece.fragment < Some(fragment);
        let number = self.pieces.partition_point(before);
        self.pieces
            .get(number)
            .map_or(self.length, |(start, _)| *start)
    }
}

/// Position within the window in memory.
fn index(bytes: u64) -> usize {
    usize::try_from(bytes).unwrap_or(usize::MAX)
}
