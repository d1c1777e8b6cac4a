//! Bytes of files on servers: from this computer, or with few requests from the server.

use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    ops::Range,
    path::{Path, PathBuf},
    sync::{
        Arc, Condvar, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use super::{
    blocks::{Blocks, is_block},
    error::RemoteError,
    place::Place,
    range::{Wanted, receive},
};
use crate::{filling::host_of, transfer::Receiver};
use areograph_base::error::{Error, Locate as _, Result};
use areograph_store::files::stand_in::{Elsewhere, Part, StandIn, block_hash};

/// Longest request, bytes: a longer part is divided, so that an interrupted transfer repeats little.
const REQUEST_BYTES: u64 = 4 << 20;
/// Blocks at most this far apart are requested together: they cost less than another request.
const GAP_BLOCKS: usize = 4;
/// Blocks that are kept in memory where the folder cannot be written, bytes.
const SPARE_BYTES: usize = 128 << 20;
/// Times that a part is read and its missing blocks are requested: other threads may displace blocks in memory.
const PASSES: usize = 8;

/// Time for which a host that could not be reached is not asked again: its failure costs a command the attempts once, and a
/// process that lives long, such as Python, recovers.
const DOWN: Duration = Duration::from_mins(1);

static RUN_ON: AtomicBool = AtomicBool::new(false);

/// Reader of the files on servers for which stand-ins stand.
#[derive(Debug, Default)]
pub struct RemoteFiles {
    places: Mutex<BTreeMap<PathBuf, Arc<Place>>>,
    hosts: Mutex<BTreeMap<String, Host>>,
    freed: Condvar,
    spare: Mutex<Spare>,
    has_warned: AtomicBool,
}

/// Blocks in memory, by the hash of their file.
#[derive(Debug, Default)]
struct Spare {
    bytes: usize,
    blocks: BTreeMap<(String, usize), Arc<Vec<u8>>>,
}

/// Successive blocks of a file.
#[derive(Debug)]
struct Request<'a> {
    /// Index of the first part that needs them.
    part: usize,
    path: &'a Path,
    file: &'a StandIn,
    blocks: Range<usize>,
}

/// Requests of a call, and their failures.
#[derive(Debug, Default)]
struct Work<'a> {
    queue: Mutex<VecDeque<Request<'a>>>,
    failed: Mutex<Vec<(usize, Error)>>,
}

/// State of a host.
#[derive(Debug, Default)]
struct Host {
    /// Connections in use.
    used: u32,
    /// Whether it has answered. Until then one connection suffices to find out that it does not.
    has_answered: bool,
    /// Time of the last attempt, if it failed.
    down: Option<Instant>,
}

/// A connection that may be used.
struct Permit<'a> {
    of: &'a RemoteFiles,
    host: String,
}

impl Drop for Permit<'_> {
    fn drop(&mut self) {
        if let Some(host) = locked(&self.of.hosts).get_mut(&self.host) {
            host.used = host.used.saturating_sub(1);
        }
        self.of.freed.notify_all();
    }
}

impl Elsewhere for RemoteFiles {
    fn bring(&self, parts: &[Part<'_>], stop: &AtomicBool) -> Vec<(usize, Error)> {
        let work = Work::default();
        let mut wanted: BTreeMap<&Path, (usize, &StandIn, BTreeSet<usize>)> = BTreeMap::new();
        for (index, part) in parts.iter().enumerate() {
            let known = wanted
                .entry(part.path)
                .or_insert((index, part.file, BTreeSet::new()));
            known.2.extend(part.file.blocks_with(&part.bytes));
        }
        let mut connections = 0;
        for (path, (part, file, blocks)) in wanted {
            let place = match self.place(path) {
                Ok(place) => place,
                Err(failure) => {
                    locked(&work.failed).push((part, failure));
                    continue;
                }
            };
            connections = connections.max(place.archives.network.connections_per_host);
            let here = Blocks::of(&place.folder, file);
            let mut missing = blocks;
            missing.retain(|block| self.block(&here, file, *block).is_none());
            let requests = runs(&missing, file).into_iter().map(|blocks| Request {
                part,
                path,
                file,
                blocks,
            });
            locked(&work.queue).extend(requests);
        }
        let workers = locked(&work.queue).len().min(connections as usize);
        thread::scope(|scope| {
            for _ in 0..workers {
                scope.spawn(|| {
                    while let Some(request) = next(&work.queue) {
                        if let Err(failure) = self.bring_one(&request, stop) {
                            locked(&work.failed).push((request.part, failure));
                        }
                    }
                });
            }
        });
        let mut failed = work
            .failed
            .into_inner()
            .unwrap_or_else(PoisonError::into_inner);
        // Requests that wait for a server that goes are refused before the failure of its last request is entered.
        failed.sort_by_key(|(part, failure)| (*part, is_refused(failure)));
        failed
    }

    fn read(&self, part: &Part<'_>, buffer: &mut [u8]) -> Result<()> {
        for _ in 0..PASSES {
            if self.fill(part, buffer)? {
                return Ok(());
            }
            let failed = self.bring(std::slice::from_ref(part), &RUN_ON);
            if let Some((_, failure)) = failed.into_iter().next() {
                return Err(failure);
            }
        }
        Err(RemoteError::Lost).in_file(part.path)
    }
}

impl RemoteFiles {
    fn place(&self, path: &Path) -> Result<Arc<Place>> {
        self.place_of(path).map(|(place, _)| place)
    }

    /// The archive of a stand-in, and the path of its file below the folder.
    fn place_of(&self, path: &Path) -> Result<(Arc<Place>, String)> {
        let (folder, below) = Place::of(path)?;
        let mut places = locked(&self.places);
        if let Some(known) = places.get(&folder) {
            return Ok((Arc::clone(known), below));
        }
        let place = Arc::new(Place::read(&folder)?);
        places.insert(folder, Arc::clone(&place));
        Ok((place, below))
    }

    /// A block that is on this computer.
    fn block(&self, here: &Blocks<'_>, file: &StandIn, block: usize) -> Option<Arc<Vec<u8>>> {
        let spare = locked(&self.spare);
        let spare = spare.blocks.get(&(file.blake3(), block)).map(Arc::clone);
        spare.or_else(|| here.read(block).map(Arc::new))
    }

    /// Fills the buffer; whether all blocks were on this computer.
    fn fill(&self, part: &Part<'_>, buffer: &mut [u8]) -> Result<bool> {
        let here = Blocks::of(&self.place(part.path)?.folder, part.file);
        for block in part.file.blocks_with(&part.bytes) {
            let Some(bytes) = self.block(&here, part.file, block) else {
                return Ok(false);
            };
            let held = part.file.bytes_of(&(block..block + 1));
            let common = held.start.max(part.bytes.start)..held.end.min(part.bytes.end);
            let of = |start: u64| {
                let place = |byte: u64| usize::try_from(byte - start).unwrap_or(usize::MAX);
                place(common.start)..place(common.end)
            };
            buffer[of(part.bytes.start)].copy_from_slice(&bytes[of(held.start)]);
        }
        Ok(true)
    }

    /// Brings the blocks of a request to this computer.
    fn bring_one(&self, request: &Request<'_>, stop: &AtomicBool) -> Result<()> {
        let Request {
            path, file, blocks, ..
        } = request;
        let (place, below) = self.place_of(path)?;
        let url = place.url_of(&below);
        let host = host_of(&url).to_owned();
        let _permit = self.permit(&host, place.archives.network.connections_per_host);
        let down = locked(&self.hosts).get(&host).and_then(|host| host.down);
        if down.is_some_and(|since| since.elapsed() < DOWN) {
            return Err(RemoteError::Down { url }).in_file(*path);
        }
        let receiver = Receiver {
            client: &place.client,
            network: &place.archives.network,
            stop,
        };
        let bytes = file.bytes_of(blocks);
        let part = named(file, blocks);
        let wanted = Wanted {
            url: &url,
            length: file.bytes(),
            bytes: bytes.clone(),
            part: &part,
        };
        let mut was_wrong = false;
        loop {
            let received = receive(&receiver, &wanted)
                .inspect_err(|failure| self.note_failure(&host, failure))
                .in_file(*path)?;
            self.note_answer(&host);
            let wrong = wrong_block(file, blocks, &received.bytes);
            let Some((block, found)) = wrong else {
                self.keep(&place.folder, file, blocks, &received.bytes);
                return Ok(());
            };
            // Once more: what changed may be the transfer, not the file.
            if was_wrong {
                let changed = RemoteError::Changed {
                    part: named(file, &(block..block + 1)),
                    found: format!(
                        "BLAKE3 {found}{}",
                        stated(received.validator.as_deref(), file)
                    ),
                    expected: file
                        .hash_of(block)
                        .map(|hash| digits(hash))
                        .unwrap_or_default(),
                    is_noticed: is_noticed(received.validator.as_deref(), file),
                    url,
                };
                return Err(changed).in_file(*path);
            }
            was_wrong = true;
        }
    }

    /// Keeps verified blocks.
    fn keep(&self, folder: &Path, file: &StandIn, blocks: &Range<usize>, bytes: &[u8]) {
        let from = file.bytes_of(blocks).start;
        let Err(error) = Blocks::of(folder, file).write(from, bytes) else {
            return;
        };
        if !self.has_warned.swap(true, Ordering::Relaxed) {
            tracing::warn!(
                "{}: bytes of files on servers cannot be kept here, and are received again by each command: {error}",
                folder.display()
            );
        }
        let mut spare = locked(&self.spare);
        if spare.bytes + bytes.len() > SPARE_BYTES {
            *spare = Spare::default();
        }
        for block in blocks.clone() {
            let held = file.bytes_of(&(block..block + 1));
            let place = |byte: u64| usize::try_from(byte - from).unwrap_or(usize::MAX);
            let held = bytes[place(held.start)..place(held.end)].to_vec();
            spare.bytes += held.len();
            spare.blocks.insert((file.blake3(), block), Arc::new(held));
        }
    }

    /// Waits for a connection to a host.
    fn permit(&self, host: &str, limit: u32) -> Permit<'_> {
        let mut hosts = locked(&self.hosts);
        loop {
            let known = hosts.entry(host.to_owned()).or_default();
            if known.used < if known.has_answered { limit } else { 1 } {
                known.used += 1;
                return Permit {
                    of: self,
                    host: host.to_owned(),
                };
            }
            hosts = self
                .freed
                .wait(hosts)
                .unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Notes that a host answers.
    fn note_answer(&self, host: &str) {
        if let Some(known) = locked(&self.hosts).get_mut(host) {
            known.has_answered = true;
        }
        self.freed.notify_all();
    }

    /// Notes a host that cannot be reached, so that other requests need not try.
    fn note_failure(&self, host: &str, failure: &Error) {
        let cause: &dyn std::error::Error = &*failure.cause;
        if let Some(RemoteError::Unreachable { .. }) = cause.downcast_ref()
            && let Some(known) = locked(&self.hosts).get_mut(host)
        {
            (known.has_answered, known.down) = (false, Some(Instant::now()));
        }
    }
}

/// Whether a request was not made because another one had failed.
fn is_refused(failure: &Error) -> bool {
    let cause: &dyn std::error::Error = &*failure.cause;
    matches!(cause.downcast_ref(), Some(RemoteError::Down { .. }))
}

/// Runs of blocks that are requested together.
fn runs(missing: &BTreeSet<usize>, file: &StandIn) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for block in missing.iter().copied() {
        if let Some(last) = runs.last_mut() {
            let bytes = file.bytes_of(&(last.start..block + 1));
            if block - last.end <= GAP_BLOCKS && bytes.end - bytes.start <= REQUEST_BYTES {
                last.end = block + 1;
                continue;
            }
        }
        runs.push(block..block + 1);
    }
    runs
}

/// The first block whose bytes are not those that were indexed, and their hash.
fn wrong_block(file: &StandIn, blocks: &Range<usize>, bytes: &[u8]) -> Option<(usize, String)> {
    let from = file.bytes_of(blocks).start;
    let place = |byte: u64| usize::try_from(byte - from).unwrap_or(usize::MAX);
    blocks.clone().find_map(|block| {
        let held = file.bytes_of(&(block..block + 1));
        let held = bytes.get(place(held.start)..place(held.end)).unwrap_or(&[]);
        (!is_block(file, block, held)).then(|| (block, digits(&block_hash(held))))
    })
}

/// Blocks and bytes for a message; blocks are counted from 1.
fn named(file: &StandIn, blocks: &Range<usize>) -> String {
    let bytes = file.bytes_of(blocks);
    let (first, last) = (blocks.start + 1, blocks.end);
    let of = file.blocks();
    let blocks = if first == last {
        format!("block {first} of {of}")
    } else {
        format!("blocks {first} to {last} of {of}")
    };
    format!(
        "{blocks} (bytes {} to {})",
        bytes.start,
        bytes.end.saturating_sub(1)
    )
}

/// The server's statement on the file, where it differs from the one at the time of the index.
fn stated(now: Option<&str>, file: &StandIn) -> String {
    let then = file.stated();
    match now {
        Some(now) if !then.contains(&Some(now)) => format!(" (the server states {now} now)"),
        _ => String::new(),
    }
}

/// Whether an index would read the file again because the server states another version, or none.
fn is_noticed(now: Option<&str>, file: &StandIn) -> bool {
    let then = file.stated();
    then == [None, None] || now.is_some_and(|now| !then.contains(&Some(now)))
}

fn digits(hash: &[u8]) -> String {
    crate::hashed::hexadecimal(&hash[..hash.len().min(6)])
}

fn next<'a>(queue: &Mutex<VecDeque<Request<'a>>>) -> Option<Request<'a>> {
    locked(queue).pop_front()
}

fn locked<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_that_the_server_does_not_state_needs_every_file_to_be_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ap19019l.b");
        areograph_store::atomic::write(&path, b"content").unwrap();
        let of = |etag: Option<&str>, time: Option<&str>| {
            let stated = [etag, time].map(|text| text.map(str::to_owned));
            StandIn::of(&path, 4, stated, Vec::new()).unwrap()
        };
        let dated = of(None, Some("Thu, 26 Feb 2009"));
        assert!(!is_noticed(Some("Thu, 26 Feb 2009"), &dated) && !is_noticed(None, &dated));
        assert!(is_noticed(Some("Fri, 27 Feb 2009"), &dated));
        assert!(is_noticed(Some("\"b\""), &of(Some("\"a\""), None)));
        assert!(is_noticed(None, &of(None, None)));
        for (is_noticed, expected) in [
            (true, "index URL` again"),
            (false, "index URL --verify` again"),
        ] {
            let changed = RemoteError::Changed {
                url: String::new(),
                part: String::new(),
                found: String::new(),
                expected: String::new(),
                is_noticed,
            };
            let advice = Error::from(changed).cause.advice();
            assert!(advice.contains(expected), "{advice}");
        }
    }
}
