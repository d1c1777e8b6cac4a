//! The folder of an index, and the archive that it describes.

use std::path::{Path, PathBuf};

use super::error::RemoteError;
use crate::{archives::Archives, client::Client, safe::is_path};
use areograph_base::error::{Locate as _, Result};
use areograph_store::{
    atomic,
    files::{Mark, MarkAt},
};

/// File that states the address of an archive, in the folder of its stand-ins. Its tables are those of
/// `config/archives/mgs.toml`.
pub const ARCHIVE_FILE: &str = "areograph-archive.toml";
const HEAD: &str = "# The archive behind the stand-ins of this folder, by areograph pedr index.\n";
const MARK: Mark = Mark {
    what: "a description of an archive that areograph wrote",
    at: MarkAt::Start(HEAD.as_bytes()),
};
/// Levels of folders above a stand-in that are searched for the file.
const FOLDERS_ABOVE: usize = 8;

/// A folder of stand-ins.
#[derive(Debug)]
pub(super) struct Place {
    pub(super) folder: PathBuf,
    pub(super) archives: Archives,
    pub(super) client: Client,
}

impl Place {
    /// The folder of the stand-in `path`, and the path of its file below it: by the names of the path, or else by the
    /// folders to which they lead.
    pub(super) fn of(path: &Path) -> Result<(PathBuf, String)> {
        let found = above(path).or_else(|| above(&path.canonicalize().ok()?));
        let file = ARCHIVE_FILE;
        found.ok_or(RemoteError::NoArchive { file }).in_file(path)
    }

    /// The archive of a folder of stand-ins.
    pub(super) fn read(folder: &Path) -> Result<Self> {
        let archives = Archives::with(&folder.join(ARCHIVE_FILE))?;
        Ok(Self {
            folder: folder.to_owned(),
            client: Client::of(&archives),
            archives,
        })
    }

    /// Address of the file with this path below the folder.
    pub(super) fn url_of(&self, below: &str) -> String {
        format!("{}/{below}", self.archives.pedr.url.trim_end_matches('/'))
    }
}

/// The next folder above with a description of an archive, and the path below it.
fn above(path: &Path) -> Option<(PathBuf, String)> {
    let mut folders = path.ancestors().skip(1).take(FOLDERS_ABOVE);
    let folder = folders.find(|folder| folder.join(ARCHIVE_FILE).is_file())?;
    let below = path.strip_prefix(folder).ok()?.to_str()?;
    is_path(below).then(|| (folder.to_owned(), below.to_owned()))
}

/// Writes the description of an archive into the folder of its stand-ins.
///
/// # Errors
/// The folder cannot be written; a file of another program.
pub(super) fn describe(folder: &Path, archives: &Archives) -> Result<()> {
    let network = &archives.network;
    let text = format!(
        "{HEAD}# Address, contact and limits may be changed.\ncontact = {}   # sent to the host, such as an e-mail address\n\n\
         [network]\nconnect_s = {:?}\nread_s = {:?}\nattempts = {}\npause_s = {:?}\npause_max_s = {:?}\nconnections_per_host = {}\n\n\
         [pedr]\nurl = {}\n",
        quoted(&archives.contact),
        network.connect_s,
        network.read_s,
        network.attempts,
        network.pause_s,
        network.pause_max_s,
        network.connections_per_host,
        quoted(&archives.pedr.url),
    );
    atomic::replace(&folder.join(ARCHIVE_FILE), text.as_bytes(), MARK)
}

/// A text of TOML: JSON writes the same for texts without control characters, which contacts and addresses have not.
fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}
