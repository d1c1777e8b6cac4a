//! What the tests of the program share beside `areograph_testing`: the program itself, its synthetic mission, sites to
//! spoil, and other people's readers.
#![allow(
    dead_code,
    unused_imports,
    reason = "each test program uses a part of this module"
)]
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

pub(crate) mod adjusted;
pub(crate) mod archive_server;
pub(crate) mod camera_files;
pub(crate) mod case;
pub(crate) mod daf;
pub(crate) mod flows;
pub(crate) mod mission;
pub(crate) mod object_store;
pub(crate) mod page;
pub(crate) mod pair;
pub(crate) mod products_site;
pub(crate) mod readers;
pub(crate) mod search;
pub(crate) mod slurm;
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
pub(crate) mod traced;

pub(crate) use areograph_testing::*;

/// All files below a folder.
pub(crate) fn files_below(folder: &std::path::Path) -> Vec<std::path::PathBuf> {
    let (mut folders, mut files) = (vec![folder.to_owned()], Vec::new());
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                files.push(path);
            }
        }
    }
    files
}
