//! Progress of commands that take time: on a terminal a live line for each site, net, calibration, match or archive;
//! elsewhere lines at intervals.

use std::{
    borrow::Cow,
    fmt,
    io::{self, IsTerminal as _, Write},
    sync::{
        Arc, LazyLock, Mutex, PoisonError,
        atomic::AtomicBool,
        mpsc::{self, RecvTimeoutError, Sender},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use indicatif::{MultiProgress, ProgressBar, ProgressState, ProgressStyle};
use tracing::level_filters::LevelFilter;
use tracing_subscriber::fmt::MakeWriter;

use crate::{
    flow::{Observer, PUBLISH, StageEvent, Task},
    watch::{Count, Counter, Watch},
};

/// The live lines of the program, on standard error; nothing is drawn if that is not a terminal.
static LINES: LazyLock<MultiProgress> = LazyLock::new(MultiProgress::new);
/// Template of a live line: site, stages done of all, time elapsed and time left, and as much of the stage as fits. A
/// bar would break the line on a terminal of 40 columns.
const LINE: &str = "{prefix:.bold}  {pos}/{len}  {elapsed}{left}  {wide_msg}";
/// The same where the number of stages is unknown.
const LINE_OF_WORK: &str = "{prefix:.bold}  {elapsed}  {wide_msg}";
/// Interval of progress lines where there is no live line.
const LINE_EVERY: Duration = Duration::from_secs(10);
/// Work that takes at least this time ends with a line that states it, seconds.
const TIME_FROM_S: f64 = 2.0;
/// Interval at which the time on a live line is redrawn.
const TICK: Duration = Duration::from_millis(200);

/// Standard error for the log: text appears above the live lines, one line per event.
#[derive(Debug, Clone, Copy)]
pub(super) struct Log;

impl MakeWriter<'_> for Log {
    type Writer = Self;

    fn make_writer(&self) -> Self {
        *self
    }
}

impl Write for Log {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let text = one_line(bytes);
        LINES.suspend(|| io::stderr().lock().write_all(&text))?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stderr().lock().flush()
    }
}

/// An event as one line: programs that collect logs take every line as an event.
fn one_line(event: &[u8]) -> Cow<'_, [u8]> {
    let end = event.strip_suffix(b"\n").unwrap_or(event);
    if !end.contains(&b'\n') {
        return Cow::Borrowed(event);
    }
    let text = String::from_utf8_lossy(end);
    let lines: Vec<&str> = text.lines().map(str::trim).collect();
    Cow::Owned((lines.join("; ") + "\n").into_bytes())
}

/// Progress of a run, or of another command that takes time.
#[derive(Debug)]
pub(super) struct Progress {
    name: String,
    begun: Instant,
    line: ProgressBar,
    counted: Mutex<Option<Counted>>,
    /// Where there is no live line.
    lines: Option<Lines>,
    is_shown: bool,
}

impl Progress {
    /// Progress of a new run. Nothing is shown with `--verbose`, since the log reports stages, or with `--quiet`.
    pub(super) fn of(task: Task<'_>) -> Self {
        Self::shown(task.name(), LINE, task.stage_count() as u64)
    }

    /// Progress of other work, which need not have stages.
    pub(super) fn of_work(name: &str) -> Self {
        Self::shown(name, LINE_OF_WORK, 0)
    }

    fn shown(name: &str, template: &str, stages: u64) -> Self {
        let level = LevelFilter::current();
        let is_shown = level >= LevelFilter::WARN && level < LevelFilter::INFO;
        let terminal = io::stderr().is_terminal();
        let line = if is_shown && terminal {
            let line = LINES.add(ProgressBar::new(stages));
            // If the library rejects the template, its default remains.
            if let Ok(style) = ProgressStyle::with_template(template) {
                line.set_style(style.with_key("left", left));
            }
            line.set_prefix(name.to_owned());
            line.enable_steady_tick(TICK);
            line
        } else {
            ProgressBar::hidden()
        };
        Self {
            name: name.to_owned(),
            begun: Instant::now(),
            line,
            counted: Mutex::new(None),
            lines: (is_shown && !terminal).then(|| Lines::of(name)),
            is_shown,
        }
    }

    /// Does work that counts its steps, which are shown.
    pub(super) fn watch<T>(&self, what: &str, work: impl FnOnce(Watch<'_>) -> T) -> T {
        let count = |count| self.count(what, count);
        let counter = Counter::new(&count);
        self.show(what.to_owned());
        // The command ends at a signal: what it writes appears whole or not at all.
        work(Watch::counted(&AtomicBool::new(false), &counter))
    }

    /// Shows what is being done.
    pub(super) fn show(&self, text: String) {
        if let Some(lines) = &self.lines {
            lines.show(&text);
        }
        self.line.set_message(text);
    }
}

/// A thread that prints the present state at intervals.
#[derive(Debug)]
struct Lines {
    text: Arc<Mutex<String>>,
    /// Ends the thread when it is dropped.
    end: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Lines {
    fn of(name: &str) -> Self {
        let text = Arc::new(Mutex::new(String::new()));
        let (end, ended) = mpsc::channel();
        let (name, shown) = (name.to_owned(), Arc::clone(&text));
        let thread = thread::spawn(move || {
            while ended.recv_timeout(LINE_EVERY) == Err(RecvTimeoutError::Timeout) {
                let text = shown.lock().unwrap_or_else(PoisonError::into_inner).clone();
                if text.is_empty() {
                    continue;
                }
                // A closed standard error is not a failure.
                let _ = writeln!(io::stderr().lock(), "{name}: {text}");
            }
        });
        Self {
            text,
            end: Some(end),
            thread: Some(thread),
        }
    }

    fn show(&self, text: &str) {
        let mut shown = self.text.lock().unwrap_or_else(PoisonError::into_inner);
        text.clone_into(&mut shown);
    }
}

impl Drop for Lines {
    fn drop(&mut self) {
        self.end.take();
        // It ends at once, and does not fail.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// The estimated time until the end, once a stage is done.
fn left(state: &ProgressState, out: &mut dyn fmt::Write) {
    let left_s = state.eta().as_secs_f64();
    if state.pos() > 0 && left_s >= 1.0 {
        // A failure to draw the line is ignored.
        let _ = write!(out, ", {} left", duration(left_s));
    }
}

impl Observer for Progress {
    fn hear(&self, stage: &str, event: &StageEvent<'_>) {
        match event {
            StageEvent::Begins(_) => self.show(stage.to_owned()),
            StageEvent::Counts(count) => self.count(stage, *count),
            StageEvent::Kept | StageEvent::Done(_) => {
                self.line.inc(1);
                // Only the first round of a calibration is known beforehand.
                if self.line.length() <= Some(self.line.position()) && stage != PUBLISH {
                    self.line.inc_length(1);
                }
            }
        }
    }
}

/// The stage whose progress is counted.
#[derive(Debug)]
struct Counted {
    stage: String,
    of: &'static str,
    begun: Instant,
}

impl Progress {
    /// Reports the progress of a stage; called from any thread.
    pub(super) fn count(&self, stage: &str, count: Count) {
        let mut counted = self.counted.lock().unwrap_or_else(PoisonError::into_inner);
        // Files are hashed for a stage before it counts its steps.
        let same = |before: &Counted| before.stage == stage && before.of == count.of;
        if !counted.as_ref().is_some_and(same) {
            *counted = Some(Counted {
                stage: stage.to_owned(),
                of: count.of,
                begun: Instant::now(),
            });
        }
        let Some(counted) = counted.as_mut() else {
            return;
        };
        self.show(words(stage, count, counted.begun.elapsed()));
    }
}

/// Progress of a stage after the time `taken`, with the estimated time left.
fn words(stage: &str, count: Count, taken: Duration) -> String {
    let Count { done, all, of } = count;
    if all == 0 {
        return format!("{stage}: {done} {of}");
    }
    let left_s = taken.as_secs_f64() * all.saturating_sub(done) as f64 / done.max(1) as f64;
    format!("{stage}: {done} of {all} {of}, {} left", duration(left_s))
}

/// Seconds as readable text.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a positive number of seconds"
)]
pub(super) fn duration(seconds: f64) -> String {
    let whole = seconds.round() as u64;
    match (whole / 3600, whole / 60 % 60, whole % 60) {
        (0, 0, seconds) => format!("{seconds} s"),
        (0, minutes, seconds) => format!("{minutes} min {seconds:02} s"),
        (hours, minutes, _) => format!("{hours} h {minutes:02} min"),
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.line.finish_and_clear();
        self.lines.take();
        let taken_s = self.begun.elapsed().as_secs_f64();
        if self.is_shown && taken_s >= TIME_FROM_S {
            // A closed standard error is not a failure.
            let _ = writeln!(io::stderr().lock(), "{}: {taken_s:.1} s", self.name);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_stage_says_how_far_it_is_and_how_long_it_takes() {
        let at = |done, all| {
            let of = "shots";
            words(
                "check_ranges",
                Count { done, all, of },
                Duration::from_secs(30),
            )
        };
        assert_eq!(
            at(1_000, 4_000),
            "check_ranges: 1000 of 4000 shots, 1 min 30 s left"
        );
        assert_eq!(
            at(4_000, 4_000),
            "check_ranges: 4000 of 4000 shots, 0 s left"
        );
        // The total is unknown.
        assert_eq!(at(3, 0), "check_ranges: 3 shots");
        assert_eq!(duration(3_725.0), "1 h 02 min");
    }
}
