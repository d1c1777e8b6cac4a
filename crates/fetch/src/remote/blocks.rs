//! Blocks of a file on a server that are on this computer.
//!
//! The local file has the length of the file on the server, with holes where blocks are missing. A block counts only if its
//! bytes have its hash: no list of blocks can be wrong after a killed process, and processes that write the same block write the same bytes.

use std::{
    fs::{self, File, OpenOptions},
    io,
    os::unix::fs::{FileExt as _, OpenOptionsExt as _},
    path::{Path, PathBuf},
};

use rustix::fs::OFlags;

use areograph_base::constants::FETCH_FOLDER;
use areograph_store::files::stand_in::{StandIn, block_hash};

/// Blocks of one file.
#[derive(Debug)]
pub(super) struct Blocks<'a> {
    path: PathBuf,
    file: &'a StandIn,
    open: Option<File>,
}

impl<'a> Blocks<'a> {
    /// The blocks in a folder of stand-ins.
    pub(super) fn of(folder: &Path, file: &'a StandIn) -> Self {
        let path = folder.join(FETCH_FOLDER).join("blocks").join(file.blake3());
        Self {
            open: File::open(&path).ok(),
            path,
            file,
        }
    }

    /// A block, if it is there.
    pub(super) fn read(&self, block: usize) -> Option<Vec<u8>> {
        let bytes = self.file.bytes_of(&(block..block + 1));
        let mut buffer = vec![0; usize::try_from(bytes.end - bytes.start).ok()?];
        self.open
            .as_ref()?
            .read_exact_at(&mut buffer, bytes.start)
            .ok()?;
        is_block(self.file, block, &buffer).then_some(buffer)
    }

    /// Keeps successive verified bytes of the file.
    pub(super) fn write(&self, from: u64, bytes: &[u8]) -> io::Result<()> {
        fs::create_dir_all(self.path.parent().unwrap_or(Path::new(".")))?;
        // A link would lead to a file that is not one of these.
        let file = OpenOptions::new()
            .write(true)
            .create(true)
            .truncate(false)
            .custom_flags(OFlags::NOFOLLOW.bits().cast_signed())
            .open(&self.path)?;
        file.write_all_at(bytes, from)
    }
}

/// Whether these are the bytes of a block that was indexed.
pub(super) fn is_block(file: &StandIn, block: usize, bytes: &[u8]) -> bool {
    file.hash_of(block) == Some(&block_hash(bytes))
}
