//! Site configuration: a TOML file, read raw, checked whole, turned into [`SiteConfig`].
//!
//! The file speaks of degrees and milliseconds, the valid form of radians and seconds. All
//! problems of a file are reported together, each as `file:line:column: key is value; expected …`.
//! `config/sites/example.toml` documents every key, `config/schema/site.schema.json` is its schema.

mod adjustment;
mod data_file;
mod geojson;
mod instruments;
mod problems;
mod raw;
mod shape;
mod site;
mod validate;

use std::{collections::BTreeMap, fs::File, io::Read as _, path::Path};

pub use adjustment::*;
pub use instruments::{
    altimeter, built_in_altimeter, built_in_instruments, instrument, usual_instrument,
};
pub use problems::Problems;
pub use site::*;

use crate::error::{Failure, Fault, IoFault, Kind, Place as _};
use problems::Review;

/// Longest configuration file, bytes.
const BYTES_MAX: u64 = 1 << 20;

/// A configuration that passed every check.
#[derive(Debug, Clone, PartialEq)]
pub struct Loaded {
    /// The valid form.
    pub site: SiteConfig,
    /// What was accepted but is worth a word, each with its place: entries that are never used.
    pub warnings: Vec<String>,
}

/// Reads and checks the configuration `path`; relative paths in it count from its own folder.
///
/// # Errors
/// [`Problems`] with everything that is wrong, or [`IoFault`] when the file cannot be read.
pub fn load(path: &Path) -> Result<Loaded, Failure> {
    let text = read(path)?;
    Ok(parse(&text, path)?)
}

/// The text of the file, of bounded length.
fn read(path: &Path) -> Result<String, Failure> {
    let size = path.metadata().map_err(IoFault::on("read")).in_file(path)?;
    // Devices and pipes could be read for ever.
    if !size.is_file() {
        return Err(Problems::of_file(path, "is no regular file; expected a TOML file").into());
    }
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(BYTES_MAX + 1).read_to_end(&mut bytes))
        .map_err(IoFault::on("read"))
        .in_file(path)?;
    if bytes.len() as u64 > BYTES_MAX {
        let text = format!("is longer than {BYTES_MAX} bytes; expected the TOML file of one site");
        return Err(Problems::of_file(path, &text).into());
    }
    String::from_utf8(bytes).map_err(|error| {
        let byte = error.utf8_error().valid_up_to() + 1;
        Problems::of_file(
            path,
            &format!("is not UTF-8 from byte {byte}; expected text"),
        )
        .into()
    })
}

/// Checks the configuration `text` of `file`.
///
/// Beyond the text it looks only at what the text names: whether files are there, which files globs
/// match, and the polygons of windows.
///
/// # Errors
/// [`Problems`] with everything that is wrong.
pub fn parse(text: &str, file: &Path) -> Result<Loaded, Problems> {
    let mut review = Review::new(file, text);
    let valid = shape::read(text, &mut review)
        .map(|(raw, written)| validate::validate(raw, file, written, &mut review));
    let (site, warnings) = review.finish(valid)?;
    Ok(Loaded { site, warnings })
}

/// Two configurations name the same site, so their products would overwrite each other.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("site is \"{site}\" in {first} and in {second}; expected one file per site")]
pub struct DuplicateSite {
    /// The identifier they share.
    pub site: String,
    /// The file that came first.
    pub first: String,
    /// The file that came later.
    pub second: String,
}

impl Fault for DuplicateSite {
    fn kind(&self) -> Kind {
        Kind::Configuration
    }

    fn advice(&self) -> String {
        "give each site its own identifier: it is also the folder of its products".to_owned()
    }
}

/// Sites of one run must have different identifiers.
///
/// # Errors
/// [`DuplicateSite`] for the first identifier that comes twice.
pub fn check_sites(sites: &[SiteConfig]) -> Result<(), DuplicateSite> {
    let mut seen: BTreeMap<&str, &Path> = BTreeMap::new();
    for site in sites {
        if let Some(first) = seen.insert(&site.site, &site.file) {
            return Err(DuplicateSite {
                site: site.site.clone(),
                first: first.display().to_string(),
                second: site.file.display().to_string(),
            });
        }
    }
    Ok(())
}
