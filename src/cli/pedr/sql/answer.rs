//! How an answer is printed or written, piece by piece.

use std::{
    fs::File,
    io::{self, BufWriter, Stdout, Write},
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};

use ::parquet::{
    arrow::ArrowWriter,
    basic::{Compression, ZstdLevel},
    file::properties::WriterProperties,
};
use datafusion::arrow::{
    csv, datatypes::SchemaRef, record_batch::RecordBatch,
    util::pretty::pretty_format_batches_with_schema,
};

use super::Format;
use crate::cli::output;
use crate::{
    error::{Cause, IoError, Kind, Locate as _, Result},
    files::StagedFile,
};

/// Rows of a table that is printed.
const TABLE_ROWS_MAX: usize = 1_000;

/// Rows that cannot be written as they were asked for.
#[derive(Debug, thiserror::Error)]
enum NotWritten {
    #[error("the answer cannot be written: {0}")]
    Refused(String),
    #[error("has the ending {0:?}; expected parquet or csv")]
    Ending(String),
}

impl NotWritten {
    fn refused(error: impl std::fmt::Display) -> Self {
        Self::Refused(error.to_string())
    }
}

impl Cause for NotWritten {
    fn kind(&self) -> Kind {
        match self {
            Self::Refused(_) => Kind::Io,
            Self::Ending(_) => Kind::Configuration,
        }
    }

    fn advice(&self) -> String {
        match self {
            Self::Refused(_) => "check the disk; a column of lists goes into Parquet, not into CSV",
            Self::Ending(_) => "give the file another ending",
        }
        .to_owned()
    }
}

/// Where an answer goes.
pub(super) enum Answer {
    /// A table on standard output.
    Table {
        schema: SchemaRef,
        batches: Vec<RecordBatch>,
    },
    /// Comma-separated values on standard output, and whether its reader is gone.
    Csv(csv::Writer<Reader>, Arc<AtomicBool>),
    /// Comma-separated values in a file.
    CsvFile(StagedFile, csv::Writer<BufWriter<File>>),
    /// Parquet.
    Parquet(StagedFile, Box<ArrowWriter<File>>),
}

/// Whoever reads standard output: one who went away (`| head`) is no failure, a disk that refuses is one.
pub(super) struct Reader {
    out: Stdout,
    is_gone: Arc<AtomicBool>,
}

impl Reader {
    /// What was done of something of which nothing is left to do once the reader is gone.
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

/// A writer of comma-separated values that has written their names, also of an answer without rows.
fn begun<W: Write>(out: W, schema: SchemaRef) -> std::result::Result<csv::Writer<W>, NotWritten> {
    let mut writer = csv::Writer::new(out);
    let names = writer.write(&RecordBatch::new_empty(schema));
    names.map_err(NotWritten::refused)?;
    Ok(writer)
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
                let reader = Reader {
                    out: io::stdout(),
                    is_gone: Arc::clone(&is_gone),
                };
                Self::Csv(begun(reader, schema)?, is_gone)
            }
        })
    }

    /// An answer in a file, which appears when it is whole.
    pub(super) fn in_file(path: &Path, schema: SchemaRef) -> Result<Self> {
        let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
        match ending.to_str() {
            Some("csv") => {
                let file = StagedFile::create(path)?;
                let writer = begun(BufWriter::new(file.writer()?), schema).in_file(path)?;
                Ok(Self::CsvFile(file, writer))
            }
            Some("parquet") => {
                let file = StagedFile::create(path)?;
                let properties = WriterProperties::builder()
                    .set_created_by(concat!("areograph ", env!("CARGO_PKG_VERSION")).to_owned())
                    .set_compression(Compression::ZSTD(ZstdLevel::default()))
                    .build();
                let writer = ArrowWriter::try_new(file.writer()?, schema, Some(properties));
                let writer = writer.map_err(NotWritten::refused).in_file(path)?;
                Ok(Self::Parquet(file, Box::new(writer)))
            }
            _ => {
                let ending = ending.to_string_lossy().into_owned();
                Err(NotWritten::Ending(ending)).in_file(path)
            }
        }
    }

    /// Takes rows, and says whether it wants more.
    pub(super) fn take(&mut self, batch: RecordBatch) -> Result<bool> {
        match self {
            Self::Table { batches, .. } => {
                batches.push(batch);
                Ok(rows(batches) <= TABLE_ROWS_MAX)
            }
            Self::Csv(writer, is_gone) => {
                writer.write(&batch).map_err(NotWritten::refused)?;
                Ok(!is_gone.load(Ordering::Relaxed))
            }
            Self::CsvFile(file, writer) => {
                let written = writer.write(&batch).map_err(NotWritten::refused);
                written.in_file(file.path()).map(|()| true)
            }
            Self::Parquet(file, writer) => {
                let written = writer.write(&batch).map_err(NotWritten::refused);
                written.in_file(file.path()).map(|()| true)
            }
        }
    }

    /// Ends the answer.
    pub(super) fn finish(self) -> Result<()> {
        match self {
            Self::Table { schema, batches } => print_table(schema, &batches),
            Self::Csv(writer, _) => {
                let flushed = writer.into_inner().flush();
                Ok(flushed.map_err(IoError::on("write standard output"))?)
            }
            Self::CsvFile(file, writer) => {
                let flushed = writer.into_inner().flush().map_err(IoError::on("write"));
                flushed.in_file(file.path())?;
                file.finish()
            }
            Self::Parquet(file, writer) => {
                let closed = writer.close().map_err(NotWritten::refused);
                closed.in_file(file.path())?;
                file.finish()
            }
        }
    }
}

fn rows(batches: &[RecordBatch]) -> usize {
    batches.iter().map(RecordBatch::num_rows).sum()
}

/// Prints the first rows; a note on standard error says that there are more.
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
    let table = pretty_format_batches_with_schema(schema, &shown);
    output::line(table.map_err(NotWritten::refused)?);
    if rows(batches) > TABLE_ROWS_MAX {
        tracing::warn!(
            "these are the first {TABLE_ROWS_MAX} rows; all of them: --format csv, or --out"
        );
    }
    Ok(())
}
