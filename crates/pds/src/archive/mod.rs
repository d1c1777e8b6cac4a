//! Many PEDR files, searched for the shots in windows: files side by side and piece by piece, all windows at once, in
//! little memory, with the same rows in the same order whatever the number of threads.
//!
//! A record far from every window is passed over by a few of its fields; near one, every shot is judged by its own
//! position in IAU 2000. An index of the archive spares the search to look at most records; what it finds is the same.

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
