//! Everything that a service requires at its start, without starting one: nothing is created or changed.

use std::{
    env, fs,
    io::ErrorKind::{NotADirectory, NotFound},
    net::TcpListener,
    path::{Path, PathBuf},
};

use rustix::fs::{Access, access};

use super::{
    clock::minute_text,
    database::{Layout, Seen, look_at},
    engine::{
        disk::free_mib,
        folders::{Folder, folders},
        hooks::{program_in, program_of},
        schedule::next_night_ms,
    },
    lock::{LOCK, Owner, refuse_network},
    recover::{refuse_foreign, require_products},
    start::never_seen,
    words::counted,
    worker::srun::{SCANCEL, SRUN},
};
use areograph_base::error::{Cause, IoError, Locate as _, Result};
use areograph_config::{ExecutorKind, ServiceConfig};

/// One subject of a check.
#[derive(Debug)]
pub struct Finding {
    /// The subject in a word.
    pub subject: &'static str,
    /// Where it is: a file, a folder, an address.
    pub place: String,
    /// What was found, or the failure.
    pub found: Result<String>,
    /// Whether a failure prevents the start; otherwise the service starts, and the subject does not work.
    pub stops: bool,
}

/// Failures that a service reports only once it needs the subject.
#[derive(Debug, thiserror::Error, Cause)]
enum Fault {
    #[error("this user cannot write to the folder")]
    #[cause(Io: "make the user of the service the owner of the folder, or name another folder in [outputs]")]
    NotWritable,
    #[error(
        "{left_mib} MiB are free, less than workers.min_free_mib = {least_mib}: no run would start"
    )]
    #[cause(Io: "free some space, or lower workers.min_free_mib")]
    NoRoom { left_mib: u64, least_mib: u64 },
    #[error("the program {0} of a hook is not an executable file")]
    #[cause(Configuration: "correct hooks.command, or make the file executable")]
    NoProgram(String),
    #[error("this machine has no program {0}: no run would start")]
    #[cause(Configuration: "install Slurm on this machine, or set executor.kind = \"local\"")]
    NoSlurm(&'static str),
}

/// Examines what the configuration names, in the order in which a service needs it.
#[must_use]
pub fn check(config: &ServiceConfig, now_ms: i64) -> Vec<Finding> {
    let mut findings = Vec::new();
    let mut note = |subject, place: &dyn ToString, stops, found: Result<String>| {
        findings.push(Finding {
            subject,
            place: place.to_string(),
            found,
            stops,
        });
    };
    let next = next_night_ms(&config.schedule, now_ms).map(minute_text);
    let next = next.map_or_else(String::new, |next| {
        format!("the next night begins at {next}")
    });
    note("schedule", &config.schedule.cron, true, Ok(next));
    let (state, products) = (&config.outputs.state, &config.outputs.products);
    note("state", &state.display(), true, state_folder(state));
    let database = look_at(state);
    let folder = products_folder(database.as_ref().ok().and_then(Option::as_ref), products);
    note("products", &products.display(), true, folder);
    let known = match &database {
        Ok(Some(seen)) => seen.roots.clone(),
        _ => Vec::new(),
    };
    let layout = database.and_then(|seen| {
        let identity = seen.as_ref().and_then(|seen| seen.identity.as_deref());
        if products.is_dir() {
            refuse_foreign(identity, products).in_file(state)?;
        }
        Ok(match seen.map(|seen| seen.layout) {
            None => "none yet: the first start creates it".to_owned(),
            Some(Layout::Present(layout)) => format!("layout {layout}"),
            Some(Layout::Former(layout)) => {
                format!("layout {layout}: the next start copies and migrates it")
            }
        })
    });
    note("database", &state.display(), true, layout);
    match folders(&config.inputs) {
        Ok(folders) => {
            for folder in folders {
                let is_known = known.contains(&folder.path);
                let (stops, found) = input_folder(&folder, is_known, &config.file);
                note(folder.kind.name(), &folder.path, stops, found);
            }
        }
        Err(failure) => {
            let failure = Err(failure).in_file(&config.file);
            note("folders", &config.file.display(), true, failure);
        }
    }
    for folder in [products, state] {
        let room = room(folder, u64::from(config.workers.min_free_mib));
        note("disk", &folder.display(), false, room);
    }
    for hook in &config.hooks {
        let named = hook.command.first().map_or("", |program| program);
        let found = program_of(named).ok_or_else(|| Fault::NoProgram(named.to_owned()));
        let found = found.map(|path| format!("starts {}", path.display()));
        note("hook", &named, false, found.in_file(&config.file));
    }
    if config.executor.kind == ExecutorKind::Slurm {
        for program in [SRUN, SCANCEL] {
            // As workers are started.
            let path = env::var_os("PATH").unwrap_or_default();
            let found = program_in(program, env::split_paths(&path));
            let found = found.ok_or(Fault::NoSlurm(program));
            let found = found.map(|path| format!("starts {}", path.display()));
            note("executor", &program, false, found.in_file(&config.file));
        }
    }
    let address = config.http.listen;
    match running(state) {
        Ok(Some(owner)) => {
            let text = format!("runs now: {}", owner.words());
            note("service", &address, false, Ok(text));
        }
        Ok(None) => note("port", &address, true, port(config)),
        Err(failure) => note("service", &address, true, Err(failure)),
    }
    findings
}

/// The service that uses a state folder now, by its record. The lock is not tried: a service that starts at this moment
/// would be refused.
fn running(state: &Path) -> Result<Option<Owner>> {
    let path = state.join(LOCK);
    match fs::read(&path) {
        // A record that is not whole is that of a service which does not listen yet.
        Ok(record) => {
            let owner = serde_json::from_slice(&record).ok();
            Ok(owner.filter(Owner::runs))
        }
        // The finding of the state folder reports a file in its place.
        Err(error) if matches!(error.kind(), NotFound | NotADirectory) => Ok(None),
        Err(error) => Err(IoError::on("read")(error)).in_file(path),
    }
}

/// Free space on the disk of a folder.
fn room(folder: &Path, least_mib: u64) -> Result<String> {
    match free_mib(&above(folder)) {
        None => Ok("the system does not report the free space".to_owned()),
        Some(left_mib) if left_mib < least_mib => {
            let failure = Fault::NoRoom {
                left_mib,
                least_mib,
            };
            Err(failure).in_file(folder)
        }
        Some(left_mib) => Ok(format!("{left_mib} MiB free")),
    }
}

fn state_folder(state: &Path) -> Result<String> {
    refuse_network(&above(state)).in_file(state)?;
    writable(state)
}

/// The folder, or the first existing one above it.
fn above(folder: &Path) -> PathBuf {
    let existing = folder.ancestors().find(|above| above.exists());
    existing.unwrap_or(Path::new("/")).to_owned()
}

/// The folder of the products beside an existing database.
fn products_folder(database: Option<&Seen>, products: &Path) -> Result<String> {
    require_products(database.map_or(0, |seen| seen.runs), products)?;
    writable(products)
}

fn writable(folder: &Path) -> Result<String> {
    let existing = above(folder);
    if !existing.is_dir() {
        let error = std::io::Error::from(std::io::ErrorKind::NotADirectory);
        return Err(IoError::on("create the folder")(error)).in_file(folder);
    }
    if access(&existing, Access::WRITE_OK | Access::EXEC_OK).is_err() {
        return Err(Fault::NotWritable).in_file(existing);
    }
    let text = if existing == folder {
        "writable"
    } else {
        "does not exist yet: the first start creates it"
    };
    Ok(text.to_owned())
}

/// A folder of inputs, and whether its failure prevents the start. One that was available before may be unavailable.
fn input_folder(folder: &Folder, is_known: bool, file: &Path) -> (bool, Result<String>) {
    let path = Path::new(&folder.path);
    if !path.is_dir() {
        if is_known {
            return (
                false,
                Ok("unavailable: its sites wait until it is available again".to_owned()),
            );
        }
        return (true, Err(never_seen(folder)).in_file(file));
    }
    let count = fs::read_dir(path)
        .and_then(|mut entries| entries.try_fold(0, |count, entry| entry.map(|_| count + 1)))
        .map_err(IoError::on("list the folder"))
        .in_file(path);
    let found = count.map(|count| match count {
        0 => "empty".to_owned(),
        count => counted(count, "item"),
    });
    (false, found)
}

fn port(config: &ServiceConfig) -> Result<String> {
    let address = config.http.listen;
    TcpListener::bind(address)
        .map_err(IoError::on("listen at the address"))
        .in_file(address.to_string())?;
    Ok("free".to_owned())
}
