//! `areograph service check`.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use clap::Args;
use serde_json::json;

use super::output;
use crate::{
    config::{Document as _, ServiceConfig, SiteConfig},
    error::{Cause, Error, Locate as _},
    files::InputFiles,
    kernel_source::{KernelList, KernelSource},
    service::{
        check::{Finding, check},
        clock::Clock,
        engine::listing::site_files,
        start::configuration,
        words::counted,
    },
    spice::KernelSet,
};

/// Checks everything that a service requires at its start.
///
/// One line per subject: configuration, folders, database, port, disk, hooks, site files, kernels. Nothing is created or
/// changed; site files are checked as far as possible without reading their data. Run the check as the user of the service.
///
/// Exit code: 0 without a failure; otherwise the code of the first failure that prevents the start or, without one, of
/// the first failure.
///
/// Example: areograph service check /etc/areograph/areograph.toml
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Configuration of the service (TOML).
    config: PathBuf,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Two site files with one name.
#[derive(Debug, thiserror::Error, Cause)]
#[error("site {site} is already defined by {}", .first.display())]
#[cause(Configuration: "give one of the sites another name")]
struct Twice {
    site: String,
    first: PathBuf,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Error> {
    let now_ms = Clock::default().now_ms();
    let file = &arguments.config;
    let mut findings = vec![];
    let loaded = configuration(file, None, now_ms);
    match loaded {
        Err(failure) => findings.push(of_file("configuration", file, true, Err(failure))),
        Ok(config) => {
            let found = Ok("valid".to_owned());
            findings.push(of_file("configuration", file, true, found));
            findings.extend(check(&config, now_ms));
            findings.extend(sites(&config));
        }
    }
    let starts = findings
        .iter()
        .all(|finding| !finding.stops || finding.found.is_ok());
    if arguments.json {
        let list: Vec<_> = findings.iter().map(document).collect();
        output::json(&json!({ "starts": starts, "findings": list }));
    } else {
        print(&findings, starts);
    }
    let faults = findings
        .into_iter()
        .filter(|finding| finding.found.is_err());
    let mut faults: Vec<Finding> = faults.collect();
    // The first failure that prevents the start determines the exit code.
    faults.sort_by_key(|fault| !fault.stops);
    let mut faults = faults.into_iter().filter_map(|fault| fault.found.err());
    let decides = faults.next();
    faults.for_each(|fault| output::error(&fault));
    decides.map_or(Ok(()), Err)
}

fn of_file(
    subject: &'static str,
    file: &Path,
    stops: bool,
    found: Result<String, Error>,
) -> Finding {
    Finding {
        subject,
        place: file.display().to_string(),
        found,
        stops,
    }
}

fn document(finding: &Finding) -> serde_json::Value {
    let (state, text) = match &finding.found {
        Ok(text) => ("ok", text.clone()),
        Err(fault) => ("failure", fault.to_string()),
    };
    json!({
        "subject": finding.subject,
        "place": finding.place,
        "state": state,
        "text": text,
        "code": finding.found.as_ref().err().map_or(0, |fault| fault.kind().exit_code()),
        "stops": finding.stops && finding.found.is_err(),
    })
}

fn print(findings: &[Finding], starts: bool) {
    for Finding {
        subject,
        place,
        found,
        ..
    } in findings
    {
        output::line(match found {
            Ok(text) if text.is_empty() => format!("ok     {subject:13}  {place}"),
            Ok(text) => format!("ok     {subject:13}  {place}: {text}"),
            Err(_) => format!("FAILED {subject:13}  {place}"),
        });
    }
    let faults = findings.iter().filter(|finding| finding.found.is_err());
    let faults = counted(faults.count(), "failure");
    let not = if starts { "" } else { "NOT " };
    output::line(format_args!("the service would {not}start; {faults}"));
}

/// The site files, each with its kernels.
fn sites(config: &ServiceConfig) -> Vec<Finding> {
    let inputs = &config.inputs;
    let roots: Vec<PathBuf> = [&inputs.sites, &inputs.kernels, &inputs.data]
        .into_iter()
        .flatten()
        .cloned()
        .collect();
    // A folder that cannot be listed is a finding of its own.
    let listed = inputs
        .sites
        .iter()
        .filter_map(|folder| site_files(folder).ok());
    let mut files: Vec<PathBuf> = listed.flatten().collect();
    files.sort();
    let mut named: BTreeMap<String, PathBuf> = BTreeMap::new();
    let read = InputFiles::default();
    let one = |file: PathBuf| {
        let found = site(&file, &roots, &mut named, &read);
        of_file("site", &file, false, found)
    };
    files.into_iter().map(one).collect()
}

fn site(
    file: &Path,
    roots: &[PathBuf],
    named: &mut BTreeMap<String, PathBuf>,
    read: &InputFiles,
) -> Result<String, Error> {
    let site = SiteConfig::load_within(file, roots)?.config;
    if let Some(first) = named.get(&site.site) {
        let (site, first) = (site.site, first.clone());
        return Err(Twice { site, first }).in_file(file);
    }
    named.insert(site.site.clone(), file.to_owned());
    let kernels = kernels(&site, read).in_site(&site.site)?;
    Ok(format!("{}, {kernels}", site.site))
}

/// The kernels of a site, which exist and are kernels.
fn kernels(site: &SiteConfig, read: &InputFiles) -> Result<String, Error> {
    let of_list = |list: &KernelList| match list {
        KernelList::Metakernel(path) => KernelSet::from_metakernel_of(read, path),
        KernelList::Files(paths) => KernelSet::from_files_of(read, paths),
    };
    let count = |set: KernelSet| set.kernels().len();
    let found = match &site.kernels.source {
        KernelSource::Listed(list) => count(of_list(list)?),
        // Which of them are read depends on the data of the site.
        KernelSource::Root(selection) => {
            return Ok(format!("kernels from {}", selection.root.display()));
        }
        KernelSource::Sets(sets) => {
            let counts = sets.iter().map(|set| of_list(&set.list).map(count));
            counts.sum::<Result<usize, Error>>()?
        }
    };
    Ok(counted(found, "kernel"))
}
