//! Lists the files below folders.

use std::{
    fs::{self, Metadata},
    io,
    os::unix::fs::MetadataExt as _,
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
};

use crate::{
    error::{Result, Stopped},
    files::Identity,
    service::worker::protocol::Listed,
    store::atomic,
};

/// Maximum depth of folders.
const DEPTH_MAX: usize = 32;

/// Lists all regular files below `roots` into a file, and returns their number. Links to files are followed, links to
/// folders are not. Names of unfinished transfers are left out.
///
/// # Errors
/// [`Stopped`]; the list cannot be written. Unreadable entries are part of the list.
pub(super) fn list(roots: &[PathBuf], into: &Path, stop: &AtomicBool) -> Result<u64> {
    let mut list = List {
        bytes: Vec::new(),
        files: 0,
        stop,
    };
    let mut files = 0;
    for root in roots {
        list.files = 0;
        let (device, problem) = match list.root(root)? {
            Ok(found) => (Some(found.dev()), None),
            Err(error) => (None, Some(error.to_string())),
        };
        list.add(&Listed::Root {
            path: root.clone(),
            device,
            files: list.files,
            problem,
        });
        files += list.files;
    }
    atomic::write(into, &list.bytes)?;
    Ok(files)
}

struct List<'a> {
    bytes: Vec<u8>,
    files: u64,
    stop: &'a AtomicBool,
}

impl List<'_> {
    fn add(&mut self, listed: &Listed) {
        // Paths that are not UTF-8 cannot be named in site files or to CSPICE either.
        if serde_json::to_writer(&mut self.bytes, listed).is_ok() {
            self.bytes.push(b'\n');
        }
    }

    fn root(&mut self, root: &Path) -> Result<io::Result<Metadata>> {
        let found = match root.metadata() {
            Ok(found) => found,
            Err(error) => return Ok(Err(error)),
        };
        Ok(self.folder(root, 0)?.map(|()| found))
    }

    fn folder(&mut self, folder: &Path, depth: usize) -> Result<io::Result<()>> {
        Stopped::check(self.stop)?;
        let entries = fs::read_dir(folder).and_then(Iterator::collect::<io::Result<Vec<_>>>);
        let mut paths: Vec<PathBuf> = match entries {
            Ok(entries) => entries.into_iter().map(|entry| entry.path()).collect(),
            Err(error) => return Ok(Err(error)),
        };
        paths.sort();
        for path in paths.into_iter().filter(|path| !is_under_way(path)) {
            self.entry(path, depth)?;
        }
        Ok(Ok(()))
    }

    fn entry(&mut self, path: PathBuf, depth: usize) -> Result<()> {
        let problem = match path.symlink_metadata() {
            Ok(found) if found.is_dir() && depth < DEPTH_MAX => self
                .folder(&path, depth + 1)?
                .err()
                .map(|error| error.to_string()),
            Ok(found) if found.is_dir() => Some(format!("more than {DEPTH_MAX} folders deep")),
            // A link counts as its target.
            Ok(_) => match path.metadata() {
                Ok(found) if found.is_file() => {
                    let identity = Identity::of(&found);
                    self.files += 1;
                    self.add(&Listed::File { path, identity });
                    return Ok(());
                }
                Ok(_) => None,
                Err(error) => Some(error.to_string()),
            },
            // It was removed after its folder was read.
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            Err(error) => Some(error.to_string()),
        };
        if let Some(problem) = problem {
            self.add(&Listed::Unreadable { path, problem });
        }
        Ok(())
    }
}

/// Whether the name is a temporary one under which programs copy files.
fn is_under_way(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().as_encoded_bytes();
    let ends = [&b".part"[..], b".tmp", b".partial"];
    name.starts_with(b".") || ends.iter().any(|end| name.ends_with(end))
}
