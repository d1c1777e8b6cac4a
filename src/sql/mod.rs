//! Shots of an archive as a table of `DataFusion`: asked for columns, with conditions of place and time, it reads only the
//! blocks of records that an index, or the records' mid-points, say may have them.

mod conditions;
mod table;

pub use table::{ShotsTable, Tally};
