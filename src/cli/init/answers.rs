//! Options of `areograph init` and answers on a terminal, each checked when it is given.

use std::{
    io::{self, IsTerminal as _, Write as _},
    path::{Path, PathBuf},
};

use super::{Arguments, Refused, edges, identifier, image_of, seen, tables};
use crate::{
    cli::files::{self, FileKind, exist, expand},
    config::{NewSite, is_site_identifier},
    error::{IoError, Result},
};

/// Options and answers, with paths relative to the current folder.
pub(super) struct Answers {
    pub(super) site: String,
    description: String,
    edges_deg: Option<[f64; 4]>,
    kernels: Vec<PathBuf>,
    pedr: Vec<PathBuf>,
    shots: Vec<PathBuf>,
    /// Identifier and label of every image.
    images: Vec<(String, PathBuf)>,
    ties: Vec<PathBuf>,
}

impl Answers {
    /// Options, completed by answers on a terminal.
    ///
    /// # Errors
    /// The first wrong option; the question for a wrong answer is repeated. Options that do not suffice for a site.
    pub(super) fn of(arguments: &Arguments, name: &str) -> Result<Self> {
        let asks = io::stdin().is_terminal() && io::stderr().is_terminal();
        let site = match &arguments.site {
            Some(site) => site_identifier(site)?,
            None if asks => {
                let usual = identifier(name);
                ask(&format!("Identifier of the site [{usual}]"), |answer| {
                    site_identifier(if answer.is_empty() { &usual } else { answer })
                })?
            }
            None => site_identifier(&identifier(name))?,
        };
        let paths = |question: &str, given: &[PathBuf], check: &Check<'_>| {
            if !given.is_empty() || !asks {
                return check(given).map(|()| given.to_vec());
            }
            ask(question, |answer| {
                let separated = answer.split([' ', '\t', ',']);
                let written = separated.filter(|part| !part.is_empty());
                let paths: Vec<PathBuf> = written.map(PathBuf::from).collect();
                check(&paths).map(|()| paths)
            })
        };
        let kernels = paths(
            "Kernels: a metakernel, a folder, or files in load order",
            &arguments.kernels,
            &kernels,
        )?;
        let pedr = if arguments.shots.is_empty() {
            paths(
                "PEDR files, folders or globs, separated by spaces [none]",
                &arguments.pedr,
                &|paths| of_kind(paths, &files::PEDR_FILES),
            )?
        } else {
            Vec::new()
        };
        let shots = if pedr.is_empty() {
            paths(
                "Shot tables from the Orbital Data Explorer [none]",
                &arguments.shots,
                &|paths| of_kind(paths, &files::SHOT_TABLES),
            )?
        } else {
            Vec::new()
        };
        let labels = paths("Image labels [none]", &arguments.labels, &|paths| {
            images(paths).map(drop)
        })?;
        let ties = paths("Tie point files [none]", &arguments.ties, &|paths| {
            of_kind(paths, &files::TIES)
        })?;
        let mut answers = Self {
            site,
            description: arguments.description.clone().unwrap_or_default(),
            edges_deg: None,
            kernels,
            pedr,
            shots,
            images: images(&labels)?,
            ties,
        };
        answers.edges_deg = match arguments.edges_deg {
            Some(written) => Some(arguments.meaning.edges_deg(written)?),
            None if asks && !answers.pedr.is_empty() => ask(
                if answers.images.is_empty() {
                    "Window west,east,south,north in degrees"
                } else {
                    "Window west,east,south,north in degrees [the area that the images cover]"
                },
                |answer| answers.window(arguments, answer),
            )?,
            None => None,
        };
        answers.complete()?;
        Ok(answers)
    }

    /// The window of an answer, which may be empty if images determine the window.
    fn window(&self, arguments: &Arguments, answer: &str) -> Result<Option<[f64; 4]>> {
        if answer.is_empty() && !self.images.is_empty() {
            return Ok(None);
        }
        let written = edges(answer).map_err(Refused::Edges)?;
        arguments.meaning.edges_deg(written).map(Some)
    }

    /// Checks that the input suffices for a site.
    fn complete(&self) -> std::result::Result<(), Refused> {
        if self.kernels.is_empty() {
            return Err(Refused::Missing("kernels (--kernels)"));
        }
        if self.pedr.is_empty() && self.shots.is_empty() && self.images.is_empty() {
            return Err(Refused::Missing(
                "shots or images of the site (--pedr, --shots, --label)",
            ));
        }
        if !self.pedr.is_empty() && self.edges_deg.is_none() && self.images.is_empty() {
            return Err(Refused::Missing(
                "the window of the site (--box, or images with --label)",
            ));
        }
        Ok(())
    }

    /// The new site with paths relative to `folder`.
    pub(super) fn new_site(&self, folder: &Path) -> Result<NewSite> {
        let seen = |paths: &[PathBuf]| seen(folder, paths);
        let mut images = Vec::with_capacity(self.images.len());
        for (id, label) in &self.images {
            images.push((id.clone(), seen(std::slice::from_ref(label))?.remove(0)));
        }
        // The window of tables alone is the box around their shots.
        let is_placed_by_tables =
            !self.shots.is_empty() && self.edges_deg.is_none() && self.images.is_empty();
        let edges_deg = if is_placed_by_tables {
            let read = expand(&self.shots, &files::SHOT_TABLES)?;
            Some(tables::box_around_deg(&read)?)
        } else {
            self.edges_deg
        };
        Ok(NewSite {
            site: self.site.clone(),
            description: self.description.clone(),
            kernels: seen(&self.kernels)?,
            kernels_are_a_folder: matches!(&self.kernels[..], [one] if one.is_dir()),
            pedr: seen(&self.pedr)?,
            shots: seen(&self.shots)?,
            edges_deg,
            images,
            ties: seen(&self.ties)?,
            ..NewSite::default()
        })
    }
}

/// Examines paths.
type Check<'a> = dyn Fn(&[PathBuf]) -> Result<()> + 'a;

fn site_identifier(text: &str) -> Result<String> {
    if is_site_identifier(text) {
        Ok(text.to_owned())
    } else {
        Err(Refused::Identifier(text.to_owned()).into())
    }
}

/// Kernels that exist; those of a folder are chosen later.
fn kernels(paths: &[PathBuf]) -> Result<()> {
    match paths {
        [] => Err(Refused::Missing("kernels (--kernels)").into()),
        paths => exist(paths),
    }
}

/// Folders and globs contain such files, and files exist.
fn of_kind(paths: &[PathBuf], kind: &FileKind) -> Result<()> {
    exist(&expand(paths, kind)?)
}

/// Identifiers and labels of images.
fn images(labels: &[PathBuf]) -> Result<Vec<(String, PathBuf)>> {
    let files = expand(labels, &files::LABELS)?;
    let named = files
        .into_iter()
        .map(|label| Ok((image_of(&label)?, label)));
    named.collect()
}

/// The answer to a question, which is repeated until `read` accepts the answer.
///
/// # Errors
/// The input ends; the terminal fails.
fn ask<T>(question: &str, read: impl Fn(&str) -> Result<T>) -> Result<T> {
    loop {
        show(&format!("{question}: "))?;
        let mut line = String::new();
        let bytes = io::stdin()
            .read_line(&mut line)
            .map_err(IoError::on("read from the terminal"))?;
        match read(line.trim()) {
            Ok(answer) => return Ok(answer),
            Err(failure) if bytes == 0 => return Err(failure),
            Err(failure) => show(&format!("{failure}\n"))?,
        }
    }
}

fn show(text: &str) -> Result<()> {
    let mut terminal = io::stderr().lock();
    let shown = terminal
        .write_all(text.as_bytes())
        .and_then(|()| terminal.flush());
    Ok(shown.map_err(IoError::on("write to the terminal"))?)
}
