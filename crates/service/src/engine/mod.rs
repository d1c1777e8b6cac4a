//! The engine: it detects changes, determines the affected sites, runs them, and keeps their publications.
//!
//! [`Engine::turn`] performs all work due at an instant and delegates long work to tasks; [`Engine::run`] repeats
//! turns.
//!
//! `turn.rs` repeats turns and begins what is due. Each file is one step of this picture:
//!
//! ```text
//!  round: list folders ─► poll: changed files ─► settle: quiet, read, opened by CSPICE ─► sites affected
//!                                                                                              │
//!  retention ◄─ diffs ◄─ runs: checked, current, noted ◄─ ending ◄─ attempt ◄─ job ◄─ plans: what would run, and why
//! ```
//!
//! A night is a round at an instant of the schedule, before which `fetch.rs` may retrieve files; it ends when its jobs end.
//! `adopt.rs` reconciles the database with the disk at every start. Time and random numbers come from `clock.rs` and `random.rs`, and workers from the trait in
//! `workers.rs`, so that tests substitute all three. Alerts fire on state changes (`alerts.rs`) and are queued for
//! hooks.

pub mod adopt;
mod agenda;
pub mod alerts;
pub mod attempt;
pub mod core;
pub mod damage;
pub mod diffs;
pub mod disk;
pub mod ending;
mod fetch;
pub mod folders;
pub mod fresh;
pub mod hold;
pub mod hooks;
pub mod listing;
mod losses;
pub mod nights;
pub mod plans;
pub mod poll;
pub mod reasons;
pub mod retention;
pub mod retry;
pub mod round;
pub mod runs;
pub mod schedule;
pub mod scrub;
pub mod settle;
pub mod sites;
pub mod turn;
pub mod workers;

pub use turn::Engine;
