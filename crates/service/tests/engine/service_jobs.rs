//! The table of jobs under random histories of requests, transitions and cancellations: its invariants hold.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests may fail loudly"
)]

use std::collections::BTreeMap;

use areograph_service::{
    database::{
        CauseKind, CauseRow, Database, DatabaseError, Job, JobFilter, JobRequest, Moved, Priority,
        advance, causes, enqueue, give_back, job, jobs, next_queued, request_cancel,
    },
    state::JobState,
};
use proptest::{
    prelude::{Strategy, any, prop_oneof},
    test_runner::{Config, TestRunner},
};

const SITES: [&str; 3] = ["eos", "gusev", "isidis"];
const STEPS: usize = 60;
const HISTORIES: u32 = 64;

/// A random event.
#[derive(Debug, Clone)]
enum Step {
    Request(usize, u8, bool),
    Take(bool),
    /// A job, by its place among all, is sent to a state.
    Send(usize, usize, bool),
    Cancel(usize),
    Later(u32),
}

fn step() -> impl Strategy<Value = Step> {
    prop_oneof![
        (0..SITES.len(), 0..4_u8, any::<bool>())
            .prop_map(|(site, class, ready)| Step::Request(site, class, ready)),
        any::<bool>().prop_map(Step::Take),
        (any::<usize>(), 0..JobState::ALL.len(), any::<bool>())
            .prop_map(|(job, state, counts)| Step::Send(job, state, counts)),
        any::<usize>().prop_map(Step::Cancel),
        (0..7_200_000_u32).prop_map(Step::Later),
    ]
}

fn priority(class: u8) -> Priority {
    [
        Priority::Backfill,
        Priority::Scheduled,
        Priority::Changed,
        Priority::Requested,
    ][usize::from(class)]
}

struct Table {
    database: Database,
    _folder: tempfile::TempDir,
    now_ms: i64,
    /// How each job ended, once it has.
    ended: BTreeMap<i64, JobState>,
}

impl Table {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        Self {
            database: Database::open(folder.path()).unwrap(),
            _folder: folder,
            now_ms: 0,
            ended: BTreeMap::new(),
        }
    }

    fn all(&self) -> Vec<Job> {
        let all =
            |connection: &rusqlite::Connection| jobs(connection, &JobFilter::default(), 10_000);
        self.database.read(all).unwrap()
    }

    fn act(&mut self, step: &Step) {
        let now_ms = self.now_ms;
        let all = self.all();
        let pick = |place: usize| (!all.is_empty()).then(|| all[place % all.len()].clone());
        match step {
            Step::Later(ms) => self.now_ms += i64::from(*ms),
            Step::Request(site, class, ready) => self.ask(SITES[*site], priority(*class), *ready),
            Step::Take(backfill) => {
                let next = self
                    .database
                    .read(|connection| next_queued(connection, now_ms, *backfill))
                    .unwrap();
                if let Some(next) = next {
                    assert!(next.not_before_ms <= now_ms);
                    assert!(*backfill || next.priority != Priority::Backfill);
                    assert!(
                        all.iter()
                            .all(|job| job.site != next.site || !job.state.is_active())
                    );
                    self.send(&next, JobState::Starting, false);
                }
            }
            Step::Send(place, state, counts) => {
                if let Some(job) = pick(*place) {
                    self.send(&job, JobState::ALL[*state], *counts);
                }
            }
            Step::Cancel(place) => {
                if let Some(found) = pick(*place) {
                    let to = self
                        .database
                        .write(|transaction| request_cancel(transaction, now_ms, found.id))
                        .unwrap()
                        .unwrap();
                    let expected = match found.state {
                        state if state.is_final() => state,
                        state if state.is_active() => JobState::Cancelling,
                        _ => JobState::Cancelled,
                    };
                    assert_eq!(to, expected);
                }
            }
        }
    }

    fn ask(&self, site: &str, class: Priority, ready: bool) {
        let now_ms = self.now_ms;
        let before = self
            .all()
            .into_iter()
            .find(|job| job.site == site && is_pending(job.state));
        let cause = CauseRow::plain(CauseKind::KernelChanged, &format!("at {now_ms}"), now_ms);
        let asked = JobRequest {
            site,
            priority: class,
            force: false,
            night: None,
            asked_by: None,
            ready,
            causes: &[cause],
        };
        let asked = self
            .database
            .write(|transaction| enqueue(transaction, now_ms, &asked))
            .unwrap();
        assert_eq!(
            asked.joined.then_some(asked.job),
            before.as_ref().map(|job| job.id)
        );
        let (now, why) = self
            .database
            .read(|connection| Ok((job(connection, asked.job)?, causes(connection, asked.job)?)))
            .unwrap();
        let now = now.unwrap();
        assert!(now.priority >= class && !why.is_empty());
        let Some(before) = before else {
            let first = if ready {
                JobState::Queued
            } else {
                JobState::Held
            };
            assert_eq!(now.state, first);
            return;
        };
        let wakes = class >= Priority::Changed
            && matches!(before.state, JobState::Blocked | JobState::Waiting);
        if wakes {
            assert!(matches!(now.state, JobState::Queued | JobState::Held));
            assert_eq!((now.failures, now.not_before_ms), (0, 0));
        }
    }

    /// A transition that is not in the table is rejected and changes nothing.
    fn send(&self, found: &Job, to: JobState, counts: bool) {
        let now_ms = self.now_ms;
        // Two pending or two active jobs of one site: the database rejects what the engine never requests.
        let others = self
            .all()
            .into_iter()
            .filter(|job| job.site == found.site && job.id != found.id);
        let doubled = others.into_iter().any(|job| {
            (job.state.is_active() && to.is_active()) || (is_pending(job.state) && is_pending(to))
        });
        let moved = Moved {
            counts_as_failure: counts,
            ..Moved::default()
        };
        let back = found.state.is_active() && is_pending(to);
        let mut others = self.all().into_iter();
        let waits = others.find(|job| job.site == found.site && is_pending(job.state));
        let sent = self.database.write(|transaction| {
            if back {
                give_back(transaction, now_ms, found.id, to, &moved)
            } else {
                advance(transaction, now_ms, found.id, to, &moved)
            }
        });
        let now = self
            .database
            .read(|connection| job(connection, found.id))
            .unwrap()
            .unwrap();
        if let Some(waits) = waits.filter(|_| back && now != *found) {
            sent.unwrap();
            assert_eq!((now.state, now.failures), (JobState::Queued, 0));
            assert!(now.priority >= waits.priority);
            return;
        }
        match sent {
            Ok(()) => {
                assert!(found.state.next().contains(&to));
                assert_eq!(now.state, to);
                assert_eq!(now.failures, found.failures + i64::from(counts));
                assert_eq!(
                    now.attempt,
                    found.attempt + i64::from(to == JobState::Starting)
                );
            }
            Err(DatabaseError::Transition(wrong)) => {
                assert!(!found.state.next().contains(&to));
                assert_eq!(
                    (wrong.job, wrong.from, wrong.to),
                    (found.id, found.state, to)
                );
                assert_eq!(now, *found);
            }
            Err(DatabaseError::Sqlite(_)) => {
                assert!(doubled, "{} -> {to}", found.state);
                assert_eq!(now, *found);
            }
            Err(error) => panic!("{error}"),
        }
    }

    /// Invariants.
    fn check(&mut self) {
        let mut active: BTreeMap<String, usize> = BTreeMap::new();
        let mut pending = active.clone();
        for job in self.all() {
            *active.entry(job.site.clone()).or_default() += usize::from(job.state.is_active());
            *pending.entry(job.site.clone()).or_default() += usize::from(is_pending(job.state));
            assert_eq!(job.ended_ms.is_some(), job.state.is_final(), "{job:?}");
            let state = job.state;
            if let Some(before) = self.ended.get(&job.id) {
                assert_eq!(*before, state, "an end was changed");
            }
            if state.is_final() {
                self.ended.insert(job.id, state);
            }
        }
        for counts in [active, pending] {
            assert!(counts.values().all(|count| *count <= 1), "{counts:?}");
        }
    }
}

fn is_pending(state: JobState) -> bool {
    !state.is_final() && !state.is_active()
}

#[test]
fn random_histories_keep_one_job_a_site_and_every_end() {
    let mut runner = TestRunner::new(Config {
        cases: HISTORIES,
        failure_persistence: None,
        ..Config::default()
    });
    let histories = proptest::collection::vec(step(), 1..STEPS);
    runner
        .run(&histories, |history| {
            let mut table = Table::new();
            for step in &history {
                table.act(step);
                table.check();
            }
            Ok(())
        })
        .unwrap();
}

#[test]
fn a_job_rises_by_a_class_an_hour_so_that_none_starves() {
    let mut table = Table::new();
    table.ask("eos", Priority::Backfill, true);
    table.now_ms = 2 * 3_600_000 + 1;
    table.ask("gusev", Priority::Scheduled, true);
    let next = |table: &Table, backfill| {
        let now_ms = table.now_ms;
        let next = table
            .database
            .read(|connection| next_queued(connection, now_ms, backfill));
        next.unwrap().map(|job| job.site)
    };
    assert_eq!(next(&table, true).as_deref(), Some("eos"));
    assert_eq!(next(&table, false).as_deref(), Some("gusev"));
    table.ask("isidis", Priority::Requested, true);
    assert_eq!(next(&table, true).as_deref(), Some("isidis"));
}
