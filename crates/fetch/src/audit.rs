//! Examination of a filled folder: against its own records, and against the archives.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

use crate::{filling::Filling, hashed::Hashed, outcome::Standing, plan::Plan, state::State};
use areograph_base::error::{IoError, Locate as _, Result};

/// A recorded file that is not as recorded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Damaged {
    /// The file.
    pub path: PathBuf,
    /// The difference.
    pub problem: String,
}

/// Reads every recorded file again; the number of files, and those that are not as recorded.
///
/// # Errors
/// The state is malformed; a file cannot be read.
pub fn verify(filling: &Filling<'_>) -> Result<(usize, Vec<Damaged>)> {
    let folder = filling.folder();
    let state = State::read(&folder.state())?;
    let mut damaged = Vec::new();
    for (name, record) in &state.files {
        let path = folder.absolute(name);
        if !path.exists() {
            let problem = "is missing".to_owned();
            damaged.push(Damaged { path, problem });
            continue;
        }
        let found = Hashed::of(&path)?;
        if !record.is(&found) {
            let problem = format!(
                "{} bytes with SHA-256 {}; expected {} bytes with {}",
                found.bytes, found.sha256, record.bytes, record.sha256
            );
            damaged.push(Damaged { path, problem });
        }
    }
    Ok((state.files.len(), damaged))
}

/// A folder against the contents of the archives for it.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Audit {
    /// Planned, and not in the folder.
    pub missing: Vec<String>,
    /// In the folder, and not as the archive states.
    pub differ: Vec<String>,
    /// Recorded files that the plan does not need.
    pub not_needed: Vec<String>,
    /// Files beside the plan that no fetch retrieved.
    pub foreign: Vec<String>,
    /// Needed, and in no index.
    pub in_no_index: Vec<String>,
}

/// Compares the folder with a plan.
///
/// # Errors
/// The state is malformed; a folder cannot be listed.
pub fn audit(filling: &Filling<'_>, plan: &Plan) -> Result<Audit> {
    let folder = filling.folder();
    let state = State::read(&folder.state())?;
    let mut audit = Audit {
        in_no_index: plan.lacks.clone(),
        ..Audit::default()
    };
    let mut places: BTreeSet<&Path> = BTreeSet::new();
    for (file, standing) in plan.files.iter().zip(filling.standing(plan)?) {
        places.extend(file.path.parent());
        let name = folder.relative(&file.path);
        match standing {
            Standing::Missing => audit.missing.push(format!("{name}: {}", file.why)),
            Standing::Begun(bytes) => {
                audit
                    .missing
                    .push(format!("{name}: {bytes} bytes have arrived; {}", file.why));
            }
            Standing::Other => audit.differ.push(format!(
                "{name}: {}",
                difference(&file.path, &name, &state, file.md5.as_deref())
            )),
            Standing::Unknown => audit.foreign.push(format!(
                "{name}: planned, but not fetched by areograph; the next fetch compares it with the archive"
            )),
            Standing::Present => {}
        }
    }
    let planned: BTreeSet<String> = plan
        .files
        .iter()
        .map(|file| folder.relative(&file.path))
        .collect();
    for (name, record) in state
        .files
        .iter()
        .filter(|(name, _)| !planned.contains(*name))
    {
        audit
            .not_needed
            .push(format!("{name}: fetched as {}", record.why));
    }
    for place in places.into_iter().filter(|place| place.is_dir()) {
        let entries = fs::read_dir(place)
            .map_err(IoError::on("list folder"))
            .in_file(place)?;
        for entry in entries {
            let path = entry
                .map_err(IoError::on("list folder"))
                .in_file(place)?
                .path();
            let name = folder.relative(&path);
            let is_own = path
                .file_name()
                .is_some_and(|name| name.to_string_lossy().starts_with('.'))
                || path == folder.state();
            if path.is_file()
                && !is_own
                && !planned.contains(&name)
                && !state.files.contains_key(&name)
            {
                audit.foreign.push(name);
            }
        }
    }
    audit.foreign.sort();
    Ok(audit)
}

fn difference(path: &Path, name: &str, state: &State, md5: Option<&str>) -> String {
    let size = path.metadata().map(|found| found.len()).unwrap_or_default();
    match (state.files.get(name), md5) {
        (Some(record), _) if record.bytes != size => {
            format!("{size} bytes; expected {}, as fetched", record.bytes)
        }
        (Some(record), Some(md5)) => {
            format!(
                "fetched with MD5 {}; the index of the archive now states {md5}",
                record.md5
            )
        }
        _ => format!("{size} bytes; the index of the archive states a different size"),
    }
}
