//! The vocabulary of areograph: units, instants, frames, bodies, instruments, footprints, errors, and what a stage is.

pub mod altimetry;
pub mod body;
pub mod constants;
pub mod error;
pub mod footprints;
pub mod frames;
pub mod image;
pub mod instruments;
pub mod kernel_source;
pub mod line_times;
pub mod schema;
pub mod style;
pub mod ties;
pub mod time;
pub mod units;
pub mod verdict;
pub mod watch;
pub mod wording;
