//! What a run tells while it goes on: on a terminal a live line for each site, elsewhere a line for each stage, and of one
//! that takes long now and then how far it is.

use std::{
    fmt,
    io::{self, IsTerminal as _, Write},
    sync::{LazyLock, Mutex, PoisonError},
    time::{Duration, Instant},
};

use indicatif::{MultiProgress, ProgressBar, ProgressState, ProgressStyle};
use tracing::level_filters::LevelFilter;
use tracing_subscriber::fmt::MakeWriter;

use crate::{
    config::SiteConfig,
    flow::{Observer, StageEvent, stage_count},
    watch::Count,
};

/// The live lines of the program, on standard error; nothing is drawn where that is no terminal.
static LINES: LazyLock<MultiProgress> = LazyLock::new(MultiProgress::new);
/// What a live line shows: site, stages done of all, time since the start and expected until the end, and of the stage as
/// much as there is room for. No bar: with one the line would break on a terminal of 40 columns.
const LINE: &str = "{prefix:.bold}  {pos}/{len}  {elapsed}{left}  {wide_msg}";
/// A stage that takes longer tells how far it is, that often where there is no live line.
const TOLD_EVERY: Duration = Duration::from_secs(10);
/// How often the time on a live line is drawn anew.
const TICK: Duration = Duration::from_millis(200);

/// Standard error for the log: what is written goes above the live lines.
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
        LINES.suspend(|| io::stderr().lock().write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stderr().lock().flush()
    }
}

/// How a site gets on.
#[derive(Debug)]
pub(super) struct Progress {
    site: String,
    line: ProgressBar,
    counted: Mutex<Option<Counted>>,
    /// Whether each stage has a line of its own.
    plain: bool,
}

impl Progress {
    /// Of a site that begins. The log tells of stages itself, and who wants errors only hears of none.
    pub(super) fn of(site: &SiteConfig) -> Self {
        let level = LevelFilter::current();
        let told = level >= LevelFilter::WARN && level < LevelFilter::INFO;
        let terminal = io::stderr().is_terminal();
        let line = if told && terminal {
            let stages = stage_count(site);
            let line = LINES.add(ProgressBar::new(stages as u64));
            // A template that the library refuses leaves its own in place.
            if let Ok(style) = ProgressStyle::with_template(LINE) {
                line.set_style(style.with_key("left", left));
            }
            line.set_prefix(site.site.clone());
            line.enable_steady_tick(TICK);
            line
        } else {
            ProgressBar::hidden()
        };
        Self {
            site: site.site.clone(),
            line,
            counted: Mutex::new(None),
            plain: told && !terminal,
        }
    }
}

/// The time until the end, once a stage tells how long one takes.
fn left(state: &ProgressState, out: &mut dyn fmt::Write) {
    let left_s = state.eta().as_secs_f64();
    if state.pos() > 0 && left_s >= 1.0 {
        // Whoever draws the line need not draw this.
        let _ = write!(out, ", {} left", duration(left_s));
    }
}

impl Observer for Progress {
    fn hear(&self, stage: &str, event: &StageEvent<'_>) {
        match event {
            StageEvent::Begins(_) => {
                self.line.set_message(stage.to_owned());
                if self.plain {
                    // Whoever does not listen any more need not hear it.
                    let _ = writeln!(io::stderr().lock(), "{}: {stage}", self.site);
                }
            }
            StageEvent::Counts(count) => self.count(stage, *count),
            StageEvent::Kept | StageEvent::Done(_) => self.line.inc(1),
        }
    }
}

/// The stage that counts.
#[derive(Debug)]
struct Counted {
    stage: String,
    of: &'static str,
    begun: Instant,
    told: Instant,
}

impl Progress {
    /// How far a stage is, which counts on any thread.
    fn count(&self, stage: &str, count: Count) {
        let mut counted = self.counted.lock().unwrap_or_else(PoisonError::into_inner);
        let now = Instant::now();
        // Files are hashed for a stage before it counts what it does.
        let same = |before: &Counted| before.stage == stage && before.of == count.of;
        if !counted.as_ref().is_some_and(same) {
            *counted = Some(Counted {
                stage: stage.to_owned(),
                of: count.of,
                begun: now,
                told: now,
            });
        }
        let Some(counted) = counted.as_mut() else {
            return;
        };
        let words = words(stage, count, counted.begun.elapsed());
        if self.plain && counted.told.elapsed() >= TOLD_EVERY {
            counted.told = now;
            let _ = writeln!(io::stderr().lock(), "{}: {words}", self.site);
        }
        self.line.set_message(words);
    }
}

/// How far a stage is after so long, and how long it may still take.
fn words(stage: &str, count: Count, taken: Duration) -> String {
    let Count { done, all, of } = count;
    if all == 0 {
        return format!("{stage}: {done} {of}");
    }
    let left_s = taken.as_secs_f64() * all.saturating_sub(done) as f64 / done.max(1) as f64;
    format!("{stage}: {done} of {all} {of}, {} left", duration(left_s))
}

/// Seconds as people say them.
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
        // Nobody knows how many it takes.
        assert_eq!(at(3, 0), "check_ranges: 3 shots");
        assert_eq!(duration(3_725.0), "1 h 02 min");
    }
}
