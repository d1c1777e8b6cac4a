//! The state of a job after an attempt, by the kind of its end.

use serde_json::{Value, json};

use crate::{
    database::{Job, Moved},
    random::Random,
    state::JobState,
    worker::{
        parent::{Ended, How},
        protocol::{CancelWhy, Failure},
    },
};
use areograph_base::error::Kind;

use super::workers::words;

/// Attempts after a failure of input or output.
pub const IO_ATTEMPTS: i64 = 5;
/// Attempts at a site whose worker is ended by a signal, or sends no heartbeat.
pub const CRASH_ATTEMPTS: i64 = 3;
/// Attempts at a site that triggers a bug in areograph.
pub const BUG_ATTEMPTS: i64 = 2;
/// Longest delay of an attempt.
const DELAY_MAX_S: f64 = 900.0;
/// Delay of an attempt that could not be made, and therefore does not count.
const UNCOUNTED_DELAY_S: f64 = 60.0;
/// Share of its memory limit above which a killed worker counts as out of memory.
const MEMORY_SHARE: f64 = 0.9;

/// An attempt without a publication, and the data that determine the next state.
#[derive(Debug)]
pub struct Fruitless<'a> {
    /// The job, as of the end of the attempt.
    pub job: &'a Job,
    /// End of the worker.
    pub ended: &'a Ended,
    /// The last reported stage.
    pub stage: Option<&'a str>,
    /// Memory limit, mebibytes.
    pub memory_mib: u32,
    /// The reason of its cancellation.
    pub cancel: Option<CancelWhy>,
    /// Delay of the first retry.
    pub retry_s: f64,
    /// Time, milliseconds of UTC since 1970.
    pub now_ms: i64,
}

/// The next state.
#[must_use]
pub fn after(attempt: &Fruitless<'_>, random: Random) -> (JobState, Moved) {
    if attempt.job.state == JobState::Cancelling {
        return ended(JobState::Cancelled, "cancelled");
    }
    if attempt.cancel == Some(CancelWhy::Shutdown) {
        return ended(JobState::Queued, "the service ended");
    }
    if let Some(Err(failure)) = &attempt.ended.answer
        && attempt.ended.how != How::DeadlinePassed
    {
        return after_failure(attempt, failure, random);
    }
    match &attempt.ended.how {
        How::DeadlinePassed => counted(
            JobState::Failed,
            json!({ "text": "the attempt took longer than workers.deadline_s", "stage": attempt.stage }),
        ),
        How::ForeignVersion(version) => uncounted(
            attempt,
            &format!("the program was replaced by areograph {version}: restart the service"),
        ),
        How::NotStarted(_) => {
            let outcome = json!({ "text": words(attempt.ended) });
            again(attempt, IO_ATTEMPTS, outcome, random)
        }
        _ => after_crash(attempt, random),
    }
}

fn after_failure(attempt: &Fruitless<'_>, failure: &Failure, random: Random) -> (JobState, Moved) {
    let outcome = json!({
        "text": failure.text,
        "code": failure.code,
        "stage": failure.stage,
        "file": failure.file,
    });
    let is = |kind: Kind| failure.code == kind.exit_code();
    if failure.busy {
        uncounted(attempt, &failure.text)
    } else if is(Kind::Io) {
        again(attempt, IO_ATTEMPTS, outcome, random)
    } else if is(Kind::Configuration) || is(Kind::Input) || is(Kind::Coverage) {
        counted(JobState::Blocked, outcome)
    } else if is(Kind::Interrupted) {
        // A signal from elsewhere: treated as a kill.
        again(attempt, CRASH_ATTEMPTS, outcome, random)
    } else {
        again(attempt, BUG_ATTEMPTS, outcome, random)
    }
}

fn after_crash(attempt: &Fruitless<'_>, random: Random) -> (JobState, Moved) {
    let place = attempt
        .stage
        .map_or_else(|| "the start".to_owned(), |stage| format!("stage {stage}"));
    let rss_mib = attempt.ended.rss_peak_kib as f64 / 1024.0;
    if rss_mib > MEMORY_SHARE * f64::from(attempt.memory_mib) {
        let text = format!(
            "at {place}, the worker needs more memory than workers.memory_mib = {} allows",
            attempt.memory_mib
        );
        let outcome = json!({ "text": text, "stage": attempt.stage, "rss_mib": rss_mib });
        return counted(JobState::Failed, outcome);
    }
    let outcome = json!({
        "text": format!("the worker crashed at {place}: {}", words(attempt.ended)),
        "stage": attempt.stage,
    });
    again(attempt, CRASH_ATTEMPTS, outcome, random)
}

/// Another attempt after a growing delay, unless that was the last of `most`.
fn again(attempt: &Fruitless<'_>, most: i64, outcome: Value, random: Random) -> (JobState, Moved) {
    let failed = attempt.job.failures;
    if failed + 1 >= most {
        return counted(JobState::Failed, outcome);
    }
    let doubled = attempt.retry_s * 2_f64.powi(i32::try_from(failed).unwrap_or(i32::MAX));
    let delay_s = doubled.min(DELAY_MAX_S) * 0.5 * (1.0 + random.unit());
    let (state, moved) = counted(JobState::Waiting, outcome);
    let not_before_ms = Some(attempt.now_ms.saturating_add(milliseconds(delay_s)));
    (
        state,
        Moved {
            not_before_ms,
            ..moved
        },
    )
}

fn uncounted(attempt: &Fruitless<'_>, text: &str) -> (JobState, Moved) {
    let (state, moved) = ended(JobState::Waiting, text);
    let delay_s = attempt.retry_s.min(UNCOUNTED_DELAY_S);
    let not_before_ms = Some(attempt.now_ms.saturating_add(milliseconds(delay_s)));
    (
        state,
        Moved {
            not_before_ms,
            ..moved
        },
    )
}

fn counted(state: JobState, outcome: Value) -> (JobState, Moved) {
    let moved = Moved {
        outcome: Some(outcome),
        counts_as_failure: true,
        ..Moved::default()
    };
    (state, moved)
}

fn ended(state: JobState, text: &str) -> (JobState, Moved) {
    let moved = Moved {
        outcome: Some(json!({ "text": text })),
        ..Moved::default()
    };
    (state, moved)
}

/// Seconds of the configuration, which are never negative, as milliseconds.
#[must_use]
#[allow(
    clippy::cast_possible_truncation,
    reason = "a number that is too large becomes the maximum"
)]
pub fn milliseconds(seconds: f64) -> i64 {
    (seconds * 1000.0).round() as i64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::database::Priority;

    fn job(state: JobState, failures: i64) -> Job {
        Job {
            id: 1,
            site: "gusev".to_owned(),
            state,
            priority: Priority::Changed,
            attempt: failures + 1,
            failures,
            not_before_ms: 0,
            force: false,
            cancel_asked: false,
            night: None,
            asked_by: None,
            created_ms: 0,
            changed_ms: 0,
            ended_ms: None,
            outcome: None,
        }
    }

    fn gone(how: How, rss_peak_kib: u64) -> Ended {
        Ended {
            how,
            answer: None,
            rss_peak_kib,
        }
    }

    fn failure(code: u8, busy: bool) -> Ended {
        let failure = Failure {
            code,
            busy,
            site: None,
            stage: None,
            file: None,
            text: "why".to_owned(),
        };
        Ended {
            answer: Some(Err(failure)),
            ..gone(How::Exited(i32::from(code)), 0)
        }
    }

    /// The state after an attempt with this number of earlier failures, the delay, and whether it counts.
    fn next(
        ended: &Ended,
        state: JobState,
        failures: i64,
        cancel: Option<CancelWhy>,
    ) -> (JobState, i64, bool) {
        let job = job(state, failures);
        let attempt = Fruitless {
            job: &job,
            ended,
            stage: Some("register/E02-00665"),
            memory_mib: 1000,
            cancel,
            retry_s: 30.0,
            now_ms: 0,
        };
        let (state, moved) = after(&attempt, Random::always(1.0));
        assert!(
            job.state.next().contains(&state),
            "{} -> {state}",
            job.state
        );
        (
            state,
            moved.not_before_ms.unwrap_or_default(),
            moved.counts_as_failure,
        )
    }

    #[test]
    fn input_and_output_is_tried_five_times_with_growing_delay() {
        let io = failure(6, false);
        let delays: Vec<i64> = (0..4)
            .map(|failures| {
                let (state, delay_ms, counts) = next(&io, JobState::Running, failures, None);
                assert!(state == JobState::Waiting && counts);
                delay_ms
            })
            .collect();
        assert_eq!(delays, [30_000, 60_000, 120_000, 240_000]);
        assert_eq!(next(&io, JobState::Running, 4, None).0, JobState::Failed);
    }

    #[test]
    fn crashes_are_tried_three_times_and_bugs_twice() {
        let crash = gone(How::Signalled(11), 0);
        let silent = gone(How::Silent, 0);
        for (how, last) in [(crash, 2), (silent, 2), (failure(1, false), 1)] {
            let before = next(&how, JobState::Running, last - 1, None);
            assert_eq!((before.0, before.2), (JobState::Waiting, true));
            let at_last = next(&how, JobState::Running, last, None);
            assert_eq!(at_last.0, JobState::Failed);
        }
    }

    #[test]
    fn what_only_another_input_can_mend_is_blocked() {
        for code in [2, 3, 4] {
            let blocked = next(&failure(code, false), JobState::Running, 0, None);
            assert_eq!(blocked.0, JobState::Blocked);
        }
    }

    #[test]
    fn what_is_nobodys_fault_does_not_count() {
        let busy = next(&failure(6, true), JobState::Running, 4, None);
        assert_eq!((busy.0, busy.2), (JobState::Waiting, false));
        let stopped = failure(130, false);
        let shutdown = next(&stopped, JobState::Running, 4, Some(CancelWhy::Shutdown));
        assert_eq!((shutdown.0, shutdown.2), (JobState::Queued, false));
        let other = gone(How::ForeignVersion("9".to_owned()), 0);
        let other = next(&other, JobState::Starting, 4, None);
        assert_eq!((other.0, other.2), (JobState::Waiting, false));
    }

    #[test]
    fn a_cancel_wins_and_a_deadline_fails() {
        for how in [failure(130, false), gone(How::Silent, 0), failure(6, false)] {
            let ended = next(&how, JobState::Cancelling, 0, Some(CancelWhy::User));
            assert_eq!(ended.0, JobState::Cancelled);
        }
        let late = Ended {
            how: How::DeadlinePassed,
            ..failure(130, false)
        };
        assert_eq!(next(&late, JobState::Running, 0, None).0, JobState::Failed);
    }

    #[test]
    fn a_worker_that_filled_its_memory_is_not_tried_again() {
        let job = job(JobState::Running, 0);
        let attempt = Fruitless {
            job: &job,
            ended: &gone(How::Signalled(9), 950 << 10),
            stage: None,
            memory_mib: 1000,
            cancel: None,
            retry_s: 30.0,
            now_ms: 0,
        };
        let (state, moved) = after(&attempt, Random::always(0.0));
        assert_eq!(state, JobState::Failed);
        let outcome = moved.outcome.unwrap().to_string();
        assert!(outcome.contains("memory_mib = 1000"), "{outcome}");
    }
}
