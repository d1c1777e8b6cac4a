//! Stop flag and progress counter of the long loops of a stage.

use std::{
    fmt,
    sync::atomic::{AtomicBool, AtomicU64, Ordering},
};

use crate::error::Stopped;

/// Progress of a stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Count {
    /// Items done.
    pub done: u64,
    /// Items in all; 0 if unknown.
    pub all: u64,
    /// Name of the items, in the plural.
    pub of: &'static str,
}

/// Counts the steps of one stage, on all threads, and reports each to a listener.
pub struct Counter<'a> {
    done: AtomicU64,
    all: AtomicU64,
    watcher: &'a (dyn Fn(Count) + Sync),
}

impl fmt::Debug for Counter<'_> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.debug_struct("Counter")
            .field("done", &self.done)
            .field("all", &self.all)
            .finish_non_exhaustive()
    }
}

impl<'a> Counter<'a> {
    /// A new counter.
    #[must_use]
    pub const fn new(watcher: &'a (dyn Fn(Count) + Sync)) -> Self {
        Self {
            done: AtomicU64::new(0),
            all: AtomicU64::new(0),
            watcher,
        }
    }
}

/// Checked by long loops before each part of their work, and informed after it. A counter is not an input: results do
/// not depend on it.
#[derive(Debug, Clone, Copy)]
pub struct Watch<'a> {
    stop: &'a AtomicBool,
    counter: Option<&'a Counter<'a>>,
}

/// Without a counter.
impl<'a> From<&'a AtomicBool> for Watch<'a> {
    fn from(stop: &'a AtomicBool) -> Self {
        Self {
            stop,
            counter: None,
        }
    }
}

impl<'a> Watch<'a> {
    /// A counter with the stop flag of the loops.
    #[must_use]
    pub const fn counted(stop: &'a AtomicBool, counter: &'a Counter<'a>) -> Self {
        Self {
            stop,
            counter: Some(counter),
        }
    }

    /// The stop flag.
    #[must_use]
    pub const fn stop(&self) -> &'a AtomicBool {
        self.stop
    }

    /// Called before a part of the work.
    ///
    /// # Errors
    /// [`Stopped`], once the flag is set.
    pub fn check(&self) -> Result<(), Stopped> {
        Stopped::check(self.stop)
    }

    /// Announces further items.
    pub fn announce(&self, more: usize) {
        if let Some(counter) = self.counter {
            counter.all.fetch_add(more as u64, Ordering::Relaxed);
        }
    }

    /// Reports items that are done; `of` is their name, in the plural.
    pub fn step(&self, by: u64, of: &'static str) {
        if let Some(counter) = self.counter {
            (counter.watcher)(Count {
                done: counter.done.fetch_add(by, Ordering::Relaxed) + by,
                all: counter.all.load(Ordering::Relaxed),
                of,
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    #[test]
    fn steps_are_reported_with_the_number_of_all() {
        let counts = Mutex::new(Vec::new());
        let watcher = |count: Count| counts.lock().unwrap().push((count.done, count.all));
        let (stop, counter) = (AtomicBool::new(false), Counter::new(&watcher));
        let watch = Watch::counted(&stop, &counter);
        watch.announce(3);
        watch.step(1, "shots");
        watch.announce(2);
        watch.step(4, "shots");
        assert_eq!(*counts.lock().unwrap(), [(1, 3), (5, 5)]);
        assert!(watch.check().is_ok());
        stop.store(true, Ordering::Relaxed);
        assert!(watch.check().is_err());
        // Without a listener nothing is counted.
        Watch::from(&stop).step(1, "shots");
        assert_eq!(counts.lock().unwrap().len(), 2);
    }
}
