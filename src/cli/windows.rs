//! Windows on the command line.

use std::path::{Path, PathBuf};

use clap::Args;

use crate::{
    config::{WindowConfig, load_windows, window_of_box, window_of_polygon},
    error::Result,
};

/// Windows of a search.
#[derive(Debug, Args)]
pub(super) struct WindowArguments {
    /// West, east, south and north edge, degrees: east longitude (-180 to 360, west above east crosses 0 or 180) and
    /// areocentric latitude.
    #[arg(long = "box", visible_alias = "window", value_name = "W,E,S,N", value_parser = edges, allow_hyphen_values = true)]
    boxes: Vec<[f64; 4]>,
    /// GeoJSON polygons.
    #[arg(long = "polygon", value_name = "FILE")]
    polygons: Vec<PathBuf>,
    /// TOML file with up to 10,000 tables `windows` as in a site file.
    #[arg(long, value_name = "FILE")]
    windows: Option<PathBuf>,
}

impl WindowArguments {
    /// Boxes, polygons and windows of files, in this order.
    ///
    /// # Errors
    /// A malformed box; a file that cannot be read or contains no window.
    pub(super) fn windows(&self) -> Result<Vec<WindowConfig>> {
        let mut windows = Vec::new();
        for (number, edges) in (1..).zip(&self.boxes) {
            windows.push(window_of_box(&format!("box{number}"), *edges)?);
        }
        for path in &self.polygons {
            windows.push(window_of_polygon(path)?);
        }
        if let Some(path) = &self.windows {
            windows.extend(load_windows(path)?);
        }
        Ok(windows)
    }

    /// The files that windows are read from.
    pub(super) fn files(&self) -> impl Iterator<Item = &Path> {
        self.polygons
            .iter()
            .chain(&self.windows)
            .map(PathBuf::as_path)
    }
}

/// West, east, south and north edge, as they are written.
pub(super) fn edges(text: &str) -> std::result::Result<[f64; 4], String> {
    let numbers: std::result::Result<Vec<f64>, _> = text
        .split(',')
        .map(|number| number.trim().parse())
        .collect();
    let numbers = numbers.ok().and_then(|numbers| numbers.try_into().ok());
    numbers.ok_or_else(|| "expected four numbers: west,east,south,north".to_owned())
}
