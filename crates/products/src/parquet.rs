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
    Array as _, ArrayRef, BooleanArray, Float64Array, GenericByteArray, Int32Array, RecordBatch,
    StringArray, TimestampMicrosecondArray, UInt32Array,
    builder::{ListBuilder, StringBuilder},
    cast::AsArray as _,
    types::{ByteArrayType, Float64Type},
};
use arrow_schema::{DataType, Field, FieldRef, Schema, SchemaRef, TimeUnit};
use rayon::prelude::*;

use super::{
    error::ProductError,
    files::{create, finish, open},
    parquet_file::ParquetFile,
    table::{Kind, Meaning, ROWS_AT_ONCE, Table, Values},
};
use areograph_base::{
    error::{Error, IoError, Locate, Result},
    utc::Utc,
};

/// Zone of instants in the schema of a file.
const UTC: &str = "UTC";

/// Writes `table` with `metadata` (key, value) and reads it back.
///
/// # Errors
/// Numbers that are not finite; errors of the disk; columns and values that are read back differently.
pub(super) fn write(path: &Path, table: &Table, metadata: Vec<(&str, String)>) -> Result<u64> {
    let mut file = create(path)?;
    let digests = encode(&mut file, table, metadata).in_file(path)?;
    finish(path, file)?;
    read_back(path, table, &digests).in_file(path)?;
    Ok(table.rows() as u64)
}

/// One digest for each column of a piece of a table.
type Digests = Vec<blake3::Hash>;

/// Writes the table; returns the digests of its pieces.
fn encode(
    file: impl Write + Send,
    table: &Table,
    metadata: Vec<(&str, String)>,
) -> Result<Vec<Digests>> {
    let schema = schema(table);
    let mut file = ParquetFile::new(file, Arc::clone(&schema)).map_err(refused)?;
    let mut digests = Vec::new();
    for rows in table.pieces() {
        let batch = record_batch(table, &schema, rows)?;
        file.write(&batch).map_err(refused)?;
        digests.push(batch.columns().par_iter().map(digest).collect());
    }
    file.finish(metadata).map_err(refused)?;
    Ok(digests)
}

/// Digest of the values of an array; its type must be one that tables contain.
fn digest(array: &ArrayRef) -> blake3::Hash {
    let mut hasher = blake3::Hasher::new();
    match array.data_type() {
        DataType::Float64 if array.null_count() > 0 => {
            let values = || array.as_primitive::<Float64Type>().iter();
            let is_known = values().map(|of| u8::from(of.is_some()));
            hasher.update(&is_known.collect::<Vec<u8>>());
            let known = values().flatten().flat_map(f64::to_le_bytes);
            hasher.update(&known.collect::<Vec<u8>>());
        }
        DataType::Boolean => {
            let values = array.as_boolean().values().iter();
            hasher.update(&values.map(u8::from).collect::<Vec<u8>>());
        }
        DataType::Utf8 => update_pieces(&mut hasher, array.as_string::<i32>()),
        DataType::List(_) => {
            let lists = array.as_list::<i32>();
            let lengths = lists.offsets().windows(2);
            let lengths = lengths.flat_map(|of| (of[1] - of[0]).to_le_bytes());
            hasher.update(&lengths.collect::<Vec<u8>>());
            update_pieces(&mut hasher, lists.values().as_string::<i32>());
        }
        _ => {
            for buffer in array.to_data().buffers() {
                hasher.update(buffer.as_slice());
            }
        }
    }
    hasher.finalize()
}

/// Adds the lengths and the bytes of texts or other sequences of bytes.
fn update_pieces<T: ByteArrayType<Offset = i32>>(
    hasher: &mut blake3::Hasher,
    array: &GenericByteArray<T>,
) {
    let offsets = array.value_offsets();
    let lengths = offsets
        .windows(2)
        .flat_map(|of| (of[1] - of[0]).to_le_bytes());
    hasher.update(&lengths.collect::<Vec<u8>>());
    hasher.update(array.value_data());
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
        Kind::List => DataType::List(element()),
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
    let kinds: Vec<Kind> = table.columns().map(|column| column.kind).collect();
    let values = table.values(rows)?.into_par_iter().zip(kinds);
    let arrays = values.map(|(values, kind)| match values {
        Values::Text(texts) if kind == Kind::List => lists(&texts),
        values => array(values),
    });
    let arrays = arrays.collect();
    RecordBatch::try_new(Arc::clone(schema), arrays)
        .map_err(ProductError::refused("assemble columns"))
}

/// The parts of lists, named as in the Parquet format.
fn element() -> FieldRef {
    Arc::new(Field::new("element", DataType::Utf8, false))
}

/// Lists of texts that were joined by semicolons.
fn lists(joined: &StringArray) -> ArrayRef {
    let mut lists = ListBuilder::new(StringBuilder::new()).with_field(element());
    for texts in joined.iter().flatten() {
        let parts = texts.split(';').filter(|part| !part.is_empty());
        lists.append_value(parts.map(Some));
    }
    Arc::new(lists.finish())
}

fn array(values: Values) -> ArrayRef {
    match values {
        Values::Real(values) => Arc::new(Float64Array::from(values)),
        Values::OptionalReal(values) => Arc::new(Float64Array::from(values)),
        Values::Natural(values) => Arc::new(UInt32Array::from(values)),
        Values::Integer(values) => Arc::new(Int32Array::from(values)),
        Values::Flag(values) => Arc::new(BooleanArray::from(values)),
        Values::Time(values) => {
            let values = values.into_iter().map(Utc::microseconds);
            let times = TimestampMicrosecondArray::from_iter_values(values);
            Arc::new(times.with_timezone(UTC))
        }
        Values::Text(values) => Arc::new(values),
        Values::Bytes(values) => Arc::new(values),
    }
}

/// Compares the file with the digests of the table, group by group on all threads.
fn read_back(path: &Path, table: &Table, digests: &[Digests]) -> Result<()> {
    let metadata = ArrowReaderMetadata::load(&open(path)?, ArrowReaderOptions::default())
        .map_err(ProductError::unreadable)?;
    if metadata.schema().fields() != schema(table).fields() {
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
            .with_batch_size(ROWS_AT_ONCE)
            .build()
            .map_err(ProductError::unreadable)?;
        compare(batches, rows, table, digests)
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

/// Compares these rows of a file with the digests of the table; every group begins at the start of a piece.
fn compare(
    batches: ParquetRecordBatchReader,
    range: &Range<usize>,
    table: &Table,
    digests: &[Digests],
) -> Result<()> {
    let mut row = range.start;
    for (batch, expected) in batches.zip(digests.iter().skip(row / ROWS_AT_ONCE)) {
        let batch = batch.map_err(ProductError::unreadable)?;
        let columns = batch.columns().iter().zip(expected);
        for (column, (found, expected)) in table.columns().zip(columns) {
            if digest(found) != *expected {
                let what = format!("column {}, from row {}", column.name, row + 1);
                return Err(ProductError::ReadBack { what }.into());
            }
        }
        row += batch.num_rows();
    }
    require_rows(row, range.end)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::{Column, Unit, column};

    /// Two columns of these rows: a number that may be missing, and a text.
    fn table(rows: Vec<(Option<f64>, &'static str)>) -> Table<'static> {
        let columns: Vec<Column<(Option<f64>, &str)>> = vec![
            column("a_m", Unit::Metre, "", |row: &(Option<f64>, &str)| row.0),
            column("name", Unit::None, "", |row: &(Option<f64>, &str)| {
                row.1.to_owned()
            }),
        ];
        Table::new(columns, rows)
    }

    #[test]
    fn a_file_of_other_values_is_not_the_table() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rows.parquet");
        let rows = |name| vec![(Some(0.0), "ab"), (None, "c"), (Some(-0.0), name)];
        assert_eq!(write(&path, &table(rows("d")), Vec::new()).unwrap(), 3);
        let refused = |rows: Vec<(Option<f64>, &'static str)>| {
            let expected = table(rows);
            let digests = encode(Vec::new(), &expected, Vec::new()).unwrap();
            read_back(&path, &expected, &digests)
                .unwrap_err()
                .to_string()
        };
        let of_column = |name: &str, failure: String| {
            let expected = format!("column {name}, from row 1");
            assert!(failure.contains(&expected), "{failure}");
        };
        of_column("name", refused(rows("e")));
        // The same letters, divided differently.
        let divided = vec![(Some(0.0), "a"), (None, "bc"), (Some(-0.0), "d")];
        of_column("name", refused(divided));
        let present = vec![(Some(0.0), "ab"), (Some(0.0), "c"), (Some(-0.0), "d")];
        of_column("a_m", refused(present));
        let sign = vec![(Some(0.0), "ab"), (None, "c"), (Some(0.0), "d")];
        of_column("a_m", refused(sign));
        // Values of every other type, in a second group.
        let long = |spoilt: usize, column_at: usize| {
            let of = move |at: usize| (i32::try_from(at).unwrap(), at == spoilt);
            let columns: Vec<Column<(i32, bool)>> = vec![
                column("count", Unit::None, "", move |row: &(i32, bool)| {
                    row.0.unsigned_abs() + u32::from(row.1 && column_at == 0)
                }),
                column("class", Unit::None, "", move |row: &(i32, bool)| {
                    -row.0 - i32::from(row.1 && column_at == 1)
                }),
                column("flag", Unit::None, "", move |row: &(i32, bool)| {
                    (row.0 % 3 == 0) != (row.1 && column_at == 2)
                }),
                column("utc", Unit::None, "", move |row: &(i32, bool)| {
                    let later = i64::from(row.1 && column_at == 3);
                    Utc::from_microseconds(i64::from(row.0) + later)
                }),
                column("geometry", Unit::None, "", move |row: &(i32, bool)| {
                    [row.0.to_le_bytes()[0], u8::from(row.1 && column_at == 4)]
                }),
                column("windows", Unit::None, "", move |row: &(i32, bool)| {
                    let texts = ["a", "", "a;b"][(row.0.unsigned_abs() as usize + 2) % 3];
                    let is_spoilt = row.1 && column_at == 5;
                    texts.replace("a;b", if is_spoilt { "ab" } else { "a;b" })
                })
                .listed(),
            ];
            Table::of(columns, 5 * ROWS_AT_ONCE + 3, of)
        };
        let path_long = folder.path().join("long.parquet");
        write(&path_long, &long(usize::MAX, 0), Vec::new()).unwrap();
        for (column_at, name) in ["count", "class", "flag", "utc", "geometry", "windows"]
            .iter()
            .enumerate()
        {
            let expected = long(5 * ROWS_AT_ONCE + 1, column_at);
            let digests = encode(Vec::new(), &expected, Vec::new()).unwrap();
            let failure = read_back(&path_long, &expected, &digests)
                .unwrap_err()
                .to_string();
            let place = format!("column {name}, from row {}", 5 * ROWS_AT_ONCE + 1);
            assert!(failure.contains(&place), "{failure}");
        }
        let fewer = refused(rows("d")[..2].to_vec());
        assert!(fewer.contains("3 rows of 2"), "{fewer}");
    }
}
