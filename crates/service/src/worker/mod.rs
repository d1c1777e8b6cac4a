//! Worker processes: the same program, one task each, JSON lines between it and the service.
//!
//! They isolate CSPICE, memory use and crashes from the service.
//!
//! The hidden command `areograph worker` takes a task line and answers on its standard output, reserved for this. The
//! service forks it from one thread (`fork.rs`), ends it by a line, then SIGTERM, then SIGKILL to its group, and always
//! waits for it. On a cluster, `srun` starts it on a node (`srun.rs`). A worker reads only below given folders, links followed (`config::load_within`, `InputFiles::within`).
//! Products are kept by hard links in folders of runs (`run_folder.rs`), under the lock of the site.

mod ended;
mod fork;
mod lines;
mod log;
pub mod parent;
pub mod process;
pub mod protocol;
pub mod run_folder;
pub mod srun;
