//! A service with simulated workers: kernels are texts in memory, a product is a list of a site's inputs, and the clock
//! is set by the test. Workers die on request.
#![allow(dead_code, reason = "each test program uses a part of this module")]
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

mod work;

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex,
        atomic::{AtomicU64, Ordering},
    },
    time::Duration,
};

use areograph_base::error::Error;
use areograph_config::{Document as _, ServiceConfig};
use areograph_service::{
    clock::Clock,
    database::{Database, Job, JobFilter, jobs},
    engine::Engine,
    lock::ServiceLock,
    random::Random,
    shared::Shared,
    start::start,
    state::JobState,
};
use areograph_store::files::Identity;
use tokio::runtime::Runtime;

pub(crate) use work::Played;

/// How a simulated worker ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Fate {
    /// It does its work.
    Works,
    /// It dies before it has done anything.
    DiesEarly,
    /// It dies when the products are published, before the run is kept.
    DiesPublished,
    /// It dies when the run is kept, before it can answer.
    DiesUnheard,
    /// The disk fails.
    Io,
    /// It goes on until it is stopped.
    Lasts,
}

/// Files, and the fates of workers.
#[derive(Debug)]
pub(crate) struct World {
    folder: tempfile::TempDir,
    files: Mutex<BTreeMap<String, (String, Identity)>>,
    inodes: AtomicU64,
    away: Mutex<Vec<String>>,
    /// Fates of the next workers of sites, the last one first; then they work.
    pub(crate) fates: Mutex<Vec<Fate>>,
    /// Permanent fate of the workers of one site.
    pub(crate) fate_of: Mutex<BTreeMap<String, Fate>>,
    /// How many of the next workers that open kernels are lost without a reason in the kernels.
    pub(crate) lost: AtomicU64,
    /// Every run that was kept: its job and attempt.
    pub(crate) kept: Mutex<Vec<(i64, i64)>>,
    /// Every started worker, by its purpose.
    pub(crate) started: Mutex<Vec<String>>,
    pub(crate) clock: Clock,
    more: String,
}

impl World {
    /// A world at `now_ms`; `more` is added to the configuration of the folders.
    pub(crate) fn new(now_ms: i64, more: &str) -> Arc<Self> {
        let folder = tempfile::tempdir().unwrap();
        for name in ["sites", "kernels", "data"] {
            fs::create_dir(folder.path().join(name)).unwrap();
        }
        let world = Arc::new(Self {
            folder,
            files: Mutex::default(),
            inodes: AtomicU64::new(1),
            away: Mutex::default(),
            fates: Mutex::default(),
            fate_of: Mutex::default(),
            lost: AtomicU64::new(0),
            kept: Mutex::default(),
            started: Mutex::default(),
            clock: Clock::set_to(now_ms),
            more: more.to_owned(),
        });
        world.put("data/remarks.txt", "no inputs");
        world
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn config(&self) -> ServiceConfig {
        let text = format!(
            "[inputs]\nsites = [\"sites\"]\nkernels = [\"kernels\"]\ndata = [\"data\"]\n{}",
            self.more
        );
        ServiceConfig::parse(&text, &self.path("areograph.toml"))
            .unwrap()
            .config
    }

    fn key(&self, name: &str) -> String {
        self.path(name).to_str().unwrap().to_owned()
    }

    /// Writes a file now.
    pub(crate) fn put(&self, name: &str, text: &str) {
        let changed_ms = self.clock.now_ms();
        let changed = [
            changed_ms.div_euclid(1000),
            changed_ms.rem_euclid(1000) * 1_000_000,
        ];
        let identity = Identity {
            device: 1,
            inode: self.inodes.fetch_add(1, Ordering::SeqCst),
            bytes: text.len() as u64,
            // Mirrors set old times on new files.
            modified: [1_000_000_000, 0],
            changed,
        };
        self.files
            .lock()
            .unwrap()
            .insert(self.key(name), (text.to_owned(), identity));
        if name.starts_with("sites/") {
            fs::write(self.path(name), text).unwrap();
        }
    }

    pub(crate) fn remove(&self, name: &str) {
        self.files.lock().unwrap().remove(&self.key(name));
    }

    pub(crate) fn text(&self, name: &str) -> Option<String> {
        self.at(&self.path(name))
    }

    /// The content of a file, by its path.
    fn at(&self, path: &Path) -> Option<String> {
        let files = self.files.lock().unwrap();
        let away = self.away.lock().unwrap();
        let gone = away.iter().any(|root| path.starts_with(root));
        let found = files.get(path.to_str().unwrap()).filter(|_| !gone);
        found.map(|(text, _)| text.clone())
    }

    /// Removes a folder, or restores it.
    pub(crate) fn mount(&self, name: &str, there: bool) {
        let mut away = self.away.lock().unwrap();
        away.retain(|root| *root != self.key(name));
        if !there {
            away.push(self.key(name));
        }
    }

    /// A site that reads these kernels.
    pub(crate) fn site(&self, name: &str, kernels: &[&str]) {
        let files: Vec<String> = kernels
            .iter()
            .map(|kernel| format!("\"../kernels/{kernel}\""))
            .collect();
        let text = format!(
            "site = \"{name}\"\n[kernels]\nfiles = [{}]\n",
            files.join(", ")
        );
        self.put(&format!("sites/{name}.toml"), &text);
    }

    /// Advances the clock.
    pub(crate) fn later(&self, seconds: i64) {
        self.clock.set(self.clock.now_ms() + seconds * 1000);
    }

    /// The publication of a clean run of a site at present.
    pub(crate) fn clean(&self, site: &str) -> Option<String> {
        work::product(self, &self.path(&format!("sites/{site}.toml"))).ok()
    }

    /// The current products of a site.
    pub(crate) fn current(&self, site: &str) -> Option<String> {
        fs::read_to_string(self.path(&format!("products/{site}/current/product.txt"))).ok()
    }

    pub(crate) fn started(&self, what: &str) -> usize {
        let started = self.started.lock().unwrap();
        started
            .iter()
            .filter(|subject| subject.starts_with(what))
            .count()
    }
}

/// A running service in a world.
pub(crate) struct Life {
    pub(crate) shared: Arc<Shared>,
    pub(crate) engine: Arc<Engine<Played>>,
    pub(crate) runtime: Option<Runtime>,
    /// Of a service that started as a process does.
    lock: Option<ServiceLock>,
}

impl Life {
    pub(crate) fn begin(world: &Arc<World>) -> Self {
        let config = world.config();
        let database = Database::open(&config.outputs.state).unwrap();
        let clock = world.clock.clone();
        let shared = Shared::new(config, database, clock, PathBuf::new()).unwrap();
        Self::of(world, shared, None)
    }

    /// Starts as a process does, with all checks of the state folder and of the products.
    pub(crate) fn start(world: &Arc<World>) -> Result<Self, Error> {
        let started = start(world.config(), "serve", world.clock.clone())?;
        Ok(Self::of(world, started.shared, Some(started.lock)))
    }

    fn of(world: &Arc<World>, shared: Shared, lock: Option<ServiceLock>) -> Self {
        let shared = Arc::new(shared);
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .enable_all()
            .build()
            .unwrap();
        let workers = Played(Arc::clone(world));
        let engine = Engine::new(Arc::clone(&shared), workers, Random::always(0.5)).unwrap();
        Self {
            shared,
            engine: Arc::new(engine),
            runtime: Some(runtime),
            lock,
        }
    }

    /// One turn; its tasks continue.
    pub(crate) fn turn(&self) {
        let runtime = self.runtime.as_ref().unwrap();
        runtime.block_on(async { self.engine.turn().unwrap() });
    }

    /// Repeats turns until no task is in progress and nothing is due.
    pub(crate) fn settle(&self) {
        for _ in 0..20_000 {
            self.turn();
            if self.engine.is_idle() {
                return;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        panic!("no end: {:?}", self.jobs());
    }

    /// Polls repeatedly at intervals of `seconds`.
    pub(crate) fn go_on(&self, world: &World, seconds: i64, times: usize) {
        for _ in 0..times {
            world.later(seconds);
            self.settle();
        }
    }

    /// The service ends at this moment, without warning.
    pub(crate) fn kill(mut self) {
        let runtime = self.runtime.take().unwrap();
        runtime.shutdown_timeout(Duration::from_secs(20));
    }

    /// All jobs, the oldest first.
    pub(crate) fn jobs(&self) -> Vec<Job> {
        let all = self
            .shared
            .read(|connection| jobs(connection, &JobFilter::default(), 100_000));
        all.unwrap().into_iter().rev().collect()
    }

    /// Sites and states of all jobs, the oldest first.
    pub(crate) fn states(&self) -> Vec<(String, JobState)> {
        let jobs = self.jobs().into_iter();
        jobs.map(|job| (job.site, job.state)).collect()
    }

    /// The answer to a database query, row by row, columns as text.
    pub(crate) fn ask(&self, question: &str) -> Vec<String> {
        let asked = self.shared.read(|connection| {
            let mut query = connection.prepare(question)?;
            let rows = query.query_map([], |row| row.get::<_, String>(0))?;
            Ok(rows.collect::<Result<_, _>>()?)
        });
        asked.unwrap()
    }
}
