//! Prints or writes an answer batch by batch.

use std::{
    io::{self, Stdout, Write},
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};

use arrow_array::RecordBatch;
use arrow_schema::SchemaRef;

use super::Format;
use crate::cli::output;
use crate::{
    error::{Cause, Locate as _, Result},
    products::{RowsFormat, RowsWriter, SQL},
    sql::{as_table, as_text, as_text_schema},
};

/// Maximum number of rows of a table on the terminal.
const TABLE_ROWS_MAX: usize = 1_000;

/// Rows that cannot be written as requested.
#[derive(Debug, thiserror::Error, Cause)]
enum NotWritten {
    #[error("the answer cannot be written: {0}")]
    #[cause(Io: "write the answer to a file (--out)")]
    Refused(String),
    #[error("has the extension {0:?}; expected parquet or csv")]
    #[cause(Configuration: "name the file with one of these extensions")]
    Ending(String),
}

impl NotWritten {
    fn refused(error: impl std::fmt::Display) -> Self {
        Self::Refused(error.to_string())
    }
}

/// Destination of an answer.
pub(super) enum Answer {
    /// A table on standard output.
    Table {
        schema: SchemaRef,
        batches: Vec<RecordBatch>,
    },
    /// Rows in a file or on standard output, and whether the reader of the latter has closed the pipe.
    Rows {
        writer: RowsWriter,
        format: RowsFormat,
        is_gone: Arc<AtomicBool>,
    },
}

/// Writer to standard output: a closed pipe (`| head`) is not a failure, but a write error is.
struct Reader {
    out: Stdout,
    is_gone: Arc<AtomicBool>,
}

impl Reader {
    /// The result of an operation; `gone` if the pipe was closed.
    fn or_gone<T>(&self, done: io::Result<T>, gone: T) -> io::Result<T> {
        match done {
            Err(error) if error.kind() == io::ErrorKind::BrokenPipe => {
                self.is_gone.store(true, Ordering::Relaxed);
                Ok(gone)
            }
            done => done,
        }
    }
}

impl Write for Reader {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.out.write(bytes);
        self.or_gone(written, bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        let flushed = self.out.flush();
        self.or_gone(flushed, ())
    }
}

impl Answer {
    /// An answer on standard output.
    pub(super) fn printed(format: Format, schema: SchemaRef) -> Result<Self> {
        Ok(match format {
            Format::Table => Self::Table {
                schema,
                batches: Vec::new(),
            },
            Format::Csv => {
                let is_gone = Arc::new(AtomicBool::new(false));
                let reader = Box::new(Reader {
                    out: io::stdout(),
                    is_gone: Arc::clone(&is_gone),
                });
                let format = RowsFormat::Csv;
                Self::Rows {
                    writer: RowsWriter::new(reader, format, as_text_schema(&schema))?,
                    format,
                    is_gone,
                }
            }
        })
    }

    /// An answer in a file, which appears once it is complete.
    pub(super) fn in_file(path: &Path, schema: &SchemaRef) -> Result<Self> {
        let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
        let (format, schema) = match ending.to_str() {
            Some("csv") => (RowsFormat::Csv, as_text_schema(schema)),
            Some("parquet") => (RowsFormat::Parquet, SchemaRef::clone(schema)),
            _ => {
                let ending = ending.to_string_lossy().into_owned();
                return Err(NotWritten::Ending(ending)).in_file(path);
            }
        };
        Ok(Self::Rows {
            writer: RowsWriter::replacing(path, format, schema)?,
            format,
            is_gone: Arc::default(),
        })
    }

    /// Accepts rows; returns whether more are wanted.
    pub(super) fn take(&mut self, batch: RecordBatch) -> Result<bool> {
        match self {
            Self::Table { batches, .. } => {
                batches.push(batch);
                Ok(rows(batches) <= TABLE_ROWS_MAX)
            }
            Self::Rows {
                writer,
                format,
                is_gone,
            } => {
                match format {
                    RowsFormat::Csv => {
                        let texts = as_text(&batch).map_err(NotWritten::refused)?;
                        writer.write(texts)?;
                    }
                    RowsFormat::Parquet | RowsFormat::GeoJson => writer.write(batch)?,
                }
                Ok(!is_gone.load(Ordering::Relaxed))
            }
        }
    }

    /// Ends the answer.
    ///
    /// * `question` – the query, for the metadata of Parquet
    pub(super) fn finish(self, question: &str) -> Result<()> {
        match self {
            Self::Table { schema, batches } => print_table(schema, &batches),
            Self::Rows { writer, .. } => writer.finish(vec![(SQL, question.to_owned())]).map(drop),
        }
    }
}

fn rows(batches: &[RecordBatch]) -> usize {
    batches.iter().map(RecordBatch::num_rows).sum()
}

/// Prints the first rows; a note on standard error reports that there are more.
fn print_table(schema: SchemaRef, batches: &[RecordBatch]) -> Result<()> {
    let mut left = TABLE_ROWS_MAX;
    let shown: Vec<RecordBatch> = batches
        .iter()
        .map(|batch| {
            let batch = batch.slice(0, batch.num_rows().min(left));
            left -= batch.num_rows();
            batch
        })
        .collect();
    let table = as_table(schema, &shown);
    output::line(table.map_err(NotWritten::refused)?);
    if rows(batches) > TABLE_ROWS_MAX {
        tracing::warn!(
            "the answer shows only the first {TABLE_ROWS_MAX} rows; give --format csv or --out for all rows"
        );
    }
    Ok(())
}
