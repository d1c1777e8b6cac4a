//! `areograph pedr cluster`.

use std::{
    net::{SocketAddr, SocketAddrV4},
    sync::Arc,
    thread,
};

use clap::{Args, Subcommand};
use tokio::{net::TcpListener, runtime::Runtime};

use crate::cli::{output, pool::limit_threads, stop::told};
use crate::{
    cluster::{Place, execute, schedule},
    error::{Cause, IoError, Locate as _, Result},
    products::ShotColumns,
};

/// Runs a process of a cluster, which answers `pedr sql --cluster`.
///
/// A cluster is a scheduler and any number of executors. All have the archive, with its index, at the same path. A cluster has no
/// access control: everyone who reaches its ports can query it, and read the files that its processes can read.
///
/// Example: `areograph pedr cluster scheduler --listen 10.0.0.1:50050` on one computer, and on each of the others
/// `areograph pedr cluster executor --scheduler df://10.0.0.1:50050 --listen 10.0.0.2:50051`
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    #[command(subcommand)]
    process: Process,
}

#[derive(Debug, Subcommand)]
enum Process {
    /// Plans queries and gives their parts to executors.
    ///
    /// Example: `areograph pedr cluster scheduler --listen 10.0.0.1:50050`
    Scheduler {
        /// Listen at this address, at which executors and clients reach this computer; port 0 selects a free port.
        #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:50050")]
        listen: SocketAddrV4,
    },
    /// Searches files of the archive for queries.
    ///
    /// Example: `areograph pedr cluster executor --scheduler df://10.0.0.1:50050 --listen 10.0.0.2:50051`
    Executor {
        /// Address of the scheduler, as the scheduler prints it.
        #[arg(long, value_name = "URL")]
        scheduler: Place,
        /// Listen at this address, at which the others reach this computer, and at the next port.
        #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:50051")]
        listen: SocketAddrV4,
        /// Parts of queries at once, and threads of their searches; by default one per core.
        #[arg(long)]
        threads: Option<u16>,
    },
}

/// An address that other processes cannot use.
#[derive(Debug, thiserror::Error, Cause)]
#[error("--listen {0} is no address at which other processes reach this computer")]
#[cause(Configuration: "give the address of a network interface, such as 10.0.0.1:50050, or 127.0.0.1:50050 for this computer alone")]
struct NoAddress(SocketAddrV4);

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    let (Process::Scheduler { listen } | Process::Executor { listen, .. }) = &arguments.process;
    if listen.ip().is_unspecified() {
        return Err(NoAddress(*listen).into());
    }
    match &arguments.process {
        Process::Scheduler { listen } => runtime()?.block_on(schedule_until_told(*listen)),
        Process::Executor {
            scheduler,
            listen,
            threads,
        } => {
            require_free(*listen)?;
            limit_threads(*threads);
            let cores = thread::available_parallelism().map_or(1, Into::into);
            let tasks = threads.map_or(cores, usize::from).max(1);
            let folder = tempfile::tempdir().map_err(IoError::on("create a temporary folder"))?;
            output::line(format_args!("executor at {listen} of {scheduler}"));
            // It ends at a signal once its work is done.
            let executed = execute(
                scheduler,
                *listen,
                folder.path(),
                tasks,
                Arc::new(ShotColumns::default()),
            );
            Ok(runtime()?.block_on(executed)?)
        }
    }
}

/// Ensures that an executor can listen at this port and the next one: Ballista does not report
/// every failure to do so.
fn require_free(listen: SocketAddrV4) -> Result<()> {
    let next = (listen.port().checked_add(1)).filter(|_| listen.port() != 0);
    let next = next.ok_or(NoAddress(listen))?;
    for address in [listen, SocketAddrV4::new(*listen.ip(), next)] {
        let bound = std::net::TcpListener::bind(address);
        let bound = bound.map_err(IoError::on("listen at the address"));
        drop(bound.in_file(address.to_string())?);
    }
    Ok(())
}

fn runtime() -> Result<Runtime> {
    Ok(Runtime::new().map_err(IoError::on("start threads"))?)
}

/// Runs a scheduler until a signal, which is the regular end.
async fn schedule_until_told(listen: SocketAddrV4) -> Result<()> {
    let listener = TcpListener::bind(listen).await;
    let listener = listener.map_err(IoError::on("listen at the address"));
    let listener = listener.in_file(listen.to_string())?;
    let address = match listener.local_addr() {
        Ok(SocketAddr::V4(address)) => address,
        _ => listen,
    };
    output::line(format_args!("scheduler at df://{address}"));
    tokio::select! {
        ended = schedule(listener, address, Arc::new(ShotColumns::default())) => Ok(ended?),
        signal = told() => Ok(signal.map_err(IoError::on("wait for signals"))?),
    }
}
