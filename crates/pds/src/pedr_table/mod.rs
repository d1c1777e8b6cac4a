//! Text tables of shots as `pedr2tab` writes them, to the byte.
//!
//! # Source
//! The MOLA team's program `pedr2tab` (G. Neumann), version 2.71828, and the variant of the USGS: columns, edit
//! descriptors, filters, order of arithmetic. Their errors are reproduced, unless [`Rules::PerShot`] is selected.

mod columns;
mod edit;
mod preferences;
mod rows;

pub use columns::Variant;
pub use preferences::{Ended, Preferences};
pub use rows::{Rules, Table};
