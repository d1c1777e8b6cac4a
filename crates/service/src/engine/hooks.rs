//! Hooks: programs run without a shell, with JSON on their standard input, for at most 30 s.

use std::{path::PathBuf, process::Stdio, time::Duration};

use rustix::fs::{Access, access};
use rustix::process::{Pid, Signal, kill_process_group};
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    process::{Child, Command},
    time::timeout,
};

use super::core::Core;
use crate::{
    database::{
        Stored,
        alerts::{Notification, due_notifications, put_delivered, put_undelivered},
    },
    engine::workers::Workers,
};

/// Longest time that a hook may take.
const LIMIT: Duration = Duration::from_secs(30);
/// Notifications delivered in one pass.
const NOTIFICATIONS_MAX: u32 = 20;
/// Bytes kept of a hook's standard error.
const COMPLAINT_MAX: u64 = 500;
/// Delay of the second try, doubled for each further one, and the longest delay.
const DELAY_MS: (i64, i64) = (60_000, 3_600_000);
/// Search path of hooks.
const PATH: &str = "/usr/local/bin:/usr/bin:/bin";

/// Delivers the notifications that are due.
///
/// # Errors
/// The database cannot be written.
pub async fn deliver<W: Workers>(core: &Core<W>) -> Stored<()> {
    let now_ms = core.now_ms();
    let notifications = core
        .shared
        .read(|connection| due_notifications(connection, now_ms, NOTIFICATIONS_MAX))?;
    for notification in notifications {
        let config = core.shared.config();
        let hook = usize::try_from(notification.hook).ok();
        let outcome = match hook.and_then(|place| config.hooks.get(place)) {
            Some(hook) => run(&hook.command, &notification.body).await,
            None => Err("the hook is no longer configured".to_owned()),
        };
        let now_ms = core.now_ms();
        core.shared.write(|transaction| match &outcome {
            Ok(()) => put_delivered(transaction, notification.id, now_ms),
            Err(why) => {
                tracing::warn!(notification = notification.id, "a hook failed: {why}");
                put_undelivered(
                    transaction,
                    notification.id,
                    why,
                    now_ms + delay_ms(&notification),
                )
            }
        })?;
    }
    Ok(())
}

fn delay_ms(notification: &Notification) -> i64 {
    let doublings = u32::try_from(notification.tries.min(20)).unwrap_or_default();
    DELAY_MS.0.saturating_mul(1 << doublings).min(DELAY_MS.1)
}

/// The executable file of a hook, searched for as at its start.
pub(crate) fn program_of(program: &str) -> Option<PathBuf> {
    if program.contains('/') {
        return Some(PathBuf::from(program)).filter(is_program);
    }
    program_in(program, PATH.split(':').map(PathBuf::from))
}

/// The program with this name in the first of some folders that has it.
pub(crate) fn program_in(
    program: &str,
    folders: impl IntoIterator<Item = PathBuf>,
) -> Option<PathBuf> {
    let mut places = folders.into_iter().map(|folder| folder.join(program));
    places.find(is_program)
}

fn is_program(path: &PathBuf) -> bool {
    path.is_file() && access(path, Access::EXEC_OK).is_ok()
}

/// Runs a hook; returns the reason of a failure.
async fn run(command: &[String], body: &str) -> Result<(), String> {
    let Some((program, arguments)) = command.split_first() else {
        return Err("the hook has no program".to_owned());
    };
    let mut child = Command::new(program)
        .args(arguments)
        .env_clear()
        .env("PATH", PATH)
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .process_group(0)
        .kill_on_drop(true)
        .spawn()
        .map_err(|error| format!("{program}: {error}"))?;
    let group = child.id().and_then(|id| i32::try_from(id).ok());
    let ended = timeout(LIMIT, to_the_end(&mut child, body)).await;
    if let Some(group) = group.and_then(Pid::from_raw) {
        // Including processes that it left behind.
        let _ = kill_process_group(group, Signal::KILL);
    }
    ended.unwrap_or_else(|_| {
        Err(format!(
            "{program} did not end within {} s",
            LIMIT.as_secs()
        ))
    })
}

async fn to_the_end(child: &mut Child, body: &str) -> Result<(), String> {
    if let Some(mut input) = child.stdin.take() {
        // The exit code decides, even for a hook that does not read.
        let _ = input.write_all(body.as_bytes()).await;
    }
    let mut complaint = Vec::new();
    if let Some(errors) = child.stderr.take() {
        let _ = errors.take(COMPLAINT_MAX).read_to_end(&mut complaint).await;
    }
    let status = child.wait().await.map_err(|error| error.to_string())?;
    if status.success() {
        return Ok(());
    }
    let complaint = String::from_utf8_lossy(&complaint);
    Err(format!("{status}: {}", complaint.trim()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shell(text: &str) -> Vec<String> {
        ["sh", "-c", text].map(str::to_owned).to_vec()
    }

    #[tokio::test]
    async fn a_hook_gets_the_letter_and_says_why_it_failed() {
        let check = "test \"$(cat)\" = '{\"a\":1}' && test -z \"$HOME\"";
        assert_eq!(run(&shell(check), "{\"a\":1}").await, Ok(()));
        let refused = run(&shell("echo no mail >&2; exit 3"), "").await;
        assert_eq!(refused, Err("exit status: 3: no mail".to_owned()));
        let unknown = run(&["/no/such/program".to_owned()], "").await;
        assert!(unknown.unwrap_err().starts_with("/no/such/program: "));
    }

    #[test]
    fn delays_grow_up_to_an_hour() {
        let notification = |tries| Notification {
            id: 1,
            hook: 0,
            body: String::new(),
            tries,
        };
        let delays: Vec<i64> = [0, 1, 5, 6, 60]
            .map(|tries| delay_ms(&notification(tries)))
            .to_vec();
        assert_eq!(delays, [60_000, 120_000, 1_920_000, 3_600_000, 3_600_000]);
    }
}
