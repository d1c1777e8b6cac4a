//! Workers on nodes of a Slurm cluster.
//!
//! `srun` is the process of such a worker on this machine: it passes input and output on, and ends with the worker. Trials on
//! virtual nodes showed what it does not do: SIGKILL of `srun` leaves its job in the queue or running, without an end of
//! input, and a node that is lost to the controller continues to work. Therefore a job whose `srun` was ended by a signal is
//! cancelled by name, and a worker ends if it does not hear the service for the time of its lease (`--lease-s`).

use std::{
    ffi::OsString,
    path::Path,
    process::{Command, Stdio},
    thread,
};

use areograph_config::ServiceConfig;

/// The program that starts a worker on a node.
pub const SRUN: &str = "srun";
/// The program that cancels its job.
pub const SCANCEL: &str = "scancel";
/// Memory of a job beyond the data of its worker, for program text and files in memory, mebibytes.
const MARGIN_MIB: u64 = 256;
/// Time of a job beyond the deadline of its worker, which the service observes, minutes.
const MARGIN_MIN: u64 = 5;

/// Resources of a worker on a node.
#[derive(Debug, Clone, PartialEq)]
pub struct Srun {
    /// Name of the job, of this attempt alone.
    pub job_name: String,
    /// Threads of the worker.
    pub threads: u16,
    /// Memory limit of the worker, mebibytes.
    pub memory_mib: u32,
    /// Longest time for the task.
    pub deadline_s: f64,
    /// Longest time without a line of the service after which the worker ends.
    pub lease_s: f64,
    /// Further options.
    pub options: Vec<String>,
}

impl Srun {
    /// The resources of a run by the configuration.
    #[must_use]
    pub fn of(config: &ServiceConfig, run: &str) -> Self {
        let workers = &config.workers;
        Self {
            job_name: job_name(run),
            threads: workers.threads,
            memory_mib: workers.memory_mib,
            deadline_s: workers.deadline_s,
            lease_s: workers.silence_s,
            options: config.executor.options.clone(),
        }
    }

    /// Program and arguments that start a worker of `program`, which has this path on all nodes.
    pub(super) fn command(&self, program: &Path) -> Vec<OsString> {
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "at most 30 days"
        )]
        let minutes = (self.deadline_s / 60.0).ceil() as u64 + MARGIN_MIN;
        let memory_mib = u64::from(self.memory_mib) + MARGIN_MIB;
        let own = [
            "--ntasks=1".to_owned(),
            format!("--cpus-per-task={}", self.threads),
            format!("--mem={memory_mib}M"),
            format!("--time={minutes}"),
            format!("--job-name={}", self.job_name),
        ];
        let worker = ["worker".to_owned(), format!("--lease-s={}", self.lease_s)];
        // The last of equal options counts: the user's are first.
        let options = self.options.iter().cloned().chain(own);
        std::iter::once(SRUN.to_owned())
            .chain(options)
            .map(OsString::from)
            .chain([program.as_os_str().to_owned()])
            .chain(worker.map(OsString::from))
            .collect()
    }
}

/// Name of the job of a run.
#[must_use]
pub fn job_name(run: &str) -> String {
    format!("areograph-{run}")
}

/// Cancels the job with this name, if there is one, without waiting for the controller.
pub fn cancel(job_name: &str) {
    let mut scancel = Command::new(SCANCEL);
    scancel.args(["--quiet", "--me"]);
    scancel.arg(format!("--name={job_name}"));
    scancel.stdin(Stdio::null()).stdout(Stdio::null());
    // Without an answer of the cluster, the lease of the worker and the lock of its site remain.
    let ended =
        thread::Builder::new().spawn(move || match scancel.stderr(Stdio::null()).status() {
            Ok(status) if status.success() => {}
            failed => tracing::warn!("scancel has failed: {failed:?}"),
        });
    if let Err(error) = ended {
        tracing::warn!("scancel cannot be started: {error}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_node_has_room_and_time_beyond_the_limits_of_the_worker() {
        let srun = Srun {
            job_name: job_name("20261122_093000_j1_a1"),
            threads: 3,
            memory_mib: 1_024,
            deadline_s: 61.0,
            lease_s: 30.0,
            options: vec!["--partition=planetary".to_owned()],
        };
        let command = srun.command(Path::new("/opt/areo graph"));
        let expected = [
            "srun",
            "--partition=planetary",
            "--ntasks=1",
            "--cpus-per-task=3",
            "--mem=1280M",
            "--time=7",
            "--job-name=areograph-20261122_093000_j1_a1",
            "/opt/areo graph",
            "worker",
            "--lease-s=30",
        ];
        assert_eq!(command, expected);
    }
}
