//! Windows on the command line.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use crate::{
    config::{
        BoxCoordinates, LatitudeKind, LongitudeSense, WindowConfig, load_windows,
        suspicious_width_deg, window_of_box, window_of_polygon,
    },
    error::{Cause, Result},
};

/// Digits after the point of a converted edge, degrees: less than 0.1 mm.
const EDGE_DIGITS: i32 = 9;

/// The option of a box, which the options on its edges require.
pub(super) const BOX: &str = "box";

/// Windows of a search.
#[derive(Debug, Args)]
pub(super) struct WindowArguments {
    /// West, east, south and north edge, degrees (longitudes -360 to 360; west above east crosses 0 or 180).
    #[arg(id = BOX, long, value_name = "W,E,S,N", value_parser = edges, allow_hyphen_values = true)]
    boxes: Vec<[f64; 4]>,
    #[command(flatten)]
    meaning: BoxMeaning,
    /// GeoJSON polygons.
    #[arg(long = "polygon", value_name = "FILE")]
    polygons: Vec<PathBuf>,
    /// TOML file with up to 10,000 tables `windows` as in a site file.
    #[arg(long, value_name = "FILE")]
    windows: Option<PathBuf>,
}

/// Meaning of the edges of a box.
#[derive(Debug, Clone, Copy, Default, Args)]
pub(super) struct BoxMeaning {
    /// Direction in which the longitudes of --box increase.
    #[arg(long, value_name = "SENSE", value_enum, default_value_t, requires = BOX)]
    longitude: Sense,
    /// Kind of the latitudes of --box.
    #[arg(long, value_name = "KIND", value_enum, default_value_t, requires = BOX)]
    latitude: Latitude,
    /// Accept a box wider than 180 degrees; without this option it is refused, since its edges may have been exchanged.
    #[arg(long, requires = BOX)]
    wide: bool,
}

/// Direction of longitudes, as typed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
enum Sense {
    #[default]
    East,
    West,
}

/// Kind of latitudes, as typed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
enum Latitude {
    #[default]
    Areocentric,
    Areographic,
}

/// A box whose edges may have been exchanged.
#[derive(Debug, thiserror::Error, Cause)]
#[error("the box spans {width_deg}° eastward, from {west} to {east}; expected at most 180°")]
#[cause(Configuration: "exchange west and east for the other {}°, or give --wide", rounded(360.0 - width_deg))]
struct Wide {
    width_deg: f64,
    /// Edges as written.
    west: f64,
    east: f64,
}

fn rounded(angle_deg: f64) -> f64 {
    let scale = 10.0_f64.powi(EDGE_DIGITS);
    (angle_deg * scale).round() / scale
}

impl BoxMeaning {
    /// The edges in east longitude and areocentric latitude, degrees.
    ///
    /// # Errors
    /// Edges beyond the globe or in the wrong order; a wide box without the option.
    pub(super) fn edges_deg(self, [west, east, south, north]: [f64; 4]) -> Result<[f64; 4]> {
        let coordinates = BoxCoordinates {
            longitude: match self.longitude {
                Sense::East => LongitudeSense::East,
                Sense::West => LongitudeSense::West,
            },
            latitude: match self.latitude {
                Latitude::Areocentric => LatitudeKind::Areocentric,
                Latitude::Areographic => LatitudeKind::Areographic,
            },
        };
        let [west_deg, east_deg] = coordinates.east_deg([west, east]);
        let [south_deg, north_deg] = match self.latitude {
            Latitude::Areocentric => [south, north],
            Latitude::Areographic => coordinates.areocentric_deg([south, north]).map(rounded),
        };
        let edges_deg = [west_deg, east_deg, south_deg, north_deg];
        window_of_box("box", edges_deg)?;
        match suspicious_width_deg([west_deg, east_deg]) {
            Some(width_deg) if !self.wide => Err(Wide {
                width_deg,
                west,
                east,
            }
            .into()),
            _ => Ok(edges_deg),
        }
    }
}

impl WindowArguments {
    /// Boxes, polygons and windows of files, in this order.
    ///
    /// # Errors
    /// A malformed box; a file that cannot be read or contains no window.
    pub(super) fn windows(&self) -> Result<Vec<WindowConfig>> {
        let mut windows = Vec::new();
        for (number, edges) in (1..).zip(&self.boxes) {
            let edges_deg = self.meaning.edges_deg(*edges)?;
            windows.push(window_of_box(&format!("box{number}"), edges_deg)?);
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
