//! What a run tells while it goes on: on a terminal a live line for each site, elsewhere a line for each stage.

use std::{
    io::{self, IsTerminal as _, Write},
    sync::LazyLock,
    time::Duration,
};

use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use tracing::level_filters::LevelFilter;
use tracing_subscriber::fmt::MakeWriter;

use crate::{
    config::SiteConfig,
    flow::{Observer, StageEvent, stage_count},
};

/// The live lines of the program, on standard error; nothing is drawn where that is no terminal.
static LINES: LazyLock<MultiProgress> = LazyLock::new(MultiProgress::new);
/// What a live line shows: site, stages done of all, time since the start and expected until the end, stage.
const LINE: &str =
    "{prefix:.bold}  {bar:16} {pos}/{len} stages  {elapsed}, about {eta} left  {msg}";
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
                line.set_style(style);
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
            plain: told && !terminal,
        }
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
            StageEvent::Kept | StageEvent::Done(_) => self.line.inc(1),
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.line.finish_and_clear();
    }
}
