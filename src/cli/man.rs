//! `areograph man`.

use std::{fs, path::PathBuf};

use clap::{Args, CommandFactory};

use super::Cli;
use crate::{
    error::{IoError, Locate, Result},
    files::{Mark, MarkAt, PartialFolder, require_own},
    store::atomic,
};

/// Mark by which an earlier page is recognised.
const PAGE: Mark = Mark {
    what: "a manual page of areograph",
    at: MarkAt::Head("\n.TH areograph", 512),
};

/// Writes the manual pages, one for each command, in the format of `man`.
///
/// Example: `areograph man ~/.local/share/man/man1`
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Folder of the pages; it is created if necessary.
    directory: PathBuf,
}

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    let directory = &arguments.directory;
    fs::create_dir_all(directory)
        .map_err(IoError::on("create the folder"))
        .in_file(directory)?;
    let generated = || {
        let draft = PartialFolder::new_in(directory)?;
        clap_mangen::generate_to(Cli::command(), draft.path())?;
        let pages = fs::read_dir(draft.path())?.map(|page| {
            let page = page?;
            Ok((directory.join(page.file_name()), fs::read(page.path())?))
        });
        pages.collect::<std::io::Result<Vec<_>>>()
    };
    let pages = generated()
        .map_err(IoError::on("write the manual pages"))
        .in_file(directory)?;
    for (path, _) in &pages {
        require_own(path, &PAGE)?;
    }
    let mut pages = pages.iter();
    pages.try_for_each(|(path, page)| atomic::replace(path, page, PAGE))
}
