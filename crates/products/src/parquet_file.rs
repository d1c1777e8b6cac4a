//! Parquet files whose columns are encoded by all threads.

use std::{io::Write, sync::Arc};

use super::table::ROWS_AT_ONCE;
use ::parquet::{
    arrow::{
        ArrowWriter,
        arrow_writer::{
            ArrowColumnChunk, ArrowColumnWriter, ArrowLeafColumn, ArrowRowGroupWriterFactory,
            compute_leaves,
        },
    },
    basic::{Compression, Encoding, ZstdLevel},
    errors::ParquetError,
    file::{
        metadata::KeyValue,
        properties::{WriterProperties, WriterPropertiesBuilder},
        writer::SerializedFileWriter,
    },
    schema::types::ColumnPath,
};
use arrow_array::RecordBatch;
use arrow_schema::{DataType, Field, SchemaRef};
use rayon::prelude::*;

/// Rows of a group, whose encoded columns are kept in memory until it is complete; readers skip groups.
const GROUP_ROWS: usize = 1 << 18;
/// Files are compared piece by piece.
const _: () = assert!(GROUP_ROWS.is_multiple_of(ROWS_AT_ONCE));

type Result<T> = std::result::Result<T, ParquetError>;

/// A file being written: the same bytes for the same batches.
pub(super) struct ParquetFile<W: Write + Send> {
    schema: SchemaRef,
    file: SerializedFileWriter<W>,
    factory: ArrowRowGroupWriterFactory,
    /// Writers of the current group, leaf by leaf.
    columns: Vec<ArrowColumnWriter>,
    /// Rows of the group so far.
    rows: usize,
    /// Rows of a complete group.
    group_rows: usize,
}

impl<W: Write + Send> ParquetFile<W> {
    /// Begins a file with these columns.
    pub(super) fn new(file: W, schema: SchemaRef) -> Result<Self> {
        Self::in_groups(file, schema, GROUP_ROWS)
    }

    fn in_groups(file: W, schema: SchemaRef, group_rows: usize) -> Result<Self> {
        let properties = schema.fields().iter().fold(
            WriterProperties::builder()
                .set_created_by(concat!("areograph ", env!("CARGO_PKG_VERSION")).to_owned())
                .set_compression(Compression::ZSTD(ZstdLevel::default())),
            |properties, field| encoded(properties, field, &[]),
        );
        let writer = ArrowWriter::try_new(file, Arc::clone(&schema), Some(properties.build()))?;
        let (file, factory) = writer.into_serialized_writer()?;
        Ok(Self {
            schema,
            file,
            factory,
            columns: Vec::new(),
            rows: 0,
            group_rows,
        })
    }

    /// Appends rows.
    pub(super) fn write(&mut self, batch: &RecordBatch) -> Result<()> {
        let mut start = 0;
        while start < batch.num_rows() {
            let rows = (self.group_rows - self.rows).min(batch.num_rows() - start);
            self.write_in_group(&batch.slice(start, rows))?;
            start += rows;
            if self.rows == self.group_rows {
                self.end_group()?;
            }
        }
        Ok(())
    }

    fn write_in_group(&mut self, batch: &RecordBatch) -> Result<()> {
        if self.columns.is_empty() {
            let group = self.file.flushed_row_groups().len();
            self.columns = self.factory.create_column_writers(group)?;
        }
        let fields = self.schema.fields().iter().zip(batch.columns());
        let leaves = fields.map(|(field, array)| compute_leaves(field, array));
        let leaves: Vec<Vec<ArrowLeafColumn>> = leaves.collect::<Result<_>>()?;
        let leaves: Vec<ArrowLeafColumn> = leaves.into_iter().flatten().collect();
        let columns = self.columns.par_iter_mut().zip(leaves);
        columns.try_for_each(|(column, leaf)| column.write(&leaf))?;
        self.rows += batch.num_rows();
        Ok(())
    }

    fn end_group(&mut self) -> Result<()> {
        let columns = std::mem::take(&mut self.columns).into_par_iter();
        let chunks = columns.map(ArrowColumnWriter::close);
        let chunks: Vec<ArrowColumnChunk> = chunks.collect::<Result<_>>()?;
        let mut group = self.file.next_row_group()?;
        for chunk in chunks {
            chunk.append_to_row_group(&mut group)?;
        }
        group.close()?;
        self.rows = 0;
        Ok(())
    }

    /// Ends the file with this metadata.
    pub(super) fn finish(mut self, metadata: Vec<(&str, String)>) -> Result<()> {
        if self.rows > 0 {
            self.end_group()?;
        }
        for (key, value) in metadata {
            let entry = KeyValue::new(key.to_owned(), value);
            self.file.append_key_value_metadata(entry);
        }
        self.file.close()?;
        Ok(())
    }
}

/// Encoding by which a column compresses best: byte-stream splitting for measured numbers, which rarely repeat;
/// differences for counts and times, which increase in steps; no encoding for geometries; a dictionary for all others.
fn encoded(
    properties: WriterPropertiesBuilder,
    field: &Field,
    above: &[String],
) -> WriterPropertiesBuilder {
    let path = [above, &[field.name().clone()]].concat();
    let plain = |properties: WriterPropertiesBuilder, encoding| {
        let path = ColumnPath::new(path.clone());
        properties
            .set_column_dictionary_enabled(path.clone(), false)
            .set_column_encoding(path, encoding)
    };
    match field.data_type() {
        DataType::Struct(parts) => parts
            .iter()
            .fold(properties, |of, part| encoded(of, part, &path)),
        DataType::Float64 | DataType::Float32 => plain(properties, Encoding::BYTE_STREAM_SPLIT),
        DataType::UInt32 | DataType::Timestamp(..) => {
            plain(properties, Encoding::DELTA_BINARY_PACKED)
        }
        DataType::Binary => plain(properties, Encoding::PLAIN),
        _ => properties,
    }
}

#[cfg(test)]
mod tests {
    use ::parquet::{
        arrow::arrow_reader::ParquetRecordBatchReaderBuilder, file::metadata::RowGroupMetaData,
    };
    use arrow_array::{Float64Array, StringArray, UInt32Array};
    use arrow_schema::Schema;
    use arrow_select::concat::concat_batches;

    use super::*;

    /// Rows `from` to `to`: a real, a count that is missing in every third row, a name repeated over many rows.
    fn rows(schema: &SchemaRef, from: u32, to: u32) -> RecordBatch {
        let reals = Float64Array::from_iter_values((from..to).map(|row| f64::from(row).sqrt()));
        let counts: UInt32Array = (from..to)
            .map(|row| (row % 3 != 0).then_some(row))
            .collect();
        let names = (from..to).map(|row| format!("profile {}", row / 4));
        let names = StringArray::from_iter_values(names);
        let columns = vec![
            Arc::new(reals) as _,
            Arc::new(counts) as _,
            Arc::new(names) as _,
        ];
        RecordBatch::try_new(Arc::clone(schema), columns).unwrap()
    }

    fn written(schema: &SchemaRef, batches: &[RecordBatch], group_rows: usize) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut file = ParquetFile::in_groups(&mut bytes, Arc::clone(schema), group_rows).unwrap();
        for batch in batches {
            file.write(batch).unwrap();
        }
        file.finish(vec![("site", "gusev".to_owned())]).unwrap();
        bytes
    }

    #[test]
    fn rows_of_several_groups_come_back_in_their_order() {
        let schema = Arc::new(Schema::new(vec![
            Field::new("a_m", DataType::Float64, false),
            Field::new("count", DataType::UInt32, true),
            Field::new("profile", DataType::Utf8, false),
        ]));
        let all = rows(&schema, 0, 23);
        // Batches that end inside a group, at its end, and behind several.
        let batches = [(0, 3), (3, 5), (5, 6), (6, 6), (6, 19), (19, 23)];
        let batches = batches.map(|(from, to)| rows(&schema, from, to));
        let bytes = written(&schema, &batches, 5);
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(&bytes).unwrap();
        let reader = ParquetRecordBatchReaderBuilder::try_new(file).unwrap();
        let groups = reader.metadata().row_groups().iter();
        let sizes: Vec<i64> = groups.map(RowGroupMetaData::num_rows).collect();
        assert_eq!(sizes, [5, 5, 5, 5, 3]);
        let keys = reader.metadata().file_metadata().key_value_metadata();
        assert!(keys.unwrap().iter().any(|entry| entry.key == "site"));
        let read: Vec<RecordBatch> = reader
            .build()
            .unwrap()
            .map(std::result::Result::unwrap)
            .collect();
        assert_eq!(concat_batches(&schema, &read).unwrap(), all);
        // Groups, and so bytes, do not depend on the batches that rows come in.
        assert_eq!(written(&schema, &[all], 5), bytes);
    }
}
