//! Turns of the engine: all that is due at an instant is begun.

use std::{
    future::Future,
    sync::{
        Arc, Mutex, MutexGuard,
        atomic::{AtomicU64, Ordering},
    },
    time::Duration,
};

use tokio::{
    sync::Mutex as AsyncMutex,
    task::yield_now,
    time::{sleep, timeout},
};
use tokio_util::task::TaskTracker;

use super::{
    adopt::adopt,
    agenda::{Agenda, lock, patience_ms},
    attempt::{AtWork, follow, take},
    core::Core,
    diffs::compare_all,
    disk::{give_up_reserve, has_room, is_full},
    fetch::fetch_all,
    fresh::tell_stale,
    hooks::deliver,
    nights::{begin_due, begin_requested, end_done},
    retention::{copy_database, remove_runs, trim},
    retry::milliseconds,
    round::{Purpose, round},
    scrub::{scrub_files, scrub_products, scrub_runs},
    sites::SiteBook,
    workers::Workers,
};
use crate::{
    database::{
        Moved, Stored, advance,
        alerts::due_notifications,
        due_waiting,
        files::any_settling,
        jobs_in,
        nights::{Night, night, open_night},
        service::beat,
    },
    random::Random,
    recover::recover,
    shared::Shared,
    state::JobState,
    worker::protocol::CancelWhy,
};
use areograph_base::error::{Locate as _, Result};

/// Longest time between two turns.
const POLL_INTERVAL_MAX: Duration = Duration::from_secs(1);
/// Longest time for a graceful end.
const END_WITHIN: Duration = Duration::from_secs(23);
/// Time between two checks of the disks, freshness and retention; and between two cleanups.
const UPKEEP_MS: i64 = 30_000;
const TRIM_MS: i64 = 3_600_000;

/// The engine of a service.
#[derive(Debug)]
pub struct Engine<W> {
    core: Arc<Core<W>>,
    at_work: Arc<AtWork>,
    book: Arc<AsyncMutex<SiteBook>>,
    tasks: TaskTracker,
    agenda: Arc<Mutex<Agenda>>,
    turns: AtomicU64,
}

impl<W: Workers> Engine<W> {
    /// Creates the engine of a service, after adoption of an earlier one's state. A lost database is first rebuilt
    /// from the products.
    ///
    /// # Errors
    /// The database or the folders of state and products cannot be read or written.
    pub fn new(shared: Arc<Shared>, workers: W, random: Random) -> Result<Self> {
        let state = shared.config().outputs.state.clone();
        recover(&shared)?;
        let core = Arc::new(Core::new(shared, workers, random)?);
        adopt(&core)?;
        let open = core.shared.read(open_night).in_file(&state)?;
        let agenda = Agenda {
            night: open.as_ref().map(|night| night.id),
            to_fetch: open.is_some(),
            to_compare: true,
            has_room: true,
            ..Agenda::default()
        };
        Ok(Self {
            core,
            at_work: Arc::new(AtWork::default()),
            book: Arc::new(AsyncMutex::new(SiteBook::default())),
            tasks: TaskTracker::new(),
            agenda: Arc::new(Mutex::new(agenda)),
            turns: AtomicU64::new(0),
        })
    }

    /// Repeats turns until the service ends, then stops current work.
    pub async fn run(&self) {
        let shared = &self.core.shared;
        while !shared.ending.is_cancelled() {
            self.try_turn();
            let poll = Duration::from_secs_f64(shared.config().changes.scan_interval_s);
            tokio::select! {
                () = shared.wake.notified() => {}
                () = sleep(poll.min(POLL_INTERVAL_MAX)) => {}
                () = shared.ending.cancelled() => {}
            }
        }
        self.stop().await;
    }

    /// Asks all workers to stop, and waits for them; their attempts do not count.
    pub async fn stop(&self) {
        self.at_work.cancel_all(CancelWhy::Shutdown);
        self.tasks.close();
        if timeout(END_WITHIN, self.tasks.wait()).await.is_err() {
            tracing::warn!("some workers did not stop in time");
        }
    }

    /// A turn; failures are reported, and the next turn retries.
    fn try_turn(&self) {
        match self.turn() {
            Ok(()) => {}
            Err(error) => {
                tracing::error!("{error}");
                if is_full(&error) {
                    give_up_reserve(&self.core.shared.config().outputs.state);
                }
            }
        }
    }

    /// Number of turns, as a heartbeat.
    #[must_use]
    pub fn turns(&self) -> u64 {
        self.turns.load(Ordering::Relaxed)
    }

    /// Whether no work begun by a turn is in progress.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.tasks.is_empty()
    }

    /// Begins a night now, independent of the schedule, and returns its number. It waits for settling files, since no
    /// later poll follows.
    ///
    /// # Errors
    /// The database cannot be written.
    pub fn begin_night(&self) -> Stored<Option<i64>> {
        let night = begin_requested(&self.core)?;
        let changes = &self.core.shared.config().changes;
        let until_ms = self.core.now_ms().saturating_add(patience_ms(changes, 0.0));
        self.agenda().begin(night, Some(until_ms));
        Ok(night)
    }

    /// A night by its number.
    ///
    /// # Errors
    /// The database cannot be read.
    pub fn night(&self, id: i64) -> Stored<Option<Night>> {
        self.core.shared.read(|connection| night(connection, id))
    }

    /// Begins all that is due.
    ///
    /// # Errors
    /// The database cannot be read or written; what was not begun is due at the next turn.
    pub fn turn(&self) -> Stored<()> {
        self.turns.fetch_add(1, Ordering::Relaxed);
        self.move_jobs()?;
        self.see_to_nights()?;
        self.see_to_fetch();
        self.see_to_round();
        self.see_to_upkeep()?;
        self.see_to_jobs()?;
        self.see_to_comparisons();
        self.see_to_products();
        self.see_to_notifications()
    }

    /// Queues jobs after their waiting time; notifies workers whose jobs are to be cancelled.
    fn move_jobs(&self) -> Stored<()> {
        let now_ms = self.core.now_ms();
        let (waited, cancelling) = self.core.shared.read(|connection| {
            Ok((
                due_waiting(connection, now_ms)?,
                jobs_in(connection, JobState::Cancelling)?,
            ))
        })?;
        for job in cancelling {
            self.at_work.cancel(job.id, CancelWhy::User);
        }
        if waited.is_empty() {
            return Ok(());
        }
        self.core.shared.write(|transaction| {
            // Read again: a request or an ended attempt may have queued some of them since.
            for job in due_waiting(transaction, now_ms)? {
                advance(
                    transaction,
                    now_ms,
                    job.id,
                    JobState::Queued,
                    &Moved::default(),
                )?;
            }
            Ok(())
        })
    }

    fn see_to_nights(&self) -> Stored<()> {
        let (night, compared) = {
            let agenda = self.agenda();
            (agenda.night, agenda.compared)
        };
        match night {
            None => {
                let due = begin_due(&self.core)?;
                self.agenda().begin(due, None);
            }
            Some(night) if compared => {
                if end_done(&self.core, night)?.is_some() {
                    {
                        let mut agenda = self.agenda();
                        (agenda.night, agenda.to_scrub) = (None, true);
                    }
                    copy_database(&self.core)?;
                }
            }
            Some(_) => {}
        }
        Ok(())
    }

    /// A night begins with files of archives, where the service is configured to fetch them.
    fn see_to_fetch(&self) {
        if !self
            .agenda()
            .begin_fetch(self.core.shared.config().fetch.nightly)
        {
            return;
        }
        let (agenda, core) = (Arc::clone(&self.agenda), Arc::clone(&self.core));
        let fetches = |core: Arc<Core<W>>| async move { fetch_all(&core).await };
        self.spawn(fetches, move |_| {
            let changes = &core.shared.config().changes;
            let patience_ms = patience_ms(changes, 3.0 * changes.sweep_limit_s);
            lock(&agenda).end_fetch(core.now_ms(), patience_ms);
        });
    }

    /// One round at a time; a night does not wait for the next one.
    fn see_to_round(&self) {
        let now_ms = self.core.now_ms();
        let poll_ms = milliseconds(self.core.shared.config().changes.scan_interval_s);
        let purpose = {
            let mut agenda = self.agenda();
            let night = agenda
                .night
                .filter(|_| !agenda.compared && !agenda.to_fetch);
            // A clock that was set back does not delay it.
            let since_ms = agenda.round_ms.map(|last_ms| now_ms - last_ms);
            let is_due = since_ms.is_none_or(|since_ms| since_ms < 0 || since_ms >= poll_ms);
            if agenda.round || !(is_due || (night.is_some() && !agenda.comparing)) {
                return;
            }
            agenda.round = true;
            agenda.comparing = night.is_some();
            agenda.round_ms = Some(now_ms);
            Purpose { night }
        };
        let (book, agenda) = (Arc::clone(&self.book), Arc::clone(&self.agenda));
        let compares = move |core: Arc<Core<W>>| async move {
            let done = round(&core, &mut *book.lock().await, purpose).await;
            if let Err(error) = &done {
                tracing::error!("a round of comparisons failed: {error}");
            }
            let settles = core.shared.read(any_settling).unwrap_or(false);
            (done.is_ok(), settles, core.now_ms())
        };
        self.spawn(compares, move |done| {
            let mut agenda = lock(&agenda);
            agenda.round = false;
            let (well, settles, now_ms) = done.unwrap_or_default();
            let until_ms = agenda.settles_until_ms;
            let waits = settles && until_ms.is_some_and(|until_ms| now_ms < until_ms);
            if purpose.night.is_some() && well && !waits {
                agenda.compared = true;
            }
        });
    }

    fn see_to_upkeep(&self) -> Stored<()> {
        let now_ms = self.core.now_ms();
        let is_due = |last_ms: Option<i64>, after_ms| {
            last_ms.is_none_or(|last_ms| now_ms < last_ms || now_ms - last_ms >= after_ms)
        };
        let (due, trims) = {
            let agenda = self.agenda();
            (
                !agenda.upkeep && is_due(agenda.upkeep_ms, UPKEEP_MS),
                is_due(agenda.trim_ms, TRIM_MS),
            )
        };
        if !due {
            return Ok(());
        }
        let room = has_room(&self.core)?;
        let config = self.core.shared.config();
        self.core.shared.write(|transaction| {
            beat(transaction, now_ms)?;
            tell_stale(transaction, &config, now_ms)
        })?;
        {
            let mut agenda = self.agenda();
            agenda.has_room = room;
            agenda.upkeep = true;
            agenda.upkeep_ms = Some(now_ms);
            if trims {
                agenda.trim_ms = Some(now_ms);
            }
        }
        let agenda = Arc::clone(&self.agenda);
        let keeps = move |core: Arc<Core<W>>| async move {
            if let Err(error) = upkeep(&core, trims).await {
                tracing::error!("upkeep failed: {error}");
            }
        };
        self.spawn(keeps, move |_| lock(&agenda).upkeep = false);
        Ok(())
    }

    fn see_to_jobs(&self) -> Stored<()> {
        if !self.agenda().has_room || self.core.shared.ending.is_cancelled() {
            return Ok(());
        }
        while let Some(taken) = take(&self.core, &self.at_work)? {
            let (at_work, job) = (Arc::clone(&self.at_work), taken.job());
            let agenda = Arc::clone(&self.agenda);
            let follows = |core: Arc<Core<W>>| follow(core, taken);
            self.spawn(follows, move |run| {
                at_work.leave(job);
                lock(&agenda).to_compare |= run.flatten().is_some();
            });
        }
        Ok(())
    }

    /// New runs are compared with their predecessors, one after the other.
    fn see_to_comparisons(&self) {
        {
            let mut agenda = self.agenda();
            if !agenda.to_compare || agenda.comparison {
                return;
            }
            (agenda.to_compare, agenda.comparison) = (false, true);
        }
        let agenda = Arc::clone(&self.agenda);
        self.spawn(compare_runs, move |_| lock(&agenda).comparison = false);
    }

    /// After a night, products are read again.
    fn see_to_products(&self) {
        {
            let mut agenda = self.agenda();
            if !agenda.to_scrub || agenda.scrub {
                return;
            }
            (agenda.to_scrub, agenda.scrub) = (false, true);
        }
        let agenda = Arc::clone(&self.agenda);
        let scrubs = |core: Arc<Core<W>>| async move {
            if let Err(error) = scrub_runs(&core).await {
                tracing::error!("reading products again failed: {error}");
            }
        };
        self.spawn(scrubs, move |_| lock(&agenda).scrub = false);
    }

    fn see_to_notifications(&self) -> Stored<()> {
        let now_ms = self.core.now_ms();
        let due = self
            .core
            .shared
            .read(|connection| due_notifications(connection, now_ms, 1))?;
        if due.is_empty() || std::mem::replace(&mut self.agenda().notifications, true) {
            return Ok(());
        }
        let agenda = Arc::clone(&self.agenda);
        let delivers = |core: Arc<Core<W>>| async move {
            if let Err(error) = deliver(&core).await {
                tracing::error!("hooks failed: {error}");
            }
        };
        self.spawn(delivers, move |_| lock(&agenda).notifications = false);
        Ok(())
    }

    /// Begins long work; its result, even a panic, is passed to `end`, and another turn follows.
    fn spawn<T, F>(
        &self,
        task: impl FnOnce(Arc<Core<W>>) -> F,
        end: impl FnOnce(Option<T>) + Send + 'static,
    ) where
        T: Send + 'static,
        F: Future<Output = T> + Send + 'static,
    {
        let core = Arc::clone(&self.core);
        let work = tokio::spawn(task(Arc::clone(&self.core)));
        self.tasks.spawn(async move {
            let done = work.await;
            if let Err(panicked) = &done {
                tracing::error!("{panicked}");
            }
            end(done.ok());
            core.shared.wake.notify_one();
        });
    }

    fn agenda(&self) -> MutexGuard<'_, Agenda> {
        lock(&self.agenda)
    }
}

async fn compare_runs<W: Workers>(core: Arc<Core<W>>) {
    if let Err(error) = compare_all(&core).await {
        tracing::error!("comparing runs failed: {error}");
    }
}

async fn upkeep<W: Workers>(core: &Arc<Core<W>>, trims: bool) -> Stored<()> {
    while remove_runs(core)? {
        yield_now().await;
    }
    scrub_files(core).await?;
    scrub_products(core).await?;
    if trims {
        trim(core)?;
    }
    Ok(())
}
