//! Sites of a campaign as array tasks of Slurm.
//!
//! Some sites are one task: a task file names their site files. The lock of each site keeps two tasks from working on it at
//! the same time.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use crate::{
    cli::{
        progress::Progress,
        slurm::{ATTEMPTS, Cluster, Resources},
        stop::Signals,
    },
    config::absolute,
    error::{Cause, Error, Kind, Result},
    flow::{Campaign, Costs, SiteEnd, SiteTask},
    watch::Count,
};

/// The command of a task.
const COMMAND: &str = "campaign-task";

/// No task with a site wrote a result.
#[derive(Debug, thiserror::Error, Cause)]
#[error("{ATTEMPTS} tasks with this site ended without a result; see the logs in {}", .0.display())]
#[cause(Io: "raise executor.memory_mb or executor.minutes, or lower executor.sites_per_task")]
struct NoResult(PathBuf);

/// Runs the sites as tasks; they are returned in their order.
///
/// # Errors
/// Site files that cannot be written; a cluster that refuses the job or does not answer; interruption, after which the job is
/// cancelled.
pub(super) fn run_sites(campaign: &Campaign, sites: &[usize], out: &Path) -> Result<Vec<SiteEnd>> {
    let signals = Signals::heard()?;
    let (out, settings) = (absolute(out)?, &campaign.config.executor);
    let name = &*campaign.config.campaign;
    let resources = Resources {
        tasks_max: settings.tasks_max,
        memory_mb: settings.memory_mb,
        minutes: minutes(campaign, Costs::read(&out)),
        threads: None,
        options: &settings.options,
    };
    let cluster = Cluster::begin(name, COMMAND, &out, resources)?;
    let mut files: BTreeMap<&str, PathBuf> = BTreeMap::new();
    let mut ended: BTreeMap<String, SiteEnd> = BTreeMap::new();
    for site in sites.iter().map(|number| &campaign.sites[*number]) {
        match campaign.write_site_file(site, &out) {
            Ok(path) => {
                files.insert(&site.id, path);
            }
            Err(failure) => {
                ended.insert(site.id.clone(), SiteEnd::failed(&site.id, &failure));
            }
        }
    }
    let progress = Progress::of_work(name);
    let interrupted = Kind::Interrupted.exit_code();
    for attempt in 1..=ATTEMPTS {
        let left = files.iter().filter(|(id, _)| !ended.contains_key(**id));
        let left: Vec<PathBuf> = left.map(|(_, path)| path.clone()).collect();
        let chunks = left.chunks(settings.sites_per_task as usize);
        let tasks = chunks.map(|chunk| SiteTask {
            site_files: chunk.to_vec(),
            out: out.clone(),
        });
        let tasks: Vec<SiteTask> = tasks.collect();
        let already = ended.len();
        let told = |results: &BTreeMap<usize, Vec<SiteEnd>>| {
            let done = already + results.values().map(Vec::len).sum::<usize>();
            let (done, all) = (done as u64, sites.len() as u64);
            let of = "sites";
            progress.count("run", Count { done, all, of });
        };
        let results = cluster.attempt(attempt, &tasks, signals.stop(), result_of, told)?;
        let results = results.into_values().flatten();
        // Sites that were interrupted on their node run again.
        let results = results.filter(|of| of.failure() != Some(interrupted));
        ended.extend(results.map(|of| (of.site.clone(), of)));
    }
    for id in files.into_keys() {
        if !ended.contains_key(id) {
            let failure = Error::from(NoResult(cluster.folder().to_owned())).in_site(id);
            ended.insert(id.to_owned(), SiteEnd::failed(id, &failure));
        }
    }
    // Logs of failed tasks remain.
    if ended.values().all(|of| of.failure().is_none()) {
        cluster.end()?;
    }
    Ok(ended.into_values().collect())
}

/// Time limit of a task, by the costs of processed sites.
fn minutes(campaign: &Campaign, costs: Option<Costs>) -> u32 {
    const AT_LEAST: u32 = 10;
    const UNKNOWN: u32 = 60;
    const MARGIN: f64 = 10.0;
    let settings = &campaign.config.executor;
    let measured = costs.map(|costs| {
        let images = campaign.sites.iter().map(|site| site.images.len());
        let images = images.max().unwrap_or(1) as f64 * f64::from(settings.sites_per_task);
        let minutes = MARGIN * costs.seconds / costs.images as f64 * images / 60.0;
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a bounded time"
        )]
        let minutes = minutes.ceil().min(100_000.0) as u32;
        minutes.max(AT_LEAST)
    });
    settings.minutes.or(measured).unwrap_or(UNKNOWN)
}

/// The result of a task; `None` if it does not contain exactly its sites.
fn result_of(task: &SiteTask, bytes: &[u8]) -> Option<Vec<SiteEnd>> {
    let result: Vec<SiteEnd> = serde_json::from_slice(bytes).ok()?;
    let sites = task.site_files.iter().map(|path| path.file_stem());
    let sites = sites.map(|stem| stem.unwrap_or_default().to_string_lossy());
    let is_whole = result.len() == task.site_files.len()
        && result.iter().zip(sites).all(|(of, site)| of.site == site);
    is_whole.then_some(result)
}
