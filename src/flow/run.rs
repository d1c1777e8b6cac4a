//! The flow that makes products: a stage runs when one of its inputs has changed.

use std::{
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
    time::Instant,
};

use serde::{Serialize, de::DeserializeOwned};

use super::{
    PUBLISH,
    bounds::Bounds,
    driver::{Driver, Exit, Flow, Ledger, MadeFrom, Publication, SiteDriver, StageReason},
    observer::{Observer, StageEvent},
    out::check_out_path,
    publish::{keep, standing},
    task::Task,
};
use crate::{
    config::SiteConfig,
    error::{Error, Locate, Result},
    files::{HashedFile, InputFiles},
    stage::{Inputs, Output, Reason, Stage},
    store::{
        cache::StageCache,
        hashes::HashCache,
        lock::SiteLock,
        manifest::Manifest,
        publish::{CACHE, note_failure},
    },
    watch::{Counter, Watch},
};

/// Options of a run.
#[derive(Debug)]
pub struct RunOptions<'a> {
    /// Products go to a subfolder with the name of the site, net or calibration; those of a match or of an archive to
    /// this folder.
    pub out: PathBuf,
    /// Last stage to run, one of [`Task::stages`].
    pub until: &'a str,
    /// Use no stored output.
    pub force: bool,
    /// Set from outside to stop between two stages, or inside the long ones.
    pub stop: &'a AtomicBool,
    /// Hashes of input files from earlier runs; hashes of this run are added.
    pub hashes: &'a HashCache,
    /// Folders below which input files must lie, links resolved; empty for no restriction.
    pub roots: &'a [PathBuf],
    /// Receives the events of each stage.
    pub observer: &'a dyn Observer,
}

impl<'a> RunOptions<'a> {
    /// A run to the products, with stored outputs, input files anywhere, and no observer.
    #[must_use]
    pub fn of(out: &Path, stop: &'a AtomicBool, hashes: &'a HashCache) -> Self {
        Self {
            out: out.to_owned(),
            until: PUBLISH,
            force: false,
            stop,
            hashes,
            roots: &[],
            observer: &(),
        }
    }

    /// The input files of a run.
    pub(super) fn files(&self) -> InputFiles {
        self.hashes.files().within(self.roots)
    }

    /// The stored outputs of the flow with products in `folder`.
    pub(super) fn stage_cache(&self, folder: &Path) -> StageCache {
        let folder = folder.join(CACHE);
        let own = self.hashes.of_own(&folder).files();
        StageCache::new(&folder, self.force).knowing(own)
    }
}

/// Outcome of a run.
#[derive(Debug)]
pub struct RunOutcome {
    /// Name of the task: the identifier of a site.
    pub name: String,
    /// Folder of the products.
    pub folder: PathBuf,
    /// Every stage that the run passed, with the reason why it ran, or that it was kept.
    pub stages: Vec<StageReason>,
    /// Reasons why inputs are left out, which the products state.
    pub left_out: Vec<Error>,
    /// End of the run.
    pub ending: Ending,
}

/// End of a run.
#[derive(Debug)]
pub enum Ending {
    /// Products were published.
    Published(Manifest),
    /// Nothing had changed; the products of an earlier run remain.
    Unchanged(Manifest),
    /// Stopped after the requested stage.
    StoppedAfter(String),
}

impl RunOutcome {
    /// The manifest of the products; `None` if the run stopped before them.
    #[must_use]
    pub const fn manifest(&self) -> Option<&Manifest> {
        match &self.ending {
            Ending::Published(manifest) | Ending::Unchanged(manifest) => Some(manifest),
            Ending::StoppedAfter(_) => None,
        }
    }

    /// Whether the products already existed.
    #[must_use]
    pub const fn is_unchanged(&self) -> bool {
        matches!(self.ending, Ending::Unchanged(_))
    }
}

/// Runs one site from its configuration to its products, as [`run_task`].
///
/// # Errors
/// As [`run_task`].
pub fn run_site(config: &SiteConfig, options: &RunOptions<'_>) -> Result<RunOutcome> {
    run_task(Task::Site(config), options)
}

/// Runs a flow from its inputs to its products.
///
/// A stage whose inputs are unchanged is not run; its stored output is used.
///
/// # Errors
/// The first failure, with task, stage and file; products of an earlier run remain unchanged.
pub fn run_task(task: Task<'_>, options: &RunOptions<'_>) -> Result<RunOutcome> {
    let name = task.name();
    let span = tracing::info_span!("site", id = %name);
    let _entered = span.enter();
    check_out_path(&options.out)?;
    let stages = task.stages_with(options.until)?;
    let folder = task.folder(&options.out);
    let _lock = SiteLock::take(&folder).in_site(name)?;
    let cache = options.stage_cache(&folder);
    let (mut run, mut driven) = drive(task, &stages, options, &folder, cache);
    if run.cache.has_lost_output() {
        tracing::warn!("a stored output is damaged or cannot be read: the run restarts");
        // Every stored output is read at once, and a damaged one is computed anew.
        let at_once = StageCache::new(&folder.join(CACHE), options.force);
        (run, driven) = drive(task, &stages, options, &folder, at_once);
    }
    run.hashes.keep(run.files());
    let of_own = run.hashes.of_own(&folder.join(CACHE));
    match run.ending {
        Ending::Published(_) | Ending::Unchanged(_) => of_own.keep_only(run.cache.own()),
        Ending::StoppedAfter(_) => of_own.keep(run.cache.own()),
    }
    let driven = driven.in_site(name);
    note_failure(
        &run.folder,
        driven.as_ref().err().map(ToString::to_string).as_deref(),
    );
    driven?;
    Ok(RunOutcome {
        name: name.to_owned(),
        folder: run.folder,
        stages: run.passed,
        left_out: run.left_out,
        ending: run.ending,
    })
}

/// Drives the flow once.
fn drive<'a>(
    task: Task<'_>,
    stages: &[&'static str],
    options: &'a RunOptions<'_>,
    folder: &Path,
    cache: StageCache,
) -> (Run<'a>, Result<()>) {
    let mut run = Run {
        cache,
        folder: folder.to_owned(),
        bounds: Bounds {
            stages: stages.to_vec(),
            until: options.until,
            stop: options.stop,
            files: options.files(),
        },
        hashes: options.hashes,
        observer: options.observer,
        ledger: Ledger::new(),
        methods: Vec::new(),
        passed: Vec::new(),
        has_parts: false,
        left_out: Vec::new(),
        ending: Ending::StoppedAfter(options.until.to_owned()),
    };
    let driven = match task.drive(&mut run) {
        Ok(()) | Err(Exit::StageReached) => run.verify_inputs(),
        Err(Exit::Failed(failure) | Exit::NotAdjusted(failure)) => {
            // Outputs made from changed files are discarded; the failure itself takes precedence over the change.
            let _ = run.verify_inputs();
            Err(failure)
        }
    };
    (run, driven)
}

struct Run<'a> {
    cache: StageCache,
    folder: PathBuf,
    bounds: Bounds<'a>,
    hashes: &'a HashCache,
    observer: &'a dyn Observer,
    ledger: Ledger,
    /// The number of the method of each stage so far, regardless of why it ran.
    methods: Vec<(String, u32)>,
    /// Every stage so far.
    passed: Vec<StageReason>,
    /// Whether a stage has parts that are not in the manifest.
    has_parts: bool,
    left_out: Vec<Error>,
    ending: Ending,
}

impl Run<'_> {
    /// Records and reports why a stage runs, or that it is kept.
    fn pass(&mut self, label: &str, reason: Reason) {
        let word = if reason.runs() { "running" } else { "kept" };
        tracing::info!(stage = label, "{word}: {reason}");
        let event = if reason.runs() {
            StageEvent::Begins(&reason)
        } else {
            StageEvent::Kept
        };
        self.observer.hear(label, &event);
        self.passed.push(StageReason {
            stage: label.to_owned(),
            reason,
        });
    }

    fn done(&self, label: &str, begun: Instant) {
        let event = StageEvent::Done(begun.elapsed().as_secs_f64());
        self.observer.hear(label, &event);
    }

    /// Ensures that all stages have read the same files. Otherwise their outputs would be stored under the hashes of
    /// other files: the new outputs are discarded.
    fn verify_inputs(&self) -> Result<()> {
        let unchanged = self.bounds.files.verify_all();
        if unchanged.is_err() {
            for fresh in self.passed.iter().filter(|of| of.reason.runs()) {
                self.cache.forget(&fresh.stage);
            }
        }
        unchanged
    }
}

impl Driver for Run<'_> {
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
        let (label, inputs) = (stage.label(), stage.inputs());
        let output = match self.cache.load(&label, &inputs) {
            Ok(output) => {
                self.pass(&label, Reason::Unchanged);
                output
            }
            Err(reason) => {
                self.pass(&label, reason);
                let begun = Instant::now();
                // The hashes of a large archive are kept even if the run fails.
                self.hashes.keep(self.files());
                let tell = |count| self.observer.hear(&label, &StageEvent::Counts(count));
                let counter = Counter::new(&tell);
                let watch = Watch::counted(self.bounds.stop, &counter);
                let value = stage.run_watched(watch).in_stage(&label)?;
                for path in inputs.file_paths() {
                    self.bounds.files.verify(path).in_stage(&label)?;
                }
                let output = self.cache.store(&label, inputs, value).in_stage(&label)?;
                self.done(&label, begun);
                output
            }
        };
        self.ledger.push((label, output.provenance().cloned()));
        if self.methods.iter().all(|(name, _)| name != S::NAME) {
            self.methods.push((S::NAME.to_owned(), S::METHOD));
        }
        Ok(output)
    }

    fn part<T: Serialize + DeserializeOwned>(
        &mut self,
        label: String,
        stored_as: &str,
        inputs: &Inputs,
    ) -> Flow<Option<Output<T>>> {
        self.has_parts = true;
        let (reason, output) = match self.cache.load(stored_as, inputs) {
            Ok(output) => (Reason::Unchanged, Some(output)),
            Err(reason) => (reason, None),
        };
        tracing::debug!(stage = label, "{reason}");
        let stage = label;
        self.passed.push(StageReason { stage, reason });
        Ok(output)
    }

    fn work<T>(
        &mut self,
        stage: &'static str,
        work: impl FnOnce(&StageCache, &InputFiles, Watch<'_>) -> Result<T>,
    ) -> Flow<Option<T>> {
        self.enter(stage)?;
        let begun = Instant::now();
        self.observer
            .hear(stage, &StageEvent::Begins(&Reason::First));
        let tell = |count| self.observer.hear(stage, &StageEvent::Counts(count));
        let counter = Counter::new(&tell);
        let watch = Watch::counted(self.bounds.stop, &counter);
        let made = work(&self.cache, &self.bounds.files, watch).in_stage(stage)?;
        self.done(stage, begun);
        Ok(Some(made))
    }

    fn leave_out(&mut self, failures: Vec<Error>) {
        self.left_out.extend(failures);
    }

    fn hash(&mut self, stage: &'static str, paths: &[PathBuf]) -> Flow<Vec<HashedFile>> {
        self.enter(stage)?;
        let tell = |count| self.observer.hear(stage, &StageEvent::Counts(count));
        let counter = Counter::new(&tell);
        let watch = Watch::counted(self.bounds.stop, &counter);
        Ok(self.files().hash_all(paths, watch).in_stage(stage)?)
    }

    /// Publishes the products unless the products of an earlier run are current.
    fn publish(&mut self, publication: &impl Publication) -> Flow<()> {
        self.enter(PUBLISH)?;
        let inputs = publication.inputs(&self.folder, &self.ledger);
        self.ending = match standing(&self.folder, &self.cache, &inputs) {
            Ok(manifest) => {
                self.pass(PUBLISH, Reason::Unchanged);
                Ending::Unchanged(manifest)
            }
            Err(reason) => {
                self.pass(PUBLISH, reason);
                let begun = Instant::now();
                self.verify_inputs().in_stage(PUBLISH)?;
                let made_from = MadeFrom {
                    folder: &self.folder,
                    ledger: &self.ledger,
                    methods: &self.methods,
                    inputs: &inputs,
                    stop: self.bounds.stop,
                };
                let manifest = publication.publish(&made_from).in_stage(PUBLISH)?;
                // Publishing may leave out further inputs.
                let inputs = publication.inputs(&self.folder, &self.ledger);
                keep(&self.cache, inputs, &manifest).in_stage(PUBLISH)?;
                // Results of files of an archive remain: a later check may name these files again.
                if !self.has_parts {
                    self.cache
                        .keep_only(manifest.stages.iter().map(|stage| &*stage.name));
                }
                self.done(PUBLISH, begun);
                Ending::Published(manifest)
            }
        };
        Ok(())
    }
}

impl SiteDriver for Run<'_> {}
