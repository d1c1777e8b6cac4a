//! Interface of a driver of the flow to its stages.

use std::{path::PathBuf, sync::atomic::AtomicBool};

use super::outputs::Site;
use crate::{
    config::SiteConfig,
    error::{Error, Kind, Locate, Result},
    files::{HashedFile, InputFiles},
    pds::SizedFile,
    spice::RequiredCoverage,
    stage::{Output, Provenance, Reason, Stage},
    stages::{group_profiles::Profile, tag_times::ImageTimes},
};

/// Reasons why the flow ends before its end.
#[derive(Debug)]
pub(super) enum Exit {
    /// The last requested stage is done.
    StageReached,
    /// Something failed.
    Failed(Error),
    /// The geometry of tie points or orientation failed: there is no adjustment.
    NotAdjusted(Error),
}

/// A step of the adjustment: a failure of its geometry, and not an unreadable file, ends only the adjustment.
pub(super) fn of_adjustment<T>(step: Flow<T>) -> Flow<T> {
    step.map_err(|leave| match leave {
        Exit::Failed(failure) if failure.kind() == Kind::Input && failure.file.is_none() => {
            Exit::NotAdjusted(failure)
        }
        leave => leave,
    })
}

impl From<Error> for Exit {
    fn from(failure: Error) -> Self {
        Self::Failed(failure)
    }
}

/// Result of a step of the flow, unless the flow ends there.
pub(super) type Flow<T> = std::result::Result<T, Exit>;

/// A stage with the reason why it runs, or [`Reason::Unchanged`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StageReason {
    /// Label of the stage, for example `register/E02-00665`.
    pub stage: String,
    /// Reason why it runs, or the statement that it is kept.
    pub reason: Reason,
}

/// Stages that the flow has passed, with the origin of their outputs where these are known.
pub(super) type Ledger = Vec<(String, Option<Provenance>)>;

/// Carries out one description of the flow: run, plan or check.
pub(super) trait Driver {
    /// The input files of the site.
    fn files(&self) -> &InputFiles;

    /// Set from outside to stop.
    fn stop(&self) -> &AtomicBool;

    /// Called before the stage with this name.
    fn enter(&mut self, stage: &'static str) -> Flow<()>;

    /// The output of a stage, or a pending one.
    fn stage<S: Stage>(&mut self, stage: &S) -> Flow<Output<S::Output>>;

    /// Files that a stage reads, with their hashes.
    fn hash(&mut self, stage: &'static str, paths: &[PathBuf]) -> Flow<Vec<HashedFile>> {
        self.enter(stage)?;
        Ok(self.files().hash_all(paths, self.stop()).in_stage(stage)?)
    }

    /// Hashes files of a kind with a largest size; a larger one is not read.
    fn hash_sized(
        &mut self,
        stage: &'static str,
        kind: SizedFile,
        paths: &[PathBuf],
    ) -> Flow<Vec<HashedFile>> {
        self.enter(stage)?;
        let sized = |_: &_| paths.iter().try_for_each(|path| kind.require(path));
        match self.attempt(stage, sized)? {
            Some(()) => self.hash(stage, paths),
            None => Ok(Vec::new()),
        }
    }

    /// The images with which profiles may be simultaneous.
    fn usable(&self, images: &[Output<ImageTimes>]) -> Vec<Output<ImageTimes>> {
        images.to_vec()
    }

    /// Result of a step between stages, which may read files; `None` if it failed and the driver continues, or if the
    /// driver reads nothing.
    fn attempt<T>(
        &mut self,
        stage: &str,
        step: impl FnOnce(&InputFiles) -> Result<T>,
    ) -> Flow<Option<T>> {
        Ok(Some(step(self.files()).in_stage(stage)?))
    }

    /// The times at which the site reads kernels; `None` while they are not known.
    fn required(
        &self,
        config: &SiteConfig,
        images: &[Output<ImageTimes>],
        profiles: &Output<Vec<Profile>>,
    ) -> Option<RequiredCoverage> {
        let images = images.iter().map(Output::get);
        let images: Vec<&ImageTimes> = images.collect::<Option<_>>()?;
        Some(super::kernels::required_coverage(
            config,
            &images,
            profiles.get()?,
        ))
    }

    /// The products.
    fn publish(&mut self, config: &SiteConfig, site: &Site) -> Flow<()>;
}
