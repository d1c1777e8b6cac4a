//! `[calibration]` of a site.

use std::path::PathBuf;

use serde::Deserialize;

use super::{
    declare::{Keys, declare_table, key},
    paths::FOLDER,
};

declare_table! {
    /// Calibrated cameras of the images, in place of those of their instrument files and kernels.
    pub struct CamerasConfig: Deserialize {
        /// Folder of a valid calibration by `areograph calibrate`. Images of a line that it calibrated have the calibrated
        /// mounting, optics and look directions. Images of other lines of the same spacecraft are refused; images
        /// of another spacecraft, and images with `isd` or `cube`, keep their camera.
        #[serde(skip)]
        from: Option<PathBuf> = key(FOLDER).unused(r#""../out/h5270""#),
    }
    check holds_cameras
}

/// A folder without calibrated cameras would change nothing.
fn holds_cameras(calibration: &CamerasConfig, keys: &mut Keys<'_, '_>) {
    let folder = calibration.from.as_ref().filter(|from| from.is_dir());
    if folder.is_some() && calibration.cameras().is_empty() {
        keys.refuse(
            "from",
            "a folder that contains cameras/<camera>/isd.json, written by `areograph calibrate`",
        );
    }
}

impl CamerasConfig {
    /// The calibrated support data of all lines, sorted; empty without a calibration.
    #[must_use]
    pub fn cameras(&self) -> Vec<PathBuf> {
        let Some(from) = &self.from else {
            return Vec::new();
        };
        let folders = from
            .join("cameras")
            .read_dir()
            .into_iter()
            .flatten()
            .flatten();
        let mut files: Vec<PathBuf> = folders
            .map(|camera| camera.path().join("isd.json"))
            .collect();
        files.retain(|file| file.is_file());
        files.sort();
        files
    }
}
