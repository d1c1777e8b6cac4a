//! Site files: the name of each, and the new files that could be its inputs.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::Path,
};

use glob::Pattern;
use rusqlite::Transaction;
use serde_json::json;
use toml::{Table, Value};

use super::folders::plain;
use crate::{
    database::{
        Moved, Stored, advance,
        files::{FileRow, FileState, files_below},
        pending_job,
        sites::{disable_site, put_site, sites},
    },
    state::JobState,
};

/// Longest site file that is read here; the worker rejects a longer one.
const BYTES_MAX: u64 = 1 << 20;

/// A site file, as far as needed before a worker reads it.
#[derive(Debug, Clone)]
pub struct SiteFile {
    /// Name of the site.
    pub name: String,
    /// Globs of files.
    globs: Vec<Pattern>,
    /// Folders from which kernels are chosen.
    folders: Vec<String>,
    /// Files named one by one.
    named: BTreeSet<String>,
}

impl SiteFile {
    /// Parses the required parts of `text`, the content of `path`. A file without a name, or with invalid TOML, is
    /// named after the file: its worker reports the fault.
    #[must_use]
    pub fn of(text: &str, path: &Path) -> Self {
        let table: Table = text.parse().unwrap_or_default();
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let name = table.get("site").and_then(Value::as_str);
        let name = name.filter(|name| is_name(name));
        let mut file = Self {
            name: name.map_or_else(|| stem.to_lowercase(), str::to_owned),
            globs: Vec::new(),
            folders: Vec::new(),
            named: BTreeSet::new(),
        };
        let folder = path.parent().unwrap_or(Path::new("/"));
        let root = table.get("kernels").and_then(|kernels| kernels.get("root"));
        if let Some(root) = root.and_then(Value::as_str) {
            let root = plain(&folder.join(root));
            file.folders.push(root.to_string_lossy().into_owned());
        }
        file.walk(&Value::Table(table), folder);
        file
    }

    /// Every text may be a path.
    fn walk(&mut self, value: &Value, folder: &Path) {
        match value {
            Value::String(text) if text.contains(['*', '?', '[']) => {
                let below = Pattern::escape(&folder.to_string_lossy());
                let glob = plain(&Path::new(&below).join(text));
                self.globs
                    .extend(Pattern::new(&glob.to_string_lossy()).ok());
            }
            Value::String(text) if !text.contains('\n') => {
                let named = plain(&folder.join(text));
                self.named.insert(named.to_string_lossy().into_owned());
            }
            Value::Array(values) => values.iter().for_each(|value| self.walk(value, folder)),
            Value::Table(table) => table.values().for_each(|value| self.walk(value, folder)),
            _ => {}
        }
    }

    /// Whether an unread file could be an input of the site.
    #[must_use]
    pub fn reaches(&self, path: &str) -> bool {
        let options = glob::MatchOptions {
            require_literal_separator: true,
            ..glob::MatchOptions::new()
        };
        self.named.contains(path)
            || self
                .globs
                .iter()
                .any(|glob| glob.matches_with(path, options))
            || self
                .folders
                .iter()
                .any(|folder| Path::new(path).starts_with(folder))
    }
}

/// Whether a name is valid, as in the configuration.
fn is_name(name: &str) -> bool {
    let allowed = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'_';
    !name.is_empty() && name.len() <= 64 && name.bytes().all(allowed)
}

/// The known site files, by path, with the content that was read.
#[derive(Debug, Default)]
pub struct SiteBook {
    read: BTreeMap<String, (Option<String>, SiteFile)>,
}

impl SiteBook {
    /// The file of a site.
    #[must_use]
    pub fn of(&self, path: &str) -> Option<&SiteFile> {
        self.read.get(path).map(|(_, file)| file)
    }

    /// Reads the files that are new or changed, and removes those that no longer exist. Files that cannot be read, or
    /// are settling, are unchanged.
    fn update(&mut self, files: &BTreeMap<String, FileRow>) {
        self.read.retain(|path, _| {
            files
                .get(path)
                .is_some_and(|file| file.state != FileState::Gone)
        });
        for (path, file) in files {
            let known = self.read.get(path).map(|(blake3, _)| blake3);
            if file.state != FileState::Ready || known == Some(&file.blake3) {
                continue;
            }
            let short = fs::metadata(path).is_ok_and(|found| found.len() <= BYTES_MAX);
            if let Some(text) = short.then(|| fs::read_to_string(path).ok()).flatten() {
                let site = SiteFile::of(&text, Path::new(path));
                self.read.insert(path.clone(), (file.blake3.clone(), site));
            }
        }
    }
}

/// Brings the sites of the database in line with the site files below `roots`.
///
/// # Errors
/// SQLite errors.
pub fn bring_in_line(
    transaction: &Transaction<'_>,
    now_ms: i64,
    book: &mut SiteBook,
    roots: &[String],
) -> Stored<()> {
    let mut files = BTreeMap::new();
    for root in roots {
        files.extend(files_below(transaction, root)?);
    }
    book.update(&files);
    let mut named: BTreeMap<&str, &str> = BTreeMap::new();
    for (path, (_, file)) in &book.read {
        if let Some(first) = named.get(&*file.name) {
            tracing::warn!("{path}: site {} is already defined by {first}", file.name);
            continue;
        }
        named.insert(&file.name, path);
    }
    for (name, path) in &named {
        put_site(transaction, name, path)?;
    }
    let gone = |name: &str| !named.contains_key(name);
    for site in sites(transaction)?.iter().filter(|site| site.enabled) {
        // A service that has just started, with unavailable folders, removes no site.
        let file_is_gone = files
            .get(&site.file)
            .is_none_or(|file| file.state == FileState::Gone)
            || book.of(&site.file).is_some();
        if gone(&site.name) && file_is_gone {
            tracing::info!(site = site.name, "the site file was removed");
            disable_site(transaction, &site.name)?;
            if let Some(job) = pending_job(transaction, &site.name)? {
                let moved = Moved {
                    outcome: Some(json!({ "text": "the site file was removed" })),
                    ..Moved::default()
                };
                advance(transaction, now_ms, job.id, JobState::Cancelled, &moved)?;
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_site_is_reached_by_what_its_file_could_match() {
        let text = "site = \"gusev\"\n[kernels]\nroot = \"../kernels\"\n[pedr]\nfiles = [\"../pedr/*.b\"]\n\
                    [ties]\nfiles = [\"../ties/gusev.csv\"]\n";
        let file = SiteFile::of(text, Path::new("/m/sites/a.toml"));
        assert_eq!(file.name, "gusev");
        for path in ["/m/kernels/ck/new.bc", "/m/pedr/ap1.b", "/m/ties/gusev.csv"] {
            assert!(file.reaches(path), "{path}");
        }
        for path in ["/m/pedr/ap1.lbl", "/m/pedr/old/ap1.b", "/m/ties/b.csv"] {
            assert!(!file.reaches(path), "{path}");
        }
        let nameless = SiteFile::of("site = \"../x\"", Path::new("/m/sites/Eos.toml"));
        assert_eq!(nameless.name, "eos");
    }
}
