//! Files of archives: before the comparisons of a night, `areograph fetch` runs as a separate process, first for the
//! indexes and then for each site file.

use std::{
    path::{Path, PathBuf},
    process::Stdio,
    time::Duration,
};

use rustix::process::{Pid, Signal, kill_process_group};
use serde_json::json;
use tokio::{
    io::{AsyncRead, AsyncReadExt as _},
    process::{Child, Command},
    task::spawn_blocking,
    time::timeout,
};

use super::{
    alerts::{Alert, tell_edge},
    core::Core,
    listing::site_files,
    workers::Workers,
};
use crate::database::{About, Stored, append};
use areograph_config::{AlertKind, ServiceConfig};

/// Bytes kept of the end of a complaint.
const COMPLAINT_MAX: usize = 2_000;

/// Brings the copies of the indexes up to date and fetches what site files need. A failure is an alert; others
/// continue.
pub(super) async fn fetch_all<W: Workers>(core: &Core<W>) {
    if let Err(error) = fetch(core).await {
        tracing::error!("fetching files failed: {error}");
    }
}

async fn fetch<W: Workers>(core: &Core<W>) -> Stored<()> {
    let config = core.shared.config();
    let mut failures: Vec<String> = Vec::new();
    let mut fetched = 0_usize;
    if let Some(folder) = &config.fetch.generic_kernels {
        match run(core, &config, What::Generic(folder)).await {
            Outcome::Stopped => return Ok(()),
            Outcome::Failed(why) => failures.push(format!("generic kernels: {why}")),
            Outcome::Done => {}
        }
    }
    match run(core, &config, What::Indexes).await {
        Outcome::Stopped => return Ok(()),
        // Without its hosts, every site would wait for them in vain.
        Outcome::Failed(why) => failures.push(format!("indexes: {why}")),
        Outcome::Done => {
            let folders = config.inputs.sites.clone();
            let sites = spawn_blocking(move || files_of_sites(&folders)).await;
            for site in sites.unwrap_or_default() {
                match run(core, &config, What::Site(&site)).await {
                    Outcome::Stopped => return Ok(()),
                    Outcome::Done => fetched += 1,
                    Outcome::Failed(why) => {
                        let name = site.file_name().unwrap_or_default().to_string_lossy();
                        failures.push(format!("{name}: {why}"));
                    }
                }
            }
        }
    }
    let now_ms = core.now_ms();
    core.shared.write(|transaction| {
        let data = json!({ "sites": fetched, "failures": failures });
        append(transaction, now_ms, "fetch", About::default(), &data)?;
        let text = format!("archive files were not fetched: {}", failures.join("; "));
        tell_edge(
            transaction,
            &config,
            now_ms,
            ("fetch", !failures.is_empty()),
            (
                &Alert::of_service(AlertKind::FetchFailed, &text),
                Some(&Alert::of_service(
                    AlertKind::Recovered,
                    "archive files are being fetched again",
                )),
            ),
        )
    })
}

/// Files of sites, in order; a folder that cannot be read has none, as its poll reports.
fn files_of_sites(folders: &[PathBuf]) -> Vec<PathBuf> {
    let listed = folders.iter().filter_map(|folder| site_files(folder).ok());
    let mut files: Vec<PathBuf> = listed.flatten().collect();
    files.sort();
    files
}

/// End of a process.
#[derive(Debug, PartialEq)]
enum Outcome {
    Done,
    Failed(String),
    /// The service ends.
    Stopped,
}

/// Target of a fetch process.
#[derive(Debug, Clone, Copy)]
enum What<'a> {
    /// Copies of the indexes.
    Indexes,
    /// The latest generic kernels, into a folder.
    Generic(&'a Path),
    /// The files of a site, by the indexes that are there.
    Site(&'a Path),
}

async fn run<W: Workers>(core: &Core<W>, config: &ServiceConfig, what: What<'_>) -> Outcome {
    let fetch = &config.fetch;
    let mut command = Command::new(&core.shared.program);
    command.args(["--quiet", "fetch"]);
    match what {
        What::Indexes => command.arg("--index"),
        What::Generic(folder) => command.arg("--generic-kernels").arg(folder),
        What::Site(site) => command.arg(site).arg("--offline-index"),
    };
    command.arg("--into").arg(&fetch.folder);
    if let Some(archives) = &fetch.archives {
        command.arg("--archives").arg(archives);
    }
    command
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .process_group(0)
        .kill_on_drop(true);
    let mut child = match command.spawn() {
        Ok(child) => child,
        Err(error) => return Outcome::Failed(error.to_string()),
    };
    let group = child.id().and_then(|id| i32::try_from(id).ok());
    let limit = Duration::from_secs_f64(fetch.limit_s);
    let ended = tokio::select! {
        ended = timeout(limit, to_the_end(&mut child)) => {
            ended.unwrap_or_else(|_| Outcome::Failed(format!("did not end within {} s", fetch.limit_s)))
        }
        () = core.shared.ending.cancelled() => Outcome::Stopped,
    };
    if let Some(group) = group.and_then(Pid::from_raw) {
        // Received parts are kept, and no file is ever incomplete under its name.
        let _ = kill_process_group(group, Signal::KILL);
    }
    ended
}

async fn to_the_end(child: &mut Child) -> Outcome {
    let complaint = match child.stderr.take() {
        Some(errors) => end_of(errors).await,
        None => String::new(),
    };
    match child.wait().await {
        Ok(status) if status.success() => Outcome::Done,
        Ok(status) => Outcome::Failed(format!("{status}: {}", complaint.trim())),
        Err(error) => Outcome::Failed(error.to_string()),
    }
}

/// The end of a text, read to its end so that the process never waits for its reader.
async fn end_of(mut text: impl AsyncRead + Unpin) -> String {
    let (mut end, mut buffer) = (Vec::new(), vec![0; 4096]);
    while let Ok(count @ 1..) = text.read(&mut buffer).await {
        end.extend(buffer.iter().take(count));
        let surplus = end.len().saturating_sub(COMPLAINT_MAX);
        end.drain(..surplus);
    }
    String::from_utf8_lossy(&end).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn the_end_of_a_long_complaint_is_kept() {
        let long = format!("{}the reason", "x".repeat(100_000));
        let end = end_of(long.as_bytes()).await;
        assert!(end.len() == COMPLAINT_MAX && end.ends_with("the reason"));
    }
}
