//! A query that a cluster answers.

use std::sync::Arc;

use areograph_base::error::{Cause, Error};
use areograph_sql::{
    Columns, Question, TABLE,
    datafusion::{
        common::{DataFusionError, Result as Answer, tree_node::TreeNodeRecursion},
        execution::{SendableRecordBatchStream, SessionStateBuilder},
        logical_expr::LogicalPlan,
        physical_plan::stream::RecordBatchStreamAdapter,
        prelude::{SessionConfig, SessionContext},
    },
    read_only,
};
use ballista::extension::SessionContextExt as _;
use ballista_core::extension::SessionConfigExt as _;
use tokio_stream::StreamExt as _;

use super::{
    codec::Codec,
    place::Place,
    table::{ArchiveTable, GROUPS_MAX},
};

/// A query without an answer from the cluster.
#[derive(Debug, thiserror::Error, Cause)]
#[error("the cluster at {place} has no answer: {why}")]
#[cause(Input: "check that scheduler and executors run this version of areograph and have the same archive with its index; without --cluster, this computer answers")]
pub struct Unanswered {
    place: Place,
    why: String,
}

/// The configuration of a session: of the program that asks, and hence of the scheduler and the executors.
pub(super) fn configuration(columns: Arc<dyn Columns>) -> SessionConfig {
    let codec = Arc::new(Codec::new(columns));
    SessionConfig::new_with_ballista()
        .with_target_partitions(GROUPS_MAX)
        // With it, Ballista 55.0 repeats a window function over no rows without end.
        .with_ballista_adaptive_query_planner(false)
        .with_ballista_logical_extension_codec(Arc::clone(&codec) as _)
        .with_ballista_physical_extension_codec(codec)
}

/// The failure of a query.
#[must_use]
pub fn failure(error: DataFusionError) -> Error {
    match error {
        DataFusionError::External(cause) => match cause.downcast::<Unanswered>() {
            Ok(unanswered) => Error::new(*unanswered),
            Err(cause) => Error::new(Question::from(DataFusionError::External(cause))),
        },
        error => Error::new(Question::from(error)),
    }
}

/// The rows of the answer, in the order that the query states; without one, in any order. `None` if the query does not
/// read the table: this computer can answer it.
///
/// # Errors
/// An invalid query, or one that would change a table; no answer from the cluster, also among the rows.
pub async fn ask(
    place: &Place,
    archive: ArchiveTable,
    columns: Arc<dyn Columns>,
    question: &str,
) -> Answer<Option<SendableRecordBatchStream>> {
    let state = SessionStateBuilder::new()
        .with_default_features()
        .with_config(configuration(columns))
        .build();
    let context = SessionContext::remote_with_state(&place.to_string(), state).await?;
    context.register_table(TABLE, Arc::new(archive))?;
    let frame = context.sql_with_options(question, read_only()).await?;
    let optimised = context.state().optimize(frame.logical_plan())?;
    if !reads_shots(&optimised)? {
        return Ok(None);
    }
    let refused = {
        let place = place.clone();
        move |error: DataFusionError| {
            let why = error.strip_backtrace();
            let place = place.clone();
            DataFusionError::External(Box::new(Unanswered { place, why }))
        }
    };
    let rows = frame.execute_stream().await.map_err(&refused)?;
    let schema = rows.schema();
    let rows = rows.map(move |batch| batch.map_err(&refused));
    Ok(Some(Box::pin(RecordBatchStreamAdapter::new(schema, rows))))
}

fn reads_shots(plan: &LogicalPlan) -> Answer<bool> {
    let is_scan = |node: &LogicalPlan| match node {
        LogicalPlan::TableScan(scan) => scan.table_name.table() == TABLE,
        _ => false,
    };
    let mut reads = false;
    plan.apply_with_subqueries(|node| {
        reads |= is_scan(node);
        Ok(TreeNodeRecursion::Continue)
    })?;
    Ok(reads)
}
