//! `[fetch]`: files of archives before every night.

use std::path::PathBuf;

use crate::{
    declare::{Declare as _, Keys, declare_table, key},
    forms::{from_to, text, yes_or_no},
    paths::FILE,
};

declare_table! {
    /// Retrieval of archive files, as by `areograph fetch`: copies of the indexes, and files that sites lack.
    /// Files with different content are never replaced. Failures cause alerts, and the night continues.
    pub struct FetchConfig {
        /// Whether every night begins with the retrieval of archive files.
        nightly: bool = key(yes_or_no("", "")).or(false),
        /// Folder for `fetch.json` and the copies of the indexes; created if missing. Site files state the locations of
        /// data files.
        folder: PathBuf = key(text()).or("fetch".to_owned()).then(|path, keys: &mut Keys<'_, '_>| keys.review().resolve(&path)),
        /// Folder for the latest leap-second kernel of NAIF; without this key, the kernel is not fetched.
        generic_kernels: Option<PathBuf> = key(text()).unused(r#""kernels/generic""#).then(|path, keys: &mut Keys<'_, '_>| {
            path.map(|path| keys.review().resolve(&path))
        }),
        /// File with other hosts or layouts, in the form of `config/archives/mgs.toml`.
        archives: Option<PathBuf> = key(FILE).unused(r#""archives.toml""#),
        /// Longest time for the retrieval of the indexes, and for that of the files of each site.
        limit_s: f64 = key(from_to(1.0, 604_800.0)).or(14_400.0),
    }
}
