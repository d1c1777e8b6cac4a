//! Some lines of an image that follow each other.

/// What is known of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LineState {
    /// As it was sent.
    Good,
    /// Decoded from damaged data, or of an uncertain place: its pixels may be wrong.
    Suspect,
    /// Not in the file; its pixels are 0.
    Missing,
}

/// Lines that follow each other.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Strip {
    /// Number of the first line, counted from 0.
    pub first_line: u32,
    /// Samples of a line.
    pub samples: u32,
    /// Line by line.
    pub pixels: Vec<u8>,
    /// One of each line.
    pub states: Vec<LineState>,
}

impl Strip {
    /// Pixels and state of every line.
    pub fn lines(&self) -> impl Iterator<Item = (&[u8], &LineState)> {
        self.pixels
            .chunks_exact(self.samples as usize)
            .zip(&self.states)
    }

    /// Lines that are not there.
    pub(super) fn missing(first_line: u32, lines: u32, samples: u32) -> Self {
        Self {
            first_line,
            samples,
            pixels: vec![0; lines as usize * samples as usize],
            states: vec![LineState::Missing; lines as usize],
        }
    }
}
