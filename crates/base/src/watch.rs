//! What the long loops of a stage look at, and what they count for whoever watches them.

use std::{
    fmt,
    sync::atomic::{AtomicBool, AtomicU64, Ordering},
};

use crate::error::Stopped;

/// How far a stage is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Count {
    /// Things done.
    pub done: u64,
    /// Things in all; 0 where nobody knows.
    pub all: u64,
    /// What they are, in the plural.
    pub of: &'static str,
}

/// Counts the steps of one stage, on all threads, and tells each to whoever listens.
pub struct Counter<'a> {
    done: AtomicU64,
    all: AtomicU64,
    tell: &'a (dyn Fn(Count) + Sync),
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
    /// One that begins.
    #[must_use]
    pub const fn new(tell: &'a (dyn Fn(Count) + Sync)) -> Self {
        Self {
            done: AtomicU64::new(0),
            all: AtomicU64::new(0),
            tell,
        }
    }
}

/// What long loops look at before each part of their work, and tell after it. A counter is no input: what is computed
/// does not depend on it.
#[derive(Debug, Clone, Copy)]
pub struct Watch<'a> {
    stop: &'a AtomicBool,
    counter: Option<&'a Counter<'a>>,
}

/// Nobody counts.
impl<'a> From<&'a AtomicBool> for Watch<'a> {
    fn from(stop: &'a AtomicBool) -> Self {
        Self {
            stop,
            counter: None,
        }
    }
}

impl<'a> Watch<'a> {
    /// A counter beside what stops the loops.
    #[must_use]
    pub const fn counted(stop: &'a AtomicBool, counter: &'a Counter<'a>) -> Self {
        Self {
            stop,
            counter: Some(counter),
        }
    }

    /// What is set from outside to stop.
    #[must_use]
    pub const fn stop(&self) -> &'a AtomicBool {
        self.stop
    }

    /// Before a part of the work.
    ///
    /// # Errors
    /// [`Stopped`], once it is to stop.
    pub fn check(&self) -> Result<(), Stopped> {
        Stopped::check(self.stop)
    }

    /// So many more things are to be done.
    pub fn announce(&self, more: usize) {
        if let Some(counter) = self.counter {
            counter.all.fetch_add(more as u64, Ordering::Relaxed);
        }
    }

    /// So many things are done; `of` says what they are, in the plural.
    pub fn step(&self, by: u64, of: &'static str) {
        if let Some(counter) = self.counter {
            (counter.tell)(Count {
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
    fn steps_are_told_with_what_is_to_come() {
        let told = Mutex::new(Vec::new());
        let tell = |count: Count| told.lock().unwrap().push((count.done, count.all));
        let (stop, counter) = (AtomicBool::new(false), Counter::new(&tell));
        let watch = Watch::counted(&stop, &counter);
        watch.announce(3);
        watch.step(1, "shots");
        watch.announce(2);
        watch.step(4, "shots");
        assert_eq!(*told.lock().unwrap(), [(1, 3), (5, 5)]);
        assert!(watch.check().is_ok());
        stop.store(true, Ordering::Relaxed);
        assert!(watch.check().is_err());
        // Where nobody listens, nothing is counted.
        Watch::from(&stop).step(1, "shots");
        assert_eq!(told.lock().unwrap().len(), 2);
    }
}
