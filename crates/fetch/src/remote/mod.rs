//! An archive read on its server, without a copy of it.
//!
//! [`Indexing`] streams every PEDR file once and leaves a stand-in of each in a folder: `store/files/stand_in.rs`. Readers of
//! PEDR files open stand-ins as they open files; [`RemoteFiles`] reads the bytes that they need with HTTP range requests,
//! verifies them by the hashes of the stand-in, and keeps them in the folder.
//!
//! The content decides: bytes with the hash of their block are those of the file that was indexed, whatever the server
//! states on it. A block on this computer is verified whenever it is read, so that neither a killed process nor two
//! processes at a time can leave a wrong one.

mod blocks;
mod error;
mod files;
mod indexing;
mod link;
mod list;
mod place;
mod range;

pub use error::RemoteError;
pub use files::RemoteFiles;
pub use indexing::{Indexed, Indexing};
pub use place::ARCHIVE_FILE;

/// Lets readers of this process read files on servers for which stand-ins stand.
pub fn read_stand_ins() {
    areograph_store::files::stand_in::install(Box::new(RemoteFiles::default()));
}
