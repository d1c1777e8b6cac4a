//! A folder that is written completely or not at all, with a list of its own files.

use std::{
    collections::BTreeMap,
    fmt::Write as _,
    fs::{self, DirEntry, File},
    io::{ErrorKind, Write as _},
    path::{self, Path, PathBuf},
};

use super::error::SceneError;
use areograph_base::error::{IoError, Locate, Result};
use areograph_store::files::{ASIDE, PartialFolder, hash_file};

/// Name of the introductory text.
const README: &str = "README.txt";
const README_LINE: &str =
    "A synthetic mission, written by `areograph scene`. Nothing in this folder is mission data.";
/// File by which a scene is recognised: one line per written file, BLAKE3 and path.
const LIST: &str = ".scene";

/// A scene being written in a temporary folder beside its final location.
///
/// Dropped unfinished, it leaves nothing; the next scene beside it removes the remains of a killed process, and
/// restores an older scene that the process had moved aside.
pub(super) struct Draft {
    final_place: PathBuf,
    /// Contains the new scene and, during the exchange, the older one.
    workshop: PartialFolder,
    folder: PathBuf,
}

impl Draft {
    /// Begins a scene for `directory`.
    ///
    /// # Errors
    /// [`SceneError`] when `directory` contains anything except an unchanged scene; errors of writing.
    pub(super) fn begin(directory: &Path, readme: &str) -> Result<Self> {
        let readme = format!("{README_LINE}\n\n{readme}");
        refuse_foreign(directory)?;
        refuse_other(directory, &readme)?;
        let final_place = path::absolute(directory)
            .map_err(IoError::on("resolve"))
            .in_file(directory)?;
        let parent = final_place.parent().unwrap_or(&final_place);
        let workshop = fs::create_dir_all(parent)
            .and_then(|()| PartialFolder::new_in(parent))
            .map_err(IoError::on("create a folder"))
            .in_file(parent)?;
        // A separate folder: temporary ones are private, a scene is readable by everyone.
        let folder = workshop.path().join("new");
        fs::create_dir(&folder)
            .map_err(IoError::on("create"))
            .in_file(&folder)?;
        put(&folder.join(README), &readme)?;
        Ok(Self {
            final_place,
            workshop,
            folder,
        })
    }

    /// Creates a folder of the draft.
    pub(super) fn folder(&self, name: &str) -> Result<PathBuf> {
        let folder = self.folder.join(name);
        fs::create_dir_all(&folder)
            .map_err(IoError::on("create"))
            .in_file(&folder)?;
        Ok(folder)
    }

    /// The draft itself.
    pub(super) fn root(&self) -> &Path {
        &self.folder
    }

    /// Lists the files of the draft and moves it to its final location. An older scene there is moved aside first: a
    /// folder cannot be replaced in one step.
    ///
    /// # Errors
    /// Those of [`Self::begin`]; an older scene then remains in place.
    pub(super) fn finish(self) -> Result<()> {
        put(&self.folder.join(LIST), &list(&self.folder)?)?;
        refuse_foreign(&self.final_place)?;
        let aside = self.workshop.path().join(ASIDE);
        fs::create_dir(&aside)
            .map_err(IoError::on("create"))
            .in_file(&aside)?;
        let older = aside.join(self.final_place.file_name().unwrap_or_default());
        match fs::rename(&self.final_place, &older) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                return Err(IoError::on("move the older scene aside")(error))
                    .in_file(&self.final_place);
            }
            _ => {}
        }
        fs::rename(&self.folder, &self.final_place)
            .inspect_err(|_| {
                // If this fails too, nothing more can be done; the first error is reported.
                let _ = fs::rename(&older, &self.final_place);
            })
            .map_err(IoError::on("rename into place"))
            .in_file(&self.final_place)
    }
}

/// Writes a text file.
pub(super) fn put(path: &Path, text: &str) -> Result<()> {
    put_bytes(path, text.as_bytes())
}

/// Writes a file of a scene.
pub(super) fn put_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    File::create(path)
        .and_then(|mut file| file.write_all(bytes))
        .map_err(IoError::on("write"))
        .in_file(path)
}

/// The text of [`LIST`]: hashes of the files below `folder`.
fn list(folder: &Path) -> Result<String> {
    let mut text = String::new();
    for (name, path) in below(folder)? {
        if path.is_file() {
            let _infallible = writeln!(text, "{}  {name}", hash_file(&path)?.0);
        }
    }
    Ok(text)
}

/// Rejects a folder that contains anything except a scene as it was written. Missing files are ignored.
fn refuse_foreign(folder: &Path) -> Result<()> {
    let held = below(folder)?;
    if held.is_empty() {
        return Ok(());
    }
    let Ok(list) = fs::read_to_string(folder.join(LIST)) else {
        return Err(SceneError::NotAScene { list: LIST }).in_file(folder);
    };
    let hashes: BTreeMap<&str, &str> = list
        .lines()
        .filter_map(|line| line.split_once("  "))
        .map(|(hash, name)| (name, hash))
        .collect();
    for (name, path) in held {
        let kind = fs::symlink_metadata(&path)
            .map_err(IoError::on("look at"))
            .in_file(&path)?
            .file_type();
        let inside = format!("{name}/");
        let written = if kind.is_dir() {
            hashes.keys().any(|file| file.starts_with(&inside))
        } else {
            kind.is_file() && (name == LIST || hashes.contains_key(name.as_str()))
        };
        if !written {
            return Err(SceneError::Foreign { entry: name }).in_file(folder);
        }
        if let Some(hash) = hashes.get(name.as_str())
            && hash_file(&path)?.0 != *hash
        {
            return Err(SceneError::Changed { file: name }).in_file(folder);
        }
    }
    Ok(())
}

/// Rejects a scene of another kind, whose introduction differs.
fn refuse_other(folder: &Path, readme: &str) -> Result<()> {
    match fs::read_to_string(folder.join(README)) {
        Ok(other) if other != readme => Err(SceneError::Other).in_file(folder),
        _ => Ok(()),
    }
}

/// Files, folders and links below `folder` by their path from there, with `/`; empty without a folder.
fn below(folder: &Path) -> Result<BTreeMap<String, PathBuf>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![(String::new(), folder.to_owned())];
    while let Some((prefix, folder)) = folders.pop() {
        for entry in entries(&folder)? {
            let name = format!("{prefix}{}", entry.file_name().to_string_lossy());
            // Metadata of the entry itself: links are not followed.
            if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
                folders.push((format!("{name}/"), entry.path()));
            }
            found.insert(name, entry.path());
        }
    }
    Ok(found)
}

fn entries(folder: &Path) -> Result<Vec<DirEntry>> {
    match fs::read_dir(folder).and_then(Iterator::collect) {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(Vec::new()),
        entries => entries.map_err(IoError::on("look into")).in_file(folder),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write_scene(place: &Path, truth: &str) {
        let draft = Draft::begin(place, "").unwrap();
        put(&draft.root().join("truth.json"), truth).unwrap();
        put(&draft.folder("sites").unwrap().join("a.toml"), "site").unwrap();
        draft.finish().unwrap();
    }

    fn refusal(place: &Path) -> String {
        Draft::begin(place, "").err().unwrap().cause.to_string()
    }

    #[test]
    fn a_draft_replaces_an_older_scene_and_leaves_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("mission");
        for text in ["one", "two"] {
            write_scene(&place, text);
            assert_eq!(fs::read_to_string(place.join("truth.json")).unwrap(), text);
        }
        drop(Draft::begin(&place, "").unwrap());
        assert_eq!(entries(folder.path()).unwrap().len(), 1);
        // A scene with a missing file is still a scene.
        fs::remove_file(place.join("sites/a.toml")).unwrap();
        write_scene(&place, "three");
    }

    #[test]
    fn a_scene_of_another_kind_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("mission");
        write_scene(&place, "truth");
        let refused = Draft::begin(&place, "An archive.").err().unwrap();
        assert!(
            refused
                .to_string()
                .contains("contains a scene of another kind")
        );
        assert!(place.join("truth.json").exists());
    }

    #[test]
    fn two_drafts_of_one_place_do_not_meet() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("mission");
        let drafts = ["one", "two"].map(|text| {
            let draft = Draft::begin(&place, "").unwrap();
            put(&draft.root().join("truth.json"), text).unwrap();
            draft
        });
        for (draft, text) in drafts.into_iter().zip(["one", "two"]) {
            draft.finish().unwrap();
            assert_eq!(fs::read_to_string(place.join("truth.json")).unwrap(), text);
        }
        assert_eq!(entries(folder.path()).unwrap().len(), 1);
    }

    #[test]
    fn what_the_scene_did_not_write_is_never_removed() {
        let folder = tempfile::tempdir().unwrap();
        let photos = folder.path().join("photos");
        fs::create_dir(&photos).unwrap();
        put(&photos.join("holiday.txt"), "sea").unwrap();
        assert!(refusal(&photos).contains("contains no areograph scene"));
        assert!(photos.join("holiday.txt").exists());

        let place = folder.path().join("mission");
        write_scene(&place, "truth");
        // An empty folder, a file among the scene's own, products in a folder.
        fs::create_dir(place.join("kept")).unwrap();
        assert!(refusal(&place).contains("contains kept, which"));
        fs::remove_dir(place.join("kept")).unwrap();
        put(&place.join("sites/b.toml"), "site").unwrap();
        assert!(refusal(&place).contains("contains sites/b.toml, which"));
        fs::remove_file(place.join("sites/b.toml")).unwrap();
        fs::create_dir(place.join("out")).unwrap();
        put(&place.join("out/ranges.json"), "{}").unwrap();
        assert!(refusal(&place).contains("contains out, which"));
        fs::remove_dir_all(place.join("out")).unwrap();

        put(&place.join("sites/a.toml"), "site of mine").unwrap();
        assert!(refusal(&place).contains("sites/a.toml has been changed"));
        put(&place.join("sites/a.toml"), "site").unwrap();
        write_scene(&place, "again");
    }

    #[test]
    fn what_came_while_the_scene_was_written_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("mission");
        let draft = Draft::begin(&place, "").unwrap();
        fs::create_dir(&place).unwrap();
        put(&place.join("notes.txt"), "mine").unwrap();
        assert!(draft.finish().is_err());
        assert_eq!(fs::read_to_string(place.join("notes.txt")).unwrap(), "mine");
        assert_eq!(entries(folder.path()).unwrap().len(), 1);
    }
}
