//! `areograph pedr index`.

mod remote;

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
};

use clap::Args;
use serde_json::json;

use crate::{
    cli::{output, progress::Progress},
    error::{Cause, Error, IoError, Locate as _},
    files::{Identity, hash_file, require_own, short_hash, stand_in::StandIn},
    pds::archive::{INDEX, INDEX_MARK, Index, IndexedFile, Listing},
    store::atomic,
};

/// Creates or updates the index of the PEDR files in and below a folder, or of an archive on a server; only new and
/// changed files are read.
///
/// `run` and `pedr search` use the index automatically. Their results do not depend on it, even if it is out of date. The
/// index of a folder is the file areograph-pedr.index in it. If the command is killed, the index remains unchanged.
///
/// Of an archive on a server (https://) or in an object store (s3://), every file is streamed once, and a stand-in of
/// each is written below the folder of --into: a few kilobytes with the place of its shots and the hashes of its blocks.
/// All commands accept stand-ins in place of PEDR files, and read the blocks that they need from the server.
/// An interrupted command continues with the first incomplete file.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  areograph pedr index /data/mola
  areograph pedr index https://archive.example.org/pedr/data/ --into mola")]
pub(super) struct Arguments {
    /// Folder of the archive, or its address.
    #[arg(value_name = "FOLDER|URL")]
    folder: PathBuf,
    /// Folder for the stand-ins of an archive on a server.
    #[arg(long, value_name = "DIR")]
    into: Option<PathBuf>,
    /// List of the files of an archive on a server: a path below its address, or an address, in each line; by default,
    /// listings of the server.
    #[arg(long, value_name = "FILE", requires = "into")]
    list: Option<PathBuf>,
    /// File with contact and limits of transfers, in the form of config/archives/mgs.toml.
    #[arg(long, value_name = "FILE", requires = "into")]
    archives: Option<PathBuf>,
    /// Read every file again, and list the files whose content differs from the index.
    #[arg(long)]
    verify: bool,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// A folder without a PEDR file.
#[derive(Debug, thiserror::Error, Cause)]
#[error("the folder contains no PEDR file (*.b)")]
#[cause(Input: "name the folder of the archive")]
struct NoFiles;

/// A file that changed without a trace in the file system.
#[derive(Debug, thiserror::Error, Cause)]
#[error(
    "the content differs from the index, although size and times match: hash was {was}, is {is}"
)]
#[cause(Input: "fetch the file again: the disk may be failing; the index now describes the present content")]
struct Altered {
    was: String,
    is: String,
}

/// The index could not be encoded.
#[derive(Debug, thiserror::Error, Cause)]
#[error("the index cannot be encoded")]
#[cause(Bug: "this is a bug in areograph; please report it")]
struct NotEncoded;

/// Indexing cannot be interrupted gracefully; killing it is harmless.
static RUN_ON: AtomicBool = AtomicBool::new(false);

/// Outcome for the files.
#[derive(Default)]
struct Outcome {
    files: Vec<IndexedFile>,
    bytes: u64,
    read: usize,
    failures: Vec<Error>,
}

/// An address without a folder, or the other way round.
#[derive(Debug, thiserror::Error, Cause)]
#[error("{0}")]
#[cause(Configuration: "write `areograph pedr index FOLDER`, or `areograph pedr index URL --into FOLDER`")]
struct Usage(&'static str);

/// A folder of stand-ins alone.
#[derive(Debug, thiserror::Error, Cause)]
#[error(
    "the folder contains only stand-ins of files on a server, which carry their index; expected PEDR files"
)]
#[cause(Configuration: "to update stand-ins, give the address of the archive (see areograph-archive.toml in the folder) and --into")]
struct OnlyStandIns;

pub(super) fn run(arguments: &Arguments) -> Result<(), Error> {
    let address = arguments.folder.to_str();
    let address = address.filter(|address| address.contains("://"));
    match (address, &arguments.into) {
        (Some(url), Some(into)) => return remote::run(url, into, arguments),
        (Some(_), None) => {
            return Err(Usage("an address without a folder for the stand-ins").into());
        }
        (None, Some(_)) => {
            return Err(
                Usage("--into without the address of an archive (https://… or s3://…)").into(),
            );
        }
        (None, None) => {}
    }
    // Nothing is created for a mistyped path.
    fs::read_dir(&arguments.folder)
        .map_err(IoError::on("list"))
        .in_file(&arguments.folder)?;
    let path = arguments.folder.join(INDEX);
    require_own(&path, &INDEX_MARK)?;
    let earlier = Index::read(&path).unwrap_or_default();
    let mut listing = Listing::below(&arguments.folder);
    let unseen = unseen(&earlier, &arguments.folder, &listing.failures);
    let files = listing.paths.len();
    listing.paths.retain(|path| !StandIn::is_at(path));
    if listing.paths.is_empty() && files > 0 {
        return Err(OnlyStandIns).in_file(&arguments.folder);
    }
    if listing.paths.is_empty() && earlier.files().next().is_none() {
        let failure = listing.failures.pop();
        return Err(failure.unwrap_or_else(|| Error::from(NoFiles).in_file(&arguments.folder)));
    }
    let mut outcome = Outcome {
        failures: listing.failures,
        ..Outcome::default()
    };
    Progress::of_work("pedr index").watch("reading", |watch| {
        watch.announce(listing.paths.len());
        for file in &listing.paths {
            if let Err(failure) = outcome.add(arguments, &earlier, file) {
                outcome.failures.push(failure);
            }
            watch.step(1, "files");
        }
    });
    let unseen_paths = unseen.iter().map(|file| arguments.folder.join(file.path()));
    let still: BTreeSet<PathBuf> = listing.paths.iter().cloned().chain(unseen_paths).collect();
    let gone = earlier
        .files()
        .filter(|file| !still.contains(&arguments.folder.join(file.path())));
    let gone = gone.count();
    let (files, read, bytes) = (outcome.files.len(), outcome.read, outcome.bytes);
    let index: Index = unseen.into_iter().chain(outcome.files).collect();
    let encoded = index.encode().ok_or(NotEncoded).in_file(&path)?;
    atomic::replace(&path, &encoded, INDEX_MARK)?;
    if arguments.json {
        output::json(&json!({
            "index": path,
            "bytes": encoded.len(),
            "files": files,
            "bytes_of_files": bytes,
            "read": read,
            "removed": gone,
        }));
    } else {
        output::line(format_args!(
            "{}: {files} files of {bytes} bytes, {read} of them read now, {gone} removed; index of {} bytes",
            path.display(),
            encoded.len()
        ));
    }
    let mut failures = outcome.failures.into_iter();
    let Some(first) = failures.next() else {
        return Ok(());
    };
    failures.for_each(output::error);
    Err(first)
}

/// Entries of files below folders that cannot be listed, such as an unmounted one; they are used again once it is
/// mounted.
fn unseen(earlier: &Index, folder: &Path, failures: &[Error]) -> Vec<IndexedFile> {
    let closed: Vec<&PathBuf> = failures
        .iter()
        .filter_map(|failure| failure.file.as_ref())
        .collect();
    let is_unseen = |file: &&IndexedFile| {
        let path = folder.join(file.path());
        closed.iter().any(|closed| path.starts_with(closed))
    };
    earlier.files().filter(is_unseen).cloned().collect()
}

impl Outcome {
    /// Reuses the entry of a file, or reads the file.
    fn add(&mut self, arguments: &Arguments, earlier: &Index, path: &Path) -> Result<(), Error> {
        let below = path.strip_prefix(&arguments.folder).unwrap_or(path);
        let metadata = fs::metadata(path)
            .map_err(IoError::on("open"))
            .in_file(path)?;
        let identity = Identity::of(&metadata);
        self.bytes += identity.bytes;
        if let Some(known) = earlier.find(below, &identity) {
            let altered = if arguments.verify {
                altered(path, &known)?
            } else {
                None
            };
            let Some(altered) = altered else {
                self.files.push(IndexedFile::clone(&known));
                return Ok(());
            };
            self.failures.push(Error::from(altered).in_file(path));
        }
        self.read += 1;
        self.files.push(IndexedFile::of(path, below, &RUN_ON)?);
        Ok(())
    }
}

/// Difference of the file from the indexed one.
fn altered(path: &Path, known: &IndexedFile) -> Result<Option<Altered>, Error> {
    let (is, _) = hash_file(path)?;
    let was = known.blake3();
    Ok((is != was).then(|| Altered {
        was: short_hash(&was),
        is: short_hash(&is),
    }))
}
