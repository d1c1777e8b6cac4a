//! `areograph service init`.

use std::{fs, path::PathBuf};

use clap::Args;

use super::output;
use crate::{
    config::{Document as _, ServiceConfig},
    error::{Cause, Error, IoError, Locate as _},
    service::{clock::Clock, private, start::configuration},
    store::atomic,
};

/// Name of the configuration.
const FILE: &str = "areograph.toml";

/// Writes the configuration of a service, with its folders.
///
/// DIR/areograph.toml states every key with its unit, range and default. Its paths are relative to DIR, so that DIR can be
/// moved, and the service can be started from anywhere.
///
/// Example: areograph service init /srv/mars
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Folder of the service; the parent folder must exist.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
}

/// Reasons why no configuration is written.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Configuration)]
enum Refused {
    #[error("a configuration already exists")]
    #[cause("check it with `areograph service check`, or name another folder")]
    Exists,
    #[error("not a folder")]
    #[cause("name a new folder, or an existing one without a configuration")]
    NotAFolder,
    #[error("the parent folder does not exist")]
    #[cause("check the path, or create the parent folder")]
    NothingAbove,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Error> {
    let folder = std::path::absolute(&arguments.folder)
        .map_err(IoError::on("resolve"))
        .in_file(&arguments.folder)?;
    let file = folder.join(FILE);
    if file.symlink_metadata().is_ok() {
        return Err(Refused::Exists).in_file(file);
    }
    if folder.symlink_metadata().is_ok() && !folder.is_dir() {
        return Err(Refused::NotAFolder).in_file(folder);
    }
    if !folder.parent().is_none_or(std::path::Path::is_dir) {
        return Err(Refused::NothingAbove).in_file(folder);
    }
    let text = ServiceConfig::example().replace(
        "schema/service.schema.json",
        "config/schema/service.schema.json of areograph",
    );
    // Refused before anything is written.
    let config = ServiceConfig::parse(&text, &file)?.config;
    let inputs = &config.inputs;
    let folders = [&inputs.sites, &inputs.kernels, &inputs.data];
    for path in folders
        .into_iter()
        .flatten()
        .chain([&config.outputs.products])
    {
        fs::create_dir_all(path)
            .map_err(IoError::on("create the folder"))
            .in_file(path)?;
    }
    let state = &config.outputs.state;
    private::create_folder(state)
        .map_err(IoError::on("create the folder"))
        .in_file(state)?;
    atomic::write(&file, text.as_bytes())?;
    configuration(&file, None, Clock::default().now_ms())?;
    let names = |paths: &[PathBuf]| {
        let names = paths.iter().filter_map(|path| path.file_name());
        let names: Vec<_> = names
            .map(|name| format!("{}/", name.to_string_lossy()))
            .collect();
        names.join(", ")
    };
    let file = file.display();
    output::line(format_args!(
        "{file}: the configuration of a service\n\
         next:\n\
         \x20 1. put kernels into {}, data into {}, site files into {}\n\
         \x20 2. areograph service check {file}\n\
         \x20 3. areograph serve {file}",
        names(&inputs.kernels),
        names(&inputs.data),
        names(&inputs.sites),
    ));
    Ok(())
}
