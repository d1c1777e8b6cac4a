//! `areograph campaign`.

mod answer;
mod slurm;
mod task;

use std::{
    collections::BTreeSet,
    ffi::OsString,
    fs,
    path::{Path, PathBuf},
    process::ExitCode,
    sync::{Arc, atomic::AtomicBool},
};

use clap::Args;

pub(super) use self::task::{Arguments as TaskArguments, run as run_task};
use super::{
    pool::{JOBS_MAX, in_pool, jobs_or_default, limit_threads},
    progress::Progress,
    report,
};
use crate::{
    config::ExecutorKind,
    error::{Cause, Kind, Locate as _, Result, Stopped},
    flow::{
        CAMPAIGN, Campaign, Costs, PlannedSite, RunOptions, SITES, SiteEnd, check_out,
        publish_results, run_site_file, select_campaign,
    },
    service::words::counted,
    store::{hashes::HashCache, lock::SiteLock, publish::read_manifest},
    watch::Count,
};

/// Processes images and pairs of an index, selected by rule, as sites.
///
/// Every pair or image becomes a site file in OUT/sites, which is run as `areograph run` runs it: a repeated command runs the
/// stages affected by a change, and continues after an interruption.
///
/// Examples:
///   areograph campaign tharsis.toml --out products --plan
///   areograph campaign tharsis.toml --out products --jobs 8
#[derive(Debug, Clone, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Campaign file (TOML).
    #[arg(value_name = "CAMPAIGN.toml")]
    file: PathBuf,
    /// Output folder; each site is written to a subfolder.
    #[arg(long, default_value = "out")]
    out: PathBuf,
    /// State what the rules select and what it costs; run no site.
    #[arg(long)]
    plan: bool,
    /// Only these sites.
    #[arg(long, value_name = "SITE", num_args = 1..)]
    only: Vec<String>,
    /// Number of sites that run at the same time on this machine (SPICE itself serves one at a time); by default two more
    /// than there are cores, at most 64. Memory grows with this number.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=i64::from(JOBS_MAX)))]
    jobs: Option<u16>,
    /// Worker threads; by default one per core. Products do not depend on it.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Read all input files, stored outputs and products again, even if unchanged.
    #[arg(long)]
    rehash: bool,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Reasons why no site runs.
#[derive(Debug, thiserror::Error, Cause)]
enum NotRun {
    #[error("the campaign has no site {0:?}")]
    #[cause(Configuration: "list its sites with --plan --json, or omit --only")]
    Unknown(String),
    #[error("{site} is left out: {lack}")]
    #[cause(Input: "provide this file, or change the campaign")]
    LeftOut { site: String, lack: String },
    #[error("the rules select none of {0}")]
    #[cause(Configuration: "relax [select] or [[windows]]")]
    NoImage(String),
    #[error("the rules select {0}, but no pair of them")]
    #[cause(Configuration: "relax [pairs], or set pairs.singles = true")]
    NoPair(String),
    #[error(
        "this folder contains the results of the campaign {found:?}; expected those of {own:?} or none"
    )]
    #[cause(Configuration: "give each campaign its own --out")]
    OtherCampaign { found: String, own: String },
    #[error("this folder contains {0:?}; expected the results of a campaign, or no folder")]
    #[cause(Configuration: "move this folder, or name another folder with --out")]
    Foreign(OsString),
}

pub(super) fn run(arguments: &Arguments) -> ExitCode {
    match ran(arguments) {
        Ok(code) => code,
        Err(failure) => report(&failure),
    }
}

fn ran(arguments: &Arguments) -> Result<ExitCode> {
    let campaign = Arc::new(select_campaign(&arguments.file)?);
    for remark in &campaign.remarks {
        tracing::warn!("{remark}");
    }
    is_selected(&campaign, arguments).in_file(&arguments.file)?;
    if arguments.plan {
        let costs = Costs::read(&arguments.out);
        answer::plan(
            &campaign,
            costs,
            jobs_or_default(arguments.jobs, arguments.threads),
            arguments.json,
        );
        return Ok(ExitCode::SUCCESS);
    }
    check_out(&arguments.out, &[])?;
    is_own_folder(&campaign, &arguments.out)?;
    // Two commands would replace each other's site files and tasks.
    let _lock = SiteLock::take(&arguments.out.join(SITES))?;
    limit_threads(arguments.threads);
    if arguments.only.is_empty() {
        for stale in campaign.remove_stale_site_files(&arguments.out)? {
            tracing::info!("{stale}: no longer a site of the campaign; its products remain");
        }
    }
    let only: BTreeSet<&String> = arguments.only.iter().collect();
    let is_wanted = |site: &PlannedSite| only.is_empty() || only.contains(&site.id);
    let numbers = 0..campaign.sites.len();
    let wanted: Vec<usize> = numbers
        .filter(|number| is_wanted(&campaign.sites[*number]))
        .collect();
    let ended = match campaign.config.executor.kind {
        ExecutorKind::Local => on_this_machine(&campaign, &wanted, arguments)?,
        ExecutorKind::Slurm => slurm::run_sites(&campaign, &wanted, &arguments.out)?,
    };
    let interrupted = Kind::Interrupted.exit_code();
    if ended.iter().any(|of| of.failure() == Some(interrupted)) {
        return Err(Stopped.into());
    }
    let mut costs = Costs::default();
    ended
        .iter()
        .filter_map(SiteEnd::costs)
        .for_each(|of_site| costs.add(of_site));
    if costs.images > 0
        && let Err(failure) = costs.keep(&arguments.out)
    {
        tracing::warn!("the costs are not kept for later plans: {failure}");
    }
    let sites = campaign.results_of(&ended, &arguments.out)?;
    let results = publish_results(&arguments.out, &campaign.config.campaign, &sites)?;
    Ok(answer::ended(&campaign, &ended, &results, arguments.json))
}

/// Refuses a campaign without sites, and unknown sites.
fn is_selected(campaign: &Campaign, arguments: &Arguments) -> std::result::Result<(), NotRun> {
    let is_site = |id: &&String| campaign.sites.iter().any(|site| site.id == **id);
    if let Some(unknown) = arguments.only.iter().find(|id| !is_site(id)) {
        let mut left_out = campaign.left_out.iter();
        return Err(match left_out.find(|of| of.site == *unknown) {
            Some(of) => NotRun::LeftOut {
                site: of.site.clone(),
                lack: of.lack.clone(),
            },
            None => NotRun::Unknown(unknown.clone()),
        });
    }
    if campaign.images.is_empty() {
        return Err(NotRun::NoImage(counted(campaign.excluded, "image")));
    }
    if campaign.sites.is_empty() && campaign.left_out.is_empty() {
        return Err(NotRun::NoPair(counted(campaign.images.len(), "image")));
    }
    Ok(())
}

/// Refuses the folder of another campaign, whose site files and results would be replaced, and a foreign folder in the place
/// of the results.
fn is_own_folder(campaign: &Campaign, out: &Path) -> Result<()> {
    let folder = out.join(CAMPAIGN);
    let own = &campaign.config.campaign;
    let found = match read_manifest(&folder) {
        Some(manifest) if manifest.site == *own => return Ok(()),
        Some(manifest) => manifest.site,
        None => {
            let entries = fs::read_dir(&folder).into_iter().flatten().flatten();
            let mut entries = entries.map(|entry| entry.file_name());
            let is_foreign = |name: &OsString| !name.to_string_lossy().starts_with('.');
            return match entries.find(is_foreign) {
                Some(name) => Err(NotRun::Foreign(name)).in_file(folder),
                None => Ok(()),
            };
        }
    };
    let own = own.clone();
    Err(NotRun::OtherCampaign { found, own }).in_file(folder)
}

/// Runs the sites on this machine; they are returned in their order.
fn on_this_machine(
    campaign: &Arc<Campaign>,
    sites: &[usize],
    arguments: &Arguments,
) -> Result<Vec<SiteEnd>> {
    let hashes = HashCache::in_folder(&arguments.out, arguments.rehash);
    let stop = Arc::new(AtomicBool::new(false));
    let all = sites.len();
    let work = sites.iter().map(|number| {
        let number = *number;
        let (campaign, stop) = (Arc::clone(campaign), Arc::clone(&stop));
        let (hashes, out) = (hashes.clone(), arguments.out.clone());
        move || {
            let path = campaign.write_site_file(&campaign.sites[number], &out)?;
            Ok(run_site_file(&path, &RunOptions::of(&out, &stop, &hashes)))
        }
    });
    let progress = Progress::of_work(&campaign.config.campaign);
    let mut ended: Vec<Option<SiteEnd>> = (0..all).map(|_| None).collect();
    let mut done = 0;
    in_pool(
        jobs_or_default(arguments.jobs, arguments.threads),
        &stop,
        work,
        |place, result| {
            done += 1;
            let of = "sites";
            let all = all as u64;
            progress.count("run", Count { done, all, of });
            let id = &campaign.sites[sites[place]].id;
            ended[place] = Some(result.unwrap_or_else(|failure| SiteEnd::failed(id, &failure)));
        },
    )?;
    Ok(ended.into_iter().flatten().collect())
}
