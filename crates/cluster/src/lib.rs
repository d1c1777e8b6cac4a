//! Queries of the shots of an archive on several processes or computers, which Ballista runs: a scheduler plans a query
//! and executors search the files of the archive. The search of each file is that of a query on one computer.
//!
//! The files are read where they are, at the same path on every computer. The program that asks names the files and
//! their hashes; an executor that has other files fails, so that no answer is incomplete.
//!
//! The crate is built only with the feature `cluster` (decision 0038).

mod ask;
mod codec;
mod named;
mod place;
mod processes;
mod scan;
mod stalled;
mod table;

pub use ask::{Unanswered, ask, failure};
pub use place::Place;
pub use processes::{NotServed, execute, schedule};
pub use table::{ArchiveTable, NotIndexed};
