//! Work of a request that needs a worker process: CSPICE and long searches run outside of the service.

use std::{fs, sync::Arc};

use axum::http::StatusCode;
use tokio::sync::{OwnedSemaphorePermit, watch};

use super::{app::App, problem::Problem};
use crate::worker::{
    parent::{Times, WorkerLimits, work},
    protocol::{Answer, CancelWhy, Failure, PROTOCOL, Task, What},
};

/// Longest log of such a worker.
const LOG_KIB: u32 = 256;

/// A slot for a worker; there are few.
pub(super) fn place(app: &App) -> Result<OwnedSemaphorePermit, Problem> {
    Arc::clone(&app.workers)
        .try_acquire_owned()
        .map_err(|_| Problem {
            retry_after_s: Some(5),
            ..Problem::new(
                StatusCode::TOO_MANY_REQUESTS,
                "Other plans and searches are in progress.",
            )
        })
}

/// Has `what` done within `deadline_s`; the worker also ends if the future is dropped or the service ends.
pub(super) async fn ask(
    app: &App,
    what: What,
    deadline_s: f64,
) -> Result<Result<Answer, Failure>, Problem> {
    let config = app.config();
    let inputs = &config.inputs;
    let roots = [&inputs.sites, &inputs.kernels, &inputs.data]
        .into_iter()
        .flatten();
    let task = Task {
        v: PROTOCOL,
        job: 0,
        attempt: 1,
        what,
        hashes_file: config.outputs.state.join("hashes"),
        roots: roots.cloned().collect(),
        threads: config.workers.threads,
        memory_mib: config.workers.memory_mib,
    };
    let limits = WorkerLimits {
        deadline_s,
        silence_s: config.workers.silence_s,
        log_max_kib: LOG_KIB,
        times: Times::USUAL,
    };
    let folder = config.outputs.state.join("requests");
    fs::create_dir_all(&folder).map_err(Problem::internal)?;
    let log = tempfile::Builder::new()
        .suffix(".log")
        .tempfile_in(&folder)
        .map_err(Problem::internal)?;
    let (cancel, cancelled) = watch::channel(None);
    let ended = work(
        &app.shared.program,
        &task,
        &limits,
        log.path(),
        cancelled,
        |_| {},
    );
    tokio::pin!(ended);
    let ended = tokio::select! {
        ended = &mut ended => ended,
        () = app.shared.ending.cancelled() => {
            let _ = cancel.send(Some(CancelWhy::Shutdown));
            ended.await
        }
    };
    ended.answer.ok_or_else(|| {
        Problem::internal(format!("a worker ended without an answer: {:?}", ended.how))
    })
}
