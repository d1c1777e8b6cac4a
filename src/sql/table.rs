//! The table, and the search that a query makes of it.

use std::{
    collections::BTreeMap,
    path::PathBuf,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
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
        stream::{RecordBatchReceiverStream, RecordBatchStreamAdapter},
        streaming::{PartitionStream, StreamingTableExec},
    },
};
use tokio::sync::mpsc::Sender;
use tokio_stream::StreamExt as _;

use super::conditions::Conditions;
use crate::{
    error::{Cause, Error, Kind, Locate as _, Result, Stopped},
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

/// Half the time between two shots, seconds: shots of two files nearer to each other are one shot.
const SAME_SHOT_S: f64 = 0.05;
/// Pieces of an answer that wait for the query: a megabyte or so each.
const PIECES_WAITING: usize = 2;

/// What queries met beside rows.
#[derive(Debug, Default)]
pub struct Tally {
    /// Complaints of records that were judged, by reason; their shots are no rows.
    pub complaints: BTreeMap<Reason, u64>,
    /// Why a query has no answer, if it got as far as that.
    pub failure: Option<Error>,
    /// Records looked at.
    pub frames_read: u64,
    /// Shots whose own position was tested.
    pub shots_read: u64,
}

/// Two files hold the same shots.
#[derive(Debug, thiserror::Error)]
#[error("record {record} is no later than what {before} ends with: its shots would count twice")]
struct Overlap {
    record: u32,
    before: String,
}

impl Cause for Overlap {
    fn kind(&self) -> Kind {
        Kind::Input
    }

    fn advice(&self) -> String {
        "if both files hold the same orbits, name only one of them, or ask for one source_file"
            .to_owned()
    }
}

/// The shots of an archive with a return, of every class, channel and attitude, in the order of files and records: the
/// columns of `footprints.parquet` but `windows`, in IAU 2000.
///
/// A query of it fails when one of its files does, or two of them hold the same shots, before it has all its rows, so that no
/// answer is silently incomplete. Its rows do not depend on the number of threads, which the search uses by itself: the table
/// has one partition.
#[derive(Debug)]
pub struct ShotsTable {
    sources: Arc<[Source]>,
    columns: ShotColumns,
    schema: SchemaRef,
    tally: Arc<Mutex<Tally>>,
    stop: Arc<AtomicBool>,
}

impl ShotsTable {
    /// The table of these files, at most 65,535; queries of it fail once `stop` is set.
    #[must_use]
    pub fn new(sources: Vec<Source>, stop: Arc<AtomicBool>) -> Self {
        let columns = ShotColumns::default();
        Self {
            sources: sources.into(),
            schema: columns.schema(),
            columns,
            tally: Arc::default(),
            stop,
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
            stop: Arc::clone(&self.stop),
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
    stop: Arc<AtomicBool>,
}

/// Ends the search when the stream of its rows goes away, such as after the last row of a limit.
struct EndOfStream(Arc<AtomicBool>);

impl Drop for EndOfStream {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
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
            paths: self.sources.iter().map(|of| of.path().to_owned()).collect(),
            files: self.sources.iter().map(Source::file).collect(),
            columns: self.columns.clone(),
            tally: Arc::clone(&self.tally),
            stop: Arc::clone(&self.stop),
            rows: stream.tx(),
            last: None,
        };
        let (sources, regions, time) = (Arc::clone(&self.sources), self.regions.clone(), self.time);
        let is_over = Arc::new(AtomicBool::new(false));
        let end = EndOfStream(Arc::clone(&is_over));
        stream.spawn_blocking(move || {
            let query = Query::unfiltered(regions, Judged::Near).within(time);
            if let Err(failure) = search(&sources, &query, &is_over, &mut hand_on) {
                hand_on.end(failure);
            }
            Ok(())
        });
        let rows = stream.build().map(move |rows| {
            let _ = &end;
            rows
        });
        Box::pin(RecordBatchStreamAdapter::new(
            SchemaRef::clone(&self.schema),
            rows,
        ))
    }
}

/// Gives rows to the query as they come.
struct HandOn {
    paths: Vec<PathBuf>,
    files: Vec<SourceFile>,
    columns: ShotColumns,
    tally: Arc<Mutex<Tally>>,
    stop: Arc<AtomicBool>,
    rows: Sender<Answer<RecordBatch>>,
    /// The last file with rows, and the latest time tag so far, ET seconds.
    last: Option<(usize, f64)>,
}

impl HandOn {
    /// Keeps a failure for those who asked, and has it follow the rows: a query that wants no more of them does not meet it.
    fn end(&self, failure: Error) {
        if self.rows.is_closed() {
            return;
        }
        let told = DataFusionError::Execution(failure.to_string());
        {
            let mut tally = self.tally.lock().unwrap_or_else(PoisonError::into_inner);
            tally.failure.get_or_insert(failure);
        }
        // Nobody asks any more by now: nobody misses it.
        let _ = self.rows.blocking_send(Err(told));
    }

    /// Makes sure that the rows of a file follow those of the files before.
    fn follow(&mut self, file: usize, found: &Found) -> Result<()> {
        let shots = &found.footprints;
        let (mut first_s, mut last_s) = (f64::INFINITY, f64::NEG_INFINITY);
        for tag_s in &shots.et_tag_s {
            (first_s, last_s) = (first_s.min(*tag_s), last_s.max(*tag_s));
        }
        if let Some((before, before_s)) = self.last {
            if before != file && first_s < before_s + SAME_SHOT_S {
                let overlap = Overlap {
                    record: shots.record.first().copied().unwrap_or_default(),
                    before: self.paths[before].display().to_string(),
                };
                return Err(overlap).in_file(&self.paths[file]);
            }
            last_s = last_s.max(before_s);
        }
        self.last = Some((file, last_s));
        Ok(())
    }
}

impl Sink for HandOn {
    fn found(&mut self, file: usize, found: Found) -> Result<()> {
        Stopped::check(&self.stop)?;
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
        self.follow(file, &found)?;
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
