//! A lock: one service at a time uses a state folder.

use std::{
    fs::{self, File, TryLockError},
    io::{Seek as _, Write as _},
    path::Path,
};

use serde::{Deserialize, Serialize};

use super::{clock::utc_text, private::create_folder};
use areograph_base::error::{Cause, IoError, Locate as _, Result};

/// Name of the lock in the state folder.
pub(crate) const LOCK: &str = "service.lock";

/// Types of file systems on which neither locks nor the database are reliable.
const NETWORK: [(i64, &str); 5] = [
    (0x6969, "NFS"),
    (0x517b, "SMB"),
    (0xff53_4d42, "CIFS"),
    (0xfe53_4d42, "SMB2"),
    (0x0002_3c37, "Coda"),
];

/// Held while a service runs; the system releases it at the end of the process, however it ends.
#[derive(Debug)]
pub struct ServiceLock {
    file: File,
}

/// The holder of the lock.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Owner {
    /// Process.
    pub pid: u32,
    /// Its command: `serve`, `nightly` or another.
    pub command: String,
    /// Address of its pages; empty without pages.
    pub address: String,
    /// Time at which it began, milliseconds of UTC since 1970.
    pub started_ms: i64,
}

#[derive(Debug, thiserror::Error, Cause)]
enum LockError {
    #[error("{} has been using this folder since {}", .0.words(), utc_text(.0.started_ms))]
    #[cause(Io: "{}stop that process first", _0.page_or())]
    Taken(Owner),
    #[error("another service is using this folder")]
    #[cause(Io: "stop that process first")]
    TakenByUnknown,
    #[error("the folder is on a network file system ({0}), where the database is not safe")]
    #[cause(Configuration: "set outputs.state to a folder on a local disk")]
    Network(&'static str),
}

impl Owner {
    pub(crate) fn words(&self) -> String {
        format!("areograph {} (process {})", self.command, self.pid)
    }

    /// Whether its process runs; a later process may have the same number.
    pub(crate) fn runs(&self) -> bool {
        let arguments = fs::read(format!("/proc/{}/cmdline", self.pid)).unwrap_or_default();
        let mut arguments = arguments.split(|byte| *byte == 0);
        arguments.any(|argument| argument == self.command.as_bytes())
    }

    /// The alternative to the end of its process, if it has pages.
    fn page_or(&self) -> String {
        if self.address.is_empty() {
            String::new()
        } else {
            format!("open http://{}, or ", self.address)
        }
    }
}

impl ServiceLock {
    /// Takes the lock of `folder`, created if necessary, and records its owner.
    ///
    /// # Errors
    /// Another process holds it; the folder is on a network file system, or cannot be written.
    pub fn take(folder: &Path, owner: &Owner) -> Result<Self> {
        create_folder(folder)
            .map_err(IoError::on("create the folder"))
            .in_file(folder)?;
        refuse_network(folder).in_file(folder)?;
        let path = folder.join(LOCK);
        let file = File::options()
            .create(true)
            .truncate(false)
            .read(true)
            .write(true)
            .open(&path)
            .map_err(IoError::on("create"))
            .in_file(&path)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let taken = owner_of(&path).map_or(LockError::TakenByUnknown, LockError::Taken);
                return Err(taken).in_file(folder);
            }
            Err(TryLockError::Error(error)) => {
                return Err(IoError::on("lock")(error)).in_file(&path);
            }
        }
        let lock = Self { file };
        lock.tell(owner)
            .map_err(IoError::on("write"))
            .in_file(&path)?;
        Ok(lock)
    }

    /// Records the owner of the lock, for other processes.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn tell(&self, owner: &Owner) -> std::io::Result<()> {
        let mut file = &self.file;
        file.set_len(0)?;
        file.rewind()?;
        serde_json::to_writer(file, owner)?;
        file.flush()
    }
}

fn owner_of(path: &Path) -> Option<Owner> {
    serde_json::from_slice(&fs::read(path).ok()?).ok()
}

/// Refuses a folder on a network file system.
pub(crate) fn refuse_network(folder: &Path) -> Result<()> {
    let found = rustix::fs::statfs(folder).ok().map(|found| found.f_type);
    match NETWORK.iter().find(|(kind, _)| Some(*kind) == found) {
        Some((_, network)) => Err(LockError::Network(network).into()),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use areograph_base::error::Kind;

    use super::*;

    #[test]
    fn a_second_service_is_refused_and_told_where_the_first_is() {
        let folder = tempfile::tempdir().unwrap();
        let owner = Owner {
            pid: 4711,
            command: "serve".to_owned(),
            address: "127.0.0.1:8470".to_owned(),
            started_ms: 0,
        };
        let lock = ServiceLock::take(folder.path(), &owner).unwrap();
        let refused = ServiceLock::take(folder.path(), &owner).unwrap_err();
        assert_eq!(refused.kind(), Kind::Io);
        let text = refused.to_string();
        for told in [
            "process 4711",
            "1970-01-01T00:00:00",
            "http://127.0.0.1:8470",
        ] {
            assert!(text.contains(told), "{text}");
        }
        drop(lock);
        ServiceLock::take(folder.path(), &owner).unwrap();
    }
}
