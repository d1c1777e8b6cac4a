//! Processes of a cluster on this computer.

use std::{
    io::{BufRead as _, BufReader},
    net::TcpListener,
    process::{Child, Stdio},
};

use crate::areograph;

/// A process that ends with its owner.
#[derive(Debug)]
pub(crate) struct Process(Child);

impl Process {
    pub(crate) fn kill(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.kill();
    }
}

/// A scheduler and its executors, in this order of their ends.
#[derive(Debug)]
pub(crate) struct Cluster {
    pub(crate) executors: Vec<Process>,
    pub(crate) scheduler: Process,
    pub(crate) url: String,
}

/// Starts a process and reads the line that it prints.
fn started(arguments: &[&str]) -> (Process, String) {
    let mut command = areograph();
    command.args(["--quiet", "pedr", "cluster"]).args(arguments);
    let mut child = command.stdout(Stdio::piped()).spawn().unwrap();
    let mut line = String::new();
    let stdout = child.stdout.take().unwrap();
    BufReader::new(stdout).read_line(&mut line).unwrap();
    (Process(child), line)
}

/// A free port whose next one is free too.
fn free_ports() -> u16 {
    loop {
        let first = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = first.local_addr().unwrap().port();
        let next = port.checked_add(1);
        if let Some(next) = next
            && TcpListener::bind(("127.0.0.1", next)).is_ok()
        {
            return port;
        }
    }
}

impl Cluster {
    /// Starts a scheduler and executors of one thread each.
    pub(crate) fn of(executors: usize) -> Self {
        let (scheduler, line) = started(&["scheduler", "--listen", "127.0.0.1:0"]);
        let url = line.trim().strip_prefix("scheduler at ").unwrap();
        let mut cluster = Self {
            executors: Vec::new(),
            scheduler,
            url: url.to_owned(),
        };
        for _ in 0..executors {
            cluster.add_executor();
        }
        cluster
    }

    pub(crate) fn add_executor(&mut self) {
        let listen = format!("127.0.0.1:{}", free_ports());
        let url = self.url.clone();
        let arguments = ["executor", "--scheduler", &url, "--listen", &listen];
        let (executor, line) = started(&[&arguments[..], &["--threads", "1"]].concat());
        assert_eq!(line.trim(), format!("executor at {listen} of {url}"));
        self.executors.push(executor);
    }
}
