//! Successive lines of an image.

/// State of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LineState {
    /// As transmitted.
    Good,
    /// Decoded from damaged data, or at an uncertain place: its pixels may be wrong.
    Suspect,
    /// Not in the file; its pixels are 0.
    Missing,
}

/// Successive lines.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Strip {
    /// Number of the first line, counted from 0.
    pub first_line: u32,
    /// Samples of a line.
    pub samples: u32,
    /// Line by line.
    pub pixels: Vec<u8>,
    /// State of each line.
    pub states: Vec<LineState>,
}

impl Strip {
    /// Pixels and state of every line.
    pub fn lines(&self) -> impl Iterator<Item = (&[u8], &LineState)> {
        self.pixels
            .chunks_exact(self.samples as usize)
            .zip(&self.states)
    }

    /// Missing lines.
    pub(super) fn missing(first_line: u32, lines: u32, samples: u32) -> Self {
        Self {
            first_line,
            samples,
            pixels: vec![0; lines as usize * samples as usize],
            states: vec![LineState::Missing; lines as usize],
        }
    }
}
