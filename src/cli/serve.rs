//! `areograph serve`.

use std::{
    net::SocketAddr,
    path::{Path, PathBuf},
    process::ExitCode,
    sync::Arc,
    time::Duration,
};

use clap::Args;
use sd_notify::NotifyState;
use tokio::{
    net::TcpListener,
    runtime::Runtime,
    signal::unix::{SignalKind, signal},
    time::{interval, sleep},
};

use super::{output, panicked::flatten, progress::Progress, report};
use crate::{
    config::{Document as _, ServiceConfig},
    error::{Cause, Error, IoError, Locate as _},
    scene::{SceneOptions, write_later_orbit, write_scene},
    service::{
        clock::Clock,
        engine::{Engine, workers::Processes},
        http,
        random::Random,
        shared::Shared,
        start::{configuration, reload, start, tell_address},
    },
    store::atomic,
};

/// Name of the configuration that `--init` writes.
const FILE: &str = "areograph.toml";
/// Maximum time of a graceful shutdown.
const END_WITHIN: Duration = Duration::from_secs(25);

/// Runs sites again when their inputs change, no later than the next night; serves pages and an interface for programs.
///
/// Example: `areograph serve --init demo && areograph serve demo/areograph.toml`
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Configuration of the service (TOML).
    #[arg(required_unless_present = "init", conflicts_with = "init")]
    config: Option<PathBuf>,
    /// Write a synthetic mission and a configuration for it into this folder, and exit.
    #[arg(long, value_name = "DIR")]
    pub(super) init: Option<PathBuf>,
    /// Listen at this address instead of the configured one; port 0 selects a free port.
    #[arg(long, value_name = "ADDRESS:PORT", conflicts_with = "init")]
    listen: Option<SocketAddr>,
}

pub(super) fn run(arguments: &Arguments) -> ExitCode {
    let done = match (&arguments.init, &arguments.config) {
        (Some(folder), _) => init(folder),
        (None, Some(config)) => serve(config, arguments.listen),
        (None, None) => Ok(()),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => report(&failure),
    }
}

/// The folder has a configuration.
#[derive(Debug, thiserror::Error, Cause)]
#[error("a configuration already exists")]
#[cause(Configuration: "serve this configuration, or name another folder")]
struct Exists;

fn init(folder: &Path) -> Result<(), Error> {
    let path = folder.join(FILE);
    if path.exists() {
        return Err(Exists).in_file(path);
    }
    let progress = Progress::of_work("serve");
    progress.watch("writing a mission", |_| {
        write_scene(folder, &SceneOptions::default())
    })?;
    drop(progress);
    atomic::write(&path, demonstration().as_bytes())?;
    let [later, used] = write_later_orbit(folder)?;
    let (folder, path) = (folder.display(), path.display());
    output::line(format_args!(
        "{folder}: a synthetic mission and a configuration; next:\n\
         \x20 areograph serve {path}\n\
         and, once its sites have run, a later orbit, to show its effect:\n\
         \x20 cp {} {}",
        later.display(),
        used.display()
    ));
    Ok(())
}

/// The example, with short intervals for a demonstration.
fn demonstration() -> String {
    let mut text = ServiceConfig::example();
    for (from, to) in [
        ("name = \"areograph\"", "name = \"demonstration\""),
        ("scan_interval_s = 60.0", "scan_interval_s = 2.0"),
        ("quiet_period_s = 600.0", "quiet_period_s = 5.0"),
        (
            "schema/service.schema.json",
            "config/schema/service.schema.json of areograph",
        ),
    ] {
        text = text.replace(from, to);
    }
    text
}

fn serve(file: &Path, listen: Option<SocketAddr>) -> Result<(), Error> {
    let clock = Clock::default();
    let config = configuration(file, listen, clock.now_ms())?;
    let address = config.http.listen;
    let started = start(config, "serve", clock)?;
    let shared = Arc::new(started.shared);
    // Two pools of threads: pages answer while the engine reads products or writes the database.
    let threads =
        || Runtime::new().map_err(|error| Error::new(IoError::on("start threads")(error)));
    let (pages, work) = (threads()?, threads()?);
    let listener = pages
        .block_on(TcpListener::bind(address))
        .map_err(IoError::on("listen at the address"))
        .in_file(address.to_string())?;
    let address = listener.local_addr().unwrap_or(address).to_string();
    tell_address(&started.lock, &started.owner, &shared, &address)?;
    let workers = Processes {
        program: shared.program.clone(),
    };
    // Pages answer from the beginning: a lost database may take minutes to be regenerated.
    let served = pages.spawn(http::serve(listener, Arc::clone(&shared)));
    let worked: Result<(), Error> = work.block_on(async {
        tokio::spawn(obey(Arc::clone(&shared), listen));
        output::line(format_args!("listening at http://{address}"));
        let _ = sd_notify::notify(&[NotifyState::Ready]);
        let engine = begin(&shared, workers).await?;
        let turning = Arc::clone(&engine);
        tokio::spawn(tell_life(move || turning.turns()));
        engine.run().await;
        Ok(())
    });
    if worked.is_err() {
        work.shutdown_background();
        pages.shutdown_background();
        return worked;
    }
    // If pages can no longer be served, the service continues its work until it is stopped.
    let served = pages.block_on(served);
    work.shutdown_background();
    pages.shutdown_background();
    flatten(served)
}

/// Begins the engine, which first takes over the state of an earlier service.
async fn begin(shared: &Arc<Shared>, workers: Processes) -> Result<Arc<Engine<Processes>>, Error> {
    let (taking, lasting) = (Arc::clone(shared), Arc::clone(shared));
    let life = tokio::spawn(tell_life(move || lasting.progress()));
    let engine =
        tokio::task::spawn_blocking(move || Engine::new(taking, workers, Random::default()));
    let engine = engine.await;
    life.abort();
    flatten(engine).map(Arc::new)
}

/// Shuts the service down at SIGTERM or SIGINT, by force at the second signal or after a delay; reloads the
/// configuration at SIGHUP.
async fn obey(shared: Arc<Shared>, listen: Option<SocketAddr>) {
    let signals = [
        signal(SignalKind::terminate()),
        signal(SignalKind::interrupt()),
        signal(SignalKind::hangup()),
    ];
    let [Ok(mut terminate), Ok(mut interrupt), Ok(mut hangup)] = signals else {
        tracing::error!("signals cannot be received");
        return;
    };
    loop {
        tokio::select! {
            _ = terminate.recv() => break,
            _ = interrupt.recv() => break,
            _ = hangup.recv() => {
                if let Err(error) = reload(&shared, listen) {
                    tracing::error!("{error}");
                }
            }
        }
    }
    tracing::info!("the service is stopping");
    let _ = sd_notify::notify(&[NotifyState::Stopping]);
    shared.ending.cancel();
    tokio::select! {
        _ = terminate.recv() => {}
        _ = interrupt.recv() => {}
        () = sleep(END_WITHIN) => {}
    }
    // Workers end with their pipes, and no incomplete file has a final name: the next service continues from here.
    std::process::exit(0);
}

/// Notifies the service manager that work continues, as long as a counter increases.
async fn tell_life(work: impl Fn() -> u64) {
    let Some(patience) = sd_notify::watchdog_enabled() else {
        return;
    };
    let mut ticks = interval(patience / 3);
    let mut seen = None;
    loop {
        ticks.tick().await;
        let done = work();
        if seen.replace(done) != Some(done) {
            let _ = sd_notify::notify(&[NotifyState::Watchdog]);
        }
    }
}
