//! Columns of lists.

use super::{Column, Kind, Table};

impl<R> Column<R> {
    /// A column of texts joined by semicolons, as lists in Parquet.
    pub(crate) fn listed(mut self) -> Self {
        self.meaning.kind = Kind::List;
        self
    }
}

impl Table<'_> {
    /// With lists as texts, for formats without lists.
    pub(crate) fn with_joined_lists(mut self) -> Self {
        for (_, column) in &mut self.columns {
            if column.kind == Kind::List {
                column.kind = Kind::Text;
            }
        }
        self
    }
}
