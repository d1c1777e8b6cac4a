//! An archive of PEDR files from its folder to its products: every shot against the kernels.
//!
//! ```text
//!  list files ─► per file, unless its result is stored:  load ─► check ─► store
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
mod gather;
mod loader;
mod manifest;

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::{atomic::AtomicBool, mpsc::sync_channel},
    thread,
};

pub use self::checker::ArchiveProgress;
use self::{
    checker::{Checker, Results},
    gather::{Gathered, file_failure, gather},
    loader::Loader,
    manifest::manifest,
};
use super::{
    PUBLISH,
    out::check_out_path,
    publish::{keep, standing},
};
use crate::{
    altimetry::{MolaClock, ShotFilter},
    config::RangeCheckConfig,
    error::{Cause, Error, Kind, Locate as _, Result, Stopped},
    files::{Identity, InputFiles, file_name},
    pds::{archive::Listing, pedr::RULES},
    products::{
        ArchiveProducts, Product, WorstProfile, write_archive_products, write_profile_shots,
    },
    report::archive_page,
    spice::{KernelSet, KernelView},
    stage::{Input as _, Inputs},
    stages::check_archive::{
        ArchiveProfile, ArchiveRanges, ArchiveRules, ArchiveSource, CALLS, CheckedFile, FileRanges,
        KernelUsed, METHOD, NAME, TRAJECTORY_TOLERANCE_M, shots_of,
    },
    store::{
        cache::StageCache,
        lock::SiteLock,
        manifest::Manifest,
        publish::{CACHE, entries, publish, read_manifest, staging},
    },
    time::Et,
    units::RADIANS_PER_DEGREE,
};

/// Raised when the layout of the products changes.
const LAYOUT: u32 = 3;
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
    /// Folder of the products.
    pub out: &'a Path,
    /// The clock of MOLA.
    pub clock: MolaClock,
    /// Whether shots without a position in the kernels leave the archive valid.
    pub allow_uncovered: bool,
    /// Check every file again, even if its result is stored.
    pub force: bool,
    /// Checked before every load.
    pub stop: &'a AtomicBool,
}

/// Outcome of a check of an archive.
#[derive(Debug)]
pub struct ArchiveOutcome {
    /// The manifest of the products.
    pub manifest: Manifest,
    /// Whether the products already existed.
    pub unchanged: bool,
    /// Reasons why files could not be checked; all others were.
    pub failures: Vec<Error>,
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

/// Checks every file and publishes the products in the folder `out`.
///
/// The result of a file is stored once it is complete: a check that was interrupted resumes where it stopped.
///
/// # Errors
/// Kernels that cannot be read; write errors; [`Stopped`]. Files that cannot be checked are part of the outcome.
pub fn check_archive(
    request: &ArchiveRequest<'_>,
    progress: &(dyn Fn(&ArchiveProgress) + Sync),
) -> Result<ArchiveOutcome> {
    check_out_path(request.out)?;
    let files = InputFiles::default();
    let kernels = KernelSet::from_metakernel_of(&files, request.kernels)?;
    let view = KernelView::positions(Some(&kernels))?;
    let _lock = SiteLock::take(request.out)?;
    let archive = Archive {
        request,
        limits: archive_limits(),
        filter: archive_filter(),
        view,
        kernels: &files,
        cache: StageCache::new(&request.out.join(CACHE), request.force),
        progress,
    };
    let (mut ranges, mut failures) = archive.check_all().in_stage(NAME)?;
    files.verify_all()?;
    let inputs = archive.publish_inputs(&ranges);
    let known = standing(request.out, &archive.cache, &inputs);
    let (manifest, unchanged) = match known {
        Ok(manifest) => (manifest, true),
        Err(reason) => {
            tracing::info!(stage = PUBLISH, %reason, "running");
            let published = archive.publish(&mut ranges, &mut failures);
            (published.in_stage(PUBLISH)?, false)
        }
    };
    Ok(ArchiveOutcome {
        manifest,
        unchanged,
        failures,
    })
}

/// A check under way.
struct Archive<'a> {
    request: &'a ArchiveRequest<'a>,
    limits: RangeCheckConfig,
    filter: ShotFilter,
    view: KernelView,
    /// The kernels, which must not change.
    kernels: &'a InputFiles,
    cache: StageCache,
    progress: &'a (dyn Fn(&ArchiveProgress) + Sync),
}

impl Archive<'_> {
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

    fn check_all(&self) -> Result<(ArchiveRanges, Vec<Error>)> {
        let Listing { paths, failures } = Listing::of(self.request.paths);
        if paths.is_empty() {
            return Err(failures
                .into_iter()
                .next()
                .unwrap_or_else(|| NoFiles.into()));
        }
        let mut sources = BTreeMap::new();
        let mut results = Results::new();
        for (file, path) in paths.iter().enumerate() {
            Stopped::check(self.request.stop)?;
            match ArchiveSource::open(path) {
                Ok(source) => drop(sources.insert(file, source.identity())),
                Err(failure) => drop(results.insert(file, Err(failure))),
            }
        }
        let mut todo = BTreeMap::new();
        for (file, identity) in &sources {
            let (label, inputs) = self.stored_as(&paths[*file], identity);
            match self.cache.load::<FileRanges>(&label, &inputs) {
                Ok(known) => drop(results.insert(*file, Ok(known.value()?.clone()))),
                Err(_) => drop(todo.insert(*file, (label, inputs))),
            }
        }
        let start = ArchiveProgress {
            files_done: paths.len() - todo.len(),
            files_stored: paths.len() - todo.len(),
            files: paths.len(),
            bytes_left: todo.keys().map(|file| sources[file].bytes).sum(),
            ..ArchiveProgress::default()
        };
        (self.progress)(&start);
        results.extend(self.check_todo(&paths, &sources, &todo, start)?);
        Ok(self.ranges(gather(&paths, &sources, results, failures)))
    }

    /// Name under which the result of a file is stored, and its inputs.
    fn stored_as(&self, path: &Path, identity: &Identity) -> (String, Inputs) {
        let place = blake3::hash(path.as_os_str().as_encoded_bytes()).to_hex();
        let mut inputs = self.inputs();
        inputs.setting("file", &file_name(path));
        inputs.setting("identity", identity);
        (format!("{NAME}/{}", &place[..32]), inputs)
    }

    /// Checks the files without stored results: this thread loads, while another one distributes the checks to all
    /// threads of the pool.
    fn check_todo(
        &self,
        paths: &[PathBuf],
        sources: &BTreeMap<usize, Identity>,
        todo: &BTreeMap<usize, (String, Inputs)>,
        start: ArchiveProgress,
    ) -> Result<Results> {
        if todo.is_empty() {
            return Ok(Results::new());
        }
        let session = self.view.session()?;
        let checker = Checker {
            rules: self.rules(),
            kernels: self.kernels,
            cache: &self.cache,
            todo,
            progress: self.progress,
        };
        thread::scope(|scope| {
            // The channel has no buffer: at most two loads are in memory.
            let (parts, received) = sync_channel(0);
            let worker = scope.spawn(|| checker.run(received, start));
            let loader = Loader {
                rules: self.rules(),
                session,
                stop: self.request.stop,
                parts,
            };
            let files = todo.keys();
            let loaded = loader.run(files.map(|file| (*file, &*paths[*file], &sources[file])));
            let checked = worker.join();
            loaded?;
            checked.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        })
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
    fn publish(&self, ranges: &mut ArchiveRanges, failures: &mut Vec<Error>) -> Result<Manifest> {
        let staging = staging(self.request.out)?;
        let (mut written, mut shots) = (Vec::new(), Vec::new());
        for (file, profile) in ranges.worst(WORST) {
            Stopped::check(self.request.stop)?;
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
        publish(self.request.out, &staging, &manifest)?;
        let manifest = read_manifest(self.request.out).unwrap_or(manifest);
        keep(&self.cache, inputs, &manifest)?;
        Ok(manifest)
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
