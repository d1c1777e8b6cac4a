//! A later version of an orbit, beside a mission: an update of a kernel that changes every site.

use std::{
    fs,
    path::{Path, PathBuf},
};

use areograph_base::error::{IoError, Locate as _, Result};
use areograph_store::atomic;

use super::kernels::spk_name;

/// Folder of kernels that are not in force.
const UPDATES: &str = "updates";
/// The orbit that site files use, and the true one.
const USED: &str = "nav";
const TRUE: &str = "gsfc";

/// Writes the true orbit of a mission as a later version of the orbit that its sites use; returns the path of the file,
/// and that of the kernel which it can replace.
///
/// # Errors
/// The mission has no kernels; a disk error.
pub fn write_later_orbit(directory: &Path) -> Result<[PathBuf; 2]> {
    let kernels = directory.join("kernels");
    let orbit = kernels.join(spk_name(TRUE));
    let orbit = fs::read(&orbit)
        .map_err(IoError::on("read"))
        .in_file(orbit)?;
    let updates = directory.join(UPDATES);
    fs::create_dir_all(&updates)
        .map_err(IoError::on("create the folder"))
        .in_file(&updates)?;
    let [later, used] = [&updates, &kernels].map(|folder| folder.join(spk_name(USED)));
    atomic::write(&later, &orbit)?;
    Ok([later, used])
}
