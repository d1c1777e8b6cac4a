//! `areograph nightly`.

use std::{path::PathBuf, process::ExitCode, sync::Arc, time::Duration};

use clap::Args;
use tokio::{runtime::Runtime, time::timeout};

use super::{output, report, stop::told};
use crate::{
    error::{Error, IoError, Kind, Locate as _},
    service::{
        clock::Clock,
        database::{JobFilter, jobs, nights::Night},
        engine::{Engine, workers::Processes},
        random::Random,
        shared::Shared,
        start::{configuration, start},
        state::JobState,
    },
};

/// Time between two turns.
const POLL_INTERVAL: Duration = Duration::from_millis(200);
/// Maximum number of jobs of one night whose outcomes are read.
const JOBS_MAX: u32 = 100_000;

/// Performs one nightly run without a service, for a timer: compares all sites, runs the affected ones, and exits.
///
/// The command fails while a service uses the same state folder. Exit codes are those of `run`.
#[derive(Debug, Args)]
#[command(after_help = "Example: areograph nightly areograph.toml")]
pub(super) struct Arguments {
    /// Configuration of the service (TOML).
    config: PathBuf,
}

pub(super) fn run(arguments: &Arguments) -> ExitCode {
    match nightly(arguments) {
        Ok(code) => ExitCode::from(code),
        Err(failure) => report(&failure),
    }
}

fn nightly(arguments: &Arguments) -> Result<u8, Error> {
    let clock = Clock::default();
    let config = configuration(&arguments.config, None, clock.now_ms())?;
    let state = config.outputs.state.clone();
    let started = start(config, "nightly", clock)?;
    let shared = Arc::new(started.shared);
    let workers = Processes {
        program: shared.program.clone(),
    };
    let engine = Engine::new(Arc::clone(&shared), workers, Random::default())?;
    let runtime = Runtime::new().map_err(IoError::on("start threads"))?;
    let night = runtime.block_on(async {
        let ending = shared.ending.clone();
        tokio::spawn(async move {
            if told().await.is_ok() {
                ending.cancel();
            }
        });
        through_the_night(&engine, &shared).await
    });
    let night = night.in_file(&state)?;
    runtime.shutdown_background();
    let Some(night) = night.filter(|night| night.ended_utc.is_some()) else {
        return Ok(Kind::Interrupted.exit_code());
    };
    output::line(night.words());
    exit_code(&shared, night.id).in_file(&state)
}

async fn through_the_night(
    engine: &Engine<Processes>,
    shared: &Shared,
) -> Result<Option<Night>, crate::service::database::DatabaseError> {
    let Some(id) = engine.begin_night()? else {
        return Ok(None);
    };
    loop {
        engine.turn()?;
        let night = engine.night(id)?;
        let over = night.as_ref().is_none_or(|night| night.ended_utc.is_some());
        // Messages that cannot be delivered now wait for the next night.
        if shared.ending.is_cancelled() || (over && engine.is_idle()) {
            engine.stop().await;
            return engine.night(id);
        }
        let _ = timeout(POLL_INTERVAL, shared.wake.notified()).await;
    }
}

/// A failure outranks an invalid site; of several failures, the first counts.
fn exit_code(shared: &Shared, night: i64) -> crate::service::database::Stored<u8> {
    let all = shared.read(|connection| jobs(connection, &JobFilter::default(), JOBS_MAX))?;
    let mut codes: Vec<u8> = Vec::new();
    for job in all.iter().rev().filter(|job| job.night == Some(night)) {
        let told = job
            .outcome
            .as_ref()
            .and_then(|outcome| outcome["code"].as_u64());
        let told = told.and_then(|code| u8::try_from(code).ok());
        match job.state {
            JobState::Failed | JobState::Blocked => {
                codes.push(told.unwrap_or(Kind::Bug.exit_code()));
            }
            JobState::Invalid => codes.push(Kind::Validation.exit_code()),
            _ => {}
        }
    }
    let failed = codes
        .iter()
        .find(|code| **code != Kind::Validation.exit_code());
    Ok(failed.or(codes.first()).copied().unwrap_or(0))
}
