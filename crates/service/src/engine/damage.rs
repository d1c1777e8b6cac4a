//! Damaged products: reported once for each run; a current run is repeated.

use std::{collections::BTreeMap, fs::File, io, path::Path};

use rusqlite::{Connection, Transaction};

use super::alerts::{Alert, tell_edge};
use crate::{
    contents::{Content, Contents, open_below},
    database::{
        CauseKind, CauseRow, JobRequest, Priority, Stored, active_job, enqueue,
        runs::{damaged_products, is_kept, put_checked, put_damaged},
        sites::site,
    },
};
use areograph_config::{AlertKind, ServiceConfig};
use areograph_store::{files::Identity, manifest::Manifest, publish::MANIFEST};

/// Products of a run that do not match its manifest.
#[derive(Debug, Clone, Copy)]
pub struct Damage<'a> {
    /// The site.
    pub site: &'a str,
    /// The run.
    pub run: &'a str,
    /// Their number, as far as known.
    pub products: i64,
    /// The first of them, as in "`footprints.parquet` does not match its manifest".
    pub what: &'a str,
}

/// Whether damage of a run has been reported.
///
/// # Errors
/// SQLite errors.
pub fn is_known_damage(connection: &Connection, run: &str) -> Stored<bool> {
    Ok(damaged_products(connection, run)? > 0)
}

/// Reports damage, if it is new. A current run is repeated, unless a job of its site is active.
///
/// # Errors
/// SQLite errors.
pub fn note_damage(
    transaction: &Transaction<'_>,
    config: &ServiceConfig,
    now_ms: i64,
    damage: &Damage<'_>,
) -> Stored<()> {
    let Damage {
        site: name,
        run,
        products,
        what,
    } = *damage;
    if !is_kept(transaction, run)? {
        return Ok(());
    }
    put_damaged(transaction, run, products)?;
    let text = format!("run {run}: {what}; it is withheld");
    edge(transaction, config, now_ms, damage, Some(&text))?;
    let is_current = site(transaction, name)?
        .is_some_and(|site| site.enabled && site.current_run.as_deref() == Some(run));
    if !is_current || active_job(transaction, name)?.is_some() {
        return Ok(());
    }
    let cause = CauseRow::plain(CauseKind::ProductDamaged, what, now_ms);
    let request = JobRequest {
        site: name,
        priority: Priority::Changed,
        force: true,
        night: None,
        asked_by: None,
        ready: true,
        causes: &[cause],
    };
    enqueue(transaction, now_ms, &request).map(|_| ())
}

/// Records the result of a complete check of a run; returns whether its products still existed. Those that were removed
/// meanwhile are not damaged.
///
/// # Errors
/// SQLite errors.
pub fn note_check(
    transaction: &Transaction<'_>,
    config: &ServiceConfig,
    now_ms: i64,
    damage: &Damage<'_>,
) -> Stored<bool> {
    if !is_kept(transaction, damage.run)? {
        return Ok(false);
    }
    put_checked(transaction, damage.run, now_ms)?;
    if damage.products > 0 {
        note_damage(transaction, config, now_ms, damage)?;
    } else if damaged_products(transaction, damage.run)? > 0 {
        put_damaged(transaction, damage.run, 0)?;
        edge(transaction, config, now_ms, damage, None)?;
    }
    Ok(true)
}

fn edge(
    transaction: &Transaction<'_>,
    config: &ServiceConfig,
    now_ms: i64,
    damage: &Damage<'_>,
    text: Option<&str>,
) -> Stored<()> {
    let alert = Alert {
        kind: AlertKind::ProductDamaged,
        site: Some(damage.site),
        run: Some(damage.run),
        text: text.unwrap_or_default(),
    };
    let subject = format!("products {}", damage.run);
    let state = (&*subject, text.is_some());
    tell_edge(transaction, config, now_ms, state, (&alert, None))
}

/// Result of reading all products of a run.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct RunCheck {
    /// Products that do not match the manifest.
    pub damaged: i64,
    /// The first of them, as text.
    pub what: String,
}

impl RunCheck {
    fn add(&mut self, what: String) {
        if self.damaged == 0 {
            self.what = what;
        }
        self.damaged += 1;
    }
}

/// Files that were read in one check, by device and inode: runs share unchanged products by links.
pub type Seen = BTreeMap<(u64, u64), (Identity, Content)>;

/// Reads all products of a run that were not `seen`, even if the file system reports no change; `None` if `step` stopped it. A product that
/// cannot be read counts as damaged.
pub fn check_run(
    contents: &Contents,
    folder: &Path,
    manifest_blake3: &str,
    seen: &mut Seen,
    mut step: impl FnMut(usize) -> bool,
) -> Option<RunCheck> {
    let mut check = RunCheck::default();
    let Some(manifest) = published_manifest(folder, manifest_blake3) else {
        check.add("the manifest of this run differs from the published manifest".to_owned());
        return Some(check);
    };
    for entry in &manifest.products {
        let opened = open_below(folder, Path::new(&entry.path));
        let read = opened.and_then(|file| {
            let read = file.map(|file| read_once(contents, &file, seen, &mut step));
            read.transpose()
        });
        match read {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => return None,
            Err(error) => check.add(format!("`{}` cannot be read: {error}", entry.path)),
            Ok(Some(content)) if content.is(entry.bytes, &entry.blake3) => {}
            Ok(_) => check.add(format!("`{}` does not match its manifest", entry.path)),
        }
    }
    Some(check)
}

fn read_once(
    contents: &Contents,
    file: &File,
    seen: &mut Seen,
    step: &mut impl FnMut(usize) -> bool,
) -> io::Result<Content> {
    let identity = Identity::of(&file.metadata()?);
    let key = (identity.device, identity.inode);
    match seen.get(&key) {
        Some((before, content)) if *before == identity => Ok(*content),
        _ => {
            let content = contents.read(file, step)?;
            seen.insert(key, (identity, content));
            Ok(content)
        }
    }
}

fn published_manifest(folder: &Path, blake3: &str) -> Option<Manifest> {
    let bytes = std::fs::read(folder.join(MANIFEST)).ok()?;
    let is_published = blake3::hash(&bytes).to_hex().as_str() == blake3;
    is_published
        .then(|| serde_json::from_slice(&bytes).ok())
        .flatten()
}

#[cfg(test)]
mod tests {

    use super::*;
    use crate::database::{
        Database,
        runs::{Run, due_run, put_removed, put_run},
    };
    use areograph_config::Document as _;

    fn run(id: &str) -> Run {
        Run {
            id: id.to_owned(),
            site: "eos".to_owned(),
            job: 1,
            attempt: 1,
            valid: true,
            verdict: "valid".to_owned(),
            ..Run::default()
        }
    }

    #[test]
    fn a_run_that_was_removed_during_its_check_is_not_damaged() {
        let folder = tempfile::tempdir().unwrap();
        let text = "[inputs]\nsites = [\".\"]\nkernels = [\"kernels\"]\ndata = [\"data\"]\n";
        let config = ServiceConfig::parse(text, &folder.path().join("areograph.toml"))
            .unwrap()
            .config;
        let database = Database::open(folder.path()).unwrap();
        let check = |id: &'static str, removed: bool| {
            database.write(|transaction| {
                put_run(transaction, &run(id))?;
                if removed {
                    put_removed(transaction, id, 1)?;
                }
                let damage = Damage {
                    site: "eos",
                    run: id,
                    products: 2,
                    what: "`footprints.csv` cannot be read",
                };
                let existed = note_check(transaction, &config, 2, &damage)?;
                Ok((existed, damaged_products(transaction, id)?))
            })
        };
        assert_eq!(check("kept", false).unwrap(), (true, 2));
        assert_eq!(check("removed", true).unwrap(), (false, 0));
        let due = database.read(|connection| due_run(connection, 2, false));
        assert_eq!(due.unwrap(), None);
    }
}
