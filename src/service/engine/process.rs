//! Processes of an earlier service: told from others that got their number, and ended.

use std::{fs, thread::sleep, time::Duration};

use rustix::process::{Pid, Signal, kill_process_group};

use crate::service::database::attempts::Attempt;

/// Time between the request to end and the end by force, and between two looks.
const PATIENCE: Duration = Duration::from_secs(10);
const LOOK: Duration = Duration::from_millis(50);

/// Identifier of this boot of the machine; empty where the system has none.
#[must_use]
pub fn boot_id() -> String {
    let id = fs::read_to_string("/proc/sys/kernel/random/boot_id").unwrap_or_default();
    id.trim().to_owned()
}

/// Start of a process, ticks since boot.
#[must_use]
pub fn process_start(pid: u32) -> Option<i64> {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    // The name of the program, in parentheses, may hold blanks; the start is field 22, the 20th after it.
    let fields = &stat[stat.rfind(')')? + 1..];
    fields.split_ascii_whitespace().nth(19)?.parse().ok()
}

/// Ends the process of an attempt with its group, if it is still there. Says whether none is left.
#[must_use]
pub fn end_of(attempt: &Attempt) -> bool {
    let Some(group) = attempt.pid.and_then(|pid| i32::try_from(pid).ok()) else {
        return true;
    };
    let alive = || {
        attempt.boot_id.as_deref() == Some(&*boot_id())
            && attempt.pid_start.is_some()
            && u32::try_from(group).ok().and_then(process_start) == attempt.pid_start
    };
    let Some(group) = Pid::from_raw(group) else {
        return true;
    };
    for signal in [Signal::TERM, Signal::KILL] {
        if !alive() {
            return true;
        }
        let _ = kill_process_group(group, signal);
        for _ in 0..PATIENCE.as_millis() / LOOK.as_millis() {
            if !alive() {
                return true;
            }
            sleep(LOOK);
        }
    }
    !alive()
}

#[cfg(test)]
mod tests {
    use std::{os::unix::process::CommandExt as _, process::Command};

    use super::*;

    #[test]
    fn a_worker_left_behind_is_ended_and_another_process_of_its_number_is_not() {
        let mut child = Command::new("sleep")
            .arg("60")
            .process_group(0)
            .spawn()
            .unwrap();
        let pid = child.id();
        let attempt = Attempt {
            job: 1,
            n: 1,
            pid: Some(i64::from(pid)),
            pid_start: process_start(pid).map(|start| start - 1),
            boot_id: Some(boot_id()),
            stage: None,
            rss_kib: None,
            ended_ms: None,
        };
        assert!(end_of(&attempt));
        assert!(child.try_wait().unwrap().is_none(), "it was another process");
        let reaper = std::thread::spawn(move || child.wait().unwrap());
        let attempt = Attempt {
            pid_start: process_start(pid),
            ..attempt
        };
        assert!(end_of(&attempt));
        assert!(!reaper.join().unwrap().success());
    }
}
