//! The table, and the search behind its queries.

use std::{
    collections::BTreeMap,
    fmt,
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
use areograph_base::{
    column::Column,
    error::{Cause, Error, Locate as _, Result, Stopped},
    footprints::{AsRead, Footprints, SourceFile},
    time::Interval,
};
use areograph_geom::window::Region;
use areograph_pds::{
    archive::{Found, Judged, Query, Seen, Sink, Source, search},
    pedr::Reason,
};

/// Batches that wait for the query: about a megabyte each.
const PIECES_WAITING: usize = 2;

/// The columns of the table, and their computation from shots.
pub trait Columns: fmt::Debug + Send + Sync {
    /// Names and types; units and descriptions are in the fields' metadata.
    fn schema(&self) -> SchemaRef;

    /// The columns at these indices, counted from 0, in this order.
    fn pick(&self, places: &[usize]) -> Arc<dyn Columns>;

    /// The values of these shots, in IAU 2000 at their time tags.
    ///
    /// * `files` – the files to which the column `file` refers
    ///
    /// # Errors
    /// A number that is not finite.
    fn batch(&self, shots: Footprints<AsRead>, files: &[SourceFile]) -> Result<RecordBatch>;
}

/// Results of queries besides rows.
#[derive(Debug, Default)]
pub struct Tally {
    /// Complaints about checked records, by reason; their shots are not rows.
    pub complaints: BTreeMap<Reason, u64>,
    /// The failure of a query that reached the search.
    pub failure: Option<Error>,
    /// Records examined.
    pub frames_read: u64,
    /// Shots whose own position was tested.
    pub shots_read: u64,
}

/// Two files hold the same shots.
#[derive(Debug, thiserror::Error, Cause)]
#[error("record {record} contains a shot that is also in {other} and would be counted twice")]
#[cause(Input: "if both files contain the same orbits, name only one of the files, or select one source_file")]
struct Overlap {
    record: u32,
    other: String,
}

/// The shots of an archive with a return, of every class, channel and attitude, in the order of files and records: the
/// columns of `footprints.parquet` except `windows`, in IAU 2000.
///
/// A query fails if one of its files fails, or if two of them contain the same shots, before it delivers all its rows,
/// so that no answer is silently incomplete. Rows do not depend on the number of threads. The search itself is
/// parallel: the table has one partition.
#[derive(Debug)]
pub struct ShotsTable {
    sources: Arc<[Source]>,
    columns: Arc<dyn Columns>,
    schema: SchemaRef,
    tally: Arc<Mutex<Tally>>,
    stop: Arc<AtomicBool>,
}

impl ShotsTable {
    /// The table of these files, at most 65,535; queries fail once `stop` is set.
    #[must_use]
    pub fn new(sources: Vec<Source>, columns: Arc<dyn Columns>, stop: Arc<AtomicBool>) -> Self {
        Self {
            sources: sources.into(),
            schema: columns.schema(),
            columns,
            tally: Arc::default(),
            stop,
        }
    }

    /// The shots that may meet these conditions, with these columns; all columns without a projection.
    #[must_use]
    pub fn shots(
        &self,
        projection: Option<&[usize]>,
        filters: &[Expr],
    ) -> Arc<dyn PartitionStream> {
        let conditions = Conditions::of(filters);
        let allowed = |source: &&Source| conditions.allow_file(&source.file().name);
        let columns = match projection {
            Some(places) => self.columns.pick(places),
            None => Arc::clone(&self.columns),
        };
        Arc::new(Shots {
            sources: self.sources.iter().filter(allowed).cloned().collect(),
            regions: conditions.regions(),
            time: conditions.time(),
            schema: columns.schema(),
            columns,
            tally: Arc::clone(&self.tally),
            stop: Arc::clone(&self.stop),
        })
    }

    /// Results, besides rows, of the queries so far.
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
        let shots = self.shots(projection.map(Vec::as_slice), filters);
        let schema = SchemaRef::clone(shots.schema());
        let plan = StreamingTableExec::try_new(schema, vec![shots], None, [], false, limit)?;
        Ok(Arc::new(plan))
    }
}

/// The shots requested by a query.
#[derive(Debug)]
struct Shots {
    sources: Arc<[Source]>,
    regions: Vec<Region>,
    time: Option<Interval>,
    columns: Arc<dyn Columns>,
    schema: SchemaRef,
    tally: Arc<Mutex<Tally>>,
    stop: Arc<AtomicBool>,
}

/// Ends the search when the stream of its rows is dropped, such as after the last row of a limit.
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
            columns: Arc::clone(&self.columns),
            tally: Arc::clone(&self.tally),
            stop: Arc::clone(&self.stop),
            rows: stream.tx(),
            seen: Seen::default(),
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

/// Passes rows to the query as they arrive.
struct HandOn {
    paths: Vec<PathBuf>,
    files: Vec<SourceFile>,
    columns: Arc<dyn Columns>,
    tally: Arc<Mutex<Tally>>,
    stop: Arc<AtomicBool>,
    rows: Sender<Answer<RecordBatch>>,
    seen: Seen,
}

impl HandOn {
    /// Keeps a failure for the caller, and sends it after the rows: a query that needs no more of them does not see it.
    fn end(&self, failure: Error) {
        if self.rows.is_closed() {
            return;
        }
        let told = DataFusionError::Execution(failure.to_string());
        {
            let mut tally = self.tally.lock().unwrap_or_else(PoisonError::into_inner);
            tally.failure.get_or_insert(failure);
        }
        // The receiver was dropped and does not need the result.
        let _ = self.rows.blocking_send(Err(told));
    }

    /// Checks that no earlier file contains one of these shots, which are in these records.
    fn require_distinct(
        &mut self,
        file: usize,
        tags_s: &Column<f64>,
        records: &Column<u32>,
    ) -> Result<()> {
        let Some((row, other)) = self.seen.take_all(file, tags_s) else {
            return Ok(());
        };
        let overlap = Overlap {
            record: records.at(row),
            other: self.paths[other].display().to_string(),
        };
        Err(overlap).in_file(&self.paths[file])
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
        let shots = &found.footprints;
        self.require_distinct(file, &shots.et_tag_s, &shots.record)?;
        let batch = self.columns.batch(found.footprints, &self.files)?;
        let sent = self.rows.blocking_send(Ok(batch));
        sent.map_err(|_gone| Stopped.into())
    }

    fn failed(&mut self, _file: usize, failure: Error) -> Result<()> {
        Err(failure)
    }
}

#[cfg(test)]
mod tests {
    use areograph_testing::shot_cases::CASES;
    use datafusion::arrow::datatypes::Schema;

    use super::*;

    #[derive(Debug)]
    struct NoColumns;

    impl Columns for NoColumns {
        fn schema(&self) -> SchemaRef {
            Arc::new(Schema::empty())
        }

        fn pick(&self, _places: &[usize]) -> Arc<dyn Columns> {
            Arc::new(Self)
        }

        fn batch(&self, _shots: Footprints<AsRead>, _files: &[SourceFile]) -> Result<RecordBatch> {
            Ok(RecordBatch::new_empty(self.schema()))
        }
    }

    #[test]
    fn shots_of_two_files_have_no_answer_together() {
        for case in CASES {
            let files = 0..case.files.len();
            let paths: Vec<PathBuf> = files
                .clone()
                .map(|file| PathBuf::from(format!("file{file}.b")))
                .collect();
            let mut hand_on = HandOn {
                paths: paths.clone(),
                files: Vec::new(),
                columns: Arc::new(NoColumns),
                tally: Arc::default(),
                stop: Arc::default(),
                rows: tokio::sync::mpsc::channel(1).0,
                seen: Seen::default(),
            };
            let mut checked = files.map(|file| {
                let tags_s = case.tags_s(file);
                let records = vec![1; tags_s.len()].into();
                hand_on.require_distinct(file, &tags_s.into(), &records)
            });
            let refused = checked.find_map(Result::err);
            let named = refused.map(|error| (error.file.clone(), error.cause.to_string()));
            match (named, case.shared) {
                (None, None) => {}
                (Some((path, why)), Some([other, file])) => {
                    assert_eq!(path.as_ref(), Some(&paths[file]), "{}", case.name);
                    let other = paths[other].display().to_string();
                    assert!(why.contains(&other), "{}: {why}", case.name);
                }
                (found, _) => panic!("{}: {found:?}", case.name),
            }
        }
    }
}
