//! Tables as Parquet files, the same bytes for the same table.

use std::{fs::File, path::Path, sync::Arc};

use ::parquet::{
    arrow::{ArrowWriter, arrow_reader::ParquetRecordBatchReaderBuilder},
    basic::Compression,
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
    files::{open, write_bytes},
    table::{Table, Values},
};
use crate::error::{Place, Result};

/// Writes `table` with `metadata` (key, value) and reads it back.
///
/// # Errors
/// What the disk refuses; values that come back different.
pub(super) fn write(path: &Path, table: &Table, metadata: Vec<(&str, String)>) -> Result<u64> {
    let batch = record_batch(table).in_file(path)?;
    let bytes = encode(&batch, metadata).in_file(path)?;
    write_bytes(path, &bytes)?;
    read_back(path, &batch).in_file(path)?;
    Ok(batch.num_rows() as u64)
}

fn encode(
    batch: &RecordBatch,
    metadata: Vec<(&str, String)>,
) -> std::result::Result<Vec<u8>, ProductFault> {
    let metadata = metadata
        .into_iter()
        .map(|(key, value)| KeyValue::new(key.to_owned(), value))
        .collect();
    let properties = WriterProperties::builder()
        .set_created_by(concat!("areograph ", env!("CARGO_PKG_VERSION")).to_owned())
        .set_compression(Compression::ZSTD(::parquet::basic::ZstdLevel::default()))
        .set_key_value_metadata(Some(metadata))
        .build();
    let refused = ProductFault::refused("encode Parquet");
    let mut writer =
        ArrowWriter::try_new(Vec::new(), batch.schema(), Some(properties)).map_err(&refused)?;
    writer.write(batch).map_err(&refused)?;
    writer.into_inner().map_err(&refused)
}

fn record_batch(table: &Table) -> std::result::Result<RecordBatch, ProductFault> {
    let (fields, arrays): (Vec<Field>, Vec<ArrayRef>) = table
        .columns
        .iter()
        .map(|column| {
            let array = array(&column.values);
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

fn array(values: &Values) -> ArrayRef {
    match values {
        Values::F64(values) | Values::Fixed(values, _) => {
            Arc::new(Float64Array::from_iter_values(values.iter().copied()))
        }
        Values::OptionalF64(values) => Arc::new(Float64Array::from(values.clone())),
        Values::U32(values) => Arc::new(UInt32Array::from(values.clone())),
        Values::I32(values) => Arc::new(Int32Array::from(values.clone())),
        Values::Bool(values) => Arc::new(BooleanArray::from(values.clone())),
        Values::Text(values) => Arc::new(StringArray::from_iter_values(values)),
        Values::Binary(values) => Arc::new(BinaryArray::from_iter_values(values)),
    }
}

fn read_back(path: &Path, written: &RecordBatch) -> Result<()> {
    let file: File = open(path)?;
    let reader = ParquetRecordBatchReaderBuilder::try_new(file)
        .and_then(ParquetRecordBatchReaderBuilder::build)
        .map_err(ProductFault::unreadable)?;
    let mut rows = 0;
    for batch in reader {
        let batch = batch.map_err(ProductFault::unreadable)?;
        let expected = written.slice(rows, batch.num_rows().min(written.num_rows() - rows));
        for (field, (found, expected)) in written
            .schema()
            .fields()
            .iter()
            .zip(batch.columns().iter().zip(expected.columns()))
        {
            if found != expected {
                return Err(ProductFault::ReadBack {
                    what: format!("column {}, from row {}", field.name(), rows + 1),
                }
                .into());
            }
        }
        rows += expected.num_rows();
    }
    if rows != written.num_rows() {
        return Err(ProductFault::ReadBack {
            what: format!("{rows} rows of {}", written.num_rows()),
        }
        .into());
    }
    Ok(())
}
