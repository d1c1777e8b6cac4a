//! Arguments of `areograph image search`.

use std::path::PathBuf;

use clap::{ArgGroup, Args, ValueEnum};

use crate::{
    cli::{numbers::above_to, windows::WindowArguments},
    config::{Document as _, SiteConfig, WindowConfig, built_in_instruments, require_outlines},
    error::{Cause, Locate as _, Result},
    pds::image_index::IndexedImage,
    stages::select_images::cameras_of,
    units::RADIANS_PER_DEGREE,
};

/// Largest angle between two directions, degrees.
const ANGLE_MAX_DEG: f64 = 180.0;
/// Wider than Mars, and therefore than any pixel.
const PIXEL_MAX_M: f64 = 1e7;

/// Finds the images of the mission's cumulative index that may show ground in a window, and pairs of these
/// images.
///
/// An image is listed if its outline meets a window within the uncertainty of the index: 0.35 degrees of latitude, which
/// may be areographic or areocentric, and 0.3 degrees / cos(latitude) of longitude, due to the prime meridian. The search
/// therefore misses no image, and also finds images just outside a window; `areograph run` determines the ground that an
/// image shows.
///
/// Pairs are images of different orbits (by the index, else by times more than 30 minutes apart) with common ground. Best
/// first: overlap × min(convergence / 20°, 1) × cos²(angle between the directions to the Sun / 2) / ratio of the pixel
/// sizes. Convergence is the angle between the rays to the spacecraft, each at the centre of its own image, since lines are
/// exposed one by one.
///
/// Example: areograph image search cumindex.tab --box 137.0,138.0,-5.5,-4.0
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
#[command(group = ArgGroup::new("where").required(true).multiple(true).args(["box", "polygons", "windows", "sites"]))]
pub(in crate::cli::image) struct Arguments {
    /// Indexes of the archive (cumindex.tab, imgindex.tab), with their labels (.lbl) beside them.
    #[arg(required = true, value_name = "INDEX")]
    pub(super) indexes: Vec<PathBuf>,
    #[command(flatten)]
    windows: WindowArguments,
    /// Site file: its windows.
    #[arg(long = "site", value_name = "SITE")]
    sites: Vec<PathBuf>,
    /// Identifiers of cameras, as in `images.instrument` of a site file; by default all.
    #[arg(long = "camera", value_name = "ID", value_delimiter = ',')]
    cameras: Vec<String>,
    /// Largest emission angle, degrees.
    #[arg(long, value_name = "DEGREES", value_parser = above_to(0.0, ANGLE_MAX_DEG), allow_negative_numbers = true)]
    emission_max_deg: Option<f64>,
    /// Largest incidence angle, degrees.
    #[arg(long, value_name = "DEGREES", value_parser = above_to(0.0, ANGLE_MAX_DEG), allow_negative_numbers = true)]
    incidence_max_deg: Option<f64>,
    /// Largest width of a pixel on the ground, metres.
    #[arg(long, value_name = "METRES", value_parser = above_to(0.0, PIXEL_MAX_M), allow_negative_numbers = true)]
    pixel_max_m: Option<f64>,
    /// Metakernel: compares the corners of the images with those computed from these kernels, where they cover the images,
    /// and warns of images whose corners are off by more than the search allows.
    #[arg(long, value_name = "FILE")]
    pub(super) kernels: Option<PathBuf>,
    /// Format of the printed answer.
    #[arg(long, value_enum, default_value = "table")]
    pub(super) format: Format,
    /// Print JSON, like --format geojson.
    #[arg(long, conflicts_with = "format")]
    pub(super) json: bool,
}

/// An unknown camera.
#[derive(Debug, thiserror::Error, Cause)]
#[error("unknown camera {0:?}; expected {known}", known = known_cameras())]
#[cause(Configuration: "name one of these with --camera, or omit --camera for all")]
struct NoCamera(String);

fn known_cameras() -> String {
    let ids: Vec<&str> = built_in_instruments()
        .iter()
        .map(|camera| &*camera.id)
        .collect();
    ids.join(", ")
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Format {
    /// Images and the best pairs, as text.
    Table,
    /// A line for each image.
    Csv,
    /// A line for each pair.
    Pairs,
    /// Outlines with all attributes of the images.
    Geojson,
    /// Tables `images` of a site file.
    Toml,
}

impl Arguments {
    pub(super) fn windows(&self) -> Result<Vec<WindowConfig>> {
        let mut windows = self.windows.windows()?;
        for path in &self.sites {
            let site = SiteConfig::load(path)?.config;
            require_outlines(&site.windows).in_file(path)?;
            windows.extend(site.windows);
        }
        Ok(windows)
    }

    /// # Errors
    /// An unknown camera.
    pub(super) fn check_cameras(&self) -> Result<()> {
        let is_known = |id: &&String| {
            built_in_instruments()
                .iter()
                .any(|camera| camera.id == **id)
        };
        match self.cameras.iter().find(|id| !is_known(id)) {
            Some(id) => Err(NoCamera(id.clone()).into()),
            None => Ok(()),
        }
    }

    /// Whether camera, angles and pixel size of an image are as requested; values missing from the index exclude no
    /// image.
    pub(super) fn wants(&self, image: &IndexedImage) -> bool {
        let within = |value: Option<f64>, most: Option<f64>| {
            value.zip(most).is_none_or(|(value, most)| value <= most)
        };
        let radians = |degrees: Option<f64>| degrees.map(|degrees| degrees * RADIANS_PER_DEGREE);
        let [emission_rad, incidence_rad, _] = image.angles_rad;
        let mut cameras = cameras_of(image);
        (self.cameras.is_empty() || cameras.any(|camera| self.cameras.contains(&camera.id)))
            && within(emission_rad, radians(self.emission_max_deg))
            && within(incidence_rad, radians(self.incidence_max_deg))
            && within(image.pixel_m, self.pixel_max_m)
    }
}
