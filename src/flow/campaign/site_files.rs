//! Site files of a campaign in its output folder.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

use super::{
    SITES,
    selection::{Campaign, PlannedSite},
};
use crate::{
    config::{SITE_FILE_MARK, real},
    error::{IoError, Locate as _, Result},
    files::{Mark, MarkAt, require_own},
    store::atomic,
};

/// Recognises such a file.
const SITE_FILE: Mark = Mark {
    what: "a site file that a campaign wrote",
    at: MarkAt::Start(SITE_FILE_MARK.as_bytes()),
};

impl Campaign {
    /// Writes the site file of a site below `out`, unless it exists with the same content, and returns its path.
    ///
    /// # Errors
    /// A foreign file in its place; a folder that cannot be written.
    pub fn write_site_file(&self, site: &PlannedSite, out: &Path) -> Result<PathBuf> {
        let folder = out.join(SITES);
        fs::create_dir_all(&folder)
            .map_err(IoError::on("create the folder"))
            .in_file(&folder)?;
        let text = self.text_of(site, out)?;
        // As the user names the folder, so that messages do.
        let path = out.join(SITES).join(format!("{}.toml", site.id));
        write(&path, &text)?;
        Ok(path)
    }

    /// The text of a site file.
    ///
    /// # Errors
    /// The folder of the site files cannot be found.
    pub(super) fn text_of(&self, site: &PlannedSite, out: &Path) -> Result<String> {
        let folder = real(&out.join(SITES))?;
        Ok(self.template.site_file(
            &site.id,
            &site.description,
            &site.entries,
            site.ties.as_deref(),
            &folder,
        ))
    }

    /// Removes site files that the campaign wrote for sites that it no longer has; products remain. Returns the sites.
    ///
    /// # Errors
    /// A folder that cannot be listed; a file that cannot be read or removed.
    pub fn remove_stale_site_files(&self, out: &Path) -> Result<Vec<String>> {
        let folder = out.join(SITES);
        let mut stale = Vec::new();
        if !folder.is_dir() {
            return Ok(stale);
        }
        let current: BTreeSet<&str> = self.sites.iter().map(|site| &*site.id).collect();
        let entries = fs::read_dir(&folder)
            .map_err(IoError::on("list"))
            .in_file(&folder)?;
        for entry in entries {
            let path = entry.map_err(IoError::on("list")).in_file(&folder)?.path();
            let id = path.file_stem().unwrap_or_default().to_string_lossy();
            let is_site = path.extension().is_some_and(|ending| ending == "toml");
            if is_site && !current.contains(&*id) && require_own(&path, &SITE_FILE).is_ok() {
                stale.push(id.into_owned());
                fs::remove_file(&path)
                    .map_err(IoError::on("remove"))
                    .in_file(&path)?;
            }
        }
        stale.sort();
        Ok(stale)
    }
}

/// Writes a site file whole, unless its content is the same.
fn write(path: &Path, text: &str) -> Result<()> {
    if fs::read(path).is_ok_and(|found| found == text.as_bytes()) {
        return Ok(());
    }
    atomic::replace(path, text.as_bytes(), SITE_FILE)
}
