//! `areograph report`.

use std::{
    cmp::Reverse,
    path::{Path, PathBuf},
    process::ExitCode,
};

use clap::{Args, Subcommand};
use serde_json::json;

use super::{open, output};
use crate::{
    difference::{Answer, Limits, Outcome, Pairs, RunDifference, SiteAnswer, compare, pairs},
    error::{Error, Kind},
    flow::page_again,
    report::difference_page,
    store::page::PagePath,
};

/// Rebuilds the report of a site from its products alone, or compares two runs.
///
/// No site file, kernel or stored stage is read; the page is identical, byte for byte, to the page that
/// `areograph run` wrote. Products that are missing, damaged or of another version are refused.
///
/// Examples:
///   areograph report products/gusev_crater
///   areograph report products/gusev_crater --page gusev.html
///   areograph report diff out.yesterday out --limit-m 5
#[derive(Debug, Args)]
#[allow(clippy::doc_markdown, reason = "examples are printed verbatim")]
#[command(
    verbatim_doc_comment,
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    arg_required_else_help = true
)]
pub(super) struct Arguments {
    /// Products of a site.
    #[arg(value_name = "OUT/SITE", required = true)]
    folder: Option<PathBuf>,
    /// Write the page to this file, and leave the products unchanged; its folder must exist.
    #[arg(long, value_name = "FILE.html")]
    page: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
    /// Open the page in the browser.
    #[arg(long)]
    open: bool,
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Debug, Subcommand)]
enum Command {
    Diff(DiffArguments),
}

/// Compares two runs: inputs, verdicts, statistics, and movements of all results.
///
/// Only products are read, and they are checked against their manifests.
/// A and B are folders of one site, or output folders, whose common sites are compared. A movement
/// is B − A. The exit code is 5 if a movement exceeds a limit.
///
/// Example: `areograph report diff out.yesterday out --limit-m 5 --page diff.html`
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
struct DiffArguments {
    /// Products of the first run.
    #[arg(value_name = "OUT_A")]
    a: PathBuf,
    /// Products of the second run.
    #[arg(value_name = "OUT_B")]
    b: PathBuf,
    /// Print JSON.
    #[arg(long)]
    json: bool,
    /// Write a page to this file as well; its folder must exist, and products are not overwritten.
    #[arg(long, value_name = "FILE.html")]
    page: Option<PathBuf>,
    /// Largest permitted movement of a footprint, a camera or a boresight on the ground, metres.
    #[arg(long, value_name = "METRES", value_parser = limit)]
    limit_m: Option<f64>,
    /// Largest permitted rotation of a camera, arcseconds.
    #[arg(long, value_name = "ARCSECONDS", value_parser = limit)]
    limit_arcsec: Option<f64>,
}

/// A limit as typed.
fn limit(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(limit) if limit.is_finite() && limit >= 0.0 => Ok(limit),
        _ => Err("expected a number, 0 or more".to_owned()),
    }
}

pub(super) fn run(arguments: &Arguments) -> ExitCode {
    let done = match (&arguments.command, &arguments.folder) {
        (Some(Command::Diff(arguments)), _) => diff(arguments),
        (None, folder) => again(folder.as_deref().unwrap_or(Path::new(".")), arguments),
    };
    match done {
        Ok(code) => ExitCode::from(code),
        Err(failure) => super::report(&failure),
    }
}

/// Rebuilds the page of the products in `folder`.
fn again(folder: &Path, arguments: &Arguments) -> Result<u8, Error> {
    let elsewhere = arguments.page.as_deref().map(PagePath::new).transpose()?;
    let again = page_again(folder)?;
    let path = match (&elsewhere, &arguments.page) {
        (Some(place), Some(path)) => {
            place.write(&again.page)?;
            path.clone()
        }
        _ => again.put_back()?,
    };
    if arguments.json {
        output::json(&json!({"site": again.site, "page": path}));
    } else {
        output::line(format_args!("{}: {}", again.site, path.display()));
    }
    if arguments.open {
        open::page(&path);
    }
    Ok(0)
}

/// A site and the result of its comparison.
type Compared = (String, Result<RunDifference, Error>);

fn diff(arguments: &DiffArguments) -> Result<u8, Error> {
    let limits = Limits {
        movement_m: arguments.limit_m,
        pointing_arcsec: arguments.limit_arcsec,
    };
    let page_path = arguments.page.as_deref().map(PagePath::new).transpose()?;
    let pairs = pairs(&arguments.a, &arguments.b)?;
    let sites: Vec<Compared> = pairs
        .both
        .iter()
        .map(|(a, b)| (crate::files::file_name(b), compare(a, b, &limits)))
        .collect();
    if arguments.json {
        output::json(&json!(answer(&sites, &pairs)));
    } else {
        print(&sites, &unmatched(&pairs, &limits));
    }
    let failures = || {
        sites
            .iter()
            .filter_map(|(_, compared)| compared.as_ref().err())
    };
    failures().for_each(output::error);
    if let Some(path) = &page_path {
        let compared = sites
            .iter()
            .filter_map(|(_, compared)| compared.as_ref().ok());
        let mut not_compared = unmatched(&pairs, &limits);
        not_compared.extend(failures().map(ToString::to_string));
        let page = difference_page(&compared.collect::<Vec<_>>(), &not_compared)?;
        path.write(&page)?;
    }
    Ok(exit_code(&sites, &pairs, &limits))
}

/// Sites that only one output has, one sentence each.
fn unmatched(pairs: &Pairs, limits: &Limits) -> Vec<String> {
    let gone = if *limits == Limits::default() {
        "only in A, not compared"
    } else {
        "BEYOND THE LIMIT: only in A, so limits cannot be applied"
    };
    let runs = [
        (&pairs.only_in_a, gone),
        (&pairs.only_in_b, "only in B, not compared"),
    ];
    let other = (&pairs.no_sites, "products of another flow, not compared");
    let sentences = runs
        .into_iter()
        .chain([other])
        .flat_map(|(names, what)| names.iter().map(move |name| format!("{name}: {what}")));
    sentences.collect()
}

/// The sites by severity; of several, those in which nothing changed in one line.
fn print(sites: &[Compared], unmatched: &[String]) {
    let compared = sites
        .iter()
        .filter_map(|(_, compared)| compared.as_ref().ok());
    let mut compared: Vec<&RunDifference> = compared.collect();
    compared.sort_by_key(|difference| Reverse(difference.severity()));
    let fold = compared.len() > 1;
    let (unchanged, told): (Vec<&RunDifference>, Vec<&RunDifference>) = compared
        .into_iter()
        .partition(|difference| fold && difference.is_unchanged());
    for difference in told {
        if difference.verdict_changed() {
            let [a, b] = [&difference.a, &difference.b].map(|run| run.verdict.word());
            output::line(format_args!("{}: {a} → {b}", difference.site));
        }
        output::line(format_args!(
            "{}: {}",
            difference.site,
            difference.headline()
        ));
        let (a, b) = (&difference.a.finished_utc, &difference.b.finished_utc);
        output::line(format_args!("  A of {a}, B of {b}"));
        for sentence in difference.sentences() {
            output::line(format_args!("  {sentence}"));
        }
    }
    if !unchanged.is_empty() {
        let names: Vec<&str> = unchanged.iter().map(|site| &*site.site).collect();
        output::line(format_args!("unchanged: {}", names.join(", ")));
    }
    unmatched.iter().for_each(output::line);
}

fn answer<'a>(sites: &'a [Compared], pairs: &'a Pairs) -> Answer<'a> {
    let of_site = |(site, compared): &'a Compared| match compared {
        Ok(difference) => SiteAnswer::Difference(difference),
        Err(failure) => SiteAnswer::Failed {
            site,
            error: failure.to_string(),
            exit_code: failure.kind().exit_code(),
        },
    };
    Answer {
        sites: sites.iter().map(of_site).collect(),
        only_in_a: &pairs.only_in_a,
        only_in_b: &pairs.only_in_b,
    }
}

/// A failure outranks a limit; a missing site exceeds every limit.
fn exit_code(sites: &[Compared], pairs: &Pairs, limits: &Limits) -> u8 {
    let failed = sites
        .iter()
        .find_map(|(_, compared)| compared.as_ref().err());
    if let Some(failure) = failed {
        return failure.kind().exit_code();
    }
    let beyond = |(_, compared): &Compared| {
        compared
            .as_ref()
            .is_ok_and(|difference| difference.outcome == Outcome::BeyondLimit)
    };
    let gone = *limits != Limits::default() && !pairs.only_in_a.is_empty();
    if gone || sites.iter().any(beyond) {
        return Kind::Validation.exit_code();
    }
    0
}
