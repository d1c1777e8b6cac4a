//! An archive on a server: the answers are those of the archive on this computer, or there is a clear error.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::panic,
    reason = "tests work in temporary folders and may fail loudly"
)]

mod answers;
mod checks;
mod incomplete;
mod indexing;
mod objects;
#[cfg(feature = "sql")]
mod sql;

use std::{
    fs,
    path::PathBuf,
    process::{Command, Output},
};

use areograph::body::Datum;
use areograph_testing::track::{FRAMES, write};

use crate::common::{
    archive_server::{ArchiveServer, Listing},
    mission::{areograph, succeed},
};

const FIRST: &str = "data/ap19xxx/AP19030L.B";
const SECOND: &str = "data/ap19xxx/ap19020k.b";
/// A band that both tracks cross, within a few of their blocks.
const SMALL: &str = "--box=-179,179,20,21";
const LARGE: &str = "--box=-170,170,-60,60";

/// An archive, its server, and a folder for stand-ins.
struct Archive {
    folder: tempfile::TempDir,
    server: ArchiveServer,
}

impl Archive {
    fn new(listing: Listing) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().join("archive");
        fs::create_dir_all(root.join("data/ap19xxx")).unwrap();
        write(&root.join(FIRST), Datum::Iau2000, 0, |_, _| ());
        write(&root.join(SECOND), Datum::Iau1991, FRAMES / 2, |_, _| ());
        fs::write(root.join("data/aareadme.txt"), "A volume").unwrap();
        let server = ArchiveServer::of(&root, listing);
        let archive = Self { folder, server };
        archive.limits(1.0);
        archive
    }

    /// The archive with its stand-ins.
    fn indexed() -> Self {
        let archive = Self::new(Listing::Plain);
        succeed(&mut archive.index(&[]));
        archive
    }

    /// Writes a table of limits.
    fn limits(&self, read_s: f64) {
        let text = format!(
            "contact = 'tester@example.org'\n[network]\nconnect_s = 2\nread_s = {read_s:?}\nattempts = 3\npause_s = 0.01\npause_max_s = 2\n"
        );
        fs::write(self.path("limits.toml"), text).unwrap();
    }

    fn path(&self, relative: &str) -> PathBuf {
        self.folder.path().join(relative)
    }

    fn url(&self) -> String {
        format!("{}/data", self.server.url())
    }

    fn index(&self, arguments: &[&str]) -> Command {
        self.index_of(&self.url(), arguments)
    }

    fn index_of(&self, url: &str, arguments: &[&str]) -> Command {
        let mut command = areograph();
        command.args(["--quiet", "pedr", "index", url, "--into"]);
        command.arg(self.path("mola"));
        command.arg("--archives").arg(self.path("limits.toml"));
        command.args(arguments);
        command
    }

    fn search(&self, folder: &str, window: &str, out: &str) -> Command {
        let mut command = areograph();
        command.args(["--quiet", "pedr", "search"]);
        command.arg(self.path(folder)).arg(window);
        command
            .arg("--out")
            .arg(self.path(out))
            .args(["--wide", "--json"]);
        command
    }

    /// Rows and statement of a search that succeeds.
    fn found(&self, folder: &str, window: &str) -> [Vec<u8>; 2] {
        let out = format!("{folder}.csv");
        let stated = succeed(&mut self.search(folder, window, &out)).stdout;
        let found: serde_json::Value = serde_json::from_slice(&stated).unwrap();
        assert!(found["complete"] == true && found["rows"].as_u64().unwrap() > 100);
        [fs::read(self.path(&out)).unwrap(), stated]
    }

    /// Code, statement and error of a search that fails.
    fn refused(&self, window: &str) -> (i32, serde_json::Value, String) {
        let output = self.search("mola", window, "refused.csv").output().unwrap();
        let (code, error) = failed(&output);
        let stated = serde_json::from_slice(&output.stdout).unwrap_or_default();
        (code, stated, error)
    }

    fn forget_blocks(&self) {
        let _ = fs::remove_dir_all(self.path("mola/.fetch/blocks"));
    }

    fn sent(&self) -> u64 {
        [FIRST, SECOND]
            .map(|file| self.server.sent(&format!("/{file}")))
            .iter()
            .sum()
    }

    fn bytes(&self) -> u64 {
        let bytes = |file| fs::metadata(self.path("archive").join(file)).unwrap().len();
        bytes(FIRST) + bytes(SECOND)
    }
}

fn failed(output: &Output) -> (i32, String) {
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success(), "{output:?}");
    assert!(!error.contains("panicked"), "{error}");
    (output.status.code().unwrap(), error)
}

/// Path of a stand-in for a path of the server.
fn below_data(file: &str) -> &str {
    file.strip_prefix("data/").unwrap()
}
