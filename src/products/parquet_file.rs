//! Parquet files whose columns are encoded by all threads.

use std::{io::Write, sync::Arc};

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
use arrow::{
    datatypes::{DataType, Field, SchemaRef},
    record_batch::RecordBatch,
};
use rayon::prelude::*;

/// Rows of a group, whose encoded columns stand in memory until it is whole; readers pass over groups.
const GROUP_ROWS: usize = 1 << 18;

type Result<T> = std::result::Result<T, ParquetError>;

/// A file that is being written: the same bytes for the same batches.
pub(super) struct ParquetFile<W: Write + Send> {
    schema: SchemaRef,
    file: SerializedFileWriter<W>,
    factory: ArrowRowGroupWriterFactory,
    /// Those of the group under way, leaf by leaf.
    columns: Vec<ArrowColumnWriter>,
    /// Rows of the group so far, and of a whole one.
    rows: usize,
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

/// Has a column written as it compresses best: measured numbers, of which hardly two are the same, byte by byte, all others
/// through a dictionary.
fn encoded(
    properties: WriterPropertiesBuilder,
    field: &Field,
    above: &[String],
) -> WriterPropertiesBuilder {
    let path = [above, &[field.name().clone()]].concat();
    match field.data_type() {
        DataType::Struct(parts) => parts
            .iter()
            .fold(properties, |of, part| encoded(of, part, &path)),
        DataType::Float64 => {
            let path = ColumnPath::new(path);
            properties
                .set_column_dictionary_enabled(path.clone(), false)
                .set_column_encoding(path, Encoding::BYTE_STREAM_SPLIT)
        }
        _ => properties,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
    use arrow::{
        array::{ArrayRef, Float64Array, StringArray, StructArray},
        compute::concat_batches,
        datatypes::Schema,
    };

    fn field(name: &str, kind: DataType) -> Field {
        Field::new(name, kind, false)
    }

    /// Rows with a number, a text that repeats, and a number in a struct.
    fn rows(range: std::ops::Range<u32>) -> RecordBatch {
        let part = field("x_m", DataType::Float64);
        let numbers = || -> ArrayRef {
            let values = range.clone().map(|row| f64::from(row).sqrt());
            Arc::new(Float64Array::from_iter_values(values))
        };
        let texts = range.clone().map(|row| format!("file {}", row / 3));
        let schema = Schema::new(vec![
            field("range_m", DataType::Float64),
            field("source_file", DataType::Utf8),
            field("place", DataType::Struct(vec![part.clone()].into())),
        ]);
        let place = StructArray::try_new(vec![part].into(), vec![numbers()], None).unwrap();
        let columns: Vec<ArrayRef> = vec![
            numbers(),
            Arc::new(StringArray::from_iter_values(texts)),
            Arc::new(place),
        ];
        RecordBatch::try_new(Arc::new(schema), columns).unwrap()
    }

    fn written(batches: &[RecordBatch]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut file = ParquetFile::in_groups(&mut bytes, batches[0].schema(), 4).unwrap();
        for batch in batches {
            file.write(batch).unwrap();
        }
        file.finish(vec![("frame", "IAU 2000".to_owned())]).unwrap();
        bytes
    }

    #[test]
    fn rows_of_several_groups_come_back_whatever_the_batches() {
        let all = rows(0..11);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("groups.parquet");
        for ends in [vec![11], vec![3, 6, 11], vec![4, 8, 11], vec![9, 10, 11]] {
            let starts = std::iter::once(0).chain(ends.iter().copied());
            let batches: Vec<RecordBatch> = starts
                .zip(&ends)
                .map(|(start, end)| rows(start..*end))
                .collect();
            std::fs::write(&path, written(&batches)).unwrap();
            let file = std::fs::File::open(&path).unwrap();
            let reader = ParquetRecordBatchReaderBuilder::try_new(file).unwrap();
            let groups = reader.metadata().row_groups().iter();
            let groups: Vec<i64> = groups.map(|group| group.num_rows()).collect();
            assert_eq!(groups, [4, 4, 3], "{ends:?}");
            let found: std::result::Result<Vec<_>, _> = reader.build().unwrap().collect();
            let found = found.unwrap();
            assert_eq!(concat_batches(&all.schema(), &found).unwrap(), all);
        }
    }
}
