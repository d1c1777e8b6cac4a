//! Tables as Parquet files, the same bytes for the same table.

use std::{collections::HashMap, io::Write, ops::Range, path::Path, sync::Arc};

use ::parquet::{
    arrow::arrow_reader::{
        ArrowReaderMetadata, ArrowReaderOptions, ParquetRecordBatchReader,
        ParquetRecordBatchReaderBuilder,
    },
    errors::ParquetError,
};
use arrow_array::{
    ArrayRef, BinaryArray, BooleanArray, Float64Array, Int32Array, RecordBatch, StringArray,
    TimestampMicrosecondArray, UInt32Array,
};
use arrow_schema::{DataType, Field, Schema, SchemaRef, TimeUnit};
use rayon::prelude::*;

use super::{
    error::ProductError,
    files::{create, finish, open},
    parquet_file::ParquetFile,
    table::{Kind, Meaning, Table, Values},
    utc::Utc,
};
use areograph_base::error::{Error, IoError, Locate, Result};

/// Zone of instants in the schema of a file.
const UTC: &str = "UTC";

/// Writes `table` with `metadata` (key, value) and reads it back.
///
/// # Errors
/// Numbers that are not finite; errors of the disk; columns and values that are read back differently.
pub(super) fn write(path: &Path, table: &Table, metadata: Vec<(&str, String)>) -> Result<u64> {
    let mut file = create(path)?;
    encode(&mut file, table, metadata).in_file(path)?;
    finish(path, file)?;
    read_back(path, table).in_file(path)?;
    Ok(table.rows() as u64)
}

fn encode(file: impl Write + Send, table: &Table, metadata: Vec<(&str, String)>) -> Result<()> {
    let schema = schema(table);
    let mut file = ParquetFile::new(file, Arc::clone(&schema)).map_err(refused)?;
    for rows in table.pieces() {
        let batch = record_batch(table, &schema, rows)?;
        file.write(&batch).map_err(refused)?;
    }
    file.finish(metadata).map_err(refused)
}

/// An error of the disk, or the library's.
pub(super) fn refused(error: ParquetError) -> Error {
    match error {
        ParquetError::External(source) => match source.downcast::<std::io::Error>() {
            Ok(source) => IoError::on("write")(*source).into(),
            Err(source) => ProductError::refused("encode Parquet")(source).into(),
        },
        error => ProductError::refused("encode Parquet")(error).into(),
    }
}

pub(super) fn schema(table: &Table) -> SchemaRef {
    let fields: Vec<Field> = table.columns().map(field).collect();
    Arc::new(Schema::new(fields))
}

/// Name and type of a column; its description and its unit are the field's metadata.
fn field(column: &Meaning) -> Field {
    let data_type = match column.kind {
        Kind::Real => DataType::Float64,
        Kind::Natural => DataType::UInt32,
        Kind::Integer => DataType::Int32,
        Kind::Flag => DataType::Boolean,
        Kind::Time => DataType::Timestamp(TimeUnit::Microsecond, Some(UTC.into())),
        Kind::Text => DataType::Utf8,
        Kind::Bytes => DataType::Binary,
    };
    let description = (
        "description".to_owned(),
        column.description.clone().into_owned(),
    );
    let unit = column.unit.symbol();
    let unit = unit.map(|symbol| ("unit".to_owned(), symbol.to_owned()));
    Field::new(column.name, data_type, column.optional).with_metadata(
        [description]
            .into_iter()
            .chain(unit)
            .collect::<HashMap<_, _>>(),
    )
}

/// The given rows, which `table` must have, as arrays.
pub(super) fn record_batch(
    table: &Table,
    schema: &SchemaRef,
    rows: Range<usize>,
) -> std::result::Result<RecordBatch, ProductError> {
    let values = table.values(rows)?.into_par_iter();
    let arrays = values.map(array).collect();
    RecordBatch::try_new(Arc::clone(schema), arrays)
        .map_err(ProductError::refused("assemble columns"))
}

fn array(values: Values) -> ArrayRef {
    match values {
        Values::Real(values) => Arc::new(Float64Array::from(values)),
        Values::OptionalReal(values) => Arc::new(Float64Array::from(values)),
        Values::Natural(values) => Arc::new(UInt32Array::from(values)),
        Values::Integer(values) => Arc::new(Int32Array::from(values)),
        Values::Flag(values) => Arc::new(BooleanArray::from(values)),
        Values::Time(values) => {
            let values = values.into_iter().map(|Utc(of)| of);
            let times = TimestampMicrosecondArray::from_iter_values(values);
            Arc::new(times.with_timezone(UTC))
        }
        Values::Text(values) => Arc::new(StringArray::from_iter_values(values)),
        Values::Bytes(values) => Arc::new(BinaryArray::from_iter_values(values)),
    }
}

/// Compares the file with the table, group by group on all threads.
fn read_back(path: &Path, table: &Table) -> Result<()> {
    let metadata = ArrowReaderMetadata::load(&open(path)?, ArrowReaderOptions::default())
        .map_err(ProductError::unreadable)?;
    let schema = schema(table);
    if metadata.schema().fields() != schema.fields() {
        let what = "names, types, units or descriptions of columns".to_owned();
        return Err(ProductError::ReadBack { what }.into());
    }
    let groups = metadata.metadata().row_groups().iter();
    let mut rows = 0;
    let ranges: Vec<Range<usize>> = groups
        .map(|group| {
            let start = rows;
            rows += usize::try_from(group.num_rows()).unwrap_or(0);
            start..rows
        })
        .collect();
    require_rows(rows, table.rows())?;
    let compared = ranges.par_iter().enumerate().map(|(group, rows)| {
        // Each with its own position in the file.
        let file = open(path)?;
        let batches = ParquetRecordBatchReaderBuilder::new_with_metadata(file, metadata.clone())
            .with_row_groups(vec![group])
            .build()
            .map_err(ProductError::unreadable)?;
        compare(batches, rows, table, &schema)
    });
    let compared: Vec<Result<()>> = compared.collect();
    compared.into_iter().collect()
}

fn require_rows(found: usize, expected: usize) -> Result<()> {
    if found == expected {
        return Ok(());
    }
    Err(ProductError::ReadBack {
        what: format!("{found} rows of {expected}"),
    }
    .into())
}

/// Compares these rows of the table with the rows of a file.
fn compare(
    batches: ParquetRecordBatchReader,
    range: &Range<usize>,
    table: &Table,
    schema: &SchemaRef,
) -> Result<()> {
    let mut rows = range.start;
    for batch in batches {
        let batch = batch.map_err(ProductError::unreadable)?;
        let end = rows + batch.num_rows();
        let expected = record_batch(table, schema, rows..end.min(range.end))?;
        for (column, (found, expected)) in table
            .columns()
            .zip(batch.columns().iter().zip(expected.columns()))
        {
            if found != expected {
                return Err(ProductError::ReadBack {
                    what: format!("column {}, from row {}", column.name, rows + 1),
                }
                .into());
            }
        }
        rows = end;
    }
    require_rows(rows, range.end)
}
