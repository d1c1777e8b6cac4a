//! A SQL query of the shots of an archive.

use std::sync::Arc;

use areograph_base::error::{Cause, Kind};
use datafusion::{
    arrow::{datatypes::SchemaRef, record_batch::RecordBatch},
    catalog::TableProvider,
    common::DataFusionError,
    datasource::MemTable,
    execution::{
        SendableRecordBatchStream, memory_pool::FairSpillPool, runtime_env::RuntimeEnvBuilder,
    },
    prelude::{SQLOptions, SessionConfig, SessionContext},
};

use super::ShotsTable;

/// Memory for sorting and grouping; more goes to temporary files.
pub const MEMORY_BYTES: usize = 128 << 20;
/// The name of the table.
pub const TABLE: &str = "shots";

/// A query that failed.
#[derive(Debug, thiserror::Error)]
#[error("{}", .0.strip_backtrace())]
pub struct Question(#[from] DataFusionError);

impl Cause for Question {
    fn kind(&self) -> Kind {
        match self.0.find_root() {
            DataFusionError::IoError(_) => Kind::Io,
            _ => Kind::Configuration,
        }
    }

    fn advice(&self) -> String {
        match self.0.find_root() {
            DataFusionError::ResourcesExhausted(_) => {
                "select fewer columns, or sort and group fewer rows in one query"
            }
            DataFusionError::IoError(_) => {
                "check the disk that contains the temporary files, then retry"
            }
            _ => "\"describe\" and the name of a table, such as \"describe shots\", lists the columns; text is written in 'single quotes'",
        }
        .to_owned()
    }
}

/// The rows of the answer in the order of the search, or as the query orders them; one thread processes the search
/// results.
///
/// # Errors
/// An invalid query, or one that would change a table.
pub async fn ask(table: ShotsTable, question: &str) -> Result<SendableRecordBatchStream, Question> {
    answer(vec![(TABLE, Arc::new(table))], question).await
}

/// The rows of the answer from tables in memory, each with its name, columns and rows.
///
/// # Errors
/// An invalid query, or one that would change a table; rows with other columns than those of their table.
pub async fn ask_tables(
    tables: Vec<(&str, SchemaRef, Vec<RecordBatch>)>,
    question: &str,
) -> Result<SendableRecordBatchStream, Question> {
    let mut known: Vec<(&str, Arc<dyn TableProvider>)> = Vec::new();
    for (name, schema, batches) in tables {
        known.push((name, Arc::new(MemTable::try_new(schema, vec![batches])?)));
    }
    answer(known, question).await
}

async fn answer(
    tables: Vec<(&str, Arc<dyn TableProvider>)>,
    question: &str,
) -> Result<SendableRecordBatchStream, Question> {
    let memory =
        RuntimeEnvBuilder::new().with_memory_pool(Arc::new(FairSpillPool::new(MEMORY_BYTES)));
    let config = SessionConfig::new()
        .with_target_partitions(1)
        .with_information_schema(true);
    let context = SessionContext::new_with_config_rt(config, memory.build_arc()?);
    for (name, table) in tables {
        context.register_table(name, table)?;
    }
    let frame = context.sql_with_options(question, read_only()).await?;
    Ok(frame.execute_stream().await?)
}

/// Limits queries to those that change nothing.
#[must_use]
pub fn read_only() -> SQLOptions {
    SQLOptions::new()
        .with_allow_ddl(false)
        .with_allow_dml(false)
        .with_allow_statements(false)
}
