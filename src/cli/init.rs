//! `areograph init`.

mod place;
mod tables;

use std::{
    fs,
    io::{self, IsTerminal as _, Write as _},
    path::{Component, Path, PathBuf},
};

use clap::Args;

use super::{output, windows::edges};
use crate::{
    config::{Document as _, NewSite, SiteConfig, built_in_instruments},
    error::{Cause, Error, IoError, Locate as _},
    files::file_name,
    pds::{product_named, read_label},
    store::atomic,
};

/// Writes a commented site file for a window and images.
///
/// On a terminal the command asks for missing options. The file is DIR/SITE.toml; paths are given relative to the current
/// folder and written relative to DIR. Without --box the window is the area that the images cover, and 5 km around it; without
/// images it is the box around the shots of the tables.
///
/// Examples:
///   areograph init gale
///   areograph init gale --box 137.0,138.0,-5.5,-4.0 --kernels kernels/nav.tm --pedr 'pedr/*.b'
///   areograph init gale --label labels/e0202855.lbl --label labels/m0402852.lbl --kernels kernels --ties gale.csv
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
    /// West, east, south and north edge of the window, degrees: east longitude and areocentric latitude.
    #[arg(long = "box", value_name = "W,E,S,N", value_parser = edges, allow_hyphen_values = true)]
    edges_deg: Option<[f64; 4]>,
    /// A metakernel (.tm), a folder of kernels to choose from, or kernels in load order.
    #[arg(long, value_name = "PATH")]
    kernels: Vec<PathBuf>,
    /// PEDR files, or globs of them.
    #[arg(long, value_name = "GLOB")]
    pedr: Vec<PathBuf>,
    /// Shot tables from the Orbital Data Explorer, or globs of them; with --place, the tables that `areograph fetch`
    /// requests, in place of PEDR files.
    #[arg(long, value_name = "GLOB", conflicts_with = "pedr")]
    shots: Vec<PathBuf>,
    /// Label of an image.
    #[arg(long = "label", value_name = "FILE")]
    labels: Vec<PathBuf>,
    /// Tie point files, or globs of them.
    #[arg(long, value_name = "GLOB")]
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
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Error> {
    let folder = absolute(&arguments.folder)?;
    if arguments.place.is_given() {
        return place::run(arguments, &folder);
    }
    let answers = Answers::of(arguments, &file_name(&folder))?;
    answers.complete()?;
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
    let mut site = answers.new_site(folder)?;
    // Checked as the future file, so that paths are relative to its folder.
    if answers.is_placed_by_tables() {
        site.edges_deg = Some([0.0, 360.0, -90.0, 90.0]);
        let anywhere = SiteConfig::parse(&site.text(), file)?.config;
        let read: Vec<PathBuf> = anywhere
            .shots
            .into_iter()
            .flat_map(|table| table.files)
            .collect();
        site.edges_deg = Some(tables::box_around_deg(&read)?);
    }
    let text = site.text();
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

/// Options and answers, with paths relative to the current folder.
struct Answers {
    site: String,
    description: String,
    edges_deg: Option<[f64; 4]>,
    kernels: Vec<PathBuf>,
    pedr: Vec<PathBuf>,
    shots: Vec<PathBuf>,
    labels: Vec<PathBuf>,
    ties: Vec<PathBuf>,
}

impl Answers {
    /// Options, completed by answers on a terminal.
    fn of(arguments: &Arguments, name: &str) -> Result<Self, Error> {
        let mut answers = Self {
            site: arguments.site.clone().unwrap_or_else(|| identifier(name)),
            description: arguments.description.clone().unwrap_or_default(),
            edges_deg: arguments.edges_deg,
            kernels: arguments.kernels.clone(),
            pedr: arguments.pedr.clone(),
            shots: arguments.shots.clone(),
            labels: arguments.labels.clone(),
            ties: arguments.ties.clone(),
        };
        if !(io::stdin().is_terminal() && io::stderr().is_terminal()) {
            return Ok(answers);
        }
        if arguments.site.is_none() {
            let answer = answer(&format!("Identifier of the site [{}]", answers.site))?;
            if !answer.is_empty() {
                answers.site = answer;
            }
        }
        let questions = [
            (
                "Kernels: a metakernel, a folder, or files in load order",
                &mut answers.kernels,
            ),
            ("PEDR files or globs [none]", &mut answers.pedr),
            (
                "Shot tables from the Orbital Data Explorer, or globs [none]",
                &mut answers.shots,
            ),
            ("Image labels [none]", &mut answers.labels),
            ("Tie point files [none]", &mut answers.ties),
        ];
        for (question, paths) in questions {
            if paths.is_empty() {
                let answer = answer(question)?;
                paths.extend(answer.split_whitespace().map(PathBuf::from));
            }
        }
        while answers.edges_deg.is_none() && !answers.pedr.is_empty() {
            let answer =
                answer("Window west,east,south,north in degrees [the area that the images cover]")?;
            if answer.is_empty() {
                break;
            }
            match edges(&answer) {
                Ok(edges_deg) => answers.edges_deg = Some(edges_deg),
                Err(problem) => tell(&format!("{problem}\n"))?,
            }
        }
        Ok(answers)
    }

    /// Checks that the input suffices for a site.
    fn complete(&self) -> Result<(), Refused> {
        if self.kernels.is_empty() {
            return Err(Refused::Missing("kernels (--kernels)"));
        }
        if self.pedr.is_empty() && self.shots.is_empty() && self.labels.is_empty() {
            return Err(Refused::Missing(
                "shots or images of the site (--pedr, --shots, --label)",
            ));
        }
        if !self.pedr.is_empty() && self.edges_deg.is_none() && self.labels.is_empty() {
            return Err(Refused::Missing(
                "the window of the site (--box, or images with --label)",
            ));
        }
        Ok(())
    }

    /// Whether the window is the box around the shots of tables.
    fn is_placed_by_tables(&self) -> bool {
        !self.shots.is_empty() && self.edges_deg.is_none() && self.labels.is_empty()
    }

    /// The new site with paths relative to `folder`.
    fn new_site(&self, folder: &Path) -> Result<NewSite, Error> {
        let seen = |paths: &[PathBuf]| seen(folder, paths);
        let mut images = Vec::with_capacity(self.labels.len());
        for (label, seen) in self.labels.iter().zip(seen(&self.labels)?) {
            images.push((image_of(label)?, seen));
        }
        Ok(NewSite {
            site: self.site.clone(),
            description: self.description.clone(),
            kernels: seen(&self.kernels)?,
            kernels_are_a_folder: matches!(&self.kernels[..], [one] if one.is_dir()),
            pedr: seen(&self.pedr)?,
            shots: seen(&self.shots)?,
            edges_deg: self.edges_deg,
            images,
            ties: seen(&self.ties)?,
            ..NewSite::default()
        })
    }
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

fn absolute(path: &Path) -> Result<PathBuf, Error> {
    let path = std::path::absolute(path)
        .map_err(IoError::on("find"))
        .in_file(path)?;
    // Parent components are resolved here: after a wildcard or before a folder exists, they lead nowhere.
    let mut steps = PathBuf::new();
    for step in path.components() {
        match step {
            Component::ParentDir => {
                steps.pop();
            }
            step => steps.push(step),
        }
    }
    Ok(steps)
}

/// `path` relative to `folder`, both absolute; unchanged if they share only the root.
fn seen_from(folder: &Path, path: &Path) -> PathBuf {
    let (here, there): (Vec<Component>, Vec<Component>) =
        (folder.components().collect(), path.components().collect());
    let common = here
        .iter()
        .zip(&there)
        .take_while(|(one, other)| one == other)
        .count();
    if common <= 1 {
        return path.to_owned();
    }
    let back = here[common..].iter().map(|_| Component::ParentDir);
    back.chain(there[common..].iter().copied()).collect()
}

/// Paths given relative to the current folder, relative to `folder`.
fn seen(folder: &Path, paths: &[PathBuf]) -> Result<Vec<PathBuf>, Error> {
    let paths = paths
        .iter()
        .map(|path| Ok(seen_from(folder, &absolute(path)?)));
    paths.collect()
}

fn tell(text: &str) -> Result<(), Error> {
    let mut terminal = io::stderr().lock();
    let told = terminal
        .write_all(text.as_bytes())
        .and_then(|()| terminal.flush());
    Ok(told.map_err(IoError::on("write to the terminal"))?)
}

/// The answer to a question, without spaces around it; empty at the end of the input.
fn answer(question: &str) -> Result<String, Error> {
    tell(&format!("{question}: "))?;
    let mut line = String::new();
    io::stdin()
        .read_line(&mut line)
        .map_err(IoError::on("read from the terminal"))?;
    Ok(line.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_seen_from_the_folder_of_the_file() {
        let seen = |folder: &str, path: &str| seen_from(Path::new(folder), Path::new(path));
        assert_eq!(
            seen("/home/a/sites", "/home/a/pedr/*.b"),
            Path::new("../pedr/*.b")
        );
        assert_eq!(seen("/home/a", "/home/a/k.tm"), Path::new("k.tm"));
        assert_eq!(seen("/home/a/b/c", "/home/d"), Path::new("../../../d"));
        assert_eq!(seen("/home/a", "/data/mola"), Path::new("/data/mola"));
        assert_eq!(
            absolute(Path::new("/a/b/../c/./d")).unwrap(),
            Path::new("/a/c/d")
        );
    }

    #[test]
    fn names_become_identifiers() {
        assert_eq!(identifier("Gale Crater-2"), "gale_crater-2");
    }
}
