//! Many PEDR files, searched for the shots in windows: files side by side and piece by piece, all windows at once, in
//! little memory, with the same rows in the same order whatever the number of threads.
//!
//! A record far from every window is passed over by a few of its fields; near one, every shot is judged by its own
//! position in IAU 2000. An index of the archive spares the search to look at most records; what it finds is the same.
//!
//! Files are read by `pread`, at most 51 MB at a time, with all threads on one file, and never mapped: a file that
//! shrinks, changes or vanishes is a failure of that file (decision 0020). Records are passed over by
//! `pedr/mid_point.rs` where no window lies in their cell of `geom/window/grid.rs`. The position of a shot is its own,
//! in the frame of the products, never that of its PEDR frame.
//!
//! The index (`index.rs`) has the extents of 128 records each, complaints, and identity and hash of each file. It is
//! trusted only for files that the file system reports as unchanged, and for records judged by the same rules
//! (`pedr::RULES`), so that no result depends on it.

mod block;
mod distinct;
mod folder;
mod found;
mod index;
mod indexing;
mod look;
mod opened;
mod query;
mod scan;
mod search;
mod source;

pub use distinct::{Copies, SAME_SHOT_S, Seen, Span, spans};
pub use folder::Listing;
pub use found::{Found, ShotRejection, WindowLists};
pub use index::{INDEX, Index, IndexedFile, Indexes};
pub use opened::Opened;
pub use query::{Judged, Query};
pub use search::{Sink, UNUSABLE_MAX, UNUSABLE_SHARE_MAX, search};
pub use source::Source;
