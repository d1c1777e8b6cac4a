//! Identity of a worker process, distinct from a later process with the same number.

use std::fs;

use rustix::process::{Pid, Signal, kill_process_group};
use serde::{Deserialize, Serialize};

/// A unique identity of a process of this machine.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ProcessIdentity {
    /// Its number, which is also the number of its group.
    pub pid: u32,
    /// Start, in ticks since the boot.
    pub start: u64,
    /// Identifier of the boot.
    pub boot_id: String,
}

impl ProcessIdentity {
    /// The process with this number, if it exists.
    #[must_use]
    pub fn of(pid: u32) -> Option<Self> {
        let stat = fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
        // The name, in brackets, may contain any characters; the start time is field 22, 20 fields after it.
        let (_, fields) = stat.rsplit_once(')')?;
        Some(Self {
            pid,
            start: fields.split_ascii_whitespace().nth(19)?.parse().ok()?,
            boot_id: boot_id()?,
        })
    }

    /// Whether it still runs, or has ended and was not waited for.
    #[must_use]
    pub fn is_there(&self) -> bool {
        Self::of(self.pid).as_ref() == Some(self)
    }

    /// Ends it and its group by force, if it exists; returns whether it did.
    #[must_use]
    pub fn end(&self) -> bool {
        self.is_there() && signal_group(self.pid, Signal::KILL)
    }
}

/// Sends a signal to the group of a process that leads one; returns whether it existed.
pub(super) fn signal_group(pid: u32, signal: Signal) -> bool {
    let group = i32::try_from(pid).ok().and_then(Pid::from_raw);
    group.is_some_and(|group| kill_process_group(group, signal).is_ok())
}

fn boot_id() -> Option<String> {
    let text = fs::read_to_string("/proc/sys/kernel/random/boot_id").ok()?;
    Some(text.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use std::{os::unix::process::CommandExt, process::Command};

    use super::*;

    #[test]
    fn a_process_is_told_from_its_successor_and_ended_with_its_group() {
        let own = ProcessIdentity::of(std::process::id()).unwrap();
        assert!(own.is_there());
        let later = ProcessIdentity {
            start: own.start + 1,
            ..own.clone()
        };
        assert!(!later.is_there());
        assert!(!later.end());
        let mut child = Command::new("sleep")
            .arg("60")
            .process_group(0)
            .spawn()
            .unwrap();
        let sleeping = ProcessIdentity::of(child.id()).unwrap();
        assert!(sleeping.end());
        assert!(!child.wait().unwrap().success());
        assert!(!sleeping.is_there());
        assert!(!sleeping.end());
    }
}
