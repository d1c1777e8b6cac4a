//! Queries that nothing continues.

use std::{collections::HashMap, time::Duration};

use ballista_core::{JobId, serde::protobuf::job_status::Status};
use ballista_scheduler::scheduler_server::SchedulerServer;
use datafusion_proto::protobuf::{LogicalPlanNode, PhysicalPlanNode};

type Scheduler = SchedulerServer<LogicalPlanNode, PhysicalPlanNode>;

/// Seconds between looks, and looks without work after which a query fails. A running query is without work only while the
/// scheduler handles an event, which takes milliseconds.
const LOOK_S: u64 = 2;
const LOOKS: u32 = 6;

/// Tasks of a query at one look.
#[derive(Debug, Clone, Copy)]
struct Tasks {
    running: usize,
    available: usize,
}

/// Why a query does not continue; `None` if it does, or waits for executors that work for others.
fn obstacle(tasks: Tasks, is_idle: bool) -> Option<&'static str> {
    match tasks {
        Tasks { running: 1.., .. } => None,
        Tasks { available: 0, .. } => {
            Some("the scheduler lost its tasks, as when an executor ends; ask again")
        }
        _ if is_idle => Some("no executor took its tasks; check that executors run, and ask again"),
        _ => None,
    }
}

/// Ends queries that nothing continues, so that who asked receives an error instead of waiting without end. When an
/// executor with results of several stages ends, the scheduler of Ballista 55.0 may keep a query that has neither
/// running nor available tasks.
pub(super) async fn end_stalled(scheduler: Scheduler) {
    let mut looks: HashMap<JobId, u32> = HashMap::new();
    loop {
        tokio::time::sleep(Duration::from_secs(LOOK_S)).await;
        looks = look(&scheduler, &looks).await;
    }
}

/// Looks at all queries once; returns how often each was found without work since it last had some.
async fn look(scheduler: &Scheduler, before: &HashMap<JobId, u32>) -> HashMap<JobId, u32> {
    let manager = &scheduler.state.task_manager;
    let mut found = Vec::new();
    for (id, query) in manager.get_running_job_cache().iter() {
        let graph = query.execution_graph.read().await;
        if let Some(Status::Failed(_)) = graph.status().status {
            // Its error has been at the disposal of the program that asked for the time between two looks.
            drop(graph);
            let _ = scheduler.cancel_job(id.clone()).await;
        } else if !graph.is_successful() {
            let tasks = Tasks {
                running: graph.running_tasks().len(),
                available: graph.available_tasks(),
            };
            found.push((id.clone(), tasks, query.execution_graph.clone()));
        }
    }
    let is_idle = found.iter().all(|(_, tasks, _)| tasks.running == 0);
    let mut after = HashMap::new();
    for (id, tasks, graph) in found {
        let Some(why) = obstacle(tasks, is_idle) else {
            continue;
        };
        let looks = before.get(&id).map_or(1, |looks| looks + 1);
        if looks < LOOKS {
            after.insert(id, looks);
            continue;
        }
        tracing::warn!("query {id} is ended: {why}");
        graph.write().await.abort_running(why.to_owned());
        if let Err(error) = manager.update_job(&id).await {
            tracing::warn!("the end of query {id} could not be recorded: {error}");
        }
    }
    after
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_query_continues_if_it_has_work_or_waits_for_others() {
        let tasks = |running, available| Tasks { running, available };
        assert_eq!(obstacle(tasks(1, 0), false), None);
        assert_eq!(obstacle(tasks(2, 5), false), None);
        assert_eq!(obstacle(tasks(0, 5), false), None);
        let lost = obstacle(tasks(0, 0), false).unwrap();
        assert!(lost.contains("lost its tasks"), "{lost}");
        let idle = obstacle(tasks(0, 5), true).unwrap();
        assert!(idle.contains("no executor"), "{idle}");
    }
}
