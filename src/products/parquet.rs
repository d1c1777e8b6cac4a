//! Tables as Parquet files, the same bytes for the same table.

use std::{fs::File, io::Write, ops::Range, path::Path, sync::Arc};

use ::parquet::{
    arrow::{ArrowWriter, arrow_reader::ParquetRecordBatchReaderBuilder},
    basic::Compression,
    errors::ParquetError,
    file::{metadata::KeyValue, properties::WriterProperties},
};
use arrow::{
    array::{
        ArrayRef, BinaryArray, BooleanArray, Float64Array, Int32Array, StringArray, UInt32Array,
    },
    datatypes::{Field, Schema},
    record_batch::RecordBatch,
};

use super::{
    fault::ProductFault,
    files::{create, finish, open},
    table::{Table, Values},
};
use crate::error::{Failure, IoFault, Place, Result};

/// Rows that stand in memory a second time, as arrays.
const ROWS_AT_ONCE: usize = 65_536;

/// Writes `table` with `metadata` (key, value) and reads it back.
///
/// # Errors
/// What the disk refuses; values that come back different.
pub(super) fn write(path: &Path, table: &Table, metadata: Vec<(&str, String)>) -> Result<u64> {
    let mut file = create(path)?;
    encode(&mut file, table, metadata).in_file(path)?;
    finish(path, file)?;
    read_back(path, table).in_file(path)?;
    Ok(table.rows() as u64)
}

fn encode(file: impl Write + Send, table: &Table, metadata: Vec<(&str, String)>) -> Result<()> {
    let metadata = metadata
        .into_iter()
        .map(|(key, value)| KeyValue::new(key.to_owned(), value))
        .collect();
    let properties = WriterProperties::builder()
        .set_created_by(concat!("areograph ", env!("CARGO_PKG_VERSION")).to_owned())
        .set_compression(Compression::ZSTD(::parquet::basic::ZstdLevel::default()))
        .set_key_value_metadata(Some(metadata))
        .build();
    let schema = record_batch(table, 0..0)?.schema();
    let mut writer = ArrowWriter::try_new(file, schema, Some(properties)).map_err(refused)?;
    for start in (0..table.rows()).step_by(ROWS_AT_ONCE) {
        let rows = start..table.rows().min(start + ROWS_AT_ONCE);
        writer.write(&record_batch(table, rows)?).map_err(refused)?;
    }
    writer.close().map_err(refused)?;
    Ok(())
}

/// The disk's refusal, or the library's.
fn refused(error: ParquetError) -> Failure {
    match error {
        ParquetError::External(source) => match source.downcast::<std::io::Error>() {
            Ok(source) => IoFault::on("write")(*source).into(),
            Err(source) => ProductFault::refused("encode Parquet")(source).into(),
        },
        error => ProductFault::refused("encode Parquet")(error).into(),
    }
}

/// The given rows, which `table` must have, as arrays.
fn record_batch(
    table: &Table,
    rows: Range<usize>,
) -> std::result::Result<RecordBatch, ProductFault> {
    let (fields, arrays): (Vec<Field>, Vec<ArrayRef>) = table
        .columns
        .iter()
        .map(|column| {
            let array = array(&column.values, rows.clone());
            let nullable = matches!(column.values, Values::OptionalF64(_));
            // One entry only: a map of several would be written in random order.
            let description = [("description".to_owned(), column.description.to_owned())];
            let field = Field::new(column.name, array.data_type().clone(), nullable)
                .with_metadata(description);
            (field, array)
        })
        .unzip();
    RecordBatch::try_new(Arc::new(Schema::new(fields)), arrays)
        .map_err(ProductFault::refused("assemble columns"))
}

fn array(values: &Values, rows: Range<usize>) -> ArrayRef {
    match values {
        Values::F64(values) | Values::Fixed(values, _) => {
            Arc::new(Float64Array::from_iter_values(values[rows].iter().copied()))
        }
        Values::OptionalF64(values) => Arc::new(Float64Array::from(values[rows].to_vec())),
        Values::U32(values) => Arc::new(UInt32Array::from(values[rows].to_vec())),
        Values::I32(values) => Arc::new(Int32Array::from(values[rows].to_vec())),
        Values::Bool(values) => Arc::new(BooleanArray::from(values[rows].to_vec())),
        Values::Text(values) => Arc::new(StringArray::from_iter_values(&values[rows])),
        Values::Binary(values) => Arc::new(BinaryArray::from_iter_values(&values[rows])),
    }
}

fn read_back(path: &Path, table: &Table) -> Result<()> {
    let file: File = open(path)?;
    let reader = ParquetRecordBatchReaderBuilder::try_new(file)
        .and_then(ParquetRecordBatchReaderBuilder::build)
        .map_err(ProductFault::unreadable)?;
    let mut rows = 0;
    for batch in reader {
        let batch = batch.map_err(ProductFault::unreadable)?;
        let end = rows + batch.num_rows();
        let expected = record_batch(table, rows..end.min(table.rows()))?;
        for (column, (found, expected)) in table
            .columns
            .iter()
            .zip(batch.columns().iter().zip(expected.columns()))
        {
            if found != expected {
                return Err(ProductFault::ReadBack {
                    what: format!("column {}, from row {}", column.name, rows + 1),
                }
                .into());
            }
        }
        rows = end;
    }
    if rows != table.rows() {
        return Err(ProductFault::ReadBack {
            what: format!("{rows} rows of {}", table.rows()),
        }
        .into());
    }
    Ok(())
}
