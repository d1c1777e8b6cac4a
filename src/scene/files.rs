//! A folder that appears whole or not at all.

use std::{
    fs::{self, File},
    io::{ErrorKind, Write},
    path::{self, Path, PathBuf},
};

use super::error::SceneError;
use crate::error::{IoFault, Place, Result};

/// File by which a scene is recognised, written before all others.
const MARKER: &str = "README.txt";
/// Its first line.
const MARKER_LINE: &str =
    "A synthetic mission, written by `areograph scene`. Nothing in this folder is mission data.";

/// A scene that is being written beside its final place.
pub(super) struct Draft {
    final_place: PathBuf,
    folder: PathBuf,
}

impl Draft {
    /// Begins `directory.partial`; what is left of a broken attempt is removed.
    ///
    /// # Errors
    /// [`SceneError::NotAScene`] when `directory` or its draft holds something else; the system's refusal.
    pub(super) fn begin(directory: &Path, readme: &str) -> Result<Self> {
        refuse_foreign(directory)?;
        let directory = &path::absolute(directory)
            .map_err(IoFault::on("resolve"))
            .in_file(directory)?;
        let mut name = directory.file_name().unwrap_or("scene".as_ref()).to_owned();
        name.push(".partial");
        let folder = directory.with_file_name(name);
        remove_scene(&folder)?;
        fs::create_dir_all(&folder)
            .map_err(IoFault::on("create"))
            .in_file(&folder)?;
        put(&folder.join(MARKER), &format!("{MARKER_LINE}\n\n{readme}"))?;
        Ok(Self {
            final_place: directory.to_owned(),
            folder,
        })
    }

    /// A folder of the draft, created.
    pub(super) fn folder(&self, name: &str) -> Result<PathBuf> {
        let folder = self.folder.join(name);
        fs::create_dir_all(&folder)
            .map_err(IoFault::on("create"))
            .in_file(&folder)?;
        Ok(folder)
    }

    /// The draft itself.
    pub(super) fn root(&self) -> &Path {
        &self.folder
    }

    /// Moves the draft to its final place. An older scene there goes first: a folder cannot be replaced in
    /// one step, so a kill in between leaves the draft alone, whole.
    pub(super) fn finish(self) -> Result<()> {
        remove_scene(&self.final_place)?;
        fs::rename(&self.folder, &self.final_place)
            .map_err(IoFault::on("rename into place"))
            .in_file(&self.final_place)
    }
}

/// Writes a text file.
pub(super) fn put(path: &Path, text: &str) -> Result<()> {
    File::create(path)
        .and_then(|mut file| file.write_all(text.as_bytes()))
        .map_err(IoFault::on("write"))
        .in_file(path)
}

/// Removes an older scene or an empty folder, if there is one.
fn remove_scene(folder: &Path) -> Result<()> {
    refuse_foreign(folder)?;
    match fs::remove_dir_all(folder) {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(IoFault {
            action: "remove the older scene",
            source: error,
        })
        .in_file(folder),
        _ => Ok(()),
    }
}

/// Refuses a folder that holds anything but a scene.
fn refuse_foreign(folder: &Path) -> Result<()> {
    let mut entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        Err(source) => {
            return Err(IoFault {
                action: "look into",
                source,
            })
            .in_file(folder);
        }
    };
    let empty = entries.next().is_none();
    let ours =
        fs::read_to_string(folder.join(MARKER)).is_ok_and(|text| text.starts_with(MARKER_LINE));
    if empty || ours {
        return Ok(());
    }
    Err(SceneError::NotAScene { marker: MARKER }).in_file(folder)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_draft_replaces_an_older_scene_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("mission");
        for text in ["one", "two"] {
            let draft = Draft::begin(&place, "").unwrap();
            put(&draft.root().join("truth.json"), text).unwrap();
            assert_eq!(
                place.exists(),
                text == "two",
                "nothing appears before the end"
            );
            draft.finish().unwrap();
            assert_eq!(fs::read_to_string(place.join("truth.json")).unwrap(), text);
        }
        let foreign = folder.path().join("photos");
        fs::create_dir(&foreign).unwrap();
        put(&foreign.join("holiday.txt"), "sea").unwrap();
        let failure = Draft::begin(&foreign, "").err().unwrap();
        assert!(
            failure.to_string().contains("holds no scene of areograph"),
            "{failure}"
        );
        assert!(foreign.join("holiday.txt").exists());
    }
}
