//! A file that is searched for fragment headers.

use std::{fs::File, io, os::unix::fs::FileExt as _};

/// Bytes of a header.
pub(super) const HEADER: usize = 62;
/// Bytes read at a time.
const CHUNK: usize = 1 << 16;

/// The file of a search.
#[derive(Debug)]
pub(super) struct Walk<'a> {
    file: &'a File,
    end: u64,
    /// The bytes last read during a search for headers, and their position: adjacent headers take one read.
    window: Vec<u8>,
    window_at: u64,
}

impl<'a> Walk<'a> {
    /// The file up to byte `end`.
    pub(super) const fn new(file: &'a File, end: u64) -> Self {
        Self {
            file,
            end,
            window: Vec::new(),
            window_at: 0,
        }
    }

    /// End of the file.
    pub(super) const fn end(&self) -> u64 {
        self.end
    }

    /// The header at `at`, if the file has enough bytes.
    pub(super) fn header(&self, at: u64) -> io::Result<Option<[u8; HEADER]>> {
        let mut bytes = [0; HEADER];
        if at.saturating_add(HEADER as u64) > self.end {
            return Ok(None);
        }
        self.file.read_exact_at(&mut bytes, at)?;
        Ok(Some(bytes))
    }

    /// The window from `at` on; at least a header, if the file has one there.
    fn window(&mut self, at: u64) -> io::Result<&[u8]> {
        let within = at
            .checked_sub(self.window_at)
            .and_then(|from| usize::try_from(from).ok());
        let within = within.filter(|from| from + HEADER <= self.window.len());
        let from = if let Some(from) = within {
            from
        } else {
            let length = usize::try_from(self.end.saturating_sub(at)).unwrap_or(usize::MAX);
            self.window.resize(length.min(CHUNK + HEADER), 0);
            self.window_at = at;
            self.file.read_exact_at(&mut self.window, at)?;
            0
        };
        Ok(&self.window[from..])
    }

    /// The first header from `from` on that meets the condition.
    pub(super) fn find(
        &mut self,
        from: u64,
        wanted: &dyn Fn(&[u8; HEADER]) -> bool,
    ) -> io::Result<Option<u64>> {
        let mut at = from;
        while at + (HEADER as u64) <= self.end {
            let bytes = self.window(at)?;
            let mut places = bytes.windows(HEADER);
            let is_wanted = |window: &[u8]| {
                // No image has zero clock seconds: padding is skipped quickly.
                window[9..13] != [0; 4] && <&[u8; HEADER]>::try_from(window).is_ok_and(wanted)
            };
            if let Some(place) = places.position(is_wanted) {
                return Ok(Some(at + place as u64));
            }
            at += (bytes.len() - HEADER + 1) as u64;
        }
        Ok(None)
    }

    /// Whether the end-around-carry sum of `bytes` from `at` on is all ones.
    pub(super) fn adds_up(&self, at: u64, bytes: u64) -> io::Result<bool> {
        let (sum, _) = byte_sum(self.file, at, bytes)?;
        Ok(sum > 0 && sum % 255 == 0)
    }
}

/// The sum of bytes, each unsigned, and the number of bytes of 128 or more.
pub(super) fn byte_sum(file: &File, at: u64, bytes: u64) -> io::Result<(u64, u64)> {
    let mut chunk = vec![0; CHUNK];
    let (mut sum, mut high, mut done) = (0, 0, 0);
    while done < bytes {
        let length = usize::try_from(bytes - done).map_or(CHUNK, |rest| rest.min(CHUNK));
        file.read_exact_at(&mut chunk[..length], at + done)?;
        // A chunk of 2^16 bytes stays below 2^24.
        let of_chunk: u32 = chunk[..length].iter().map(|byte| u32::from(*byte)).sum();
        let high_of_chunk: u32 = chunk[..length]
            .iter()
            .map(|byte| u32::from(byte >> 7))
            .sum();
        sum += u64::from(of_chunk);
        high += u64::from(high_of_chunk);
        done += length as u64;
    }
    Ok((sum, high))
}
