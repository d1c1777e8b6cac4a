//! The log of an attempt: what its worker writes to standard error, of bounded length.

use std::{collections::VecDeque, io, path::Path};

use tokio::{
    fs::File,
    io::{AsyncRead, AsyncReadExt as _, AsyncWriteExt as _},
};

/// Bytes read at a time.
const CHUNK: usize = 16 << 10;

/// Copies `from` into a new file `path`, at most about `max_kib`: the first half is written as it arrives; of the rest,
/// the end is kept and written last, after a line `{"cut_bytes": …}`. Returns whether it reports that memory was refused.
///
/// # Errors
/// The file cannot be written; then reading stops.
pub(super) async fn copy(
    mut from: impl AsyncRead + Unpin,
    path: &Path,
    max_kib: u32,
) -> io::Result<bool> {
    let half = usize::try_from(max_kib).unwrap_or(usize::MAX) << 9;
    let mut file = File::create(path).await?;
    let (mut written, mut cut) = (0, 0_u64);
    let mut tail: VecDeque<u8> = VecDeque::new();
    let mut chunk = vec![0; CHUNK];
    let mut memory = Search::default();
    loop {
        let read = from.read(&mut chunk).await?;
        if read == 0 {
            break;
        }
        memory.look(&chunk[..read]);
        let room = read.min(half - written);
        file.write_all(&chunk[..room]).await?;
        file.flush().await?;
        written += room;
        tail.extend(&chunk[room..read]);
        let over = tail.len().saturating_sub(half);
        tail.drain(..over);
        cut += over as u64;
    }
    if cut > 0 {
        // The rest of a line whose start was cut is dropped.
        let line = tail.iter().position(|byte| *byte == b'\n');
        let remains = line.map_or(0, |end| end + 1);
        tail.drain(..remains);
        cut += remains as u64;
        let note = format!("\n{{\"cut_bytes\":{cut}}}\n");
        file.write_all(note.as_bytes()).await?;
    }
    file.write_all(tail.make_contiguous()).await?;
    file.flush().await?;
    Ok(memory.found)
}

/// Text that a Rust process writes before it aborts because the system refused memory.
const REFUSED_MEMORY: &[u8] = b"memory allocation of ";

/// Search for [`REFUSED_MEMORY`] in consecutive pieces of text.
#[derive(Debug, Default)]
struct Search {
    /// End of the text so far, shorter than the searched text.
    end: Vec<u8>,
    found: bool,
}

impl Search {
    fn look(&mut self, piece: &[u8]) {
        if self.found {
            return;
        }
        self.end.extend_from_slice(piece);
        let mut windows = self.end.windows(REFUSED_MEMORY.len());
        self.found = windows.any(|window| window == REFUSED_MEMORY);
        let over = self.end.len().saturating_sub(REFUSED_MEMORY.len() - 1);
        self.end.drain(..over);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refused_memory_is_found_across_pieces() {
        for cut in 0..REFUSED_MEMORY.len() {
            let mut search = Search::default();
            let (head, tail) = REFUSED_MEMORY.split_at(cut);
            search.look(&[b"a line\nmemory ", head].concat());
            assert!(!search.found, "{cut}");
            search.look(&[tail, b"8388608 bytes failed\n"].concat());
            assert!(search.found, "{cut}");
        }
    }

    #[tokio::test]
    async fn head_and_tail_are_kept_and_what_was_cut_is_counted() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log");
        let text =
            |lines: usize| (0..lines).fold(String::new(), |text, n| format!("{text}{n:09}\n"));
        let short = text(100);
        copy(short.as_bytes(), &path, 16).await.unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), short);
        let long = text(100_000);
        copy(long.as_bytes(), &path, 16).await.unwrap();
        let kept = std::fs::read_to_string(&path).unwrap();
        let (head, tail) = kept.split_once("\n{\"cut_bytes\":").unwrap();
        let (cut, tail) = tail.split_once("}\n").unwrap();
        assert!(long.starts_with(head) && long.ends_with(tail));
        assert_eq!(
            head.len() + cut.parse::<usize>().unwrap() + tail.len(),
            long.len()
        );
        assert_eq!(head.len(), 8 << 10);
        assert!((8 << 10) - tail.len() <= 10);
    }
}
