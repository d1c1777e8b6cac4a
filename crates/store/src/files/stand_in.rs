//! Stand-ins of files on a server: length and hashes, by which some bytes of the file are read and verified.
//!
//! A stand-in is a small file with the name of the file for which it stands. A program installs the reader of the bytes
//! ([`install`]), since this crate knows no network.

use std::{
    fmt,
    fs::File,
    io::{self, Read, Seek as _, SeekFrom},
    ops::Range,
    path::Path,
    sync::{OnceLock, atomic::AtomicBool},
};

use serde::{Deserialize, Serialize};

use super::{Mark, MarkAt};
use areograph_base::error::{Cause, Error, IoError, Locate as _, Result};

/// Start of a stand-in: type and format version. The BLAKE3 of the remainder follows, then the remainder in postcard.
const HEADER: &[u8] = b"areograph stand-in 1\n";
/// What follows the header while the file has not been indexed.
const PENDING: &[u8] = b"pending\n";
/// Mark by which stand-ins are recognised.
pub const STAND_IN_MARK: Mark = Mark {
    what: "a stand-in that areograph wrote",
    at: MarkAt::Start(HEADER),
};
const HASH_SIZE: usize = 32;
/// Bytes of the hash of a block: the first half of its BLAKE3, which no accidental change matches.
const BLOCK_HASH_SIZE: usize = 16;
/// Largest stand-in that is read, bytes: that of a file of 100 GB.
const BYTES_MAX: u64 = 1 << 26;

/// First bytes of the BLAKE3 of a block.
pub type BlockHash = [u8; BLOCK_HASH_SIZE];

/// A file on a server, as it was when it was indexed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct StandIn {
    bytes: u64,
    blake3: [u8; HASH_SIZE],
    /// Bytes of a block; the last one may be shorter.
    block_bytes: u64,
    blocks: Vec<BlockHash>,
    /// The server's statements on the file: strong validator, time of the last change.
    stated: [Option<String>; 2],
    /// Content of the file for its reader.
    note: Vec<u8>,
}

/// A stand-in whose bytes are not those that were written.
#[derive(Debug, thiserror::Error, Cause)]
#[error("the stand-in of a file on a server is damaged, or of a different version of areograph")]
#[cause(Input: "run `areograph pedr index URL` again with the same folder; it replaces the stand-in")]
struct Damaged;

/// A stand-in of a file that has not been indexed.
#[derive(Debug, thiserror::Error, Cause)]
#[error("this file of the server is not indexed yet; expected its length and hashes")]
#[cause(Input: "run `areograph pedr index URL --into DIR` again with the same folder: it indexes the missing files")]
struct Pending;

/// No reader was installed.
#[derive(Debug, thiserror::Error, Cause)]
#[error("stands for a file on a server, which this program does not read")]
#[cause(Input: "name a file of this computer, or use the areograph command")]
struct NoReader;

/// Successive bytes of a file on a server.
#[derive(Debug, Clone)]
pub struct Part<'a> {
    /// Path of the stand-in.
    pub path: &'a Path,
    /// The file.
    pub file: &'a StandIn,
    /// The bytes, within the file.
    pub bytes: Range<u64>,
}

/// Reads bytes of files on servers.
pub trait Elsewhere: fmt::Debug + Send + Sync {
    /// Brings several parts to this computer at once, so that [`read`](Self::read) need not wait for each. Returns the
    /// failures, each with the index of its part.
    fn bring(&self, parts: &[Part<'_>], stop: &AtomicBool) -> Vec<(usize, Error)>;

    /// Reads a part, verified, into `buffer`, whose length is that of the part.
    ///
    /// # Errors
    /// The server cannot be reached, or its bytes differ from those that were indexed.
    fn read(&self, part: &Part<'_>, buffer: &mut [u8]) -> Result<()>;
}

static INSTALLED: OnceLock<Box<dyn Elsewhere>> = OnceLock::new();

/// Installs the reader of the process; the first one stays.
pub fn install(reader: Box<dyn Elsewhere>) {
    let _first_stays = INSTALLED.set(reader);
}

/// The reader of the process.
///
/// # Errors
/// None is installed.
pub fn elsewhere() -> Result<&'static dyn Elsewhere> {
    let installed = INSTALLED.get().map(AsRef::as_ref);
    Ok(installed.ok_or(NoReader)?)
}

/// The hash of a block.
#[must_use]
pub fn block_hash(bytes: &[u8]) -> BlockHash {
    let mut first = [0; BLOCK_HASH_SIZE];
    first.copy_from_slice(&blake3::hash(bytes).as_bytes()[..BLOCK_HASH_SIZE]);
    first
}

impl StandIn {
    /// Describes a file by reading it once.
    ///
    /// * `block_bytes` – bytes of a block, at least one
    /// * `stated` – the server's strong validator, and its time of the last change
    /// * `note` – content of the file for its reader
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn of(
        path: &Path,
        block_bytes: u64,
        stated: [Option<String>; 2],
        note: Vec<u8>,
    ) -> Result<Self> {
        let described = || -> io::Result<Self> {
            let mut file = File::open(path)?;
            let (mut whole, mut bytes, mut blocks) = (blake3::Hasher::new(), 0, Vec::new());
            let mut block = Vec::new();
            loop {
                block.clear();
                let count = (&mut file)
                    .take(block_bytes.max(1))
                    .read_to_end(&mut block)?;
                if count == 0 {
                    break;
                }
                whole.update(&block);
                blocks.push(block_hash(&block));
                bytes += count as u64;
            }
            Ok(Self {
                bytes,
                blake3: *whole.finalize().as_bytes(),
                block_bytes: block_bytes.max(1),
                blocks,
                stated,
                note,
            })
        };
        described().map_err(IoError::on("read")).in_file(path)
    }

    /// Whether a file that begins with these bytes is a stand-in.
    #[must_use]
    pub fn begins(bytes: &[u8]) -> bool {
        bytes.starts_with(HEADER)
    }

    /// The stand-in that a file is; `None` for any other file.
    ///
    /// # Errors
    /// The file cannot be read; a damaged stand-in.
    pub fn of_open(mut file: &File) -> Result<Option<Self>> {
        let mut bytes = Vec::new();
        let mut read = || -> io::Result<bool> {
            file.seek(SeekFrom::Start(0))?;
            file.take(HEADER.len() as u64).read_to_end(&mut bytes)?;
            if !Self::begins(&bytes) {
                return Ok(false);
            }
            file.take(BYTES_MAX).read_to_end(&mut bytes)?;
            Ok(true)
        };
        if !read().map_err(IoError::on("read"))? {
            return Ok(None);
        }
        if bytes == Self::pending() {
            return Err(Pending.into());
        }
        Ok(Some(Self::decode(&bytes).ok_or(Damaged)?))
    }

    /// Content of the place of a file that is still to be indexed: every reader refuses it, so that an archive is never
    /// taken for complete while files are missing.
    #[must_use]
    pub fn pending() -> Vec<u8> {
        [HEADER, PENDING].concat()
    }

    /// Whether a file has the mark of stand-ins, damaged and pending ones included.
    #[must_use]
    pub fn is_at(path: &Path) -> bool {
        let mut bytes = Vec::new();
        let found = File::open(path);
        let found = found.and_then(|file| file.take(HEADER.len() as u64).read_to_end(&mut bytes));
        found.is_ok() && Self::begins(&bytes)
    }

    fn decode(bytes: &[u8]) -> Option<Self> {
        let (hash, rest) = bytes.strip_prefix(HEADER)?.split_at_checked(HASH_SIZE)?;
        if blake3::hash(rest).as_bytes() != hash {
            return None;
        }
        let found: Self = postcard::from_bytes(rest).ok()?;
        let blocks = found.bytes.div_ceil(found.block_bytes.max(1));
        (found.block_bytes > 0 && found.blocks.len() as u64 == blocks).then_some(found)
    }

    /// Its form in a file; `None` if it cannot be encoded.
    #[must_use]
    pub fn encode(&self) -> Option<Vec<u8>> {
        let rest = postcard::to_stdvec(self).ok()?;
        let hash = blake3::hash(&rest);
        Some([HEADER, hash.as_bytes(), &rest].concat())
    }

    /// Length of the file.
    #[must_use]
    pub const fn bytes(&self) -> u64 {
        self.bytes
    }

    /// BLAKE3 of the file, hexadecimal.
    #[must_use]
    pub fn blake3(&self) -> String {
        blake3::Hash::from_bytes(self.blake3).to_hex().to_string()
    }

    /// The server's strong validator, and its time of the last change, when the file was indexed.
    #[must_use]
    pub fn stated(&self) -> [Option<&str>; 2] {
        let [validator, time] = &self.stated;
        [validator.as_deref(), time.as_deref()]
    }

    /// Content of the file for its reader.
    #[must_use]
    pub fn note(&self) -> &[u8] {
        &self.note
    }

    /// Number of blocks.
    #[must_use]
    pub fn blocks(&self) -> usize {
        self.blocks.len()
    }

    /// The blocks that contain these bytes.
    #[must_use]
    pub fn blocks_with(&self, bytes: &Range<u64>) -> Range<usize> {
        let end = bytes.end.min(self.bytes);
        if bytes.start >= end {
            return 0..0;
        }
        let block = |byte: u64| usize::try_from(byte / self.block_bytes).unwrap_or(usize::MAX);
        block(bytes.start)..block(end - 1) + 1
    }

    /// The bytes of these blocks.
    #[must_use]
    pub fn bytes_of(&self, blocks: &Range<usize>) -> Range<u64> {
        let start = |block: usize| (block as u64 * self.block_bytes).min(self.bytes);
        start(blocks.start)..start(blocks.end)
    }

    /// The hash of a block, if the file has it.
    #[must_use]
    pub fn hash_of(&self, block: usize) -> Option<&BlockHash> {
        self.blocks.get(block)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write as _;

    #[test]
    fn a_stand_in_describes_every_block_and_any_damage_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ap19019l.b");
        let content: Vec<u8> = (0..1_050_u32).map(|value| (value % 251) as u8).collect();
        File::create(&path).unwrap().write_all(&content).unwrap();
        assert_eq!(StandIn::of_open(&File::open(&path).unwrap()).unwrap(), None);
        let stated = [Some("\"a\"".to_owned()), None];
        let one = StandIn::of(&path, 100, stated, b"note".to_vec()).unwrap();
        assert_eq!((one.bytes(), one.blocks()), (1_050, 11));
        assert_eq!(one.blake3(), blake3::hash(&content).to_hex().to_string());
        assert_eq!(one.blocks_with(&(99..201)), 0..3);
        assert_eq!(one.blocks_with(&(1_049..5_000)), 10..11);
        assert_eq!(one.blocks_with(&(7..7)), 0..0);
        assert_eq!(one.bytes_of(&(9..11)), 900..1_050);
        assert_eq!(one.hash_of(10), Some(&block_hash(&content[1_000..])));
        assert_eq!(one.hash_of(11), None);
        let good = one.encode().unwrap();
        let found = |bytes: &[u8]| {
            let path = folder.path().join("x.b");
            File::create(&path).unwrap().write_all(bytes).unwrap();
            StandIn::of_open(&File::open(&path).unwrap())
        };
        assert_eq!(found(&good).unwrap(), Some(one));
        for bit in 8 * HEADER.len()..8 * good.len() {
            let mut bytes = good.clone();
            bytes[bit / 8] ^= 1 << (bit % 8);
            assert!(found(&bytes).is_err(), "bit {bit}");
        }
        assert!(found(&good[..good.len() - 1]).is_err());
        assert!(found(HEADER).is_err());
        let pending = found(&StandIn::pending()).unwrap_err().to_string();
        assert!(pending.contains("not indexed yet"), "{pending}");
        assert!(StandIn::is_at(&folder.path().join("x.b")) && !StandIn::is_at(&path));
    }
}
