//! Streams of rows in the requested format: the one writer for searches, queries and the service.

use std::{
    fs::File,
    io::{BufWriter, Read as _, Write},
    panic::resume_unwind,
    path::Path,
    sync::mpsc::{SyncSender, sync_channel},
    thread::{self, JoinHandle},
};

use ::parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use arrow_array::{Array, ArrayRef, RecordBatch, StringArray, cast::AsArray as _, types};
use arrow_schema::{DataType, FieldRef, SchemaRef, TimeUnit};
use rayon::prelude::*;

use super::{
    coordinates::frame,
    error::ProductError,
    geojson,
    geoparquet::point_of,
    parquet,
    parquet_file::ParquetFile,
    table::{ROWS_OF_A_TASK, Values, pieces},
    text_table,
};
use areograph_base::{
    body::Body,
    error::{Cause, IoError, Locate, Result},
    utc::Utc,
};
use areograph_store::files::{Mark, MarkAt, StagedFile};

/// The column of points in well-known binary.
pub(super) const GEOMETRY: &str = "geometry";

/// Keys of the metadata of Parquet files by which an answer is recognised: of a search, and of an SQL query.
pub(super) const SEARCH: &str = "areograph_search";
/// Key of an answer of SQL.
pub const SQL: &str = "areograph_sql";

/// Format of rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RowsFormat {
    /// Parquet; units and descriptions of columns are the metadata of its fields.
    Parquet,
    /// Comma-separated values, of all columns except columns of bytes.
    Csv,
    /// GeoJSON points on Mars: the column `geometry` with all columns except columns of bytes.
    GeoJson,
}

impl RowsFormat {
    /// Mark by which an earlier answer in this format is recognised.
    const fn mark(self) -> Mark {
        Mark {
            what: "an earlier answer of this command",
            at: match self {
                Self::Parquet => MarkAt::Content(is_answer),
                Self::Csv => MarkAt::List,
                Self::GeoJson => MarkAt::Content(is_collection_of_shots),
            },
        }
    }
}

/// Whether the metadata of a Parquet file states a search or a query.
fn is_answer(path: &Path) -> bool {
    let Ok(Ok(reader)) = File::open(path).map(ParquetRecordBatchReaderBuilder::try_new) else {
        return false;
    };
    let metadata = reader.metadata().file_metadata().key_value_metadata();
    let mut entries = metadata.into_iter().flatten();
    entries.any(|entry| [SEARCH, SQL].contains(&&*entry.key))
}

/// Whether the file begins as a collection of found shots does.
fn is_collection_of_shots(path: &Path) -> bool {
    let Ok(head) = shots_head() else {
        return false;
    };
    let mut found = vec![0; head.len()];
    let read = File::open(path).and_then(|mut file| file.read_exact(&mut found));
    read.is_ok() && found == head.as_bytes()
}

fn shots_head() -> std::result::Result<String, ProductError> {
    geojson::head_of("shots", Body::Mars, frame(Body::Mars), None)
}

/// Columns that cannot be written.
#[derive(Debug, thiserror::Error, Cause)]
enum RowsError {
    #[error("the column {name} contains {holds}; expected a number, a flag or text in each row")]
    #[cause(Configuration: "write Parquet, which also supports lists and groups, or select other columns")]
    Column { name: String, holds: String },
    #[error("the column {GEOMETRY} is missing or contains no points")]
    #[cause(Input: "if another version of areograph wrote the products, regenerate them with this version")]
    NoPoints,
    #[error("columns of these rows differ from those of earlier rows")]
    #[cause(like = NoPoints)]
    Differ,
    #[error("rows were written after an error of earlier rows")]
    #[cause(Bug: "report this with the command and the log")]
    Ended,
}

/// Destination of rows.
pub type Out = Box<dyn Write + Send>;

/// Rows being written by a thread of its own, so that they are encoded while the next ones are found; a file gets its
/// final name when finished.
pub struct RowsWriter {
    staged: Option<StagedFile>,
    /// Rows for the thread, which ends when this is dropped.
    batches: Option<SyncSender<RecordBatch>>,
    /// The thread until it is joined.
    thread: Option<JoinHandle<Result<Rows>>>,
    schema: SchemaRef,
}

/// Rows in their form.
struct Rows {
    form: Form,
    rows: u64,
}

enum Form {
    Parquet(Box<ParquetFile<Out>>),
    Csv(BufWriter<Out>),
    GeoJson(BufWriter<Out>),
}

impl RowsWriter {
    /// Begins the file `path`, in a folder of areograph itself, with rows of these columns.
    ///
    /// # Errors
    /// Errors of the disk.
    pub fn create(path: &Path, format: RowsFormat, schema: SchemaRef) -> Result<Self> {
        Self::staged(StagedFile::create(path)?, format, schema)
    }

    /// Begins a file at a path of the user, where only an earlier answer in this format is replaced.
    ///
    /// # Errors
    /// Errors of the disk; a file that is not such an answer.
    pub fn replacing(path: &Path, format: RowsFormat, schema: SchemaRef) -> Result<Self> {
        Self::staged(StagedFile::replacing(path, format.mark())?, format, schema)
    }

    fn staged(staged: StagedFile, format: RowsFormat, schema: SchemaRef) -> Result<Self> {
        let path = staged.path().to_owned();
        let mut writer = Self::new(Box::new(staged.writer()?), format, schema).in_file(path)?;
        writer.staged = Some(staged);
        Ok(writer)
    }

    /// Begins rows of these columns that go to `out`.
    ///
    /// # Errors
    /// Errors of `out`.
    pub fn new(out: Out, format: RowsFormat, schema: SchemaRef) -> Result<Self> {
        let form = match format {
            RowsFormat::Parquet => {
                let writer = ParquetFile::new(out, SchemaRef::clone(&schema));
                Form::Parquet(Box::new(writer.map_err(parquet::refused)?))
            }
            RowsFormat::Csv => {
                let mut out = BufWriter::new(out);
                text_table::write_names(&mut out, &names(&schema))?;
                Form::Csv(out)
            }
            RowsFormat::GeoJson => {
                let mut out = BufWriter::new(out);
                put(&mut out, shots_head()?)?;
                Form::GeoJson(out)
            }
        };
        let mut rows = Rows { form, rows: 0 };
        // One batch waits while another is encoded.
        let (batches, received) = sync_channel::<RecordBatch>(1);
        let thread = thread::spawn(move || {
            for batch in received {
                rows.append(&batch)?;
            }
            Ok(rows)
        });
        Ok(Self {
            staged: None,
            batches: Some(batches),
            thread: Some(thread),
            schema,
        })
    }

    /// Appends rows.
    ///
    /// # Errors
    /// Other columns than before. Of these or of earlier rows: columns that text cannot hold; errors of the disk.
    pub fn write(&mut self, batch: RecordBatch) -> Result<()> {
        let written = self.send(batch);
        match &self.staged {
            Some(staged) => written.in_file(staged.path()),
            None => written,
        }
    }

    fn send(&mut self, batch: RecordBatch) -> Result<()> {
        let (fields, begun) = (batch.schema(), self.schema.fields().iter());
        let begun = begun.map(|of| (of.name(), of.data_type()));
        if !begun.eq(fields
            .fields()
            .iter()
            .map(|field| (field.name(), field.data_type())))
        {
            return Err(RowsError::Differ.into());
        }
        let batches = self.batches.as_ref();
        if batches.is_some_and(|batches| batches.send(batch).is_ok()) {
            return Ok(());
        }
        // The thread ended early, because of an error.
        self.join().map(|_| ())
    }

    /// The rows when all of them are encoded.
    fn join(&mut self) -> Result<Rows> {
        drop(self.batches.take());
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(ended)) => ended,
            Some(Err(panic)) => resume_unwind(panic),
            None => Err(RowsError::Ended.into()),
        }
    }

    /// Ends the rows, and returns their number.
    ///
    /// * `notes` – metadata of Parquet, text by key; members of GeoJSON, whose text is JSON; CSV cannot hold them
    ///
    /// # Errors
    /// Errors of earlier rows; errors of the disk; a Parquet file that is read back with another number of rows.
    pub fn finish(mut self, notes: Vec<(&str, String)>) -> Result<u64> {
        let ended = self.join().and_then(|of| of.end(notes));
        let Some(staged) = self.staged.take() else {
            return ended.map(|(rows, _)| rows);
        };
        let (rows, is_parquet) = ended.in_file(staged.path())?;
        if is_parquet {
            require_rows(staged.reader()?, rows).in_file(staged.path())?;
        }
        staged.finish()?;
        Ok(rows)
    }
}

impl Drop for RowsWriter {
    /// Waits for the thread, so that nobody writes to an unfinished file when it is removed.
    fn drop(&mut self) {
        drop(self.batches.take());
        if let Some(thread) = self.thread.take() {
            let _unfinished = thread.join();
        }
    }
}

impl Rows {
    fn append(&mut self, batch: &RecordBatch) -> Result<()> {
        match &mut self.form {
            Form::Parquet(writer) => writer.write(batch).map_err(parquet::refused)?,
            Form::Csv(out) => {
                for text in texts(batch, csv_rows) {
                    put(out, text?)?;
                }
            }
            Form::GeoJson(out) => {
                for (index, text) in texts(batch, features).into_iter().enumerate() {
                    if index > 0 || self.rows > 0 {
                        put(out, geojson::SEPARATOR)?;
                    }
                    put(out, text?)?;
                }
            }
        }
        self.rows += batch.num_rows() as u64;
        Ok(())
    }

    /// Ends the rows: their number, and whether they can be read back.
    fn end(self, notes: Vec<(&str, String)>) -> Result<(u64, bool)> {
        let is_parquet = matches!(self.form, Form::Parquet(_));
        self.form.end(notes)?;
        Ok((self.rows, is_parquet))
    }
}

impl Form {
    fn end(self, notes: Vec<(&str, String)>) -> Result<()> {
        match self {
            Self::Parquet(writer) => writer.finish(notes).map_err(parquet::refused),
            Self::Csv(mut out) => Ok(out.flush().map_err(IoError::on("write"))?),
            Self::GeoJson(mut out) => {
                let notes = notes
                    .iter()
                    .map(|(key, json)| format!(",\n\"{key}\": {json}"));
                put(&mut out, format!("\n]{}\n}}\n", notes.collect::<String>()))?;
                Ok(out.flush().map_err(IoError::on("write"))?)
            }
        }
    }
}

fn put(out: &mut impl Write, text: impl AsRef<[u8]>) -> Result<()> {
    Ok(out.write_all(text.as_ref()).map_err(IoError::on("write"))?)
}

/// Calls `text_of` for parts of the batch on all threads.
fn texts(
    batch: &RecordBatch,
    text_of: impl Fn(&RecordBatch) -> Result<Vec<u8>> + Sync,
) -> Vec<Result<Vec<u8>>> {
    let parts: Vec<_> = pieces(batch.num_rows(), ROWS_OF_A_TASK).collect();
    let parts = parts.into_par_iter();
    parts
        .map(|rows| text_of(&batch.slice(rows.start, rows.len())))
        .collect()
}

/// Whether text can hold the column.
fn is_text(field: &FieldRef) -> bool {
    *field.data_type() != DataType::Binary
}

fn csv_rows(batch: &RecordBatch) -> Result<Vec<u8>> {
    let values = attributes(batch)?;
    let columns: Vec<_> = values.iter().map(|values| (None, values)).collect();
    Ok(text_table::values_as_text(&columns, batch.num_rows()))
}

fn features(batch: &RecordBatch) -> Result<Vec<u8>> {
    let points = batch
        .column_by_name(GEOMETRY)
        .and_then(|points| points.as_binary_opt::<i32>())
        .and_then(|points| points.iter().map(|point| point_of(point?)).collect());
    let points: Vec<[f64; 2]> = points.ok_or(RowsError::NoPoints)?;
    let text = geojson::points_as_text(&names(&batch.schema()), &attributes(batch)?, &points);
    Ok(text?)
}

/// Names of the columns that text can hold.
fn names(schema: &SchemaRef) -> Vec<&str> {
    let fields = schema.fields().iter().filter(|field| is_text(field));
    fields.map(|field| &**field.name()).collect()
}

/// Types of these columns.
fn attributes(batch: &RecordBatch) -> Result<Vec<Values>> {
    let fields = batch.schema();
    let columns = fields.fields().iter().zip(batch.columns());
    columns
        .filter(|(field, _)| is_text(field))
        .map(|(field, array)| values_of(field.name(), array))
        .collect()
}

/// Values of a column, row by row. Only numbers with a fraction, and text, may be missing.
fn values_of(name: &str, array: &ArrayRef) -> Result<Values> {
    let is_whole = array.null_count() == 0;
    Ok(match array.data_type() {
        DataType::Float64 if is_whole => {
            Values::Real(array.as_primitive::<types::Float64Type>().values().to_vec())
        }
        DataType::Float64 => {
            Values::OptionalReal(array.as_primitive::<types::Float64Type>().iter().collect())
        }
        DataType::UInt32 if is_whole => {
            Values::Natural(array.as_primitive::<types::UInt32Type>().values().to_vec())
        }
        DataType::Int32 if is_whole => {
            Values::Integer(array.as_primitive::<types::Int32Type>().values().to_vec())
        }
        DataType::Boolean if is_whole => {
            Values::Flag(array.as_boolean().iter().flatten().collect())
        }
        DataType::Timestamp(TimeUnit::Microsecond, Some(_)) if is_whole => {
            let times = array.as_primitive::<types::TimestampMicrosecondType>();
            Values::Time(
                times
                    .values()
                    .iter()
                    .map(|of| Utc::from_microseconds(*of))
                    .collect(),
            )
        }
        DataType::Utf8 if is_whole => Values::Text(array.as_string().clone()),
        DataType::Utf8 => {
            let texts = array.as_string::<i32>().iter();
            Values::Text(StringArray::from_iter_values(
                texts.map(Option::unwrap_or_default),
            ))
        }
        // As in tables: identifiers of windows.
        DataType::List(item) if is_whole && *item.data_type() == DataType::Utf8 => {
            let lists = array.as_list::<i32>().iter().flatten();
            let joined = lists.map(|list| {
                let texts: Vec<&str> = list.as_string::<i32>().iter().flatten().collect();
                texts.join(";")
            });
            Values::Text(StringArray::from_iter_values(joined))
        }
        other => {
            let (name, holds) = (name.to_owned(), other.to_string());
            return Err(RowsError::Column { name, holds }.into());
        }
    })
}

/// Reads back the number of rows of the file.
fn require_rows(file: File, rows: u64) -> Result<()> {
    let reader =
        ParquetRecordBatchReaderBuilder::try_new(file).map_err(ProductError::unreadable)?;
    let found = reader.metadata().file_metadata().num_rows();
    if u64::try_from(found).is_ok_and(|found| found == rows) {
        return Ok(());
    }
    let what = format!("{found} rows of {rows}");
    Err(ProductError::ReadBack { what }.into())
}
