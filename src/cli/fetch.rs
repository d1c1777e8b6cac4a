//! `areograph fetch`.

mod show;
mod wish;

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use self::wish::needs;
use super::{
    stop::Signals,
    windows::{BOX, BoxMeaning, edges},
};
use crate::{
    error::{Error, Kind as ErrorKind, Result},
    fetch::{
        Archives, FetchError, Filling, Outcome,
        audit::{audit, verify},
        plan::Plan,
    },
    flow::Needs,
};

/// Fetches the files that a site needs from the archives of the mission.
///
/// A site file states what is needed: its images, and the folders and files that do not exist yet. Without a site file,
/// options state it. Kernels are chosen by the coverage in the index of their archive, laser files by orbits, images by
/// the cumulative index, tables of shots by the windows. Transfers are resumed, and files are verified by size and
/// checksum, tables of shots by their rows; a file appears complete or not at all. fetch.json records every file. Other
/// files are never replaced without --replace.
///
/// Examples:
///   areograph fetch gale.toml --index
///   areograph fetch gale.toml --plan
///   areograph fetch gale.toml
///   areograph fetch --into mars --image E02-00665 --dates 2001-03-01,2001-03-09
///   areograph fetch --into gusev --box 175,178.2,-15.1,-14.1
///   areograph fetch --generic-kernels kernels
///   areograph fetch gale.toml --audit
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
#[allow(clippy::struct_excessive_bools, reason = "command-line switches")]
pub(super) struct Arguments {
    /// Site files (TOML), folders or globs of them; their inputs may be missing.
    #[arg(value_name = "SITE.toml")]
    sites: Vec<PathBuf>,
    /// Folder of fetch.json and of copies of the indexes; also of the files that no site file places. By default the
    /// folder of the first site file, else the current folder.
    #[arg(long, value_name = "DIR")]
    into: Option<PathBuf>,
    /// An image of the mission.
    #[arg(long = "image", value_name = "PRODUCT")]
    images: Vec<String>,
    /// First and last day for kernels and laser files.
    #[arg(long, value_name = "DAY,DAY", value_parser = wish::days)]
    dates: Vec<[crate::fetch::Utc; 2]>,
    /// West, east, south and north edge, degrees (longitudes -360 to 360): a table of the shots in this box, from the
    /// Orbital Data Explorer.
    #[arg(id = BOX, long, value_name = "W,E,S,N", value_parser = edges, allow_hyphen_values = true)]
    edges_deg: Option<[f64; 4]>,
    #[command(flatten)]
    meaning: BoxMeaning,
    /// Fetch NAIF's latest generic leap-second kernel into this folder.
    #[arg(long, value_name = "DIR")]
    generic_kernels: Option<PathBuf>,
    /// First and last orbit of the laser files.
    #[arg(long, value_name = "FIRST,LAST", value_parser = wish::orbits)]
    orbits: Vec<[u32; 2]>,
    /// Only files of these kinds.
    #[arg(long, value_name = "KIND", value_delimiter = ',')]
    only: Vec<Kind>,
    /// File with other hosts or layouts, in the form of config/archives/mgs.toml.
    #[arg(long, value_name = "FILE")]
    archives: Option<PathBuf>,
    /// Update the copies of the indexes, and exit.
    #[arg(long, conflicts_with_all = ["plan", "verify", "audit"])]
    index: bool,
    /// List the files with sizes and reasons, from the copies of the indexes, and exit; no archive is contacted.
    #[arg(long, conflicts_with_all = ["verify", "audit"])]
    plan: bool,
    /// Read every fetched file again, compare it with its record, and exit.
    #[arg(long, conflicts_with = "audit")]
    verify: bool,
    /// Compare the folder with the copies of the indexes, list files that are missing, differ or are not needed, and exit.
    #[arg(long)]
    audit: bool,
    /// Do not request new indexes first.
    #[arg(long)]
    offline_index: bool,
    /// Replace files with different content.
    #[arg(long)]
    replace: bool,
}

/// Kinds of files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Kind {
    /// SPICE kernels.
    Kernels,
    /// PEDR files.
    Pedr,
    /// Images with their labels.
    Images,
    /// Tables of the shots in windows.
    Shots,
}

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    let archives = match &arguments.archives {
        Some(path) => Archives::with(path)?,
        None => Archives::built_in()?,
    };
    let signals = Signals::heard()?;
    let filling = Filling::of(&archives, &arguments.folder(), signals.stop())?;
    if arguments.verify {
        return verified(&filling);
    }
    let Needs { wish, notes } = needs(arguments)?;
    let mut indexes = Filling::indexes_of(&wish);
    if arguments.index {
        // For `areograph init --place`, which looks for images.
        indexes.images |=
            arguments.sites.is_empty() && wish.is_empty() && arguments.takes(Kind::Images);
        let changed = filling.refresh(indexes)?;
        super::output::line(format_args!("indexes are up to date; changed: {changed}"));
        return Ok(());
    }
    if !(arguments.plan || arguments.audit || arguments.offline_index) {
        filling.refresh(indexes)?;
    }
    let mut plan = filling.plan(&wish)?;
    plan.notes.splice(0..0, notes);
    if arguments.audit {
        show::audit(&audit(&filling, &plan)?);
        return Ok(());
    }
    if arguments.plan {
        show::plan(&plan, &filling.standing(&plan)?);
        return Ok(());
    }
    fetched(&filling, &plan, arguments.replace)
}

impl Arguments {
    fn folder(&self) -> PathBuf {
        let of_site = || {
            let folder = self.sites.first()?.parent()?;
            (folder != Path::new("")).then(|| folder.to_owned())
        };
        let given = self.into.clone().or_else(of_site);
        given.unwrap_or_else(|| PathBuf::from("."))
    }

    fn takes(&self, kind: Kind) -> bool {
        self.only.is_empty() || self.only.contains(&kind)
    }
}

fn verified(filling: &Filling<'_>) -> Result<()> {
    let (files, damaged) = verify(filling)?;
    for one in &damaged {
        super::output::line(format_args!("{}: {}", one.path.display(), one.problem));
    }
    if damaged.is_empty() {
        super::output::line(format_args!(
            "files unchanged since they were fetched: {files}"
        ));
        return Ok(());
    }
    let damaged = damaged.len();
    Err(FetchError::Damaged { damaged, files }.into())
}

fn fetched(filling: &Filling<'_>, plan: &Plan, replace: bool) -> Result<()> {
    let outcomes = filling.fetch(plan, replace, &show::outcome)?;
    show::lacks(plan);
    show::summary(&outcomes);
    let failed = |outcome: &&Outcome| outcome.result.is_err();
    let failed = outcomes.iter().filter(failed).count();
    if failed > 0 {
        let mut failures: Vec<Error> = outcomes
            .into_iter()
            .filter_map(|outcome| outcome.result.err())
            .collect();
        let planned = plan.files.len();
        // One file's failure is the failure of the command, and so is a lack that all failures share.
        let is_lack = failures
            .iter()
            .all(|failure| failure.kind() == ErrorKind::Coverage);
        return Err(if failed == 1 || is_lack {
            failures.swap_remove(0)
        } else {
            FetchError::Incomplete { failed, planned }.into()
        });
    }
    match plan.lacks.len() {
        0 => Ok(()),
        lacks => Err(FetchError::Lacks { lacks }.into()),
    }
}
