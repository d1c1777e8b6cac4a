//! Shots of an archive as a table of `DataFusion`: a query with conditions on position and time reads only the blocks
//! of records that may match, by an index or the records' mid-points.
//!
//! The program supplies the [`Columns`] of its products; this crate has no other dependency on it.
//!
//! The crate is built only with the feature `sql` (decision 0022).

mod conditions;
mod question;
mod table;
mod text;

pub use datafusion;

pub use question::{MEMORY_BYTES, Question, TABLE, ask, ask_tables, read_only};
pub use table::{Columns, ShotsTable, Tally};
pub use text::{as_table, as_text, as_text_schema};
