//! The flow of a plan: the stages that would run, and the reasons; no product is written.

use std::{path::PathBuf, sync::atomic::AtomicBool};

use serde::{Serialize, de::DeserializeOwned};

use super::{
    PUBLISH,
    bounds::Bounds,
    driver::{Driver, Exit, Flow, Ledger, Publication, SiteDriver, StageReason},
    out::check_out_path,
    publish::standing,
    run::RunOptions,
    task::Task,
};
use crate::{
    config::SiteConfig,
    error::Result,
    files::{HashedFile, InputFiles},
    stage::{Inputs, Output, Reason, Stage},
    store::{cache::StageCache, publish::CACHE},
};

/// Plan of a run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunPlan {
    /// Every stage with the reason why it would run, or that it would be kept.
    pub stages: Vec<StageReason>,
    /// The files that the stages read, as far as is known before the first stage that would run.
    pub files: Vec<HashedFile>,
}

/// Reports what [`run_site`](super::run_site) would do with these options, as [`plan_task`].
///
/// # Errors
/// As [`plan_task`].
pub fn plan_site(config: &SiteConfig, options: &RunOptions<'_>) -> Result<RunPlan> {
    plan_task(Task::Site(config), options)
}

/// Reports what [`run_task`](super::run_task) would do with these options. Only hashes are written.
///
/// A stage below one that would run is listed as running because that output may change; if it does not, the run
/// keeps the later stage.
///
/// # Errors
/// Input files or kernels that cannot be read.
pub fn plan_task(task: Task<'_>, options: &RunOptions<'_>) -> Result<RunPlan> {
    check_out_path(&options.out)?;
    let stages = task.stages_with(options.until)?;
    let folder = task.folder(&options.out);
    let drive = |cache| {
        let mut plan = Plan {
            cache,
            folder: folder.clone(),
            bounds: Bounds {
                stages: stages.clone(),
                until: options.until,
                stop: options.stop,
                files: options.files(),
            },
            planned: Vec::new(),
            ledger: Ledger::new(),
        };
        let driven = task.drive(&mut plan);
        (plan, driven)
    };
    let (mut plan, mut driven) = drive(options.stage_cache(&folder));
    if plan.cache.has_lost_output() {
        // As a run does.
        (plan, driven) = drive(StageCache::new(&folder.join(CACHE), options.force));
    }
    options.hashes.keep(plan.files());
    match driven {
        Ok(()) | Err(Exit::StageReached) => Ok(RunPlan {
            files: plan.files().all(),
            stages: plan.planned,
        }),
        Err(Exit::Failed(failure) | Exit::NotAdjusted(failure)) => {
            Err(failure.in_site(task.name()))
        }
    }
}

struct Plan<'a> {
    cache: StageCache,
    folder: PathBuf,
    bounds: Bounds<'a>,
    planned: Vec<StageReason>,
    ledger: Ledger,
}

impl Driver for Plan<'_> {
    fn files(&self) -> &InputFiles {
        &self.bounds.files
    }

    fn stop(&self) -> &AtomicBool {
        self.bounds.stop
    }

    fn enter(&mut self, stage: &'static str) -> Flow<()> {
        self.bounds.enter(stage)
    }

    fn stage<S: Stage>(&mut self, stage: &S) -> Flow<Output<S::Output>> {
        self.enter(S::NAME)?;
        let label = stage.label();
        let (reason, output) = match self.cache.load(&label, &stage.inputs()) {
            Ok(output) => (Reason::Unchanged, output),
            Err(reason) => (reason, Output::pending(label.clone())),
        };
        let provenance = output.provenance().cloned();
        self.ledger.push((label.clone(), provenance));
        self.planned.push(StageReason {
            stage: label,
            reason,
        });
        Ok(output)
    }

    fn part<T: Serialize + DeserializeOwned>(
        &mut self,
        label: String,
        stored_as: &str,
        inputs: &Inputs,
    ) -> Flow<Option<Output<T>>> {
        let (reason, output) = match self.cache.load(stored_as, inputs) {
            Ok(output) => (Reason::Unchanged, Some(output)),
            Err(reason) => (reason, None),
        };
        let stage = label;
        self.planned.push(StageReason { stage, reason });
        Ok(output)
    }

    fn publish(&mut self, publication: &impl Publication) -> Flow<()> {
        self.enter(PUBLISH)?;
        let inputs = publication.inputs(&self.folder, &self.ledger);
        let standing = standing(&self.folder, &self.cache, &inputs);
        self.planned.push(StageReason {
            stage: PUBLISH.to_owned(),
            reason: standing.err().unwrap_or(Reason::Unchanged),
        });
        Ok(())
    }
}

impl SiteDriver for Plan<'_> {}
