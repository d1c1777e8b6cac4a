//! An archive of PEDR files from its folder to its products: every shot against the kernels.
//!
//! ```text
//!  list files ─► per file, unless its result is stored:  load ─► check ─► store        here, or in other processes
//!                                    one thread, with CSPICE      all threads
//!  results in order of time, every shot once ─► shots of the worst profiles ─► verdict ─► products, manifest last
//! ```
//!
//! At most two loads, a wave of tasks and one or two profiles are in memory, regardless of the size of the archive.
//! One thread reads a load of records and tabulates the trajectory over it, the only part that calls CSPICE;
//! meanwhile all threads check the preceding load.
//!
//! The result of a file is stored with the identity of the file, the hashes of the kernels and the rules, once the
//! kernels are confirmed unchanged. The BLAKE3 of a file is computed from the checked bytes. `archive/gather.rs` counts
//! every shot once: copies are recognised by hash, and files whose profiles overlap in time are a failure. Products,
//! journal and manifest are handled as for a net.

mod checker;
mod checking;
mod gather;
mod loader;
mod manifest;
mod task;

use std::{
    cell::RefCell,
    collections::BTreeMap,
    path::{Path, PathBuf},
};

pub use self::task::{ArchiveFile, ArchiveTask, ArchiveWorkers};
use self::{
    checker::Results,
    gather::{Gathered, file_failure, gather},
    manifest::manifest,
};
use super::driver::{Driver, Flow, Ledger, MadeFrom, Publication};
use crate::{
    altimetry::{MolaClock, ShotFilter},
    config::RangeCheckConfig,
    error::{Cause, Error, Kind, Result, Stopped},
    files::{Identity, file_name},
    pds::{archive::Listing, pedr::RULES},
    products::{
        ArchiveProducts, Product, WorstProfile, write_archive_products, write_profile_shots,
    },
    report::archive_page,
    spice::{KernelSet, KernelView},
    stage::{Input as _, Inputs},
    stages::{
        check_archive::{
            self, ArchiveProfile, ArchiveRanges, ArchiveRules, ArchiveSource, CALLS, CheckedFile,
            FileRanges, KernelUsed, METHOD, TRAJECTORY_TOLERANCE_M, shots_of,
        },
        judge::Verdict,
    },
    store::{
        manifest::Manifest,
        publish::{entries, publish, read_manifest, staging},
    },
    time::Et,
    units::RADIANS_PER_DEGREE,
};

/// Stands for the name of a site in messages and in the manifest.
pub(super) const NAME: &str = "archive";
/// The only stage.
pub(super) const STAGE: &str = check_archive::NAME;
/// Raised when the layout of the products changes.
const LAYOUT: u32 = 8;
/// Profiles whose shots are written.
const WORST: usize = 12;
/// Step of the scan of clock biases, seconds: the parabola through the variances interpolates between steps.
const SCAN_STEP_S: f64 = 0.05;

/// The archive to check.
#[derive(Debug)]
pub struct ArchiveRequest<'a> {
    /// Folders of PEDR files, and single files.
    pub paths: &'a [PathBuf],
    /// The metakernel.
    pub kernels: &'a Path,
    /// The clock of MOLA.
    pub clock: MolaClock,
    /// Whether shots without a position in the kernels leave the archive valid.
    pub allow_uncovered: bool,
    /// Other processes that check files before this one checks the rest.
    pub workers: Option<&'a dyn ArchiveWorkers>,
}

/// No file to check.
#[derive(Debug, thiserror::Error, Cause)]
#[error("no PEDR file (*.b) to check")]
#[cause(Input: "name the folder of the PEDR files, or files (AP#####v.B)")]
struct NoFiles;

/// The limits of a check, as in a site file, with a coarser scan.
#[must_use]
pub fn archive_limits() -> RangeCheckConfig {
    RangeCheckConfig {
        scan_step_s: SCAN_STEP_S,
        ..RangeCheckConfig::default()
    }
}

/// The shots that are checked: those that a site file keeps by default.
#[must_use]
pub fn archive_filter() -> ShotFilter {
    ShotFilter {
        classes: vec![1],
        channels: vec![1, 2, 3, 4],
        attitude_flags: vec![0, 1],
        off_nadir_max_rad: 90.0 * RADIANS_PER_DEGREE,
        solar_longitude_rad: ShotFilter::ALL_SEASONS,
    }
}

/// Checks every file and publishes the products. The result of a file is stored once it is complete.
pub(super) fn archive<D: Driver>(flow: &mut D, request: &ArchiveRequest<'_>) -> Flow<()> {
    flow.enter(STAGE)?;
    let kernels = KernelSet::from_metakernel_of(flow.files(), request.kernels)?;
    let archive = Archive::of(request, &kernels)?;
    let checked = archive.check_all(flow)?;
    let publication = ArchivePublication {
        archive: &archive,
        checked: RefCell::new(checked),
    };
    let published = flow.publish(&publication);
    if let Some((_, failures)) = publication.checked.into_inner() {
        flow.leave_out(failures);
    }
    published
}

/// A check under way.
struct Archive<'a> {
    request: &'a ArchiveRequest<'a>,
    limits: RangeCheckConfig,
    filter: ShotFilter,
    view: KernelView,
}

/// The files of an archive.
struct Files<'a> {
    paths: &'a [PathBuf],
    sources: &'a BTreeMap<usize, Identity>,
    /// Those without a stored result: under which name it is stored, and its inputs.
    todo: &'a BTreeMap<usize, (String, Inputs)>,
}

/// The results, and the failures of files that have none.
type Checked = (ArchiveRanges, Vec<Error>);

/// The products of an archive.
struct ArchivePublication<'a> {
    archive: &'a Archive<'a>,
    /// `None` while a file is still to be checked. Publishing adds failures of files that can no longer be read.
    checked: RefCell<Option<Checked>>,
}

impl Publication for ArchivePublication<'_> {
    fn inputs(&self, _folder: &Path, _ledger: &Ledger) -> Inputs {
        if let Some((ranges, _)) = &*self.checked.borrow() {
            return self.archive.publish_inputs(ranges);
        }
        let mut inputs = self.archive.inputs();
        inputs.setting("(layout)", &LAYOUT);
        // The other inputs of products are results.
        let name = format!("output of {STAGE}");
        for prefix in ["files", "copies", "failures", "allow_uncovered"] {
            inputs.not_known_yet(&name, &format!("key {prefix}"));
        }
        inputs
    }

    fn verdict(&self) -> Result<Verdict> {
        let checked = self.checked.borrow();
        let (ranges, _) = checked.as_ref().ok_or(NotChecked)?;
        Ok(ranges.verdict())
    }

    fn publish(&self, from: &MadeFrom<'_>) -> Result<Manifest> {
        let mut checked = self.checked.borrow_mut();
        let (ranges, failures) = checked.as_mut().ok_or(NotChecked)?;
        self.archive.publish(from, ranges, failures)
    }
}

/// Products were requested before the files were checked.
#[derive(Debug, thiserror::Error, Cause)]
#[error("the products of an archive were requested before its files were checked")]
#[cause(Bug: "this is a bug in areograph; please report it with the command")]
struct NotChecked;

impl<'a> Archive<'a> {
    fn of(request: &'a ArchiveRequest<'a>, kernels: &KernelSet) -> Result<Self> {
        Ok(Self {
            request,
            limits: archive_limits(),
            filter: archive_filter(),
            view: KernelView::positions(Some(kernels))?,
        })
    }

    const fn rules(&self) -> ArchiveRules<'_> {
        ArchiveRules {
            clock: &self.request.clock,
            limits: &self.limits,
            filter: &self.filter,
        }
    }

    /// The inputs of every result.
    fn inputs(&self) -> Inputs {
        let mut inputs = Inputs::new(METHOD);
        inputs.calls(CALLS);
        (&self.view).add_to("kernels", &mut inputs);
        inputs.setting("mola_clock", &self.request.clock);
        inputs.setting("range_check", &self.limits);
        inputs.setting("filter", &self.filter);
        inputs.setting("pedr_rules", &RULES);
        inputs.setting("trajectory_tolerance_m", &TRAJECTORY_TOLERANCE_M);
        inputs
    }

    /// The results of all files; `None` where files are still to be checked and nothing runs.
    fn check_all<D: Driver>(&self, flow: &mut D) -> Flow<Option<Checked>> {
        let Listing { paths, failures } = Listing::of(self.request.paths);
        if paths.is_empty() {
            let first = failures.into_iter().next();
            return Err(first.unwrap_or_else(|| NoFiles.into()).into());
        }
        let mut sources = BTreeMap::new();
        let mut results = Results::new();
        for (file, path) in paths.iter().enumerate() {
            flow.enter(STAGE)?;
            match ArchiveSource::open(path) {
                Ok(source) => drop(sources.insert(file, source.identity())),
                Err(failure) => drop(results.insert(file, Err(failure))),
            }
        }
        let mut todo = BTreeMap::new();
        for (file, identity) in &sources {
            let (stored_as, inputs) = self.stored_as(&paths[*file], identity);
            let label = format!("{STAGE}/{}", file_name(&paths[*file]));
            match flow.part::<FileRanges>(label, &stored_as, &inputs)? {
                Some(known) => drop(results.insert(*file, Ok(known.value()?.clone()))),
                None => drop(todo.insert(*file, (stored_as, inputs))),
            }
        }
        if !todo.is_empty() {
            let checked = flow.work(STAGE, |cache, kernels, watch| {
                let files = Files {
                    paths: &paths,
                    sources: &sources,
                    todo: &todo,
                };
                self.check_todo(&files, kernels, cache, watch)
            })?;
            match checked {
                Some(checked) => results.extend(checked),
                None => return Ok(None),
            }
        }
        Ok(Some(
            self.ranges(gather(&paths, &sources, results, failures)),
        ))
    }

    /// Name under which the result of a file is stored, and its inputs.
    fn stored_as(&self, path: &Path, identity: &Identity) -> (String, Inputs) {
        let place = blake3::hash(path.as_os_str().as_encoded_bytes()).to_hex();
        let mut inputs = self.inputs();
        inputs.setting("file", &file_name(path));
        // Computers number the device of a shared file system differently.
        let everywhere = Identity {
            device: 0,
            ..*identity
        };
        inputs.setting("identity", &everywhere);
        (format!("{STAGE}/{}", &place[..32]), inputs)
    }

    /// The results, and the failures of the other files.
    fn ranges(&self, gathered: Gathered) -> (ArchiveRanges, Vec<Error>) {
        let kernels = self.view.kernels().into_iter().flat_map(KernelSet::kernels);
        let ranges = ArchiveRanges {
            files: gathered.files,
            copies: gathered.copies,
            failures: gathered.failures.iter().map(file_failure).collect(),
            allow_uncovered: self.request.allow_uncovered,
            clock: self.request.clock.clone(),
            limits: self.limits.clone(),
            filter: self.filter.clone(),
            kernels: kernels
                .map(|kernel| KernelUsed {
                    name: kernel.file_name(),
                    role: kernel.role.to_string(),
                    bytes: kernel.bytes,
                    blake3: kernel.blake3.clone(),
                })
                .collect(),
        };
        (ranges, gathered.failures)
    }

    fn publish_inputs(&self, ranges: &ArchiveRanges) -> Inputs {
        let mut inputs = self.inputs();
        inputs.setting("(layout)", &LAYOUT);
        let files: Vec<_> = ranges
            .files
            .iter()
            .map(|file| (file.path.to_string_lossy(), &file.found.blake3))
            .collect();
        inputs.setting("files", &files);
        inputs.setting("copies", &ranges.copies);
        inputs.setting("failures", &ranges.failures);
        inputs.setting("allow_uncovered", &ranges.allow_uncovered);
        inputs
    }

    /// Publishes, and adds the failures of files that could not be read again for it.
    fn publish(
        &self,
        from: &MadeFrom<'_>,
        ranges: &mut ArchiveRanges,
        failures: &mut Vec<Error>,
    ) -> Result<Manifest> {
        let folder = from.folder;
        let staging = staging(folder)?;
        let (mut written, mut shots) = (Vec::new(), Vec::new());
        for (file, profile) in ranges.worst(WORST) {
            Stopped::check(from.stop)?;
            match self.shots_of(file, profile, &staging)? {
                Ok(product) => {
                    shots.push(Some(product.path.to_string_lossy().into_owned()));
                    written.push(product);
                }
                Err(failure) => {
                    shots.push(None);
                    failures.push(failure);
                }
            }
        }
        let lost = shots.iter().filter(|shots| shots.is_none()).count();
        let lost = &failures[failures.len() - lost..];
        ranges.failures.extend(lost.iter().map(file_failure));
        let ranges = &*ranges;
        let worst = ranges.worst(WORST).into_iter().zip(shots);
        let worst: Vec<WorstProfile<'_>> = worst
            .map(|((file, profile), shots)| {
                let start = Et::from_seconds(profile.start_et_s);
                let session = self.view.session()?;
                Ok(WorstProfile {
                    file,
                    profile,
                    shots,
                    // Without leap seconds there is no UTC, and it is not required.
                    start_utc: session.et_to_utc(start).ok(),
                })
            })
            .collect::<Result<_>>()?;
        let verdict = ranges.verdict();
        let page = archive_page(ranges, &worst, &verdict)?;
        let products = ArchiveProducts {
            ranges,
            verdict: &verdict,
            page: &page,
        };
        written.extend(write_archive_products(&staging, &products)?);
        let files: Vec<(PathBuf, u64)> = written
            .into_iter()
            .map(|product| (product.path, product.rows))
            .collect();
        let inputs = self.publish_inputs(ranges);
        let manifest = Manifest {
            products: entries(&staging, &files)?,
            ..manifest(ranges, &inputs)
        };
        publish(folder, &staging, &manifest)?;
        Ok(read_manifest(folder).unwrap_or(manifest))
    }

    /// Writes the shots of a profile, or returns the reason why its file no longer provides them.
    fn shots_of(
        &self,
        file: &CheckedFile,
        profile: &ArchiveProfile,
        staging: &Path,
    ) -> Result<Result<Product>> {
        let (session, rules) = (self.view.session()?, self.rules());
        match shots_of(&file.path, &file.identity, profile, session, &rules) {
            Ok(shots) => write_profile_shots(staging, file, profile, &shots).map(Ok),
            Err(failure) if failure.kind() == Kind::Bug => Err(failure),
            Err(failure) => Ok(Err(failure)),
        }
    }
}
