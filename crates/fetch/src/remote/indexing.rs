//! Building the stand-ins of an archive: every file is streamed once.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
    thread,
};

use super::{
    error::{RemoteError, advised},
    link::is_pedr,
    list::{Files, listed, of_text},
    place::{ARCHIVE_FILE, describe},
    range::require_ranges,
};
use crate::{
    archives::Archives,
    client::{Ask, Client, Reply},
    folder::Folder,
    part::{Meta, Part},
    transfer::{Receiver, Wanted},
};
use areograph_base::{
    error::{Error, IoError, Kind, Locate as _, Result},
    watch::Watch,
};
use areograph_pds::archive::stand_in;
use areograph_store::{
    atomic,
    files::{
        require_own,
        stand_in::{STAND_IN_MARK, StandIn},
    },
};

/// An archive on a server, and the folder of its stand-ins.
#[derive(Debug)]
pub struct Indexing<'a> {
    /// Address of the archive, which ends in a slash; in the table `pedr`.
    pub archives: Archives,
    /// Whether contact and limits of `archives` replace those that the folder states.
    pub replace: bool,
    /// The folder.
    pub into: &'a Path,
    /// A list of the files; without it, listings of the server name them.
    pub list: Option<&'a Path>,
    /// Whether every file is streamed, even if the server states that it is unchanged.
    pub verify: bool,
}

/// Outcome of an indexing.
#[derive(Debug, Default)]
pub struct Indexed {
    /// Stand-ins.
    pub files: usize,
    /// Bytes of the files for which they stand.
    pub bytes: u64,
    /// Bytes of the stand-ins.
    pub stand_in_bytes: u64,
    /// Files that were streamed.
    pub read: usize,
    /// Stand-ins of files that the archive no longer has.
    pub removed: usize,
    /// Files that could not be indexed.
    pub failures: Vec<Error>,
}

impl Indexing<'_> {
    /// Makes or updates the stand-ins; complete ones of an interrupted call are kept.
    ///
    /// # Errors
    /// The archive cannot be listed, the folder cannot be written, or another process fills it; failures of files are in
    /// the outcome.
    pub fn run(mut self, watch: Watch<'_>) -> Result<Indexed> {
        self.keep_settings()?;
        let client = Client::of(&self.archives);
        let receiver = Receiver {
            client: &client,
            network: &self.archives.network,
            stop: watch.stop(),
        };
        let url = &self.archives.pedr.url;
        let files = match self.list {
            None => listed(&receiver, url)?,
            Some(path) => {
                let text = fs::read_to_string(path).map_err(IoError::on("read"));
                Files {
                    readable: of_text(&text.in_file(path)?, url).in_file(path)?,
                    ..Files::default()
                }
            }
        };
        let (expected, files, compressed) = (files.expected(), files.readable, files.compressed);
        if let Some(first) = files.first() {
            require_ranges(&receiver, &format!("{url}{first}"))?;
        }
        let folder = Folder::at(self.into)?;
        let _lock = folder.lock()?;
        describe(self.into, &self.archives)?;
        self.reserve(&expected)?;
        watch.announce(files.len());
        let queue: Mutex<Vec<&String>> = Mutex::new(files.iter().rev().collect());
        let outcome = Mutex::new(Indexed::default());
        let connections = self.archives.network.connections_per_host as usize;
        thread::scope(|scope| {
            for _ in 0..connections.min(files.len()) {
                scope.spawn(|| {
                    while let Some(file) = next(&queue) {
                        let made = self.one(file, &receiver, &folder);
                        if made.as_ref().err().is_some_and(ends_all) {
                            locked(&queue).clear();
                        }
                        locked(&outcome).add(made);
                        watch.step(1, "files");
                    }
                });
            }
        });
        watch.check()?;
        let mut outcome = outcome.into_inner().unwrap_or_else(PoisonError::into_inner);
        outcome.removed = self.remove_others(&expected)?;
        let compressed = compressed.iter().map(|path| RemoteError::Compressed {
            url: format!("{url}{path}"),
        });
        outcome.failures.extend(compressed.map(Error::from));
        let in_order = |failure: &Error| failure.file.clone();
        outcome.failures.sort_by_key(in_order);
        Ok(outcome)
    }

    /// Contact and limits that the folder states, unless others are given. A folder belongs to one archive.
    fn keep_settings(&mut self) -> Result<()> {
        let path = self.into.join(ARCHIVE_FILE);
        if !path.is_file() {
            return Ok(());
        }
        let known = Archives::with(&path)?;
        let (found, expected) = (known.pedr.url, self.archives.pedr.url.clone());
        if found.trim_end_matches('/') != expected.trim_end_matches('/') {
            return Err(RemoteError::OtherArchive { found, expected }).in_file(path);
        }
        if self.replace {
            return Ok(());
        }
        self.archives.contact = known.contact;
        self.archives.network = known.network;
        Ok(())
    }

    /// Takes the place of every file without a stand-in before the first file is read: an index that ends early, or lacks a
    /// file that cannot be read, is no complete archive.
    fn reserve(&self, files: &BTreeSet<String>) -> Result<()> {
        let mut folders = BTreeSet::new();
        for path in files.iter().map(|file| self.into.join(file)) {
            // A file of the user is reported when its turn comes.
            if path.symlink_metadata().is_ok() {
                continue;
            }
            let folder = path.parent().unwrap_or(Path::new("."));
            fs::create_dir_all(folder)
                .map_err(IoError::on("create the folder"))
                .in_file(folder)?;
            atomic::replace_unflushed(&path, &StandIn::pending(), STAND_IN_MARK)?;
            folders.insert(folder.to_owned());
        }
        for folder in &folders {
            atomic::sync_folder(folder);
        }
        Ok(())
    }

    /// Makes one stand-in; whether the file was streamed.
    fn one(&self, file: &str, receiver: &Receiver<'_>, folder: &Folder) -> Result<(bool, StandIn)> {
        let path = self.into.join(file);
        let url = format!("{}{file}", self.archives.pedr.url);
        require_own(&path, &STAND_IN_MARK)?;
        if let Some(known) = self.known(&path, &url, receiver) {
            return Ok((false, known));
        }
        let mut part = Part::at(folder.part(&url, &path), &url);
        let wanted = Wanted {
            url: &url,
            path: &path,
            md5: None,
            bytes: None,
            is_page: false,
            replace: true,
        };
        let received = receiver.receive(&wanted, &mut part);
        received.map_err(advised).in_file(&path)?;
        let stated = [part.meta.etag.clone(), part.meta.last_modified.clone()];
        let made = stand_in(part.path(), &path, stated, receiver.stop);
        let made = match made {
            // A file that cannot be indexed is received again by the next call.
            Err(failure) if failure.kind() != Kind::Interrupted => {
                part.discard()?;
                return Err(failure);
            }
            made => made?,
        };
        // The encoding of numbers and texts does not fail.
        let bytes = made.encode().unwrap_or_default();
        atomic::replace(&path, &bytes, STAND_IN_MARK)?;
        part.discard()?;
        Ok((true, made))
    }

    /// The stand-in of a file that the server states to be unchanged.
    fn known(&self, path: &Path, url: &str, receiver: &Receiver<'_>) -> Option<StandIn> {
        let known = readable(path).filter(|_| !self.verify)?;
        let [etag, last_modified] = known.stated().map(|text| text.map(str::to_owned));
        let meta = Meta {
            url: url.to_owned(),
            etag,
            last_modified,
            length: Some(known.bytes()),
            ..Meta::default()
        };
        meta.validator()?;
        let ask = Ask {
            known: Some(&meta),
            ..Ask::default()
        };
        let is_same = match receiver.client.get(url, ask) {
            Ok(Reply::Unchanged) => true,
            Ok(Reply::Body(answer)) => {
                let now = &answer.meta;
                now.length == meta.length
                    && now.validator() == meta.validator()
                    && now.last_modified == meta.last_modified
            }
            // Receiving the file states the reason.
            Ok(Reply::OtherFile) | Err(_) => false,
        };
        is_same.then_some(known)
    }

    /// Removes the stand-ins of files that the archive no longer has. A list may name a part of the archive, and
    /// removes nothing.
    fn remove_others(&self, files: &BTreeSet<String>) -> Result<usize> {
        if self.list.is_some() {
            return Ok(0);
        }
        let still: BTreeSet<PathBuf> = files.iter().map(|file| self.into.join(file)).collect();
        let mut folders = vec![self.into.to_owned()];
        let mut removed = 0;
        while let Some(folder) = folders.pop() {
            let listed = fs::read_dir(&folder).map_err(IoError::on("list"));
            for entry in listed.in_file(&folder)? {
                let entry = entry.map_err(IoError::on("list")).in_file(&folder)?;
                let (path, kind) = (entry.path(), entry.file_type());
                let kind = kind.map_err(IoError::on("look at")).in_file(&path)?;
                // Links lead elsewhere, and a folder with a description of its own is another archive.
                if kind.is_dir() && !path.join(ARCHIVE_FILE).exists() {
                    folders.push(path);
                } else if kind.is_file()
                    && is_pedr(&path.to_string_lossy())
                    && !still.contains(&path)
                    && StandIn::is_at(&path)
                {
                    fs::remove_file(&path)
                        .map_err(IoError::on("remove"))
                        .in_file(&path)?;
                    removed += 1;
                }
            }
        }
        Ok(removed)
    }
}

impl Indexed {
    fn add(&mut self, made: Result<(bool, StandIn)>) {
        match made {
            Ok((is_read, made)) => {
                self.files += 1;
                self.bytes += made.bytes();
                self.stand_in_bytes += made.encode().map_or(0, |bytes| bytes.len() as u64);
                self.read += usize::from(is_read);
            }
            Err(failure) => self.failures.push(failure),
        }
    }
}

/// The stand-in at a path, if it can be used.
fn readable(path: &Path) -> Option<StandIn> {
    let file = fs::File::open(path).ok()?;
    StandIn::of_open(&file).ok().flatten()
}

/// Whether the other files would fail for the same reason.
fn ends_all(failure: &Error) -> bool {
    let cause: &dyn std::error::Error = &*failure.cause;
    failure.kind() == Kind::Interrupted
        || matches!(cause.downcast_ref(), Some(RemoteError::Unreachable { .. }))
}

fn next<'a>(queue: &Mutex<Vec<&'a String>>) -> Option<&'a String> {
    locked(queue).pop()
}

fn locked<T>(of: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}
