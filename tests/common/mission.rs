//! The built-in synthetic mission, written once for all tests of one build of the program.

use std::{
    fs::{self, File},
    path::{Path, PathBuf},
    process::{Command, Output},
};

/// The program under test.
pub(crate) fn areograph() -> Command {
    Command::new(env!("CARGO_BIN_EXE_areograph"))
}

/// Folder of the default mission. Test programs run side by side: the first one writes it.
pub(crate) fn mission() -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let program = fs::read(env!("CARGO_BIN_EXE_areograph")).unwrap();
    let name = format!("mission-{}", &blake3::hash(&program).to_hex()[..16]);
    let lock = File::create(folder.join("mission.lock")).unwrap();
    lock.lock().unwrap();
    let mission = folder.join(&name);
    if !mission.join("truth.json").exists() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let old = path
                .file_name()
                .unwrap()
                .to_string_lossy()
                .starts_with("mission-");
            if old && path.is_dir() {
                fs::remove_dir_all(path).unwrap();
            }
        }
        succeed(areograph().arg("--quiet").arg("scene").arg(&mission));
    }
    mission
}

/// Runs a command that must succeed.
pub(crate) fn succeed(command: &mut Command) -> Output {
    let output = command.output().unwrap();
    assert!(
        output.status.success(),
        "{command:?} ended with {}:\n{}{}",
        output.status,
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
    output
}

/// Every product below `folder` by relative path; `.cache` and `.lock` are not products, and the
/// manifest's time of day is cut out.
pub(crate) fn products(folder: &Path) -> std::collections::BTreeMap<PathBuf, Vec<u8>> {
    fn walk(root: &Path, folder: &Path, found: &mut std::collections::BTreeMap<PathBuf, Vec<u8>>) {
        let Ok(entries) = fs::read_dir(folder) else {
            return;
        };
        for entry in entries {
            let path = entry.unwrap().path();
            if path.file_name().unwrap().to_string_lossy().starts_with('.') {
                continue;
            }
            if path.is_dir() {
                walk(root, &path, found);
            } else {
                let mut bytes = fs::read(&path).unwrap();
                if path.ends_with("manifest.json") {
                    let mut manifest: serde_json::Value = serde_json::from_slice(&bytes).unwrap();
                    manifest.as_object_mut().unwrap().remove("finished_utc");
                    bytes = serde_json::to_vec(&manifest).unwrap();
                }
                found.insert(path.strip_prefix(root).unwrap().to_owned(), bytes);
            }
        }
    }
    let mut found = std::collections::BTreeMap::new();
    walk(folder, folder, &mut found);
    // The page over all sites shows the manifests' times of day.
    found.remove(Path::new("index.html"));
    found
}
