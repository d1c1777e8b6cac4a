//! The table, and the search that a query makes of it.

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, PoisonError, atomic::AtomicBool},
};

use async_trait::async_trait;
use datafusion::{
    arrow::{datatypes::SchemaRef, record_batch::RecordBatch},
    catalog::{Session, TableProvider},
    common::{DataFusionError, Result as Answer},
    execution::{SendableRecordBatchStream, TaskContext},
    logical_expr::{Expr, TableProviderFilterPushDown, TableType},
    physical_plan::{
        ExecutionPlan,
        stream::RecordBatchReceiverStream,
        streaming::{PartitionStream, StreamingTableExec},
    },
};
use tokio::sync::mpsc::Sender;

use super::conditions::Conditions;
use crate::{
    error::{Error, Result, Stopped},
    footprints::SourceFile,
    geom::window::Region,
    pds::{
        archive::{Found, Judged, Query, Sink, Source, search},
        pedr::Reason,
    },
    products::ShotColumns,
    stages::convert_datum::convert_at_tags,
    time::Interval,
};

/// Pieces of an answer that wait for the query: a megabyte or so each.
const PIECES_WAITING: usize = 2;

/// What queries met beside rows.
#[derive(Debug, Default)]
pub struct Tally {
    /// Complaints of records that were judged, by reason; their shots are no rows.
    pub complaints: BTreeMap<Reason, u64>,
    /// What ended a query before its end.
    pub failure: Option<Error>,
    /// Records looked at.
    pub frames_read: u64,
    /// Shots whose own position was tested.
    pub shots_read: u64,
}

/// The shots of an archive with a return, of every class, channel and attitude, in the order of files and records: the
/// columns of `footprints.parquet` but `windows`, in IAU 2000.
///
/// A query of it fails when one of its files does, so that no answer is silently incomplete. Its rows do not depend on the
/// number of threads, which the search uses by itself: the table has one partition.
#[derive(Debug)]
pub struct ShotsTable {
    sources: Arc<[Source]>,
    columns: ShotColumns,
    schema: SchemaRef,
    tally: Arc<Mutex<Tally>>,
}

impl ShotsTable {
    /// The table of these files, at most 65,535.
    #[must_use]
    pub fn new(sources: Vec<Source>) -> Self {
        let columns = ShotColumns::default();
        Self {
            sources: sources.into(),
            schema: columns.schema(),
            columns,
            tally: Arc::default(),
        }
    }

    /// What the queries so far met beside rows.
    #[must_use]
    pub fn tally(&self) -> Arc<Mutex<Tally>> {
        Arc::clone(&self.tally)
    }
}

#[async_trait]
impl TableProvider for ShotsTable {
    fn schema(&self) -> SchemaRef {
        SchemaRef::clone(&self.schema)
    }

    fn table_type(&self) -> TableType {
        TableType::Base
    }

    fn supports_filters_pushdown(
        &self,
        filters: &[&Expr],
    ) -> Answer<Vec<TableProviderFilterPushDown>> {
        let use_of = |filter: &&Expr| {
            if Conditions::can_use(filter) {
                TableProviderFilterPushDown::Inexact
            } else {
                TableProviderFilterPushDown::Unsupported
            }
        };
        Ok(filters.iter().map(use_of).collect())
    }

    async fn scan(
        &self,
        _session: &dyn Session,
        projection: Option<&Vec<usize>>,
        filters: &[Expr],
        limit: Option<usize>,
    ) -> Answer<Arc<dyn ExecutionPlan>> {
        let conditions = Conditions::of(filters);
        let allowed = |source: &&Source| conditions.allow_file(&source.file().name);
        let columns = match projection {
            Some(places) => self.columns.pick(places),
            None => self.columns.clone(),
        };
        let schema = columns.schema();
        let shots: Arc<dyn PartitionStream> = Arc::new(Shots {
            sources: self.sources.iter().filter(allowed).cloned().collect(),
            regions: conditions.regions(),
            time: conditions.time(),
            schema: SchemaRef::clone(&schema),
            columns,
            tally: Arc::clone(&self.tally),
        });
        let plan = StreamingTableExec::try_new(schema, vec![shots], None, [], false, limit)?;
        Ok(Arc::new(plan))
    }
}

/// The shots that a query asks for.
#[derive(Debug)]
struct Shots {
    sources: Arc<[Source]>,
    regions: Vec<Region>,
    time: Option<Interval>,
    columns: ShotColumns,
    schema: SchemaRef,
    tally: Arc<Mutex<Tally>>,
}

impl PartitionStream for Shots {
    fn schema(&self) -> &SchemaRef {
        &self.schema
    }

    fn execute(&self, _context: Arc<TaskContext>) -> SendableRecordBatchStream {
        let schema = SchemaRef::clone(&self.schema);
        let mut stream = RecordBatchReceiverStream::builder(schema, PIECES_WAITING);
        if self.regions.is_empty() {
            return stream.build();
        }
        let mut hand_on = HandOn {
            files: self.sources.iter().map(Source::file).collect(),
            columns: self.columns.clone(),
            tally: Arc::clone(&self.tally),
            rows: stream.tx(),
        };
        let (sources, regions, time) = (Arc::clone(&self.sources), self.regions.clone(), self.time);
        stream.spawn_blocking(move || {
            let query = Query::unfiltered(regions, Judged::Near).within(time);
            match search(&sources, &query, &AtomicBool::new(false), &mut hand_on) {
                Ok(()) => Ok(()),
                Err(failure) => hand_on.end(failure),
            }
        });
        stream.build()
    }
}

/// Gives rows to the query as they come.
struct HandOn {
    files: Vec<SourceFile>,
    columns: ShotColumns,
    tally: Arc<Mutex<Tally>>,
    rows: Sender<Answer<RecordBatch>>,
}

impl HandOn {
    /// Keeps a failure for those who asked; a query that wants no more rows is none.
    fn end(&self, failure: Error) -> Answer<()> {
        if self.rows.is_closed() {
            return Ok(());
        }
        let told = DataFusionError::Execution(failure.to_string());
        let mut tally = self.tally.lock().unwrap_or_else(PoisonError::into_inner);
        tally.failure.get_or_insert(failure);
        Err(told)
    }
}

impl Sink for HandOn {
    fn found(&mut self, _file: usize, found: Found) -> Result<()> {
        {
            let mut tally = self.tally.lock().unwrap_or_else(PoisonError::into_inner);
            tally.frames_read += found.frames_read;
            tally.shots_read += found.shots_read;
            for (reason, count) in &found.complaint_counts {
                *tally.complaints.entry(*reason).or_default() += count;
            }
        }
        if found.footprints.is_empty() {
            return Ok(());
        }
        let batch = self
            .columns
            .batch(&convert_at_tags(found.footprints, &self.files))?;
        let sent = self.rows.blocking_send(Ok(batch));
        sent.map_err(|_gone| Stopped.into())
    }

    fn failed(&mut self, _file: usize, failure: Error) -> Result<()> {
        Err(failure)
    }
}
