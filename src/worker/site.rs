//! Runs and plans a site.

use std::path::{Path, PathBuf};

use super::Worker;
use crate::{
    config::{Document as _, Loaded, SiteConfig},
    error::{Cause, Locate, Result},
    files::HashedFile,
    flow::{Ending, PUBLISH, RunOptions, StageReason, check_out, plan_site, run_site},
    geom::window::{Region, bounds_rad},
    service::worker::{
        protocol::{PlanAnswer, PlannedFile, PlannedStage, RunAnswer, What},
        run_folder::{RunRecord, keep},
    },
    units::RADIANS_PER_DEGREE,
};

/// A site file whose keys differ from those that the service recorded.
#[derive(Debug, thiserror::Error, Cause)]
#[error(
    "the keys of the site file have the hash {is}; expected {seen}, which the service recorded"
)]
#[cause(Input: "run again after the service has detected the change")]
struct OtherKeys {
    is: String,
    seen: String,
}

/// A run that ended before its products were written.
#[derive(Debug, thiserror::Error, Cause)]
#[error("the run ended after {0}; expected a run with products")]
#[cause(Bug: "this is a bug in areograph; please report it with the configuration")]
struct NoProducts(String);

impl Worker {
    /// Runs the site of the task and keeps its products as a run.
    pub(super) fn run(&self) -> Result<RunAnswer> {
        let What::Run {
            site_file,
            config_blake3,
            out,
            runs,
            run,
            force,
        } = &self.task.what
        else {
            return Err(NoProducts("another task".to_owned()).into());
        };
        let site = self.load(site_file)?.config;
        if site.blake3 != *config_blake3 {
            let (is, seen) = (site.blake3, config_blake3.clone());
            return Err(OtherKeys { is, seen })
                .in_site(&site.site)
                .in_file(site_file);
        }
        check_out(out, std::slice::from_ref(&site))?;
        let outcome = run_site(&site, &self.options(out, *force))?;
        let manifest = match outcome.ending {
            Ending::Published(manifest) | Ending::Unchanged(manifest) => manifest,
            Ending::StoppedAfter(stage) => return Err(NoProducts(stage)).in_site(&site.site),
        };
        let made_by = RunRecord {
            run: run.clone(),
            job: self.task.job,
            attempt: self.task.attempt,
            manifest_blake3: String::new(),
        };
        let kept = keep(&outcome.folder, &manifest, runs, &made_by);
        let (manifest_blake3, is_new) = kept.in_site(&site.site)?;
        Ok(RunAnswer {
            run: is_new.then(|| run.clone()),
            manifest_blake3,
            valid: manifest.verdict.valid,
            verdict: manifest.verdict.word().to_owned(),
            reasons: manifest.verdict.reasons,
            ran: outcome
                .stages
                .iter()
                .filter(|stage| stage.reason.runs())
                .map(planned)
                .collect(),
        })
    }

    /// Reports the plan of a run, and its inputs.
    pub(super) fn plan(&self, site_file: &Path, out: &Path) -> Result<PlanAnswer> {
        let Loaded {
            config: site,
            files,
            ..
        } = self.load(site_file)?;
        let plan = plan_site(&site, &self.options(out, false))?;
        let mut read = plan.files;
        read.extend(self.others(&files, &read)?);
        read.sort_by(|a, b| a.path.cmp(&b.path));
        let regions: Vec<Region> = site
            .windows
            .iter()
            .map(|window| Region::new(&window.shape))
            .collect();
        let bounds = bounds_rad(&regions);
        Ok(PlanAnswer {
            config_blake3: site.blake3,
            stages: plan.stages.iter().map(planned).collect(),
            files: read
                .into_iter()
                .map(|file| PlannedFile {
                    path: file.path,
                    blake3: file.blake3,
                })
                .collect(),
            bounds_deg: bounds.map(|edges| edges.map(|edge| edge / RADIANS_PER_DEGREE)),
            body: site.body,
        })
    }

    fn load(&self, site_file: &Path) -> Result<Loaded<SiteConfig>> {
        let loaded = SiteConfig::load_within(site_file, &self.roots)?;
        for warning in &loaded.warnings {
            tracing::warn!("{warning}");
        }
        Ok(loaded)
    }

    fn options(&self, out: &Path, force: bool) -> RunOptions<'_> {
        RunOptions {
            out: out.to_owned(),
            until: PUBLISH,
            force,
            stop: &self.stop,
            hashes: &self.hashes,
            roots: &self.roots,
            observer: &*self.reporter,
        }
    }

    /// Files of the configuration that no stage reads: metakernels, outlines, cameras.
    fn others(&self, files: &[PathBuf], read: &[HashedFile]) -> Result<Vec<HashedFile>> {
        let known = |path: &PathBuf| read.iter().any(|file| file.path == *path);
        let others = files.iter().filter(|path| path.is_file() && !known(path));
        let others: Vec<PathBuf> = others.cloned().collect();
        let files = self.hashes.files();
        let hashed = files.hash_all(&others, &*self.stop)?;
        self.hashes.keep(&files);
        Ok(hashed)
    }
}

fn planned(stage: &StageReason) -> PlannedStage {
    PlannedStage {
        stage: stage.stage.clone(),
        runs: stage.reason.runs(),
        because: stage.reason.to_string(),
    }
}
