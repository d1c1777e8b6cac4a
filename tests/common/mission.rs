//! The built-in synthetic mission and runs of its sites, written once for all tests of one build of the program.

use std::{
    fs::{self, File},
    path::{Path, PathBuf},
    process::{Command, Output},
    sync::{LazyLock, OnceLock},
};

/// The program under test.
pub(crate) fn areograph() -> Command {
    Command::new(env!("CARGO_BIN_EXE_areograph"))
}

/// Folder of the default mission.
pub(crate) fn mission() -> PathBuf {
    static MISSION: OnceLock<PathBuf> = OnceLock::new();
    let write = |folder: &Path| {
        succeed(
            areograph()
                .args(["--quiet", "scene", "mission"])
                .arg(folder),
        );
    };
    MISSION.get_or_init(|| once("mission", write)).clone()
}

/// A run of a site of the default mission, to read only: its products and stage outputs.
pub(crate) fn site_run(site: &str) -> PathBuf {
    let file = mission().join(format!("sites/{site}.toml"));
    let run = |folder: &Path| {
        let mut run = areograph();
        run.args(["--quiet", "run"]).arg(&file);
        succeed(run.arg("--out").arg(folder));
    };
    once(&format!("run-{site}"), run).join(site)
}

/// The folder of a fixture that this build of the program makes once. Test programs run side by side: the first one
/// makes it.
pub(crate) fn once(name: &str, make: impl FnOnce(&Path)) -> PathBuf {
    static BUILD: LazyLock<String> = LazyLock::new(|| {
        let program = fs::read(env!("CARGO_BIN_EXE_areograph")).unwrap();
        blake3::hash(&program).to_hex()[..16].to_owned()
    });
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("fixtures");
    let build = folder.join(&*BUILD);
    fs::create_dir_all(&folder).unwrap();
    let lock = File::create(folder.join(format!("{name}.lock"))).unwrap();
    lock.lock().unwrap();
    if !build.exists() {
        for entry in fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() && path != build {
                // Another fixture may be removing it.
                let _ = fs::remove_dir_all(path);
            }
        }
    }
    let fixture = build.join(name);
    if !fixture.exists() {
        let part = build.join(format!("{name}.part"));
        let _ = fs::remove_dir_all(&part);
        make(&part);
        fs::rename(part, &fixture).unwrap();
    }
    fixture
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
