//! A synthetic mission with known truth: kernels, PEDR files, labels and site configurations.
//!
//! | file | contents |
//! |---|---|
//! | `plan` | six images, three sites, the days written in full |
//! | `error_sources`, `drawn` | errors of the data: kinds and sizes, and the values drawn for one mission |
//! | `orbit`, `versions` | the true orbit of a day, and two rivals with errors of metres |
//! | `attitude`, `arc` | pointing, and orbit and attitude solved so that an image shows its site |
//! | `terrain`, `roughness`, `laser` | the ground, and laser shots on it in PEDR frames |
//! | `further_pairs` | further image pairs of the sites, in earlier months |
//! | `further_passes` | laser passes on days without an image |
//! | `images` | the six images, pixel by pixel |
//! | `context` | wide-angle images around two of the six, a fourth site |
//! | `telemetry` | echo data of the instrument besides ranges |
//! | `archive`, `archive_frames` | PEDR files of any number of days, with kernels to check them |
//! | `ties` | tie points of two images whose true positions and times differ from the nominal ones |
//! | `calibration`, `pushbroom_pair` | two stereo lines of a camera for its calibration |
//! | `calibration_loop`, `line_images`, `line_light`, `compression` | three lines with their pixels and laser passes: the calibration from pixels |
//! | `calibration_orbits`, `calibration_images` | an ageing camera in several orbits, by tables and by pixels |
//! | `terrain_model`, `passes` | a shifted terrain model, laser passes over it |
//! | `campaign` | pairs and single images of five mission phases with an index, without site files |
//! | `kernels`, `pedr`, `sites`, `truth` | the files |
//! | `mission`, `along` | the entry points of a mission |
//! | `later_orbit` | an orbit that can replace the one that the sites of a mission use |
//!
//! Injected errors: attitude is stored 1.15 s early in the C-kernel, laser time tags are 0.117 s late, version K files
//! are in IAU 1991; tie points are measured in images exposed some lines off their labels, and a few of them are
//! blunders. [`SceneErrors`] has further errors. `truth.json` contains all of them.
//!
//! ```
//! use areograph_scene::{SceneOptions, write_scene};
//!
//! let folder = tempfile::tempdir().unwrap();
//! let options = SceneOptions { day_s: 600.0, ..SceneOptions::default() };
//! let summary = write_scene(&folder.path().join("mission"), &options).unwrap();
//! assert_eq!(summary.sites, 4);
//! ```

mod along;
mod arc;
mod archive;
mod archive_frames;
mod attitude;
mod calibration;
mod calibration_images;
mod calibration_loop;
mod calibration_orbits;
mod campaign;
mod compression;
mod context;
mod drawn;
mod error;
mod error_sources;
mod files;
mod further_pairs;
mod further_passes;
mod images;
mod kernels;
mod laser;
mod later_orbit;
mod line_images;
mod line_light;
mod mission;
mod orbit;
mod passes;
mod pedr;
pub mod plan;
mod plane;
mod plane_net;
mod plane_pictures;
mod profile_shift;
mod pushbroom_pair;
mod roughness;
mod sites;
mod sun;
mod telemetry;
mod terrain;
mod terrain_model;
mod ties;
mod truth;
mod value_noise;
mod versions;

use std::{
    fmt,
    path::{Path, PathBuf},
};

use areograph_geom::random;

pub use along::write_scene_along;
pub use archive::{ArchiveOptions, ArchiveSummary, write_archive};
pub use calibration::write_calibration_scene;
pub use calibration_images::write_calibration_images;
pub use calibration_loop::{
    LineErrors, LineScene, OneOfOrbits, write_calibration_loop_scene, write_line_scene,
};
pub use calibration_orbits::{OrbitsScene, write_calibration_orbits};
pub use campaign::{CampaignOptions, CampaignSummary, write_campaign};
pub use error::SceneError;
pub use error_sources::{
    AltimeterErrors, AttitudeErrors, CameraErrors, Jitter, Misregistration, PositionErrors, Relief,
    Roughness, SceneErrors,
};
pub use images::Coder;
pub use later_orbit::write_later_orbit;
pub use mission::{TrueGround, write_scene, write_scene_with_images};
pub use plane::write_plane_scene;
pub use plane_net::{PlaneRecipe, PlaneScene};
pub use terrain_model::write_terrain_model_scene;

/// Options of a synthetic mission.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneOptions {
    /// Seed of terrain, clouds, orbit differences and all drawn errors.
    pub seed: u64,
    /// Seconds of frames in the files of full days, 600 to 90 000; other files hold at most one revolution.
    pub day_s: f64,
    /// Narrow-angle image pairs of each site, 1 to 5: those beyond the first are further passes, each a quarter of a year before the
    /// one before it.
    pub pairs: u32,
    /// Further laser passes over each site of narrow-angle images, on days without an image.
    pub passes: u32,
    /// Tie points of each site at random places of its images, 2 to 10 000; fewer where the images hardly overlap.
    pub ties: u32,
    /// Whether each site also has tie points at laser shots, as matching by areograph measures them.
    pub ties_at_shots: bool,
    /// Errors of the data, and the relief.
    pub errors: SceneErrors,
}

impl Default for SceneOptions {
    /// Seed 1, days of 24 h, one pair and 154 tie points a site as in the paper at Gusev, no further passes, no tie points at shots,
    /// errors of the worked example.
    fn default() -> Self {
        Self {
            seed: 1,
            day_s: areograph_base::units::SECONDS_PER_DAY,
            pairs: 1,
            passes: 0,
            ties: 154,
            ties_at_shots: false,
            errors: SceneErrors::demo(),
        }
    }
}

/// Summary of the mission written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SceneSummary {
    /// Folder of the mission.
    pub directory: PathBuf,
    /// Site configurations.
    pub sites: usize,
    /// Images.
    pub images: usize,
    /// PEDR files.
    pub pedr_files: usize,
    /// Frames in them.
    pub frames: u64,
}

impl SceneSummary {
    fn of(directory: &Path, truth: &truth::Truth, sites: usize) -> Self {
        Self {
            directory: directory.to_owned(),
            sites,
            images: truth.images.len() + truth.wide_angle.len(),
            pedr_files: truth.files.len(),
            frames: truth.files.iter().map(|file| file.frames).sum(),
        }
    }
}

impl fmt::Display for SceneSummary {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plural = |count: usize| if count == 1 { "" } else { "s" };
        write!(
            formatter,
            "{}: {} site{}, {} image{}, {} frames in {} PEDR file{}; next: areograph run {}/sites/*.toml",
            self.directory.display(),
            self.sites,
            plural(self.sites),
            self.images,
            plural(self.images),
            self.frames,
            self.pedr_files,
            plural(self.pedr_files),
            self.directory.display(),
        )
    }
}
