//! The engine: it finds changes, decides which sites they touch, has them run, and keeps what they publish.
//!
//! [`Engine::turn`] does all that is due at an instant and leaves what takes long to tasks; [`Engine::run`] takes one turn
//! after the other.

pub mod adopt;
mod agenda;
pub mod alerts;
pub mod attempt;
pub mod core;
pub mod diffs;
pub mod disk;
pub mod ending;
pub mod folders;
pub mod fresh;
pub mod hold;
pub mod hooks;
pub mod listing;
pub mod nights;
pub mod plans;
pub mod reasons;
pub mod retention;
pub mod retry;
pub mod round;
pub mod runs;
pub mod schedule;
pub mod scrub;
pub mod settle;
pub mod sites;
pub mod sweep;
pub mod turn;
pub mod workers;

pub use turn::Engine;
