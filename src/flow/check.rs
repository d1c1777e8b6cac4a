//! The flow of a check: configuration, files and kernel coverage of a site, and on request the verdict of a run; no
//! product is written.

use std::{collections::BTreeSet, path::PathBuf, sync::atomic::AtomicBool, time::Instant};

use super::{
    Observer, RivalSet, RunOptions, StageEvent, Task,
    driver::{Driver, Exit, Flow, Publication, SiteDriver},
    kernels::{load_rivals, required_coverage},
    outputs::Prepared,
    overlays::overlays,
    plan::plan_task,
    site::{finish, kernels, orient, prepare},
    triangulate::{match_ties, ties_of_files},
};
use crate::{
    config::SiteConfig,
    error::{Cause, Error, Locate, Result},
    files::{HashedFile, InputFiles},
    kernel_source::KernelSource,
    spice::RequiredCoverage,
    stage::{Output, Provenance, Reason, Round, Stage},
    stages::{group_profiles::Profile, judge::Verdict, tag_times::ImageTimes},
    store::publish::read_manifest,
    watch::{Counter, Watch},
};

/// Outcome of a check.
#[derive(Debug, Default)]
pub struct Checked {
    /// Results that are in order, one line each.
    pub findings: Vec<String>,
    /// All failures of a run, not only the first.
    pub failures: Vec<Error>,
    /// The verdict of a run; `None` if an input prevents it, or if it is not known without computing.
    pub verdict: Option<Verdict>,
    /// Products in the output folder.
    pub products: FoundProducts,
}

/// Products that a check finds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum FoundProducts {
    /// None, or not examined.
    #[default]
    Absent,
    /// A run would replace them.
    OutOfDate,
    /// A run would keep them: the verdict is theirs.
    Current,
}

/// Extent of a check.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Extent {
    /// Inputs and coverage; the verdict of products that are up to date.
    Inputs,
    /// Also the verdict of a run: every stage is computed, unless products are up to date.
    Full,
}

/// Checks a site's kernels, labels, PEDR and tie point files, and coverage at its images and at its shots; of rival
/// sets of kernels every one, since any of them may be chosen.
///
/// The PEDR files are searched as in a run: only shots in the windows determine the required times. Causes that would
/// make products invalid are failures too, as far as `extent` determines them.
///
/// * `options` – those of the run; kernels that are known to `hashes` are not read again for the check of their content
#[must_use]
pub fn check_site(config: &SiteConfig, extent: Extent, options: &RunOptions<'_>) -> Checked {
    let files = options.hashes.files();
    let mut check = Check::of(config, files, options.stop, options.observer);
    let checked = check.all(config, extent, options);
    if let Err(Exit::Failed(failure) | Exit::NotAdjusted(failure)) = checked {
        check.checked.failures.push(failure.in_site(&config.site));
    }
    check.checked
}

/// The times at which a site reads kernels, determined by the stages that need no orbit; nothing is stored.
///
/// # Errors
/// Failures of those stages with labels, clocks and PEDR files.
pub fn required_by_site(config: &SiteConfig) -> Result<RequiredCoverage> {
    let never = AtomicBool::new(false);
    let mut check = Check::of(config, InputFiles::default(), &never, &());
    let prepared = prepare(&mut check, config);
    if let Some(failure) = check.checked.failures.into_iter().next() {
        return Err(failure);
    }
    match prepared {
        Ok(prepared) => Ok(prepared.required.unwrap_or_default()),
        Err(Exit::StageReached) => Ok(RequiredCoverage::default()),
        Err(Exit::Failed(failure) | Exit::NotAdjusted(failure)) => {
            Err(failure.in_site(&config.site))
        }
    }
}

/// The rival sets of the configuration; empty if it names one source of kernels.
///
/// # Errors
/// Kernels that cannot be read.
pub fn rival_sets(config: &SiteConfig) -> Result<Vec<RivalSet>> {
    load_rivals(config, &InputFiles::default()).in_site(&config.site)
}

/// The products of a run would be invalid, or the present ones are.
#[derive(Debug, thiserror::Error, Cause)]
#[error("products {}: {reason}", if *.exist { "are invalid" } else { "would be invalid" })]
#[cause(Validation: "a run still writes the products, marks them as invalid, and reports the numbers")]
struct Invalid {
    exist: bool,
    reason: String,
}

struct Check<'a> {
    site: &'a str,
    files: InputFiles,
    stop: &'a AtomicBool,
    observer: &'a dyn Observer,
    /// Set of kernels to which findings refer.
    prefix: String,
    /// Whether all inputs are valid, so that every stage runs as it does in a run.
    is_trial: bool,
    checked: Checked,
    /// Failures that have been reported.
    told: BTreeSet<String>,
}

impl<'a> Check<'a> {
    fn of(
        config: &'a SiteConfig,
        files: InputFiles,
        stop: &'a AtomicBool,
        observer: &'a dyn Observer,
    ) -> Self {
        Self {
            site: &config.site,
            files,
            stop,
            observer,
            prefix: String::new(),
            is_trial: false,
            checked: Checked::default(),
            told: BTreeSet::new(),
        }
    }

    fn all(&mut self, config: &SiteConfig, extent: Extent, options: &RunOptions<'_>) -> Flow<()> {
        let prepared = prepare(self, config)?;
        if !config.ties.files.is_empty() {
            let times = self.usable(&prepared.images);
            ties_of_files(self, config, &times)?;
        }
        if let KernelSource::Sets(sets) = &config.kernels.source {
            for (index, set) in sets.iter().enumerate() {
                self.prefix = format!("kernel set {}: ", set.id);
                self.check_kernels(config, prepared.clone(), index)?;
            }
            self.prefix.clear();
        } else {
            self.check_kernels(config, prepared.clone(), 0)?;
        }
        if self.checked.failures.is_empty()
            && !self.reuse(config, options)?
            && extent == Extent::Full
        {
            self.is_trial = true;
            finish(self, config, prepared)?;
        }
        Ok(())
    }

    /// Takes the verdict of products, if a run would keep them.
    fn reuse(&mut self, config: &SiteConfig, options: &RunOptions<'_>) -> Flow<bool> {
        let task = Task::Site(config);
        let Some(manifest) = read_manifest(&task.folder(&options.out)) else {
            return Ok(false);
        };
        let plan = plan_task(task, options)?;
        if plan.stages.iter().any(|stage| stage.reason.runs()) {
            self.checked.products = FoundProducts::OutOfDate;
            return Ok(false);
        }
        self.checked.products = FoundProducts::Current;
        self.judge(manifest.verdict);
        Ok(true)
    }

    /// Enters the verdict; its reasons are failures.
    fn judge(&mut self, verdict: Verdict) {
        for reason in &verdict.reasons {
            let reason = reason.clone();
            let failure = Error::from(Invalid {
                exist: self.checked.products == FoundProducts::Current,
                reason,
            });
            self.checked.failures.push(failure.in_site(self.site));
        }
        self.checked.verdict = Some(verdict);
    }

    /// Orbit and orientation with one set of kernels.
    fn check_kernels(&mut self, config: &SiteConfig, prepared: Prepared, set: usize) -> Flow<()> {
        let Some(kernels) = kernels(self, config, prepared.required.as_ref(), set)? else {
            // The failure is noted; without kernels every time would be a gap.
            return Ok(());
        };
        for line in kernels.explanation() {
            self.tell(line);
        }
        let mut site = orient(self, config, prepared, Some(kernels))?;
        if config.ties.matched {
            let images = site.images()?;
            match_ties(self, config, Round::Initial, &images, site.shots()?, None)?;
        }
        overlays(self, config, &mut site)
    }

    /// Runs a stage, which the observer follows.
    fn watched<S: Stage>(&self, label: &str, stage: &S) -> Result<S::Output> {
        self.observer
            .hear(label, &StageEvent::Begins(&Reason::First));
        let tell = |count| self.observer.hear(label, &StageEvent::Counts(count));
        let counter = Counter::new(&tell);
        let begun = Instant::now();
        let made = stage.run_watched(Watch::counted(self.stop, &counter));
        if made.is_ok() {
            let taken_s = begun.elapsed().as_secs_f64();
            self.observer.hear(label, &StageEvent::Done(taken_s));
        }
        made
    }

    fn tell(&mut self, finding: &str) {
        self.checked
            .findings
            .push(format!("{}{finding}", self.prefix));
    }

    /// Records a finding or a failure; each failure once, since kernels are loaded for clocks and for orbits.
    fn note<T>(&mut self, stage: &str, result: Result<T>) -> Option<T> {
        match result.in_stage(stage).in_site(self.site) {
            Ok(found) => Some(found),
            Err(failure) => {
                if self.told.insert(failure.to_string()) {
                    self.checked.failures.push(failure);
                }
                None
            }
        }
    }
}

impl Driver for Check<'_> {
    fn files(&self) -> &InputFiles {
        &self.files
    }

    fn stop(&self) -> &AtomicBool {
        self.stop
    }

    fn enter(&mut self, _stage: &'static str) -> Flow<()> {
        Ok(())
    }

    /// An unreadable file is reported by the stage that reads it, or by the examination of that stage.
    fn hash(&mut self, _stage: &'static str, paths: &[PathBuf]) -> Flow<Vec<HashedFile>> {
        let hashed = self.files.hash_all(paths, self.stop);
        Ok(hashed.unwrap_or_default())
    }

    fn attempt<T>(
        &mut self,
        stage: &str,
        step: impl FnOnce(&InputFiles) -> Result<T>,
    ) -> Flow<Option<T>> {
        let result = step(&self.files);
        Ok(self.note(stage, result))
    }

    fn stage<S: Stage>(&mut self, stage: &S) -> Flow<Output<S::Output>> {
        let label = stage.label();
        if self.is_trial {
            let made = self.watched(&label, stage).in_stage(&label)?;
            return Ok(known(label, made));
        }
        let mut sound = true;
        for found in stage.examine() {
            match self.note(&label, found) {
                Some(finding) => self.tell(&finding),
                None => sound = false,
            }
        }
        let pending = Output::pending(label.clone());
        if !(sound && S::CHECKED && stage.inputs().is_complete()) {
            return Ok(pending);
        }
        let made = self.watched(&label, stage);
        let Some(value) = self.note(&label, made) else {
            return Ok(pending);
        };
        for finding in stage.findings(&value) {
            self.tell(&finding);
        }
        Ok(known(label, value))
    }

    /// The verdict, as a run would publish it.
    fn publish(&mut self, publication: &impl Publication) -> Flow<()> {
        self.judge(publication.verdict()?);
        Ok(())
    }
}

impl SiteDriver for Check<'_> {
    /// An image without times fails on its own; profiles are checked nevertheless.
    fn usable(&self, images: &[Output<ImageTimes>]) -> Vec<Output<ImageTimes>> {
        let usable = images.iter().filter(|image| image.get().is_some());
        usable.cloned().collect()
    }

    /// The required times, as far as they are known.
    fn required(
        &self,
        config: &SiteConfig,
        images: &[Output<ImageTimes>],
        profiles: &Output<Vec<Profile>>,
    ) -> Option<RequiredCoverage> {
        let images: Vec<&ImageTimes> = images.iter().filter_map(Output::get).collect();
        let profiles = profiles.get().map_or(&[][..], Vec::as_slice);
        Some(required_coverage(config, &images, profiles))
    }
}

/// The origin of an output is not used here.
fn known<T>(label: String, value: T) -> Output<T> {
    let nowhere = Provenance {
        blake3: String::new(),
        fingerprint: String::new(),
    };
    Output::known(label, value, nowhere)
}
