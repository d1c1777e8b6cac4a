//! Shots of an archive as a table of `DataFusion`: asked for columns, with conditions of place and time, it reads only the
//! blocks of records that an index, or the records' mid-points, say may have them.
//!
//! The program hands in the [`Columns`] of its products; nothing else of it is known here.
//!
//! The crate is built with the feature `sql` alone (decision 0022).

mod conditions;
mod question;
mod table;
mod text;

pub use datafusion;

pub use question::{Question, ask};
pub use table::{Columns, ShotsTable, Tally};
pub use text::{as_table, as_text, as_text_schema};
