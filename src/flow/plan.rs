//! The flow that looks: which stages would run, and why; nothing is written.

use std::{
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
};

use super::{
    PUBLISH,
    bounds::Bounds,
    driver::{Driver, Flow, Leave, Ledger, StageReason},
    outputs::Site,
    publish::{inputs, standing},
    site::site,
};
use crate::{
    config::SiteConfig,
    error::Result,
    files::InputFiles,
    stage::{Output, Reason, Stage},
    store::{cache::StageCache, publish::CACHE},
};

/// Says what [`run_site`](super::run_site) would do.
///
/// A stage below one that would run is listed as running because that output may change; if it turns
/// out the same, the run will keep the later stage.
///
/// # Errors
/// Input files or kernels that cannot be read.
pub fn plan_site(
    config: &SiteConfig,
    out: &Path,
    until: &str,
    force: bool,
) -> Result<Vec<StageReason>> {
    let folder = out.join(&config.site);
    let mut plan = Plan {
        cache: StageCache::new(&folder.join(CACHE), force),
        folder,
        bounds: Bounds {
            until,
            stop: &AtomicBool::new(false),
            files: InputFiles::default(),
        },
        planned: Vec::new(),
        ledger: Ledger::new(),
    };
    match site(&mut plan, config) {
        Ok(()) | Err(Leave::StageReached) => Ok(plan.planned),
        Err(Leave::Failed(failure)) => Err(failure.in_site(&config.site)),
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

    fn publish(&mut self, config: &SiteConfig, site: &Site) -> Flow<()> {
        self.enter(PUBLISH)?;
        let inputs = inputs(config, site, &self.folder, &self.ledger);
        let standing = standing(&self.folder, &self.cache, &inputs);
        self.planned.push(StageReason {
            stage: PUBLISH.to_owned(),
            reason: standing.err().unwrap_or(Reason::Unchanged),
        });
        Ok(())
    }
}
