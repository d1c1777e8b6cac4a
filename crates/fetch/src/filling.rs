//! Filling a folder: indexes, plan, transfers side by side, state.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError, atomic::AtomicBool},
    thread,
};

use crate::{
    answer::Made,
    archives::Archives,
    cache::{Cache, Indexes},
    client::Client,
    error::FetchError,
    examined::{examined, verified_by},
    folder::Folder,
    hashed::Hashed,
    outcome::{Done, Outcome, Standing},
    part::Part,
    plan::{
        FileKind, Plan, PlannedFile, Wish, find_images, plan_generic, plan_kernels, plan_pedr,
        plan_shots,
    },
    state::{Record, State, Verified},
    table,
    transfer::{Receiver, Wanted, publish},
};
use areograph_base::error::{Locate as _, Result};
use areograph_pds::shot_table::ode_pedr_heading;
use areograph_store::atomic;

/// A folder and the archives that fill it.
#[derive(Debug)]
pub struct Filling<'a> {
    archives: &'a Archives,
    folder: Folder,
    stop: &'a AtomicBool,
}

impl<'a> Filling<'a> {
    /// The folder `into`, which need not exist.
    ///
    /// # Errors
    /// The current folder is unknown.
    pub fn of(archives: &'a Archives, into: &Path, stop: &'a AtomicBool) -> Result<Self> {
        Ok(Self {
            archives,
            folder: Folder::at(into)?,
            stop,
        })
    }

    pub(crate) const fn folder(&self) -> &Folder {
        &self.folder
    }

    const fn cache(&self) -> Cache<'_> {
        Cache {
            archives: self.archives,
            folder: &self.folder,
        }
    }

    const fn receiver<'r>(&'r self, client: &'r Client) -> Receiver<'r> {
        Receiver {
            client,
            network: &self.archives.network,
            stop: self.stop,
        }
    }

    /// Indexes with which a wish is planned.
    #[must_use]
    pub fn indexes_of(wish: &Wish) -> Indexes {
        Indexes {
            kernels: wish.kernels.is_some(),
            generic: wish.generic.is_some(),
            pedr: wish.pedr.is_some(),
            images: !wish.images.is_empty(),
        }
    }

    /// Brings copies of indexes up to date; the number of those that have changed.
    ///
    /// # Errors
    /// [`FetchError`]; the folder cannot be written.
    pub fn refresh(&self, indexes: Indexes) -> Result<usize> {
        let _lock = self.folder.lock()?;
        let client = self.cache().client();
        self.cache().refresh(indexes, &self.receiver(&client))
    }

    /// The files that a wish needs, by the copies of the indexes: no archive is asked.
    ///
    /// # Errors
    /// [`FetchError::NoIndex`]; [`FetchError::Index`].
    pub fn plan(&self, wish: &Wish) -> Result<Plan> {
        let (cache, mut spans) = (self.cache(), wish.spans.clone());
        let mut plan = Plan::default();
        if !wish.images.is_empty() {
            let (images, of_images) =
                find_images(&wish.images, &cache.images()?, &self.archives.images);
            plan.add(images);
            spans.extend(of_images);
        }
        if let Some(kernels) = &wish.kernels {
            plan.add(plan_kernels(
                kernels,
                &spans,
                &cache.kernels()?,
                &self.archives.kernels,
            ));
        }
        if let Some(folder) = &wish.generic {
            let listed = cache.generic()?;
            plan.add(plan_generic(folder, &listed, &self.archives.generic));
        }
        if let Some(folder) = &wish.pedr {
            if spans.is_empty() && wish.orbits.is_empty() {
                plan.notes.push(
                    "pedr: no images, dates or orbits; give --dates or --orbits for laser files"
                        .to_owned(),
                );
            }
            let listed = cache.pedr()?;
            plan.add(plan_pedr(
                folder,
                &wish.orbits,
                &spans,
                &listed,
                &self.archives.pedr,
            ));
        }
        if !wish.shots.is_empty() {
            let state = State::read(&self.folder.state())?;
            let is_own = |file: &PlannedFile| {
                let is_begun = table::answer_of(&self.part_path(file)).exists();
                is_begun || state.files.contains_key(&self.folder.relative(&file.path))
            };
            plan.add(plan_shots(&wish.shots, &self.archives.shots, &is_own));
        }
        Ok(plan.in_order())
    }

    /// States of the files of a plan, without reading them.
    ///
    /// # Errors
    /// The state is malformed.
    pub fn standing(&self, plan: &Plan) -> Result<Vec<Standing>> {
        let state = State::read(&self.folder.state())?;
        Ok(plan
            .files
            .iter()
            .map(|file| self.standing_of(file, &state))
            .collect())
    }

    fn part_path(&self, file: &PlannedFile) -> PathBuf {
        self.folder.part(&file.url, &file.path)
    }

    /// The part of a file that an earlier attempt left.
    fn part_of(&self, file: &PlannedFile) -> Part {
        let path = self.part_path(file);
        let made = match file.kind {
            FileKind::Shots => Made::kept(&table::answer_of(&path), &file.url),
            FileKind::Kernel | FileKind::Pedr | FileKind::Image => None,
        };
        Part::at(path, made.as_ref().map_or(&file.url, |made| &made.url))
    }

    fn standing_of(&self, file: &PlannedFile, state: &State) -> Standing {
        let Ok(found) = file.path.metadata() else {
            let part = self.part_of(file);
            return match part.bytes() {
                0 => Standing::Missing,
                bytes => Standing::Begun(bytes),
            };
        };
        let exact = file.bytes.filter(|_| file.is_exact);
        match state.files.get(&self.folder.relative(&file.path)) {
            Some(record) if record.bytes != found.len() => Standing::Other,
            Some(record) if file.md5.as_ref().is_some_and(|md5| *md5 != record.md5) => {
                Standing::Other
            }
            Some(_) => Standing::Present,
            None if exact.is_some_and(|bytes| bytes != found.len()) => Standing::Other,
            None => Standing::Unknown,
        }
    }

    /// Fetches the files of a plan, some side by side; `told` is called for each. Other files continue after a failure.
    ///
    /// * `replace` – whether a file with different content is replaced
    ///
    /// # Errors
    /// [`FetchError::Busy`]; the folder or its state cannot be read or written. Failures of
    /// files are in their outcomes.
    pub fn fetch(
        &self,
        plan: &Plan,
        replace: bool,
        told: &(dyn Fn(&Outcome) + Sync),
    ) -> Result<Vec<Outcome>> {
        let _lock = self.folder.lock()?;
        let state = Mutex::new(State::read(&self.folder.state())?);
        let client = self.cache().client();
        let mut by_host: BTreeMap<&str, Vec<&PlannedFile>> = BTreeMap::new();
        for file in plan.files.iter().rev() {
            by_host.entry(host_of(&file.url)).or_default().push(file);
        }
        let outcomes = Mutex::new(Vec::with_capacity(plan.files.len()));
        thread::scope(|scope| {
            for files in by_host.into_values() {
                let connections = self.archives.network.connections_per_host as usize;
                let workers = connections.min(files.len());
                let queue = std::sync::Arc::new(Mutex::new(files));
                for _ in 0..workers {
                    let queue = std::sync::Arc::clone(&queue);
                    let (client, state, outcomes) = (&client, &state, &outcomes);
                    scope.spawn(move || {
                        while let Some(file) = locked(&queue).pop() {
                            let result = self.complete(file, client, state, replace);
                            let outcome = Outcome {
                                file: file.clone(),
                                result,
                            };
                            // Whether a box may be empty depends on the others of its window.
                            if !is_empty_box(&outcome) {
                                told(&outcome);
                            }
                            locked(outcomes).push(outcome);
                        }
                    });
                }
            }
        });
        let mut outcomes = outcomes
            .into_inner()
            .unwrap_or_else(PoisonError::into_inner);
        self.settle_empty_boxes(&mut outcomes, &state, told)?;
        outcomes.sort_by(|one, other| one.file.path.cmp(&other.file.path));
        Ok(outcomes)
    }

    /// Gives an empty box of a window whose other boxes have shots a table without rows, so that the window is complete.
    fn settle_empty_boxes(
        &self,
        outcomes: &mut [Outcome],
        state: &Mutex<State>,
        told: &(dyn Fn(&Outcome) + Sync),
    ) -> Result<()> {
        let whole = |outcome: &Outcome| Some(outcome.file.shot_box.as_ref()?.whole.clone());
        let filled = outcomes.iter().filter(|outcome| outcome.result.is_ok());
        let filled: BTreeSet<String> = filled.filter_map(whole).collect();
        for outcome in outcomes.iter_mut().filter(|outcome| is_empty_box(outcome)) {
            if whole(outcome).is_some_and(|whole| filled.contains(&whole)) {
                let file = &outcome.file;
                atomic::write(&file.path, ode_pedr_heading().as_bytes())?;
                let hashed = Hashed::of(&file.path)?;
                let record = Record::of(&file.url, hashed, Verified::Rows, &file.why);
                self.record(&self.folder.relative(&file.path), &record, state)?;
                outcome.result = Ok((Done::Empty, record));
            }
            told(outcome);
        }
        Ok(())
    }

    /// Makes one file complete and records it.
    fn complete(
        &self,
        file: &PlannedFile,
        client: &Client,
        state: &Mutex<State>,
        replace: bool,
    ) -> Result<(Done, Record)> {
        let name = self.folder.relative(&file.path);
        let known = locked(state).files.get(&name).cloned();
        let mut part = self.part_of(file);
        if file.path.symlink_metadata().is_ok() {
            let found = examined(file, known.as_ref(), &part, client, replace);
            match found {
                Ok(Some((done, record))) => {
                    if known.as_ref() != Some(&record) {
                        self.record(&name, &record, state)?;
                    }
                    self.discard(file, &mut part)?;
                    return Ok((done, record));
                }
                Ok(None) => {}
                Err(failure) if !replace => return Err(failure.in_file(&file.path)),
                Err(failure) => {
                    tracing::warn!("{}: {}; it is replaced", file.path.display(), failure.cause);
                }
            }
        }
        let wanted = Wanted {
            url: &file.url,
            path: &file.path,
            md5: file.md5.as_deref(),
            bytes: file.bytes.filter(|_| file.is_exact),
            is_page: false,
            replace,
        };
        let receiver = self.receiver(client);
        let (mut made_url, mut resumed) = (None, part.bytes());
        let hashed = if let Some(of) = &file.shot_box {
            let wish = table::Wish {
                file,
                box_deg: of.edges_deg,
                part: self.part_path(file),
                limit: self.archives.shots.limit(),
                replace,
            };
            let received = table::receive(&receiver, &wish).in_file(&file.path)?;
            (part, resumed, made_url) = (received.part, received.resumed, Some(received.url));
            received.hashed
        } else {
            receiver.receive(&wanted, &mut part).in_file(&file.path)?
        };
        let verified_by = verified_by(file, &part);
        publish(&wanted, &mut part, &hashed)?;
        let record = Record {
            made_url,
            ..Record::of(&file.url, hashed, verified_by, &file.why)
        };
        self.record(&name, &record, state)?;
        self.discard(file, &mut part)?;
        Ok((Done::Fetched { resumed }, record))
    }

    /// Removes the part of a complete file, and the answer that it came from.
    fn discard(&self, file: &PlannedFile, part: &mut Part) -> Result<()> {
        part.discard()?;
        table::forget(&self.part_path(file))
    }

    fn record(&self, name: &str, record: &Record, state: &Mutex<State>) -> Result<()> {
        let mut state = locked(state);
        state.files.insert(name.to_owned(), record.clone());
        state.write(&self.folder.state())
    }
}

/// Whether the service has no shot in the box of a table.
fn is_empty_box(outcome: &Outcome) -> bool {
    let failure = outcome.result.as_ref().err();
    let cause = failure.and_then(|failure| {
        let cause: &dyn std::error::Error = &*failure.cause;
        cause.downcast_ref()
    });
    matches!(cause, Some(FetchError::NoShots { .. }))
}

/// Scheme and host of an address.
pub(crate) fn host_of(url: &str) -> &str {
    let start = url.find("://").map_or(0, |at| at + 3);
    let end = url[start..].find('/').map_or(url.len(), |at| start + at);
    &url[..end]
}

fn locked<T>(of: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}
