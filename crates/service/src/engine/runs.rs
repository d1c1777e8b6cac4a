//! Runs on the disk: checked, made current, recorded.

use std::{
    fs,
    os::unix::fs::symlink,
    path::{Path, PathBuf},
    time::Duration,
};

use chrono::DateTime;
use serde_json::{Value, json};

use crate::{
    database::runs::Run,
    instant::Instant,
    worker::run_folder::{RUN_RECORD, RunRecord, remove},
};
use areograph_base::error::{Cause, IoError, Locate as _, Result};
use areograph_store::{
    atomic::sync_folder, manifest::Manifest, publish::MANIFEST, published::read_published,
};

/// Link to the current run.
pub const CURRENT: &str = "current";
/// The identifier of an attempt's run.
#[must_use]
pub fn run_id(started_ms: i64, job: i64, attempt: i64) -> String {
    let started = DateTime::from_timestamp_millis(started_ms).unwrap_or_default();
    format!("{}_j{job}_a{attempt}", started.format("%Y%m%d_%H%M%S"))
}

/// A run on the disk whose products match its manifest.
#[derive(Debug)]
pub struct Published {
    /// The attempt that published it.
    pub by: RunRecord,
    /// Its manifest.
    pub manifest: Manifest,
    /// BLAKE3 of the manifest.
    pub manifest_blake3: String,
}

/// The folder contains another run than expected.
#[derive(Debug, thiserror::Error, Cause)]
#[error(
    "the folder contains run {run} of job {job}, attempt {attempt}; expected the run with the name of the folder"
)]
#[cause(Input: "move the folder away; the service then runs the site again")]
struct Foreign {
    job: i64,
    attempt: i64,
    run: String,
}

/// The folder of a site contains a run of another one, as after a copy of that site's folder.
#[derive(Debug, thiserror::Error, Cause)]
#[error("the manifest names site {found}; expected {expected}, the site of the folder")]
#[cause(Input: "move the run folder back to the folder of its site, or elsewhere")]
struct OtherSite {
    found: String,
    expected: String,
}

/// A manifest that differs from the one that was published.
#[derive(Debug, thiserror::Error, Cause)]
#[error("the manifest differs from the published manifest")]
#[cause(Input: "restore the manifest from a copy, or move the run folder elsewhere")]
struct Altered;

/// Reads a run of a site and checks every product against its manifest.
///
/// # Errors
/// It is incomplete, or belongs to another attempt or site; a disk error.
pub fn read_run(site: &str, folder: &Path) -> Result<Published> {
    let published = identify_run_of(site, folder)?;
    read_published(folder)?;
    Ok(published)
}

/// Reads the manifest of a run, but no product.
///
/// # Errors
/// It belongs to another attempt, or its manifest is not the one that was published; a disk error.
pub fn identify_run(folder: &Path) -> Result<Published> {
    let path = folder.join(RUN_RECORD);
    let read = |path: &Path| fs::read(path).map_err(IoError::on("read")).in_file(path);
    let by: RunRecord = serde_json::from_slice(&read(&path)?)
        .map_err(|error| IoError::on("read")(error.into()))
        .in_file(&path)?;
    if folder.file_name() != Some(by.run.as_ref()) {
        let RunRecord {
            run, job, attempt, ..
        } = by;
        return Err(Foreign { job, attempt, run }).in_file(folder);
    }
    let path = folder.join(MANIFEST);
    let bytes = read(&path)?;
    let manifest_blake3 = blake3::hash(&bytes).to_hex().to_string();
    if by.manifest_blake3 != manifest_blake3 {
        return Err(Altered).in_file(path);
    }
    let manifest = serde_json::from_slice(&bytes)
        .map_err(|error| IoError::on("read")(error.into()))
        .in_file(path)?;
    Ok(Published {
        by,
        manifest,
        manifest_blake3,
    })
}

/// Reads the manifest of a run in the folder of a site, but no product.
///
/// # Errors
/// As of [`identify_run`]; it is a run of another site.
pub fn identify_run_of(site: &str, folder: &Path) -> Result<Published> {
    let published = identify_run(folder)?;
    if published.manifest.site != site {
        let (found, expected) = (published.manifest.site, site.to_owned());
        return Err(OtherSite { found, expected }).in_file(folder);
    }
    Ok(published)
}

/// The current run, by the link.
#[must_use]
pub fn current(site_folder: &Path) -> Option<String> {
    let target = fs::read_link(site_folder.join(CURRENT)).ok()?;
    let name = target.file_name()?.to_str()?;
    site_folder
        .join("runs")
        .join(name)
        .is_dir()
        .then(|| name.to_owned())
}

/// Makes a run the current one: at every instant either the old or the new one is current.
///
/// # Errors
/// A disk error.
pub fn make_current(site_folder: &Path, run: &str) -> Result<()> {
    let fresh = site_folder.join(format!(".{CURRENT}-{run}"));
    let _ = fs::remove_file(&fresh);
    let place = site_folder.join(CURRENT);
    // Only the service makes links here: another entry is not its own.
    let is_free = fs::symlink_metadata(&place).map_or(Ok(()), |found| {
        let foreign = || std::io::Error::from(std::io::ErrorKind::AlreadyExists);
        found.is_symlink().then_some(()).ok_or_else(foreign)
    });
    is_free
        .and_then(|()| symlink(PathBuf::from("runs").join(run), &fresh))
        .and_then(|()| fs::rename(&fresh, place))
        .map_err(IoError::on("link"))
        .in_file(site_folder.join(CURRENT))?;
    sync_folder(site_folder);
    Ok(())
}

/// The database row of a run.
#[must_use]
pub fn row(
    published: &Published,
    because: Value,
    stages: Value,
    predecessor: Option<String>,
    published_ms: i64,
) -> Run {
    let manifest = &published.manifest;
    let kernels = manifest.kernels.iter();
    let kernels: Vec<Value> = kernels
        .map(|kernel| json!({ "name": kernel.name, "role": kernel.role, "blake3": kernel.blake3 }))
        .collect();
    Run {
        id: published.by.run.clone(),
        site: manifest.site.clone(),
        job: published.by.job,
        attempt: published.by.attempt,
        version: manifest.version.clone(),
        manifest_blake3: published.manifest_blake3.clone(),
        valid: manifest.verdict.valid,
        verdict: manifest.verdict.word().to_owned(),
        reasons: json!(manifest.verdict.reasons),
        because,
        stages,
        counts: json!(manifest.counts),
        figures: json!(manifest.figures),
        kernels: json!(kernels),
        predecessor,
        published_utc: Instant(published_ms),
        ..Run::default()
    }
}

/// Time of publication of a run, by its manifest.
#[must_use]
pub fn finished_ms(manifest: &Manifest) -> Option<i64> {
    let finished = DateTime::parse_from_rfc3339(&manifest.finished_utc).ok()?;
    Some(finished.timestamp_millis())
}

/// Folders of published runs of a site, by name; unpublished ones are removed.
///
/// # Errors
/// A disk error.
pub fn tidy(site_folder: &Path) -> Result<Vec<PathBuf>> {
    let runs = site_folder.join("runs");
    let mut published = Vec::new();
    let Ok(entries) = fs::read_dir(&runs) else {
        return Ok(published);
    };
    for entry in entries {
        let path = entry.map_err(IoError::on("list")).in_file(&runs)?.path();
        if path.join(MANIFEST).is_file() && path.extension().is_none() {
            published.push(path);
        } else if path.is_dir() {
            remove(&path)?;
        } else if is_old_bar(&path) {
            // One that remains does no harm.
            let _ = fs::remove_file(&path);
        }
    }
    published.sort();
    Ok(published)
}

/// Whether a file took the name of a run ([`bar`](crate::worker::run_folder::bar)) so long ago that its worker has ended.
fn is_old_bar(path: &Path) -> bool {
    // The longest lease is a day.
    const OLD: Duration = Duration::from_hours(48);
    let metadata = fs::symlink_metadata(path);
    metadata.is_ok_and(|of| {
        let age = of
            .modified()
            .ok()
            .and_then(|changed| changed.elapsed().ok());
        of.is_file() && of.len() == 0 && age.is_some_and(|age| age > OLD)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::worker::run_folder::bar;

    #[test]
    fn the_link_leads_to_one_whole_run_after_the_other() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(current(folder.path()), None);
        for run in ["20261122_093000_j1_a1", "20261123_093000_j2_a1"] {
            fs::create_dir_all(folder.path().join("runs").join(run)).unwrap();
            make_current(folder.path(), run).unwrap();
            make_current(folder.path(), run).unwrap();
            assert_eq!(current(folder.path()).as_deref(), Some(run));
        }
        fs::remove_dir(folder.path().join("runs/20261123_093000_j2_a1")).unwrap();
        assert_eq!(current(folder.path()), None);
        assert_eq!(run_id(0, 12, 3), "19700101_000000_j12_a3");
    }

    #[test]
    fn what_was_not_published_is_removed() {
        use std::os::unix::fs::PermissionsExt as _;
        let folder = tempfile::tempdir().unwrap();
        let run = |name: &str| folder.path().join("runs").join(name);
        for name in ["a", "b", "c.partial"] {
            fs::create_dir_all(run(name).join("report")).unwrap();
        }
        for name in ["b", "c.partial"] {
            fs::File::create(run(name).join(MANIFEST)).unwrap();
        }
        let read_only = fs::Permissions::from_mode(0o555);
        fs::set_permissions(run("a").join("report"), read_only.clone()).unwrap();
        fs::set_permissions(run("a"), read_only).unwrap();
        // Names taken from lost workers, one of them long ago.
        for name in ["old", "new"] {
            bar(&run(name)).unwrap();
        }
        let old = fs::File::options().write(true).open(run("old")).unwrap();
        let now = std::time::SystemTime::now();
        old.set_modified(now - Duration::from_hours(49)).unwrap();
        assert_eq!(tidy(folder.path()).unwrap(), [run("b")]);
        assert!(!run("a").exists() && !run("c.partial").exists());
        assert!(!run("old").exists() && run("new").is_file());
        // The folder of a worker that publishes later does not take the name; a run that exists keeps it.
        assert!(fs::rename(run("b"), run("new")).is_err());
        bar(&run("b")).unwrap();
        assert!(run("b").join(MANIFEST).is_file());
    }
}
