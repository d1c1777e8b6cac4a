//! Starts workers from one thread that lives as long as the service: a worker ends when the thread that forked it does.

use std::{
    env, io,
    os::unix::process::CommandExt as _,
    path::{Path, PathBuf},
    process::{self, Child, Command, Stdio},
    sync::LazyLock,
    thread,
};

use tokio::sync::{mpsc, oneshot};

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

struct Order {
    program: PathBuf,
    started: oneshot::Sender<io::Result<Child>>,
}

static ORDERS: LazyLock<io::Result<mpsc::UnboundedSender<Order>>> = LazyLock::new(|| {
    let (orders, mut received) = mpsc::unbounded_channel::<Order>();
    let forks = thread::Builder::new().name("fork workers".to_owned());
    forks.spawn(move || {
        while let Some(order) = received.blocking_recv() {
            let started = start(&order.program);
            if let Err(Ok(mut unwanted)) = order.started.send(started) {
                // The caller no longer waits: the worker has no task and ends with its input.
                drop(unwanted.stdin.take());
                let _ = unwanted.wait();
            }
        }
    })?;
    Ok(orders)
});

/// A worker in its own process group, with pipes.
///
/// # Errors
/// An error of the system.
pub(super) async fn fork(program: &Path) -> io::Result<Child> {
    let orders = ORDERS
        .as_ref()
        .map_err(|error| io::Error::new(error.kind(), error.to_string()))?;
    let (started, child) = oneshot::channel();
    let order = Order {
        program: program.to_owned(),
        started,
    };
    let gone = |()| io::Error::other("the thread that starts workers has ended");
    orders.send(order).map_err(|_| gone(()))?;
    child.await.map_err(|_| gone(()))?
}

fn start(program: &Path) -> io::Result<Child> {
    let passed_on =
        env::vars_os().filter(|(name, _)| PASSED_ON.iter().any(|passed| name == passed));
    Command::new(program)
        .arg("worker")
        .args(["--parent", &process::id().to_string()])
        .env_clear()
        .envs(passed_on)
        .process_group(0)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
}
