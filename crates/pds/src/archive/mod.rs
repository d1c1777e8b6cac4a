//! Search of many PEDR files for the shots in windows: several files and pieces in parallel, all windows at once, in
//! little memory. Rows and their order do not depend on the number of threads.
//!
//! A few fields of a record decide whether it is far from every window; near a window, every shot is tested by its own
//! position in IAU 2000. With an index of the archive, most records are not examined; the result is the same.
//!
//! Files are read by `pread`, at most 51 MB at a time, with all threads on one file, and never mapped: a file that
//! shrinks, changes or vanishes is a failure of that file (decision 0020). `pedr/mid_point.rs` skips records in cells
//! of `geom/window/grid.rs` without a window. The position of a shot is its own, in the frame of the products, never
//! the position of its PEDR frame.
//!
//! The index (`index.rs`) holds the extents of blocks of 128 records, complaints, and identity and hash of each file.
//! It is trusted only for unchanged files, and for records checked by the same rules (`pedr::RULES`), so that results
//! do not depend on it.
//!
//! A file may be on a server: its stand-in (`store/files/stand_in.rs`) contains its index entry, and the search brings
//! the bytes of all its pieces at once.

mod apart;
mod block;
mod distinct;
mod folder;
mod found;
mod index;
mod indexing;
mod look;
mod opened;
mod parts;
mod query;
mod scan;
mod search;
mod source;
mod tables;

pub use apart::apart;
pub use distinct::{Copies, Repetition, SAME_SHOT_S, Seen, Span, TableRows, spans};
pub use folder::{Listing, decompressed};
pub use found::{Found, ShotRejection, WindowLists};
pub use index::{INDEX, INDEX_MARK, Index, IndexedFile, Indexes};
pub use indexing::stand_in;
pub use opened::Opened;
pub use query::{Judged, Query};
pub use search::{Sink, UNUSABLE_MAX, UNUSABLE_SHARE_MAX, search};
pub use source::Source;
pub use tables::{FoundInTables, SearchedTable, repetition_complaint, search_tables};
