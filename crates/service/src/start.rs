//! Start of a service: configuration, lock, database, all checked; and reloading of its configuration.

use std::{
    net::SocketAddr,
    path::{Path, PathBuf},
    process,
    sync::OnceLock,
};

use rusqlite::{Connection, Transaction};
use serde_json::json;

use super::{
    clock::Clock,
    database::{About, Database, Stored, append, files::roots, runs::count, service::put_service},
    engine::{
        folders::{Folder, folders},
        schedule::Schedule,
    },
    lock::{Owner, ServiceLock},
    recover::{examine, is_lost, require_products},
    shared::Shared,
    worker::process::ProcessIdentity,
};
use areograph_base::error::{Cause, Error, IoError, Locate as _, Result};
use areograph_config::{Document as _, ServiceConfig};

/// A started service, which owns its state folder for the lifetime of this value.
#[derive(Debug)]
pub struct Started {
    /// The service.
    pub shared: Shared,
    /// Its lock.
    pub lock: ServiceLock,
    /// Its owner entry.
    pub owner: Owner,
}

/// An address, or a change, that a service rejects.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Configuration)]
enum Refused {
    #[error("{0} is not a loopback address")]
    #[cause(
        "listen on 127.0.0.1, or set http.behind_tls_proxy = \"yes\" behind a proxy that encrypts"
    )]
    Public(SocketAddr),
    #[error("{0} changed")]
    #[cause("restart the service, or restore the previous value")]
    NeedsRestart(&'static str),
    #[error("inputs.{0}: the folder {1} does not exist and was never available to this service")]
    #[cause(
        "correct the path, or mount the folder; only a folder that was available before may be missing"
    )]
    NeverSeen(&'static str, String),
}

/// Reads and checks the configuration `file`, with another address if one is stated.
///
/// # Errors
/// All faults of the configuration.
pub fn configuration(
    file: &Path,
    listen: Option<SocketAddr>,
    now_ms: i64,
) -> Result<ServiceConfig> {
    // Paths of tasks must not depend on the working folder.
    let file = std::path::absolute(file)
        .map_err(IoError::on("resolve"))
        .in_file(file)?;
    let loaded = ServiceConfig::load(&file)?;
    for warning in loaded.warnings {
        tracing::warn!("{warning}");
    }
    let mut config = loaded.config;
    Schedule::of(&config.schedule, now_ms).in_file(&file)?;
    if let Some(listen) = listen {
        if !listen.ip().is_loopback() && !config.http.behind_tls_proxy {
            return Err(Refused::Public(listen).into());
        }
        config.http.listen = listen;
    }
    Ok(config)
}

/// The file that starts the program, where this is not the file of the process.
static PROGRAM: OnceLock<PathBuf> = OnceLock::new();

/// States the file that starts the program, for a process of another language; the first statement counts.
pub fn set_program(program: PathBuf) {
    let _ = PROGRAM.set(program);
}

/// Starts a service; `command` is the name shown to other processes.
///
/// # Errors
/// Another service uses the same state folder; the database is damaged, newer, or belongs to another service; a disk
/// error.
pub fn start(config: ServiceConfig, command: &str, clock: Clock) -> Result<Started> {
    let state = config.outputs.state.clone();
    let owner = Owner {
        pid: process::id(),
        command: command.to_owned(),
        address: String::new(),
        started_ms: clock.now_ms(),
    };
    let lock = ServiceLock::take(&state, &owner)?;
    let products = &config.outputs.products;
    let database = Database::open(&state)?;
    let runs = database.read(count).in_file(&state)?;
    require_products(runs, products)?;
    std::fs::create_dir_all(products)
        .map_err(IoError::on("create the folder"))
        .in_file(products)?;
    examine(&database, products)?;
    let lost = database.read(is_lost).in_file(&state)?;
    database
        .read(|connection| seen(connection, &config))
        .in_file(&state)??;
    let program = match PROGRAM.get() {
        Some(program) => program.clone(),
        None => std::env::current_exe()
            .map_err(IoError::on("find"))
            .in_file("areograph")?,
    };
    let shared = Shared::new(config, database, clock, program).in_file(&state)?;
    shared.set_recovering(lost);
    Ok(Started {
        shared,
        lock,
        owner,
    })
}

/// Checks that every folder of inputs is known to the service, or exists. A known one is not accessed: its mount may be
/// unresponsive.
fn seen(connection: &Connection, config: &ServiceConfig) -> Stored<Result<()>> {
    let known = roots(connection)?;
    let unseen = folders(&config.inputs)?.into_iter().find(|folder| {
        known.iter().all(|root| root.path != folder.path) && !Path::new(&folder.path).is_dir()
    });
    Ok(match unseen {
        None => Ok(()),
        Some(folder) => Err(never_seen(&folder)).in_file(&config.file),
    })
}

/// The fault of a folder of inputs that does not exist and is unknown to the service.
pub(crate) fn never_seen(folder: &Folder) -> Error {
    Refused::NeverSeen(folder.kind.name(), folder.path.clone()).into()
}

/// Records the address of the service in its lock and in the database.
///
/// # Errors
/// A disk error.
pub fn tell_address(
    lock: &ServiceLock,
    owner: &Owner,
    shared: &Shared,
    address: &str,
) -> Result<()> {
    let state = &shared.config().outputs.state;
    let owner = Owner {
        address: address.to_owned(),
        ..owner.clone()
    };
    lock.tell(&owner)
        .map_err(IoError::on("write"))
        .in_file(state)?;
    if let Some(process) = ProcessIdentity::of(owner.pid) {
        let noted = shared
            .write(|transaction| put_service(transaction, &process, address, shared.now_ms()));
        noted.in_file(state)?;
    }
    Ok(())
}

/// Reloads the configuration of the file. An invalid one has no effect, and is reported on the pages.
///
/// # Errors
/// The database cannot be written.
pub fn reload(shared: &Shared, listen: Option<SocketAddr>) -> Stored<()> {
    let before = shared.config();
    let now_ms = shared.now_ms();
    let loaded = configuration(&before.file, listen, now_ms).and_then(|after| {
        unchangeable(&before, &after)?;
        shared
            .read(|connection| seen(connection, &after))
            .in_file(&before.file)??;
        Ok(after)
    });
    let text = match loaded {
        Ok(after) => {
            shared.set_config(after);
            shared.wake.notify_one();
            None
        }
        Err(failure) => {
            let text = failure.to_string();
            shared.set_problem(Some(text.clone()));
            Some(text)
        }
    };
    match &text {
        None => tracing::info!("the configuration {} is in force", before.file.display()),
        Some(text) => tracing::error!(
            "the new configuration is invalid, and the previous configuration remains in force: {text}"
        ),
    }
    shared.write(|transaction: &Transaction<'_>| {
        let data = json!({ "taken": text.is_none(), "text": text });
        append(transaction, now_ms, "config", About::default(), &data).map(|_| ())
    })
}

/// Settings that cannot change while the service runs.
fn unchangeable(before: &ServiceConfig, after: &ServiceConfig) -> Result<()> {
    let what = if before.outputs != after.outputs {
        "a folder of outputs"
    } else if before.http != after.http {
        "the table [http]"
    } else {
        return Ok(());
    };
    Err(Refused::NeedsRestart(what)).in_file(&after.file)
}
