//! `areograph check`.

use std::path::PathBuf;

use clap::Args;

use super::{load_sites, output};
use crate::{error::Error, flow::check_site, store::hashes::HashCache};

/// Checks configuration, files and kernel coverage; reports everything that a run would stumble over.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Site files (TOML).
    #[arg(required = true, value_name = "SITE.toml")]
    sites: Vec<PathBuf>,
    /// Folder of products; kernels that a run into it has read are not read again when they did not change.
    #[arg(long, default_value = "out")]
    out: PathBuf,
    /// Read every input file again, whatever is known of files that did not change.
    #[arg(long)]
    rehash: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Error> {
    let hashes = HashCache::in_folder(&arguments.out, arguments.rehash);
    let mut last = None;
    for site in load_sites(&arguments.sites)? {
        let checked = check_site(&site, &hashes);
        let word = if checked.failures.is_empty() {
            "ready"
        } else {
            "NOT READY"
        };
        output::line(format_args!("{}: {word}", site.site));
        for finding in checked.findings {
            output::line(format_args!("  {finding}"));
        }
        for failure in checked.failures {
            if let Some(earlier) = last.replace(failure) {
                output::error(earlier);
            }
        }
    }
    last.map_or(Ok(()), Err)
}
