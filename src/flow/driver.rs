//! Interface of a driver of the flow to its stages.

use std::{
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
};

use serde::{Serialize, de::DeserializeOwned};

use crate::{
    config::SiteConfig,
    error::{Error, Kind, Locate, Result},
    files::{HashedFile, InputFiles},
    pds::SizedFile,
    spice::RequiredCoverage,
    stage::{Inputs, Output, Provenance, Reason, Stage},
    stages::{group_profiles::Profile, judge::Verdict, tag_times::ImageTimes},
    store::{cache::StageCache, manifest::Manifest},
    watch::Watch,
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

/// The products at the end of a flow.
pub(super) trait Publication {
    /// Everything on which the products depend.
    fn inputs(&self, folder: &Path, ledger: &Ledger) -> Inputs;

    /// The verdict that the products state.
    fn verdict(&self) -> Result<Verdict>;

    /// Makes the products and gives them their final names.
    fn publish(&self, made_from: &MadeFrom<'_>) -> Result<Manifest>;
}

/// Origin of products, and their folder.
pub(super) struct MadeFrom<'a> {
    pub(super) folder: &'a Path,
    pub(super) ledger: &'a Ledger,
    /// The number of the method of each stage.
    pub(super) methods: &'a [(String, u32)],
    pub(super) inputs: &'a Inputs,
    /// Set from outside to stop before products are published.
    pub(super) stop: &'a AtomicBool,
}

/// Carries out the description of a flow: run, plan, check, or list of names.
pub(super) trait Driver {
    /// The input files.
    fn files(&self) -> &InputFiles;

    /// Set from outside to stop.
    fn stop(&self) -> &AtomicBool;

    /// Called before the stage with this name.
    fn enter(&mut self, stage: &'static str) -> Flow<()>;

    /// The output of a stage, or a pending one.
    fn stage<S: Stage>(&mut self, stage: &S) -> Flow<Output<S::Output>>;

    /// The stored output of one of many parts that [`Driver::work`] makes together; `None` if it has to be made.
    ///
    /// * `label` – in plans, with the name of the stage
    /// * `stored_as` – in the folder of stored outputs
    fn part<T: Serialize + DeserializeOwned>(
        &mut self,
        _label: String,
        _stored_as: &str,
        _inputs: &Inputs,
    ) -> Flow<Option<Output<T>>> {
        Ok(None)
    }

    /// Makes parts of a stage, each of which is stored when it is complete; `None` where no stage runs.
    fn work<T>(
        &mut self,
        _stage: &'static str,
        _work: impl FnOnce(&StageCache, &InputFiles, Watch<'_>) -> Result<T>,
    ) -> Flow<Option<T>> {
        Ok(None)
    }

    /// Records inputs that the products leave out.
    fn leave_out(&mut self, _failures: Vec<Error>) {}

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

    /// Result of a step between stages, which may read files; `None` if it failed and the driver continues, or if the
    /// driver reads nothing.
    fn attempt<T>(
        &mut self,
        stage: &str,
        step: impl FnOnce(&InputFiles) -> Result<T>,
    ) -> Flow<Option<T>> {
        Ok(Some(step(self.files()).in_stage(stage)?))
    }

    /// The products.
    fn publish(&mut self, publication: &impl Publication) -> Flow<()>;
}

/// Carries out the description of the flow of a site.
pub(super) trait SiteDriver: Driver {
    /// The images with which profiles may be simultaneous.
    fn usable(&self, images: &[Output<ImageTimes>]) -> Vec<Output<ImageTimes>> {
        images.to_vec()
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
}
