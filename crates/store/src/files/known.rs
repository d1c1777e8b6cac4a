//! Known files of earlier runs, valid while the file system reports no change.

use std::{
    collections::BTreeMap,
    fs::Metadata,
    os::unix::fs::MetadataExt,
    time::{Duration, SystemTime, UNIX_EPOCH},
};

use serde::{Deserialize, Serialize};

/// Time for which a file must have been unchanged before it was read, seconds. File systems count time in steps: the
/// second of two changes within one step leaves no trace. The coarsest in use count 2 s.
const STEADY_S: u64 = 2;

/// Identity of a file in the file system; writing to a file changes its times, within the resolution of the system.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity {
    /// Device of its file system.
    pub device: u64,
    /// Inode.
    pub inode: u64,
    /// Size.
    pub bytes: u64,
    /// Time of the last change of its content, as stated: seconds and nanoseconds of UTC since 1970.
    pub modified: [i64; 2],
    /// Time of the last change of the file or its metadata; no program can set it.
    pub changed: [i64; 2],
}

impl Identity {
    /// The identity of a file.
    #[must_use]
    pub fn of(metadata: &Metadata) -> Self {
        Self {
            device: metadata.dev(),
            inode: metadata.ino(),
            bytes: metadata.size(),
            modified: [metadata.mtime(), metadata.mtime_nsec()],
            changed: [metadata.ctime(), metadata.ctime_nsec()],
        }
    }

    /// Whether both are the same unchanged file. Computers number the device of a shared file system differently; inode
    /// and times are those of its server.
    #[must_use]
    pub fn is_same_file(&self, other: &Self) -> bool {
        Self { device: 0, ..*self }
            == Self {
                device: 0,
                ..*other
            }
    }

    /// Whether the file had been unchanged for a while at `instant`, so that any later change shows in its times.
    #[must_use]
    pub fn is_steady(&self, instant: SystemTime) -> bool {
        let latest = instant
            .checked_sub(Duration::from_secs(STEADY_S))
            .and_then(|latest| latest.duration_since(UNIX_EPOCH).ok());
        let before = |[seconds, nanoseconds]: [i64; 2]| {
            latest.is_some_and(|latest| {
                let latest_s = i64::try_from(latest.as_secs()).unwrap_or(i64::MAX);
                (seconds, nanoseconds) < (latest_s, i64::from(latest.subsec_nanos()))
            })
        };
        before(self.modified) && before(self.changed)
    }
}

/// A file whose content is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct KnownFile {
    /// Its identity when it was read.
    pub identity: Identity,
    /// BLAKE3 of its content.
    pub blake3: [u8; 32],
    /// Version of the check of kernels that its content passed; 0 for none.
    pub checked: u32,
    /// Time at which it was read, seconds of UTC since 1970.
    pub read_s: u64,
}

/// Files whose content is known, each once.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct KnownFiles(BTreeMap<(u64, u64), KnownFile>);

impl KnownFiles {
    /// Adds a file; it replaces an earlier entry.
    pub fn add(&mut self, file: KnownFile) {
        let Identity { device, inode, .. } = file.identity;
        self.0.insert((device, inode), file);
    }

    /// The entry of the file with this identity.
    #[must_use]
    pub fn get(&self, identity: &Identity) -> Option<&KnownFile> {
        let found = self.0.get(&(identity.device, identity.inode));
        found.filter(|known| known.identity == *identity)
    }

    /// All of them.
    #[must_use]
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &KnownFile> {
        self.0.values()
    }
}

impl FromIterator<KnownFile> for KnownFiles {
    fn from_iter<I: IntoIterator<Item = KnownFile>>(files: I) -> Self {
        let mut known = Self::default();
        files.into_iter().for_each(|file| known.add(file));
        known
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_steady_two_seconds_after_both_of_its_times() {
        let at = |s: u64, ms: u64| UNIX_EPOCH + Duration::from_millis(s * 1000 + ms);
        let of = |modified, changed| Identity {
            device: 1,
            inode: 2,
            bytes: 3,
            modified,
            changed,
        };
        let file = of([100, 500_000_000], [90, 0]);
        assert!(!file.is_steady(at(102, 500)));
        assert!(file.is_steady(at(102, 501)));
        assert!(!of([90, 0], [100, 0]).is_steady(at(101, 0)));
        assert!(!of([i64::MAX, 0], [0, 0]).is_steady(at(1_000, 0)));
        assert!(!file.is_steady(UNIX_EPOCH));
    }

    #[test]
    fn a_file_is_the_same_on_another_computer_unless_it_changed() {
        let file = Identity {
            device: 1,
            inode: 2,
            bytes: 3,
            modified: [4, 5],
            changed: [6, 7],
        };
        assert!(file.is_same_file(&Identity { device: 9, ..file }));
        for other in [
            Identity { inode: 9, ..file },
            Identity { bytes: 9, ..file },
            Identity {
                modified: [4, 9],
                ..file
            },
            Identity {
                changed: [6, 9],
                ..file
            },
        ] {
            assert!(!file.is_same_file(&other));
        }
    }
}
