//! The files of an archive: by the listings of its server, or by a list.

use std::{
    collections::{BTreeSet, VecDeque},
    path::Path,
    time::Duration,
};

use super::{
    error::RemoteError,
    link::{Link, is_pedr},
};
use crate::{index::addresses, safe::is_path, transfer::Receiver};
use areograph_base::error::Result;
use areograph_pds::archive::decompressed;

/// Folders of an archive at most.
const FOLDERS_MAX: usize = 1_000;
/// Levels of folders below the address.
const DEPTH_MAX: usize = 6;

/// Files of an archive, by their paths below its address.
#[derive(Debug, Default)]
pub(super) struct Files {
    /// PEDR files.
    pub(super) readable: BTreeSet<String>,
    /// Compressed PEDR files without the file itself beside them.
    pub(super) compressed: BTreeSet<String>,
}

impl Files {
    /// The paths of all PEDR files of a complete archive, the compressed ones as they are named without compression.
    pub(super) fn expected(&self) -> BTreeSet<String> {
        let unpacked = self.compressed.iter().filter_map(|path| unpacked(path));
        self.readable.iter().cloned().chain(unpacked).collect()
    }
}

/// The path of a compressed PEDR file without its compression suffix.
fn unpacked(path: &str) -> Option<String> {
    let name = decompressed(Path::new(path))?;
    let folder = path.rfind('/').map_or("", |at| &path[..=at]);
    Some(format!("{folder}{}", name.to_str()?))
}

/// The PEDR files below `url`, which ends in a slash, by the listings of the server.
///
/// # Errors
/// No file; a folder that the server does not list, or not completely; a link that may name a part of the archive and is
/// not understood; too many folders.
pub(super) fn listed(receiver: &Receiver<'_>, url: &str) -> Result<Files> {
    let limit = Duration::from_secs_f64(receiver.network.read_s);
    let (mut files, mut seen) = (Files::default(), BTreeSet::new());
    let mut folders = VecDeque::from([String::new()]);
    while let Some(folder) = folders.pop_front() {
        let address = format!("{url}{folder}");
        let page = receiver.page(&address, limit);
        let page = page.map_err(super::error::advised)?;
        for found in addresses(&page) {
            match Link::of(found, &folder, url) {
                Link::Other => {}
                Link::File(path) if is_pedr(&path) => drop(files.readable.insert(path)),
                Link::File(path) => {
                    if unpacked(&path).is_some() {
                        files.compressed.insert(path);
                    }
                }
                Link::Folder(below) => {
                    if below.matches('/').count() > DEPTH_MAX {
                        let max = DEPTH_MAX;
                        return Err(RemoteError::TooDeep { url: address, max }.into());
                    }
                    if seen.insert(below.clone()) {
                        folders.push_back(below);
                    }
                }
                Link::Unclear => {
                    let (url, found) = (address, found.to_owned());
                    return Err(RemoteError::Link { url, found }.into());
                }
            }
        }
        if seen.len() > FOLDERS_MAX {
            let (url, max) = (url.to_owned(), FOLDERS_MAX);
            return Err(RemoteError::TooManyFolders { url, max }.into());
        }
    }
    let Files {
        readable,
        compressed,
    } = &mut files;
    compressed.retain(|path| !unpacked(path).is_some_and(|path| readable.contains(&path)));
    if readable.is_empty() && compressed.is_empty() {
        let url = url.to_owned();
        return Err(RemoteError::NoFiles { url }.into());
    }
    Ok(files)
}

/// Paths of the PEDR files that a text names, such as a list or a script of wget: each is a path below `url`, or an address
/// below it of any scheme.
///
/// # Errors
/// A name that leads elsewhere; no file.
pub(super) fn of_text(text: &str, url: &str) -> Result<BTreeSet<String>> {
    let without_scheme =
        |address: &str| -> Option<String> { Some(address.split_once("://")?.1.to_owned()) };
    let base = without_scheme(url).unwrap_or_default();
    let mut files = BTreeSet::new();
    for (line, text) in (1..).zip(text.lines()) {
        let text = text.split('#').next().unwrap_or_default();
        let separators = |letter: char| letter.is_whitespace() || "\"',;".contains(letter);
        for found in text.split(separators).filter(|word| is_pedr(word)) {
            let below = match without_scheme(found) {
                Some(address) => address.strip_prefix(&base).map(str::to_owned),
                None => Some(found.strip_prefix("./").unwrap_or(found).to_owned()),
            };
            let Some(below) = below.filter(|below| is_path(below)) else {
                let (found, url) = (found.to_owned(), url.to_owned());
                return Err(RemoteError::Listed { line, found, url }.into());
            };
            files.insert(below);
        }
    }
    if files.is_empty() {
        return Err(RemoteError::EmptyList.into());
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_name_files_below_the_address() {
        let url = "https://a.gov/mgs/data/";
        let text = "# all files\nwget -nc -nv ftp://a.gov/mgs/data/ap01xxx/ap01578l.b\n\"ap01xxx/ap01593l.b\", ./AP01608L.B\n";
        let files: Vec<String> = of_text(text, url).unwrap().into_iter().collect();
        assert_eq!(
            files,
            ["AP01608L.B", "ap01xxx/ap01578l.b", "ap01xxx/ap01593l.b"]
        );
        for bad in [
            "../ap01578l.b",
            "a/../../ap01578l.b",
            "/mirror/ap01578l.b",
            "https://b.gov/mgs/data/ap01578l.b",
            "https://a.gov/mgs/data/../ap01578l.b",
            "https://a.gov/mgs/data/%2e%2e/ap01578l.b",
        ] {
            let told = of_text(&format!("x\n{bad}"), url).unwrap_err().to_string();
            assert!(told.contains("line 2") && told.contains(bad), "{told}");
        }
        assert!(of_text("nothing", url).is_err());
    }
}
