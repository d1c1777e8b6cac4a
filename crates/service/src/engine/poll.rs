//! Evaluation of a folder list: changed files, and the availability of the folder.

use std::collections::BTreeMap;

use crate::{
    clock::utc_text,
    database::files::{FileRow, FileState, RootRow, RootState},
    words::counted,
};
use areograph_store::files::Identity;

/// The known state of a folder and its list.
#[derive(Debug)]
pub struct Poll<'a> {
    /// The folder as it was.
    pub root: &'a RootRow,
    /// Files known below it.
    pub known: &'a BTreeMap<String, FileRow>,
    /// Files found below it, or the reason for which it could not be listed.
    pub found: Result<&'a BTreeMap<String, Identity>, &'a str>,
    /// Time, milliseconds of UTC since 1970.
    pub now_ms: i64,
    /// A larger share of missing files makes the folder unavailable.
    pub max_loss: f64,
    /// It is used after this time without changes.
    pub quiet_ms: i64,
}

/// The result.
#[derive(Debug, Clone, PartialEq)]
pub struct Polled {
    /// The new state of the folder.
    pub root: RootRow,
    /// Files that changed.
    pub changed: Vec<FileRow>,
    /// Files in a quiet folder: their content can be read now.
    pub settled: Vec<FileRow>,
}

/// Compares. An unavailable folder changes no file.
#[must_use]
pub fn compare(poll: &Poll<'_>) -> Polled {
    let found = match unavailable(poll) {
        Ok(found) => found,
        Err(detail) => {
            return Polled {
                root: with_state(poll, RootState::Unavailable, poll.root.files, detail),
                changed: Vec::new(),
                settled: Vec::new(),
            };
        }
    };
    let changed = changed(poll, found);
    let news: BTreeMap<&str, &FileRow> = changed.iter().map(|file| (&*file.path, file)).collect();
    let known = poll.known.values();
    // A file counts as settling from the poll that detected its change; only a later one may find it quiet.
    let waiting: Vec<&FileRow> = known
        .filter(|file| file.state == FileState::Settling && !news.contains_key(&*file.path))
        .collect();
    let last_change_ms = waiting
        .iter()
        .copied()
        .chain(news.values().copied())
        .map(last_change_ms)
        .max();
    let files = i64::try_from(found.len()).unwrap_or(i64::MAX);
    let quiet_from_ms = last_change_ms.map(|change_ms| change_ms.saturating_add(poll.quiet_ms));
    let (state, settled, detail) = match quiet_from_ms {
        None => (RootState::Available, Vec::new(), String::new()),
        Some(from_ms) if news.is_empty() && from_ms <= poll.now_ms => {
            let settled = waiting.into_iter().cloned().collect();
            (RootState::Available, settled, String::new())
        }
        Some(from_ms) => {
            let count = waiting.len() + news.len();
            let until = utc_text(from_ms.max(poll.now_ms));
            let files = counted(count, "file");
            let detail = format!("{files} changed; the quiet period ends at {until}");
            (RootState::Settling, Vec::new(), detail)
        }
    };
    Polled {
        root: with_state(poll, state, files, detail),
        changed,
        settled,
    }
}

/// The files, or the reason for which the folder is unavailable.
fn unavailable<'a>(poll: &Poll<'a>) -> Result<&'a BTreeMap<String, Identity>, String> {
    let found = poll.found.map_err(str::to_owned)?;
    let there = |file: &&FileRow| file.state != FileState::Gone;
    let known = poll.known.values().filter(there).count();
    // A folder that never held a file, such as that of tie points, is merely not in use.
    if found.is_empty() && known > 0 {
        return Err("the folder is empty".to_owned());
    }
    let is_lost = |file: &&FileRow| there(file) && !found.contains_key(&file.path);
    let lost = poll.known.values().filter(is_lost).count();
    if lost as f64 > poll.max_loss * known as f64 {
        return Err(format!(
            "{lost} of {known} files are missing, more than changes.max_loss = {} allows; if the files were removed \
             intentionally, raise this limit until the next poll",
            poll.max_loss
        ));
    }
    Ok(found)
}

fn with_state(poll: &Poll<'_>, state: RootState, files: i64, detail: String) -> RootRow {
    let since_ms = if state == poll.root.state {
        poll.root.since_ms
    } else {
        poll.now_ms
    };
    RootRow {
        files,
        state,
        since_ms,
        detail,
        ..poll.root.clone()
    }
}

fn changed(poll: &Poll<'_>, found: &BTreeMap<String, Identity>) -> Vec<FileRow> {
    let mut changed = Vec::new();
    for (path, identity) in found {
        match poll.known.get(path) {
            Some(file)
                if file.identity == *identity
                    && file.state != FileState::Gone
                    && !is_missing(file) => {}
            Some(file) => changed.push(FileRow {
                identity: *identity,
                changed_ms: poll.now_ms,
                state: FileState::Settling,
                detail: String::new(),
                ..file.clone()
            }),
            None => changed.push(FileRow {
                path: path.clone(),
                identity: *identity,
                blake3: None,
                first_seen_ms: poll.now_ms,
                changed_ms: poll.now_ms,
                checked_ms: None,
                state: FileState::Settling,
                detail: String::new(),
                round: 0,
            }),
        }
    }
    let missing = poll.known.values().filter(|file| {
        file.state != FileState::Gone && !is_missing(file) && !found.contains_key(&file.path)
    });
    changed.extend(missing.map(|file| FileRow {
        changed_ms: poll.now_ms,
        state: FileState::Settling,
        detail: MISSING.to_owned(),
        ..file.clone()
    }));
    changed
}

/// Detail of a missing settling file: mirrors remove files before they add others.
const MISSING: &str = "missing";

/// Whether a settling file was missing when its folder was last listed.
#[must_use]
pub fn is_missing(file: &FileRow) -> bool {
    file.state == FileState::Settling && file.detail == MISSING
}

/// Time of a file's change: by the file system, since a starting service sees everything for the first time, but not
/// later than its detection.
fn last_change_ms(file: &FileRow) -> i64 {
    if is_missing(file) {
        return file.changed_ms;
    }
    let [seconds, nanoseconds] = file.identity.changed;
    let changed_ms = seconds.saturating_mul(1000) + nanoseconds / 1_000_000;
    file.changed_ms.min(changed_ms)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::database::files::RootKind;

    const QUIET_MS: i64 = 600_000;

    fn identity(inode: u64, changed_ms: i64) -> Identity {
        Identity {
            device: 1,
            inode,
            bytes: 100,
            modified: [5, 0],
            changed: [changed_ms / 1000, changed_ms % 1000 * 1_000_000],
        }
    }

    /// A folder that is polled repeatedly, and whose settled files count as read.
    struct Folder {
        root: RootRow,
        known: BTreeMap<String, FileRow>,
        files: BTreeMap<String, Identity>,
    }

    impl Folder {
        fn new(count: u64) -> Self {
            let root = RootRow {
                path: "/k".to_owned(),
                kind: RootKind::Kernels,
                files: 0,
                state: RootState::Available,
                since_ms: 0,
                detail: String::new(),
            };
            let files = (0..count).map(|n| (format!("/k/{n:03}.bc"), identity(n, 0)));
            Self {
                root,
                known: BTreeMap::new(),
                files: files.collect(),
            }
        }

        /// Changed paths, and settled ones.
        fn poll(&mut self, now_ms: i64, found: Result<(), &str>) -> (usize, usize) {
            let polled = compare(&Poll {
                root: &self.root,
                known: &self.known,
                found: found.map(|()| &self.files),
                now_ms,
                max_loss: 0.2,
                quiet_ms: QUIET_MS,
            });
            let counts = (polled.changed.len(), polled.settled.len());
            self.root = polled.root;
            let settled = polled.settled.into_iter().map(|file| FileRow {
                state: if is_missing(&file) {
                    FileState::Gone
                } else {
                    FileState::Ready
                },
                ..file
            });
            for file in polled.changed.into_iter().chain(settled) {
                self.known.insert(file.path.clone(), file);
            }
            counts
        }
    }

    #[test]
    fn a_new_service_uses_old_files_at_its_second_sweep() {
        let mut folder = Folder::new(10);
        assert_eq!(folder.poll(QUIET_MS, Ok(())), (10, 0));
        assert_eq!(folder.root.state, RootState::Settling);
        assert_eq!(folder.poll(QUIET_MS + 1, Ok(())), (0, 10));
        assert_eq!(folder.root.state, RootState::Available);
        assert_eq!(folder.poll(QUIET_MS + 2, Ok(())), (0, 0));
    }

    #[test]
    fn a_folder_that_never_held_a_file_is_available() {
        let mut folder = Folder::new(0);
        assert_eq!(folder.poll(QUIET_MS, Ok(())), (0, 0));
        assert_eq!(folder.root.state, RootState::Available);
        folder.files.insert("/k/a.bc".to_owned(), identity(1, 0));
        assert_eq!(folder.poll(QUIET_MS + 1, Ok(())), (1, 0));
        assert_eq!(folder.poll(QUIET_MS + 2, Ok(())), (0, 1));
        folder.files.clear();
        assert_eq!(folder.poll(QUIET_MS + 3, Ok(())), (0, 0));
        assert_eq!(folder.root.state, RootState::Unavailable);
    }

    #[test]
    fn a_copy_in_pieces_is_used_once_at_its_end() {
        let mut folder = Folder::new(10);
        folder.poll(QUIET_MS, Ok(()));
        folder.poll(QUIET_MS + 1, Ok(()));
        let begin_ms = 2 * QUIET_MS;
        let mut settled = 0;
        // Pieces every five minutes, an old modification time, polls every minute.
        for minute in 0..40 {
            let now_ms = begin_ms + minute * 60_000;
            if minute <= 20 && minute % 5 == 0 {
                let slow = Identity {
                    bytes: 10 + minute.unsigned_abs(),
                    ..identity(77, now_ms)
                };
                folder.files.insert("/k/slow.bc".to_owned(), slow);
            }
            let (_, now_settled) = folder.poll(now_ms, Ok(()));
            assert!(
                now_settled == 0 || minute == 30,
                "settled in minute {minute}"
            );
            settled += now_settled;
        }
        assert_eq!(settled, 1);
    }

    #[test]
    fn a_folder_that_vanishes_or_loses_much_changes_no_file() {
        let mut folder = Folder::new(100);
        folder.poll(QUIET_MS, Ok(()));
        folder.poll(QUIET_MS + 1, Ok(()));
        let (known, files) = (folder.known.clone(), folder.files.clone());
        assert_eq!(folder.poll(QUIET_MS + 2, Err("not there")), (0, 0));
        assert_eq!(folder.root.state, RootState::Unavailable);
        assert_eq!(folder.root.since_ms, QUIET_MS + 2);
        folder.files.clear();
        assert_eq!(folder.poll(QUIET_MS + 3, Ok(())), (0, 0));
        assert!(folder.root.detail.contains("is empty"));
        folder.files = files.clone();
        folder.files.retain(|path, _| path.as_str() >= "/k/021.bc");
        assert_eq!(folder.poll(QUIET_MS + 4, Ok(())), (0, 0));
        assert!(folder.root.detail.contains("21 of 100 files are missing"));
        assert_eq!(folder.root.since_ms, QUIET_MS + 2);
        assert_eq!(folder.known, known);
        // Restored: no change.
        folder.files = files;
        assert_eq!(folder.poll(QUIET_MS + 5, Ok(())), (0, 0));
        assert_eq!(folder.root.state, RootState::Available);
        // A single missing file is a change, after the quiet period.
        folder.files.remove("/k/005.bc");
        assert_eq!(folder.poll(2 * QUIET_MS, Ok(())), (1, 0));
        assert_eq!(folder.poll(3 * QUIET_MS - 1, Ok(())), (0, 0));
        assert_eq!(folder.poll(3 * QUIET_MS, Ok(())), (0, 1));
        assert_eq!(folder.known["/k/005.bc"].state, FileState::Gone);
    }
}
