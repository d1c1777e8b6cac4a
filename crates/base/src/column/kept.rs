//! Packed pieces in memory, and in an unnamed temporary file.

use std::{
    any::Any,
    borrow::Cow,
    fs::File,
    io,
    os::unix::fs::FileExt as _,
    panic::resume_unwind,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicU64, AtomicUsize, Ordering},
    },
};

use crate::error::{Cause, Error};

/// Bytes of packed pieces that a process holds in memory; more lie in a temporary file.
pub const MEMORY_BYTES: usize = 1 << 22;
/// Bytes of a temporary file, after which the next one begins: a file disappears with its last piece.
const FILE_BYTES: u64 = 1 << 28;

static IN_MEMORY: AtomicUsize = AtomicUsize::new(0);
static PIECES: AtomicU64 = AtomicU64::new(0);
static FILE: Mutex<Option<(Arc<File>, u64)>> = Mutex::new(None);

/// Values that cannot be read from a temporary file.
#[derive(Debug, thiserror::Error, Cause)]
#[error("values of shots cannot be read back from a temporary file")]
#[cause(Io: "check the disk that contains the temporary files (TMPDIR), then repeat the command")]
struct LostValues;

/// Ends the task: no value stands for a lost one, and the many readers of single values return no errors.
pub(super) fn lose() -> ! {
    resume_unwind(Box::new(LostValues))
}

/// The failure of a task that ended since values of a column were lost; `None` for a panic.
#[must_use]
pub fn lost_values(panic: &(dyn Any + Send)) -> Option<Error> {
    panic.is::<LostValues>().then(|| LostValues.into())
}

/// A packed piece.
#[derive(Debug)]
pub(super) struct Kept {
    /// Distinguishes the pieces of the process.
    pub(super) number: u64,
    place: Place,
}

#[derive(Debug)]
enum Place {
    Memory(Box<[u8]>),
    File {
        file: Arc<File>,
        start: u64,
        length: usize,
        hash: blake3::Hash,
    },
}

impl Kept {
    pub(super) fn new(bytes: Vec<u8>) -> Self {
        Self::within(MEMORY_BYTES, bytes)
    }

    /// A piece in memory if there are at most this many bytes with it, or if no file can be written.
    fn within(memory_bytes: usize, bytes: Vec<u8>) -> Self {
        let held = IN_MEMORY.fetch_add(bytes.len(), Ordering::Relaxed) + bytes.len();
        let filed = if held > memory_bytes {
            filed(&bytes).ok()
        } else {
            None
        };
        let place = match filed {
            Some((file, start)) => {
                IN_MEMORY.fetch_sub(bytes.len(), Ordering::Relaxed);
                let length = bytes.len();
                Place::File {
                    file,
                    start,
                    length,
                    hash: blake3::hash(&bytes),
                }
            }
            None => Place::Memory(bytes.into()),
        };
        Self {
            number: PIECES.fetch_add(1, Ordering::Relaxed),
            place,
        }
    }

    /// Number of bytes.
    pub(super) const fn length(&self) -> usize {
        match &self.place {
            Place::Memory(bytes) => bytes.len(),
            Place::File { length, .. } => *length,
        }
    }

    /// The bytes; the task ends if the file does not return them.
    pub(super) fn bytes(&self) -> Cow<'_, [u8]> {
        match &self.place {
            Place::Memory(bytes) => Cow::Borrowed(bytes),
            Place::File {
                file,
                start,
                length,
                hash,
            } => {
                let read = read(file, *start, *length).ok();
                let intact = read.filter(|bytes| blake3::hash(bytes) == *hash);
                Cow::Owned(intact.unwrap_or_else(|| lose()))
            }
        }
    }
}

impl Drop for Kept {
    fn drop(&mut self) {
        if let Place::Memory(bytes) = &self.place {
            IN_MEMORY.fetch_sub(bytes.len(), Ordering::Relaxed);
        }
    }
}

fn read(file: &File, start: u64, length: usize) -> io::Result<Vec<u8>> {
    let mut bytes = vec![0; length];
    file.read_exact_at(&mut bytes, start)?;
    Ok(bytes)
}

/// Writes a piece to the temporary file, and returns where it begins.
fn filed(bytes: &[u8]) -> io::Result<(Arc<File>, u64)> {
    let (file, start) = {
        let mut current = FILE.lock().unwrap_or_else(PoisonError::into_inner);
        let (file, end) = match current.take() {
            Some((file, end)) if end < FILE_BYTES => (file, end),
            _ => (Arc::new(tempfile::tempfile()?), 0),
        };
        *current = Some((Arc::clone(&file), end + bytes.len() as u64));
        (file, end)
    };
    file.write_all_at(bytes, start)?;
    Ok((file, start))
}

#[cfg(test)]
mod tests {
    use std::panic::catch_unwind;

    use super::*;
    use crate::error::Kind;

    #[test]
    fn pieces_beyond_the_memory_lie_in_a_file() {
        let pieces: Vec<Kept> = (0..100_u8)
            .map(|number| Kept::within(0, vec![number; 1 + usize::from(number)]))
            .collect();
        for (number, piece) in (0..).zip(&pieces) {
            assert!(matches!(piece.place, Place::File { .. }));
            assert_eq!(*piece.bytes(), vec![number; 1 + usize::from(number)]);
        }
        // Another byte in the file, as after a write that the disk lost.
        let Place::File { file, start, .. } = &pieces[99].place else {
            panic!("not in a file");
        };
        file.write_all_at(&[98], *start + 50).unwrap();
        let panic = catch_unwind(|| pieces[99].bytes().len()).unwrap_err();
        assert_eq!(lost_values(&*panic).unwrap().kind(), Kind::Io);
        assert_eq!(pieces[98].bytes().len(), 99);
        let other = catch_unwind(|| panic!("another")).unwrap_err();
        assert!(lost_values(&*other).is_none());
        let inside = Kept::within(usize::MAX, vec![1, 2]);
        assert!(matches!(inside.place, Place::Memory(_)));
        assert_eq!(*inside.bytes(), [1, 2]);
    }
}
