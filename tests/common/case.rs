//! A small site of a test's own: kernels, one PEDR file, one label, and a site file over them.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use super::mission::{areograph, mission, once, succeed};

const SITE: &str = r#"site = "case"
[kernels]
metakernel = "kernels/nav.tm"
[pedr]
files = ["pedr/*.b"]
[[windows]]
id = "window"
longitude_deg = [87.5, 88.5]
latitude_deg = [4.0, 5.0]
[[images]]
id = "image"
label = "image.lbl"
"#;

/// Copies the files of a folder.
fn copy_folder(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        fs::copy(&path, to.join(path.file_name().unwrap())).unwrap();
    }
}

/// The site, in a folder that goes with it.
pub(crate) struct Case {
    folder: tempfile::TempDir,
}

impl Case {
    /// An empty folder.
    pub(crate) fn empty() -> Self {
        Self {
            folder: tempfile::tempdir().unwrap(),
        }
    }

    /// A folder with the kernels of the mission, and an empty one for PEDR files.
    fn with_kernels() -> Self {
        let case = Self::empty();
        let mission = mission();
        for folder in ["kernels", "pedr"] {
            fs::create_dir(case.path(folder)).unwrap();
        }
        for entry in fs::read_dir(mission.join("kernels")).unwrap() {
            let path = entry.unwrap().path();
            fs::copy(&path, case.path("kernels").join(path.file_name().unwrap())).unwrap();
        }
        case
    }

    /// The mission's pair of images over Isidis with its tie points, as `isidis`.
    pub(crate) fn pair() -> Self {
        let (case, mission) = (Self::with_kernels(), mission());
        for folder in ["labels", "ties"] {
            fs::create_dir(case.path(folder)).unwrap();
        }
        for file in [
            "pedr/ap19019k.b",
            "pedr/ap19117l.b",
            "labels/E02-01301.lbl",
            "labels/E02-02016.lbl",
            "ties/isidis.csv",
        ] {
            fs::copy(mission.join(file), case.path(file)).unwrap();
        }
        let site = fs::read_to_string(mission.join("sites/isidis.toml")).unwrap();
        case.write("site.toml", site.replace("../", ""));
        case
    }

    /// The pair with the stage outputs of a run of it, which a change must not let pass for its own.
    pub(crate) fn pair_after_a_run() -> Self {
        let stored = once("stages-of-pair", |folder| {
            let case = Self::pair();
            succeed(&mut case.run());
            copy_folder(&case.path("out/isidis/.cache"), folder);
        });
        let case = Self::pair();
        copy_folder(&stored, &case.path("out/isidis/.cache"));
        case
    }

    pub(crate) fn new() -> Self {
        let (case, mission) = (Self::with_kernels(), mission());
        let pedr = mission.join("pedr/ap19117l.b");
        fs::copy(pedr, case.path("pedr/ap19117l.b")).unwrap();
        fs::copy(mission.join("labels/E02-02016.lbl"), case.path("image.lbl")).unwrap();
        case.write("site.toml", SITE);
        case
    }

    pub(crate) fn path(&self, relative: &str) -> PathBuf {
        self.folder.path().join(relative)
    }

    pub(crate) fn write(&self, relative: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path(relative), content).unwrap();
    }

    pub(crate) fn read(&self, relative: &str) -> Vec<u8> {
        fs::read(self.path(relative)).unwrap()
    }

    pub(crate) fn replace(&self, relative: &str, from: &str, to: &str) {
        let text = String::from_utf8(self.read(relative)).unwrap();
        assert!(text.contains(from), "{relative} has no {from}");
        self.write(relative, text.replace(from, to));
    }

    pub(crate) fn truncate(&self, relative: &str, bytes: usize) {
        self.write(relative, &self.read(relative)[..bytes]);
    }

    /// The program, in the folder of the case.
    pub(crate) fn areograph(&self) -> Command {
        let mut command = areograph();
        command.current_dir(self.folder.path());
        command
    }

    pub(crate) fn run(&self) -> Command {
        let mut command = self.areograph();
        command.args(["--quiet", "run", "site.toml", "--out", "out", "--jobs", "1"]);
        command
    }

    /// Runs into `out`, and gives the stages that the log says ran.
    pub(crate) fn stages_run(&self) -> Vec<String> {
        let mut command = self.areograph();
        command.args(["--verbose", "run", "site.toml", "--out", "out"]);
        let log = String::from_utf8(succeed(&mut command).stderr).unwrap();
        log.lines()
            .filter(|line| line.contains(": running: "))
            .map(|line| {
                line.split("stage=\"")
                    .nth(1)
                    .unwrap()
                    .trim_end_matches('"')
                    .to_owned()
            })
            .collect()
    }

    pub(crate) fn check(&self) -> Command {
        let mut command = self.areograph();
        command.args(["--quiet", "check", "--full", "site.toml"]);
        command
    }

    /// Exit code and everything printed, the case's folder cut out.
    pub(crate) fn outcome(&self, mut command: Command) -> String {
        let output = command.output().unwrap();
        let printed = [&output.stdout[..], &output.stderr[..]].concat();
        let folder = self.folder.path().canonicalize().unwrap();
        let printed = String::from_utf8(printed)
            .unwrap()
            .replace(&format!("{}/", folder.display()), "")
            .replace(&format!("{}/", self.folder.path().display()), "");
        format!("exit {}\n{printed}", output.status.code().unwrap_or(-1))
    }
}
