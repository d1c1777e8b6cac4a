//! `areograph run`.

use std::{
    path::PathBuf,
    process::ExitCode,
    sync::{Arc, atomic::AtomicBool},
};

use clap::{Args, builder::PossibleValuesParser};
use serde_json::json;

use super::{
    load_sites, open, output, plan,
    pool::{JOBS_MAX, in_pool, jobs_or_default, limit_threads},
    progress::Progress,
    report,
    single::{RunFlags, stopped_after, untested},
};
use crate::{
    config::SiteConfig,
    error::{Error, Kind},
    flow::{
        Ending, Observer, PUBLISH, RunOptions, RunOutcome, STAGES, Task, check_out, publish_sites,
        run_answer, run_site,
    },
    products::REPORT,
    service::words::counted,
    store::{hashes::HashCache, manifest::Manifest},
};

/// Runs sites from kernels to validated products in `<out>/<site>`.
///
/// A stage runs only if one of its inputs has changed; the log (-v) names this input.
///
/// Examples:
///   areograph run sites/*.toml --out products
///   areograph run sites/gusev.toml --out products --open
///   areograph run sites/gusev.toml --out products --until register -v
#[derive(Debug, Clone, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Site files (TOML), folders or globs of them.
    #[arg(required = true, value_name = "SITE.toml")]
    sites: Vec<PathBuf>,
    /// Output folder; each site is written to a subfolder.
    #[arg(long, default_value = "out")]
    out: PathBuf,
    /// Number of sites that run at the same time (SPICE itself serves one at a time); by default two more than
    /// there are cores, at most 64. Memory grows with this number.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=i64::from(JOBS_MAX)))]
    jobs: Option<u16>,
    /// Worker threads; by default one per core. Products do not depend on it.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Stop after this stage.
    #[arg(
        long,
        value_name = "STAGE",
        default_value = PUBLISH,
        hide_default_value = true,
        value_parser = PossibleValuesParser::new(STAGES)
    )]
    until: String,
    #[command(flatten)]
    flags: RunFlags,
    /// Open the page in the browser: the report of a single site, or the overview of several.
    #[arg(long)]
    open: bool,
}

impl Arguments {
    fn options<'a>(
        &'a self,
        stop: &'a AtomicBool,
        hashes: &'a HashCache,
        observer: &'a dyn Observer,
    ) -> RunOptions<'a> {
        RunOptions {
            out: self.out.clone(),
            until: &self.until,
            force: self.flags.force,
            stop,
            hashes,
            roots: &[],
            observer,
        }
    }
}

/// Runs the sites and reports the outcome of each, in the order given.
pub(super) fn run(arguments: &Arguments) -> ExitCode {
    let sites = match load_sites(&arguments.sites) {
        Ok(sites) => sites,
        Err(failure) => return report(&failure),
    };
    if let Err(failure) = check_out(&arguments.out, &sites) {
        return report(&failure);
    }
    let hashes = HashCache::in_folder(&arguments.out, arguments.flags.rehash);
    if arguments.flags.plan {
        let never = AtomicBool::new(false);
        let options = arguments.options(&never, &hashes, &());
        let tasks: Vec<Task<'_>> = sites.iter().map(Task::Site).collect();
        return super::finish(plan::print(&tasks, &options, arguments.flags.json));
    }
    limit_threads(arguments.threads);
    let outcomes = match run_all(sites, arguments, &hashes) {
        Ok(outcomes) => outcomes,
        Err(failure) => return report(&failure),
    };
    print(&outcomes, arguments.flags.json);
    // If the folder could not be created, the run has already reported it.
    let page = arguments
        .out
        .is_dir()
        .then(|| publish_sites(&arguments.out));
    match &page {
        Some(Ok(page)) if !arguments.flags.json && outcomes.len() > 1 => {
            output::line(format_args!("all sites: {}", page.display()));
        }
        Some(Err(failure)) => output::error(failure),
        _ => {}
    }
    if arguments.open {
        open_page(&outcomes, page.as_ref().and_then(|page| page.as_ref().ok()));
    }
    // A failure outranks an invalid site; of several failures, the first counts.
    let codes: Vec<u8> = outcomes
        .iter()
        .map(exit_code)
        .chain(
            page.and_then(Result::err)
                .map(|failure| failure.kind().exit_code()),
        )
        .filter(|code| *code != 0)
        .collect();
    let failed = codes
        .iter()
        .find(|code| **code != Kind::Validation.exit_code());
    ExitCode::from(failed.or(codes.first()).copied().unwrap_or(0))
}

type Outcome = Result<RunOutcome, Error>;

/// Runs at most `jobs` sites at a time; after a signal each finishes its stage, or leaves a long one, and stops.
fn run_all(
    sites: Vec<SiteConfig>,
    arguments: &Arguments,
    hashes: &HashCache,
) -> Result<Vec<Outcome>, Error> {
    let stop = Arc::new(AtomicBool::new(false));
    let mut outcomes: Vec<Option<Outcome>> = sites.iter().map(|_| None).collect();
    let work = sites.into_iter().map(|site| {
        let stop = Arc::clone(&stop);
        let (arguments, hashes) = (arguments.clone(), hashes.clone());
        move || {
            let progress = Progress::of(Task::Site(&site));
            run_site(&site, &arguments.options(&stop, &hashes, &progress))
        }
    });
    in_pool(
        jobs_or_default(arguments.jobs, arguments.threads),
        &stop,
        work,
        |number, outcome| {
            outcomes[number] = Some(outcome);
        },
    )?;
    Ok(outcomes.into_iter().flatten().collect())
}

fn exit_code(outcome: &Outcome) -> u8 {
    match outcome {
        Err(failure) => failure.kind().exit_code(),
        Ok(outcome) => match outcome.manifest() {
            Some(manifest) if !manifest.verdict.valid => Kind::Validation.exit_code(),
            _ => 0,
        },
    }
}

fn print(outcomes: &[Outcome], as_json: bool) {
    if as_json {
        output::json(&outcomes.iter().map(outcome_json).collect());
    }
    for outcome in outcomes {
        match outcome {
            Err(failure) => output::error(failure),
            Ok(outcome) if !as_json => print_outcome(outcome),
            Ok(_) => {}
        }
    }
}

fn print_outcome(outcome: &RunOutcome) {
    let (site, folder) = (&outcome.name, outcome.folder.display());
    let (what, manifest) = match &outcome.ending {
        Ending::StoppedAfter(stage) => return stopped_after(outcome, stage),
        Ending::Published(manifest) => ("products", manifest),
        Ending::Unchanged(manifest) => ("nothing changed; products are up to date", manifest),
    };
    let verdict = &manifest.verdict;
    output::line(format_args!(
        "{site}: {}; {what} in {folder}, see report/index.html",
        verdict.word()
    ));
    let contents = contents(manifest);
    if !contents.is_empty() {
        output::line(format_args!("  {contents}"));
    }
    for reason in verdict.reasons.iter().chain(&verdict.remarks) {
        output::line(format_args!("  {reason}"));
    }
    for check in verdict.key_checks() {
        output::line(format_args!("  {check}"));
    }
    untested(verdict);
}

/// The content of the products in numbers, and the principal file.
fn contents(manifest: &Manifest) -> String {
    let count = |name: &str| manifest.counts.get(name).copied().unwrap_or(0);
    let mut parts = Vec::new();
    if count("footprints") > 0 {
        let footprints = counted(count("footprints"), "footprint");
        let profiles = counted(count("profiles"), "profile");
        parts.push(format!("{footprints} of {profiles}"));
    }
    if count("images") > 0 {
        parts.push(counted(count("images"), "image"));
    }
    if count("registered") > 0 {
        let (inside, all) = (count("registered_inside"), count("registered"));
        parts.push(format!(
            "{inside} of {all} projected footprints inside an image"
        ));
    }
    let has = |name: &&&str| {
        let mut products = manifest.products.iter();
        products.any(|product| product.path == ***name)
    };
    let principal = ["registered_footprints.parquet", "footprints.parquet"];
    let mut principal = principal.iter();
    let file = principal.find(has).filter(|_| count("footprints") > 0);
    let file = file.map_or_else(String::new, |file| format!("; see {file}"));
    format!("{}{file}", parts.join(", "))
}

/// The report of the only site that has products, or the page over all of them.
fn open_page(outcomes: &[Outcome], over_all: Option<&PathBuf>) {
    let mut reports = outcomes.iter().flatten().filter_map(|outcome| {
        let report = outcome.folder.join(REPORT);
        report.is_file().then_some(report)
    });
    let page = match (reports.next(), reports.next()) {
        (Some(report), None) => Some(report),
        _ => over_all.cloned(),
    };
    if let Some(page) = page {
        open::page(&page);
    }
}

fn outcome_json(outcome: &Outcome) -> serde_json::Value {
    match outcome {
        Err(failure) => json!({
            "site": failure.site,
            "error": failure.to_string(),
            "exit_code": failure.kind().exit_code(),
        }),
        Ok(outcome) => run_answer(outcome),
    }
}
