//! Named columns of a Parquet file.

use std::path::Path;

use ::parquet::arrow::{ProjectionMask, arrow_reader::ParquetRecordBatchReaderBuilder};
use arrow::{
    array::{Array as _, Float64Array, StringArray, UInt32Array},
    record_batch::RecordBatch,
};

use super::ReadFault;
use crate::{
    error::{Place, Result},
    products::files::open,
};

/// What files are read as, for messages.
const PARQUET: &str = "Parquet";

/// Calls `take` with batch after batch of the columns `names`; columns that are not there are left out.
pub(super) fn read(
    path: &Path,
    names: &[&str],
    mut take: impl FnMut(&Batch) -> std::result::Result<(), ReadFault>,
) -> Result<()> {
    let builder = ParquetRecordBatchReaderBuilder::try_new(open(path)?)
        .map_err(ReadFault::unreadable(PARQUET))
        .in_file(path)?;
    let wanted = ProjectionMask::columns(builder.parquet_schema(), names.iter().copied());
    let batches = builder
        .with_projection(wanted)
        .build()
        .map_err(ReadFault::unreadable(PARQUET))
        .in_file(path)?;
    for batch in batches {
        let batch = batch
            .map_err(ReadFault::unreadable(PARQUET))
            .in_file(path)?;
        take(&Batch(batch)).in_file(path)?;
    }
    Ok(())
}

/// Some rows of the columns asked for.
pub(super) struct Batch(RecordBatch);

impl Batch {
    pub(super) fn rows(&self) -> usize {
        self.0.num_rows()
    }

    fn column<T: 'static>(
        &self,
        name: &'static str,
        expected: &'static str,
        may_be_null: bool,
    ) -> std::result::Result<&T, ReadFault> {
        let wrong = |found: String| ReadFault::Column {
            name,
            found,
            expected,
        };
        let column = self
            .0
            .column_by_name(name)
            .ok_or_else(|| wrong("missing".to_owned()))?;
        if !may_be_null && column.null_count() > 0 {
            return Err(wrong("without a value in some rows".to_owned()));
        }
        column
            .as_any()
            .downcast_ref()
            .ok_or_else(|| wrong(format!("of type {}", column.data_type())))
    }

    /// A column of numbers, none missing.
    pub(super) fn numbers(
        &self,
        name: &'static str,
    ) -> std::result::Result<&Float64Array, ReadFault> {
        self.column(name, "64-bit floating point", false)
    }

    /// A column of numbers, some perhaps missing.
    pub(super) fn optional_numbers(
        &self,
        name: &'static str,
    ) -> std::result::Result<&Float64Array, ReadFault> {
        self.column(name, "64-bit floating point", true)
    }

    /// A column of counts.
    pub(super) fn counts(
        &self,
        name: &'static str,
    ) -> std::result::Result<&UInt32Array, ReadFault> {
        self.column(name, "32-bit unsigned integer", false)
    }

    /// A column of texts.
    pub(super) fn texts(&self, name: &'static str) -> std::result::Result<&StringArray, ReadFault> {
        self.column(name, "text", false)
    }
}
