//! `areograph init`.

mod answers;
mod place;
mod tables;

use std::{
    fs,
    path::{Path, PathBuf},
};

use clap::Args;

use self::answers::Answers;
use super::{
    output,
    windows::{BOX, BoxMeaning, edges},
};
use crate::{
    config::{
        Document as _, SITE_IDENTIFIER, SiteConfig, absolute, built_in_instruments, seen_from,
    },
    error::{Cause, Error, IoError, Locate as _},
    files::file_name,
    pds::{product_named, read_label},
    store::atomic,
};

/// Writes a commented site file for a window and images.
///
/// On a terminal, the command asks for missing options. The file is DIR/SITE.toml; paths are given relative to the current
/// folder and written relative to DIR. Without --box, the window is the area that the images cover, with a margin of 5 km;
/// without images, it is the box around the shots of the tables.
///
/// Examples:
///   areograph init gale
///   areograph init gale --box 137.0,138.0,-5.5,-4.0 --kernels kernels/nav.tm --pedr pedr
///   areograph init gale --label labels/e0202855.lbl labels/m0402852.lbl --kernels kernels --ties gale.csv
///   areograph init gusev --shots 'gusev/*.csv' --kernels naif0012.tls
///   areograph init gale --place gale --pairs 2    # then: areograph fetch gale/gale.toml
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Folder of the site file; it is created if necessary.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Identifier of the site; by default the name of the folder.
    #[arg(long, value_name = "NAME")]
    site: Option<String>,
    /// Free text for the report.
    #[arg(long, value_name = "TEXT")]
    description: Option<String>,
    /// West, east, south and north edge of the window, degrees (longitudes -360 to 360).
    #[arg(id = BOX, long, value_name = "W,E,S,N", value_parser = edges, allow_hyphen_values = true)]
    edges_deg: Option<[f64; 4]>,
    #[command(flatten)]
    meaning: BoxMeaning,
    /// A metakernel (.tm), a folder of kernels to choose from, or kernels in load order.
    #[arg(long, value_name = "PATH", num_args = 1..)]
    kernels: Vec<PathBuf>,
    /// PEDR files, folders or globs of them.
    #[arg(long, value_name = "PATH", num_args = 1..)]
    pedr: Vec<PathBuf>,
    /// Shot tables from the Orbital Data Explorer, folders or globs of them; with --place, the tables that
    /// `areograph fetch` requests, instead of PEDR files.
    #[arg(long, value_name = "PATH", num_args = 1.., conflicts_with = "pedr")]
    shots: Vec<PathBuf>,
    /// Labels of images, folders or globs of them.
    #[arg(long = "label", value_name = "PATH", num_args = 1..)]
    labels: Vec<PathBuf>,
    /// Tie point files, folders or globs of them.
    #[arg(long, value_name = "PATH", num_args = 1..)]
    ties: Vec<PathBuf>,
    #[command(flatten)]
    place: place::PlaceArguments,
}

/// Reasons why no site file is written.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Configuration)]
enum Refused {
    #[error("already exists")]
    #[cause("name a different folder or --site, or remove the file")]
    Exists,
    #[error("missing: {0}")]
    #[cause("give the options of `areograph init --help`, or answer on a terminal")]
    Missing(&'static str),
    #[error("the identifier of the site is {0:?}; expected {SITE_IDENTIFIER}")]
    #[cause("give such an identifier with --site")]
    Identifier(String),
    #[error("{0}")]
    #[cause("write the edges as 137.0,138.0,-5.5,-4.0")]
    Edges(String),
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Error> {
    let folder = absolute(&arguments.folder)?;
    if arguments.place.is_given() {
        return place::run(arguments, &folder);
    }
    let answers = Answers::of(arguments, &file_name(&folder))?;
    let file = arguments.folder.join(format!("{}.toml", answers.site));
    if file.exists() {
        return Err(Refused::Exists).in_file(file);
    }
    in_new_folder(&folder, || write(&answers, &folder, &file))
}

/// `work` in the folder, which is created; what was created is removed again if it fails and left nothing there.
fn in_new_folder(folder: &Path, work: impl FnOnce() -> Result<(), Error>) -> Result<(), Error> {
    let missing: Vec<&Path> = folder.ancestors().take_while(|of| !of.exists()).collect();
    fs::create_dir_all(folder)
        .map_err(IoError::on("create the folder"))
        .in_file(folder)?;
    let done = work();
    if done.is_err() {
        // Innermost first; a folder with files stays.
        let _ = missing.into_iter().try_for_each(fs::remove_dir);
    }
    done
}

/// Checks and writes the site file.
fn write(answers: &Answers, folder: &Path, file: &Path) -> Result<(), Error> {
    let site = answers.new_site(folder)?;
    let text = site.text();
    // Checked as the future file, so that paths are relative to its folder.
    let loaded = SiteConfig::parse(&text, file)?;
    for warning in loaded.warnings {
        tracing::warn!("{warning}");
    }
    atomic::write(file, text.as_bytes())?;
    output::line(format_args!(
        "{}: written; next: areograph check {}",
        file.display(),
        file.display()
    ));
    Ok(())
}

/// The identifier of an image: the product identifier of its label, such as `E02-02855`, else the file name.
fn image_of(label: &Path) -> Result<String, Error> {
    let product = read_label(label, built_in_instruments())?.product_id;
    let product = product.and_then(|product| product_named(&product));
    Ok(product.map_or_else(
        || identifier(&label.file_stem().unwrap_or_default().to_string_lossy()),
        |product| format!("{}-{}", &product[..3], &product[3..]),
    ))
}

/// A name with characters that identifiers do not permit replaced.
fn identifier(name: &str) -> String {
    let letters = name.chars().map(|letter| match letter {
        '-' | '_' => letter,
        _ if letter.is_ascii_alphanumeric() => letter.to_ascii_lowercase(),
        _ => '_',
    });
    letters.collect()
}

/// Paths given relative to the current folder, relative to `folder`.
fn seen(folder: &Path, paths: &[PathBuf]) -> Result<Vec<PathBuf>, Error> {
    let paths = paths
        .iter()
        .map(|path| Ok(seen_from(folder, &absolute(path)?)));
    paths.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_identifiers() {
        assert_eq!(identifier("Gale Crater-2"), "gale_crater-2");
    }
}
