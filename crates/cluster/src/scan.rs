//! The search of an executor.

use std::{
    fmt,
    path::{Path, PathBuf},
    sync::{Arc, PoisonError},
};

use areograph_base::error::{Cause, Error, Locate as _, Result};
use areograph_pds::archive::{Opened, Source};
use areograph_sql::{
    Columns, ShotsTable, Tally,
    datafusion::{
        arrow::{
            array::{ArrayRef, StringArray},
            datatypes::{DataType, Field, Schema},
            record_batch::RecordBatch,
        },
        common::{DataFusionError, Result as Answer, internal_err, tree_node::TreeNodeRecursion},
        datasource::memory::MemorySourceConfig,
        execution::{SendableRecordBatchStream, TaskContext},
        logical_expr::Expr,
        physical_expr::{EquivalenceProperties, PhysicalExpr},
        physical_plan::{
            DisplayAs, DisplayFormatType, ExecutionPlan, Partitioning, PlanProperties,
            execution_plan::{Boundedness, EmissionType},
            limit::LimitStream,
            metrics::{BaselineMetrics, ExecutionPlanMetricsSet},
            stream::RecordBatchReceiverStream,
        },
    },
};
use tokio::task::spawn_blocking;
use tokio_stream::StreamExt as _;

use super::named::Named;

/// Columns of the input.
const PATH: &str = "path";
const BLAKE3: &str = "blake3";
/// Batches that wait for the query: about a megabyte each.
const BATCHES_WAITING: usize = 2;

/// A file that is not the one for which the query was planned.
#[derive(Debug, thiserror::Error, Cause)]
enum OtherArchive {
    #[error(
        "is another file than on the computer that asks, whose index states BLAKE3 {expected}; here it is {found}"
    )]
    #[cause(Input: "give all computers the same files, or run `areograph pedr index` where the archive has changed")]
    Version { expected: String, found: String },
    #[error("has no valid entry in an index on this computer")]
    #[cause(Input: "run `areograph pedr index` for the archive: the file has changed, or the index does not describe it")]
    NotIndexed,
    #[error("was not opened")]
    #[cause(Bug: "this is a bug in areograph; please report it")]
    Missing,
}

/// The shots of the files that its input names, partition by partition.
///
/// The files are rows of an input because Ballista gives each task some partitions of the leaves that it knows, and would
/// give every task all partitions of another leaf.
#[derive(Debug, Clone)]
pub(super) struct ShotsScan {
    files: Arc<dyn ExecutionPlan>,
    reading: Reading,
    columns: Arc<dyn Columns>,
    properties: Arc<PlanProperties>,
}

/// What a scan reads of its files.
#[derive(Debug, Clone)]
pub(super) struct Reading {
    /// Indices of the columns; `None` for all.
    pub(super) projection: Option<Vec<usize>>,
    /// Conditions that the search may use; the query tests every row again.
    pub(super) filters: Vec<Expr>,
    /// Rows after which a partition may end.
    pub(super) limit: Option<usize>,
}

impl ShotsScan {
    /// The shots of groups of files, a partition each.
    pub(super) fn of_groups(
        groups: &[Vec<Named>],
        reading: Reading,
        columns: Arc<dyn Columns>,
    ) -> Answer<Self> {
        let text = |name: &str| Field::new(name, DataType::Utf8, false);
        let schema = Arc::new(Schema::new(vec![text(PATH), text(BLAKE3)]));
        let rows = |group: &Vec<Named>| {
            let column = |value: fn(&Named) -> &String| -> ArrayRef {
                Arc::new(StringArray::from_iter_values(group.iter().map(value)))
            };
            let columns = vec![column(|file| &file.path), column(|file| &file.blake3)];
            Ok(vec![RecordBatch::try_new(Arc::clone(&schema), columns)?])
        };
        let partitions = groups.iter().map(rows).collect::<Answer<Vec<_>>>()?;
        let files = MemorySourceConfig::try_new_exec(&partitions, Arc::clone(&schema), None)?;
        Ok(Self::new(files, reading, columns))
    }

    pub(super) fn new(
        files: Arc<dyn ExecutionPlan>,
        reading: Reading,
        columns: Arc<dyn Columns>,
    ) -> Self {
        let schema = match &reading.projection {
            Some(places) => columns.pick(places).schema(),
            None => columns.schema(),
        };
        let partitions = files.properties().output_partitioning().partition_count();
        let properties = PlanProperties::new(
            EquivalenceProperties::new(schema),
            Partitioning::UnknownPartitioning(partitions),
            EmissionType::Incremental,
            Boundedness::Bounded,
        );
        Self {
            files,
            reading,
            columns,
            properties: Arc::new(properties),
        }
    }

    pub(super) const fn reading(&self) -> &Reading {
        &self.reading
    }
}

/// The files that rows of the input name.
fn named(rows: &RecordBatch) -> Answer<Vec<Named>> {
    let column = |name: &str| {
        let column = rows.column_by_name(name);
        let column = column.and_then(|column| column.as_any().downcast_ref::<StringArray>());
        column.map_or_else(|| internal_err!("a scan without {name}"), Ok)
    };
    let (paths, hashes) = (column(PATH)?, column(BLAKE3)?);
    let files = (0..rows.num_rows()).map(|row| Named {
        path: paths.value(row).to_owned(),
        blake3: hashes.value(row).to_owned(),
    });
    Ok(files.collect())
}

/// The files of a group, which are those that the program that asks has.
fn open(group: &[Named]) -> Result<Vec<Source>> {
    let paths: Vec<PathBuf> = group.iter().map(|file| PathBuf::from(&file.path)).collect();
    let Opened { sources, failures } = Opened::all(&paths)?;
    if let Some(failure) = failures.into_iter().next() {
        return Err(failure);
    }
    for file in group {
        let source = sources
            .iter()
            .find(|source| source.path() == Path::new(&file.path));
        let source = source.ok_or(OtherArchive::Missing).in_file(&file.path)?;
        let found = source.blake3().ok_or(OtherArchive::NotIndexed);
        let found = found.in_file(&file.path)?;
        if found != file.blake3 {
            let expected = file.blake3.clone();
            return Err(OtherArchive::Version { expected, found }).in_file(&file.path);
        }
    }
    Ok(sources)
}

fn refused(failure: &Error) -> DataFusionError {
    DataFusionError::Execution(failure.to_string())
}

/// Logs complaints, which the program that asks does not see.
fn log(tally: &Tally) {
    for (reason, count) in &tally.complaints {
        tracing::warn!(
            "records with errors, whose invalid shots are omitted: {count} × {reason:?}"
        );
    }
}

impl DisplayAs for ShotsScan {
    fn fmt_as(&self, _as: DisplayFormatType, formatter: &mut fmt::Formatter) -> fmt::Result {
        write!(formatter, "ShotsScan: limit={:?}", self.reading.limit)
    }
}

impl ExecutionPlan for ShotsScan {
    fn name(&self) -> &'static str {
        "ShotsScan"
    }

    fn properties(&self) -> &Arc<PlanProperties> {
        &self.properties
    }

    fn children(&self) -> Vec<&Arc<dyn ExecutionPlan>> {
        vec![&self.files]
    }

    /// Files that may contain the same shot stay together.
    fn benefits_from_input_partitioning(&self) -> Vec<bool> {
        vec![false]
    }

    fn apply_expressions(
        &self,
        _function: &mut dyn FnMut(&Arc<dyn PhysicalExpr>) -> Answer<TreeNodeRecursion>,
    ) -> Answer<TreeNodeRecursion> {
        Ok(TreeNodeRecursion::Continue)
    }

    fn with_new_children(
        self: Arc<Self>,
        mut children: Vec<Arc<dyn ExecutionPlan>>,
    ) -> Answer<Arc<dyn ExecutionPlan>> {
        let (Some(files), true) = (children.pop(), children.is_empty()) else {
            return internal_err!("a scan has one input");
        };
        let (reading, columns) = (self.reading.clone(), Arc::clone(&self.columns));
        Ok(Arc::new(Self::new(files, reading, columns)))
    }

    fn fetch(&self) -> Option<usize> {
        self.reading.limit
    }

    fn with_fetch(&self, limit: Option<usize>) -> Option<Arc<dyn ExecutionPlan>> {
        let reading = Reading {
            limit,
            ..self.reading.clone()
        };
        let (files, columns) = (Arc::clone(&self.files), Arc::clone(&self.columns));
        Some(Arc::new(Self::new(files, reading, columns)))
    }

    fn execute(
        &self,
        partition: usize,
        context: Arc<TaskContext>,
    ) -> Answer<SendableRecordBatchStream> {
        let mut files = self.files.execute(partition, Arc::clone(&context))?;
        let columns = Arc::clone(&self.columns);
        let Reading {
            projection,
            filters,
            limit,
        } = self.reading.clone();
        let mut stream = RecordBatchReceiverStream::builder(self.schema(), BATCHES_WAITING);
        let receiver = stream.tx();
        stream.spawn(async move {
            while let Some(rows) = files.next().await {
                let group = named(&rows?)?;
                let opened = spawn_blocking(move || open(&group)).await;
                let opened = opened.map_err(|error| DataFusionError::External(error.into()))?;
                let sources = opened.map_err(|failure| refused(&failure))?;
                let table = ShotsTable::new(sources, Arc::clone(&columns), Arc::default());
                let tally = table.tally();
                let shots = table.shots(projection.as_deref(), &filters);
                let mut shots = shots.execute(Arc::clone(&context));
                while let Some(batch) = shots.next().await {
                    if receiver.send(batch).await.is_err() {
                        // Nothing reads the rest, such as after the last row of a limit.
                        return Ok(());
                    }
                }
                log(&tally.lock().unwrap_or_else(PoisonError::into_inner));
            }
            Ok(())
        });
        let metrics = BaselineMetrics::new(&ExecutionPlanMetricsSet::new(), partition);
        let rows = LimitStream::new(stream.build(), 0, limit, metrics);
        Ok(Box::pin(rows))
    }
}
