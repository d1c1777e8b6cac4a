//! Answers as text, for columns of any type.

use std::sync::Arc;

use datafusion::arrow::{
    array::{Array as _, ArrayRef, StringArray},
    datatypes::{DataType, Field, Fields, Schema, SchemaRef},
    error::ArrowError,
    record_batch::RecordBatch,
    util::{
        display::{ArrayFormatter, FormatOptions},
        pretty::pretty_format_batches_with_schema,
    },
};

/// The columns of [`as_text`].
#[must_use]
pub fn as_text_schema(schema: &SchemaRef) -> SchemaRef {
    let text = |field: &Arc<Field>| {
        if field.data_type().is_nested() {
            Arc::clone(field)
        } else {
            Arc::new(Field::new(field.name(), DataType::Utf8, true))
        }
    };
    let fields: Fields = schema.fields().iter().map(text).collect();
    Arc::new(Schema::new(fields))
}

/// Rows whose columns are text, as formatted by Arrow; empty where there is no value. Lists and groups are unchanged.
///
/// # Errors
/// A value that Arrow cannot format.
pub fn as_text(batch: &RecordBatch) -> Result<RecordBatch, ArrowError> {
    let options = FormatOptions::default();
    let text = |column: &ArrayRef| -> Result<ArrayRef, ArrowError> {
        if column.data_type().is_nested() {
            return Ok(Arc::clone(column));
        }
        let formatter = ArrayFormatter::try_new(column, &options)?;
        let texts = (0..column.len()).map(|row| formatter.value(row).try_to_string());
        let texts: Vec<String> = texts.collect::<Result<_, _>>()?;
        Ok(Arc::new(StringArray::from(texts)))
    };
    let columns = batch.columns().iter().map(text);
    let columns = columns.collect::<Result<Vec<_>, _>>()?;
    RecordBatch::try_new(as_text_schema(&batch.schema()), columns)
}

/// Rows as a table with borders.
///
/// # Errors
/// A value that Arrow cannot format.
pub fn as_table(schema: SchemaRef, batches: &[RecordBatch]) -> Result<String, ArrowError> {
    Ok(pretty_format_batches_with_schema(schema, batches)?.to_string())
}
