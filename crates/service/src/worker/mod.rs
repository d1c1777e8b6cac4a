//! Worker processes: the same program, one task each, JSON lines between it and the service.
//!
//! CSPICE, memory and crashes stay in there.
//!
//! `areograph worker`, hidden, takes a task line and answers on the standard output that it reserves for this. The
//! service forks it from one thread (`fork.rs`), ends it by a line, then SIGTERM, then SIGKILL to its group, and always
//! waits. A worker reads below given folders only, links followed (`config::load_within`, `InputFiles::within`).
//! Products are kept by hard links in folders of runs (`run_folder.rs`), under the lock of the site.

mod fork;
mod lines;
mod log;
pub mod parent;
pub mod process;
pub mod protocol;
pub mod run_folder;
