//! The processes of a cluster.

use std::{net::SocketAddrV4, path::Path, sync::Arc};

use areograph_base::error::Cause;
use areograph_sql::{Columns, MEMORY_BYTES, datafusion::prelude::SessionContext};
use ballista_core::{
    config::TaskSchedulingPolicy, error::BallistaError, registry::BallistaFunctionRegistry,
};
use ballista_executor::executor_process::{ExecutorProcessConfig, start_executor_process};
use ballista_scheduler::{
    cluster::BallistaCluster,
    config::SchedulerConfig,
    scheduler_process::{create_scheduler, start_grpc_service_with_listener},
};
use datafusion_proto::protobuf::{LogicalPlanNode, PhysicalPlanNode};
use tokio::net::TcpListener;

use super::{ask::configuration, codec::Codec, place::Place, stalled::end_stalled};

/// Seconds between signs of life of an executor.
const HEARTBEAT_S: u64 = 2;
/// Seconds without one after which its work is given to others; as long without any executor, and a query fails.
const LOST_S: u64 = 10;
/// Seconds for which an executor tries to reach the scheduler.
const CONNECT_S: u16 = 20;
/// Seconds for which results of a query are kept for the program that asked, and between removals.
const RESULTS_S: u64 = 3_600;
const REMOVAL_S: u64 = 600;

/// A process that ends.
#[derive(Debug, thiserror::Error, Cause)]
#[error("{0}")]
#[cause(Io: "check the addresses, and that the scheduler runs")]
pub struct NotServed(#[from] BallistaError);

/// Runs a scheduler; it ends with the process. `address` is also that at which executors reach it.
///
/// # Errors
/// A scheduler that cannot start.
pub async fn schedule(
    listener: TcpListener,
    address: SocketAddrV4,
    columns: Arc<dyn Columns>,
) -> Result<(), NotServed> {
    let codec = Arc::new(Codec::new(Arc::clone(&columns)));
    let config = SchedulerConfig {
        external_host: address.ip().to_string(),
        bind_host: address.ip().to_string(),
        bind_port: address.port(),
        scheduling_policy: TaskSchedulingPolicy::PullStaged,
        executor_timeout_seconds: LOST_S,
        no_executors_grace_period_seconds: LOST_S,
        expire_dead_executor_interval_seconds: HEARTBEAT_S,
        override_config_producer: Some(Arc::new(move || configuration(Arc::clone(&columns)))),
        override_logical_codec: Some(Arc::clone(&codec) as _),
        override_physical_codec: Some(codec),
        ..SchedulerConfig::default()
    };
    let cluster = BallistaCluster::new_from_config(&config).await?;
    let scheduler =
        create_scheduler::<LogicalPlanNode, PhysicalPlanNode>(cluster, Arc::new(config)).await?;
    tokio::spawn(end_stalled(scheduler.clone()));
    Ok(start_grpc_service_with_listener(listener, scheduler).await?)
}

/// Runs an executor until a signal ends it. It serves results at `address`, and listens for work at the next port.
///
/// * `folder` – for intermediate results
/// * `tasks` – parts of queries at once
///
/// # Errors
/// An executor that cannot start, or that lost the scheduler.
pub async fn execute(
    scheduler: &Place,
    address: SocketAddrV4,
    folder: &Path,
    tasks: usize,
    columns: Arc<dyn Columns>,
) -> Result<(), NotServed> {
    let codec = Arc::new(Codec::new(Arc::clone(&columns)));
    // The functions of a session, some of which Ballista's own registry lacks.
    let functions = BallistaFunctionRegistry::from(&SessionContext::new().state());
    let config = ExecutorProcessConfig {
        bind_host: address.ip().to_string(),
        external_host: Some(address.ip().to_string()),
        port: address.port(),
        grpc_port: address.port().saturating_add(1),
        scheduler_host: scheduler.host.clone(),
        scheduler_port: scheduler.port,
        scheduler_connect_timeout_seconds: CONNECT_S,
        task_scheduling_policy: TaskSchedulingPolicy::PullStaged,
        vcores: tasks,
        work_dir: Some(folder.display().to_string()),
        job_data_ttl_seconds: RESULTS_S,
        job_data_clean_up_interval_seconds: REMOVAL_S,
        executor_heartbeat_interval_seconds: HEARTBEAT_S,
        memory_pool_size: Some(MEMORY_BYTES as u64 * tasks as u64),
        override_function_registry: Some(Arc::new(functions)),
        override_config_producer: Some(Arc::new(move || configuration(Arc::clone(&columns)))),
        override_logical_codec: Some(Arc::clone(&codec) as _),
        override_physical_codec: Some(codec),
        ..ExecutorProcessConfig::default()
    };
    Ok(start_executor_process(Arc::new(config)).await?)
}
