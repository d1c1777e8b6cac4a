//! Runs that are changed, killed and taken up again.

mod changes;
mod cluster;
#[path = "../common/mod.rs"]
mod common;
mod killed;
mod killed_writers;
