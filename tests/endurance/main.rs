//! Runs that are changed, killed and taken up again.

mod changes;
mod cluster;
mod cluster_archive;
#[path = "../common/mod.rs"]
mod common;
mod killed;
mod killed_writers;
