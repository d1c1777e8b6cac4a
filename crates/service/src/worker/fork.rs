//! Starts workers from one thread that lives as long as the service: a worker ends when the thread that forked it does.

use std::{
    env,
    ffi::OsString,
    io,
    os::unix::process::CommandExt as _,
    path::{Path, PathBuf},
    process::{self, Child, Command, Stdio},
    sync::LazyLock,
    thread,
};

use tokio::sync::{mpsc, oneshot};

use super::srun::{SRUN, Srun};

/// Environment variables passed to a worker: locations of libraries and temporary files, and text encoding.
const PASSED_ON: [&str; 7] = [
    "PATH",
    "LD_LIBRARY_PATH",
    "TMPDIR",
    "LANG",
    "LC_ALL",
    "TZ",
    "RUST_BACKTRACE",
];
/// Environment variable passed to `srun` in addition: the configuration of the cluster.
const OF_SLURM: &str = "SLURM_CONF";

struct Order {
    program: PathBuf,
    srun: Option<Srun>,
    started: oneshot::Sender<io::Result<Child>>,
}

static ORDERS: LazyLock<io::Result<mpsc::UnboundedSender<Order>>> = LazyLock::new(|| {
    let (orders, mut received) = mpsc::unbounded_channel::<Order>();
    let forks = thread::Builder::new().name("fork workers".to_owned());
    forks.spawn(move || {
        while let Some(order) = received.blocking_recv() {
            let started = start(&order.program, order.srun.as_ref());
            if let Err(Ok(mut unwanted)) = order.started.send(started) {
                // The caller no longer waits: the worker has no task and ends with its input.
                drop(unwanted.stdin.take());
                let _ = unwanted.wait();
            }
        }
    })?;
    Ok(orders)
});

/// A worker, or the `srun` that starts it on a node, in its own process group, with pipes.
///
/// # Errors
/// An error of the system.
pub(super) async fn fork(program: &Path, srun: Option<&Srun>) -> io::Result<Child> {
    let orders = ORDERS
        .as_ref()
        .map_err(|error| io::Error::new(error.kind(), error.to_string()))?;
    let (started, child) = oneshot::channel();
    let order = Order {
        program: program.to_owned(),
        srun: srun.cloned(),
        started,
    };
    let gone = |()| io::Error::other("the thread that starts workers has ended");
    orders.send(order).map_err(|_| gone(()))?;
    child.await.map_err(|_| gone(()))?
}

fn start(program: &Path, srun: Option<&Srun>) -> io::Result<Child> {
    let command = srun.map_or_else(
        || {
            let parent = process::id().to_string();
            let own = ["worker", "--parent", &parent].map(OsString::from);
            [vec![program.as_os_str().to_owned()], own.to_vec()].concat()
        },
        |srun| srun.command(program),
    );
    let passed_on = env::vars_os().filter(|(name, _)| {
        PASSED_ON.iter().any(|passed| name == passed) || srun.is_some() && name == OF_SLURM
    });
    let started = Command::new(&command[0])
        .args(&command[1..])
        .env_clear()
        .envs(passed_on)
        .process_group(0)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn();
    match srun {
        Some(_) => started.map_err(|error| {
            let text = format!(
                "cannot start {SRUN}: {error}; install Slurm, or set executor.kind = \"local\""
            );
            io::Error::new(error.kind(), text)
        }),
        None => started,
    }
}
