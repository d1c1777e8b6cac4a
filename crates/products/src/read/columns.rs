//! Named columns of a Parquet file.

use std::path::Path;

use ::parquet::arrow::{ProjectionMask, arrow_reader::ParquetRecordBatchReaderBuilder};
use arrow_array::{Array as _, BooleanArray, Float64Array, RecordBatch, StringArray, UInt32Array};

use super::ReadError;
use crate::files::open;
use areograph_base::error::{Locate, Result};

/// Name of the contents of files, for messages.
const PARQUET: &str = "Parquet";

/// Calls `take` with batch after batch of the columns `names`; missing columns are left out.
pub(super) fn read(
    path: &Path,
    names: &[&str],
    mut take: impl FnMut(&Batch) -> std::result::Result<(), ReadError>,
) -> Result<()> {
    let builder = ParquetRecordBatchReaderBuilder::try_new(open(path)?)
        .map_err(ReadError::unreadable(PARQUET))
        .in_file(path)?;
    let required = ProjectionMask::columns(builder.parquet_schema(), names.iter().copied());
    let batches = builder
        .with_projection(required)
        .build()
        .map_err(ReadError::unreadable(PARQUET))
        .in_file(path)?;
    let mut rows_before = 0;
    for batch in batches {
        let columns = batch
            .map_err(ReadError::unreadable(PARQUET))
            .in_file(path)?;
        let batch = Batch {
            columns,
            rows_before,
        };
        take(&batch).in_file(path)?;
        rows_before += batch.rows();
    }
    Ok(())
}

/// Some rows of the selected columns.
pub(super) struct Batch {
    columns: RecordBatch,
    /// Rows of the file before these.
    rows_before: usize,
}

impl Batch {
    pub(super) fn rows(&self) -> usize {
        self.columns.num_rows()
    }

    fn column<T: 'static>(
        &self,
        name: &'static str,
        expected: &'static str,
        may_be_null: bool,
    ) -> std::result::Result<&T, ReadError> {
        let wrong = |found: String| ReadError::Column {
            name,
            found,
            expected,
        };
        let column = self
            .columns
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

    /// A column of finite numbers, none missing.
    pub(super) fn numbers(
        &self,
        name: &'static str,
    ) -> std::result::Result<&Float64Array, ReadError> {
        self.finite(name, false)
    }

    /// A column of finite numbers, some possibly missing.
    pub(super) fn optional_numbers(
        &self,
        name: &'static str,
    ) -> std::result::Result<&Float64Array, ReadError> {
        self.finite(name, true)
    }

    fn finite(
        &self,
        name: &'static str,
        may_be_null: bool,
    ) -> std::result::Result<&Float64Array, ReadError> {
        let numbers: &Float64Array = self.column(name, "64-bit floating point", may_be_null)?;
        let mut rows = numbers.iter().zip(self.rows_before + 1..);
        match rows.find_map(|(number, row)| Some((number.filter(|n| !n.is_finite())?, row))) {
            None => Ok(numbers),
            Some((number, row)) => Err(ReadError::Column {
                name,
                found: format!("{number} in row {row}"),
                expected: "finite numbers",
            }),
        }
    }

    /// A column of counts.
    pub(super) fn counts(
        &self,
        name: &'static str,
    ) -> std::result::Result<&UInt32Array, ReadError> {
        self.column(name, "32-bit unsigned integer", false)
    }

    /// A column of flags.
    pub(super) fn flags(
        &self,
        name: &'static str,
    ) -> std::result::Result<&BooleanArray, ReadError> {
        self.column(name, "Boolean", false)
    }

    /// A column of texts.
    pub(super) fn texts(&self, name: &'static str) -> std::result::Result<&StringArray, ReadError> {
        self.column(name, "text", false)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use arrow_array::ArrayRef;

    use super::*;

    #[test]
    fn numbers_that_are_none_are_refused_with_their_row() {
        let batch = |numbers: [Option<f64>; 3]| Batch {
            columns: RecordBatch::try_from_iter([(
                "x_m",
                Arc::new(Float64Array::from_iter(numbers)) as ArrayRef,
            )])
            .unwrap(),
            rows_before: 100,
        };
        let refused = |error: std::result::Result<&Float64Array, ReadError>| {
            error.map(drop).unwrap_err().to_string()
        };
        let expected = "column x_m is NaN in row 103; expected finite numbers";
        let spoilt = batch([Some(1.0), Some(2.0), Some(f64::NAN)]);
        assert_eq!(refused(spoilt.numbers("x_m")), expected);
        assert_eq!(refused(spoilt.optional_numbers("x_m")), expected);
        let expected = "column x_m is -inf in row 102; expected finite numbers";
        let spoilt = batch([None, Some(f64::NEG_INFINITY), Some(0.0)]);
        assert_eq!(refused(spoilt.optional_numbers("x_m")), expected);
        let whole = batch([None, Some(1.0), Some(2.0)]);
        assert_eq!(whole.optional_numbers("x_m").unwrap().null_count(), 1);
    }
}
