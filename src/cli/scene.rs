//! `areograph scene`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::output;
use crate::{
    error::Error,
    scene::{
        ArchiveOptions, Coder, Roughness, SceneErrors, SceneOptions, write_archive,
        write_calibration_loop_scene, write_calibration_scene, write_plane_scene, write_scene,
        write_scene_along, write_scene_with_images, write_terrain_model_scene,
    },
    units::SECONDS_PER_DAY,
};

/// Writes a synthetic mission: kernels, PEDR files, labels, site files, and the truth behind them.
///
/// Example: `areograph scene demo && areograph run demo/sites/*.toml --out products`
#[derive(Debug, Args)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "each is a flag of the command line"
)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Folder to write; an earlier scene in it is replaced if nothing was added or changed.
    directory: PathBuf,
    /// Seed of terrain and noise; the same seed gives the same bytes.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Seconds of shots in the files of whole days, 600 to 90000; images and windows fit into 600.
    #[arg(long, value_name = "SECONDS", default_value_t = SECONDS_PER_DAY, conflicts_with = "along")]
    day_s: f64,
    /// Draw errors of the size that the real mission may have had, instead of those of the worked example: line times,
    /// attitude and jitter, orbit, camera, boresight of the laser, shifted MOLA profiles, noisy shots over rough ground. Their
    /// sizes are drawn as well, and are not those that areograph assumes.
    #[arg(long, conflicts_with = "along")]
    realistic: bool,
    /// With --realistic: roughness of the ground (heights 300 m apart differ by 5, 10 or 25 m).
    #[arg(long, value_enum, default_value_t = Ground::Plains, requires = "realistic")]
    roughness: Ground,
    /// With --realistic: noise of tie points, lines and samples, 0 to 5; stereo matching reaches 0.22.
    #[arg(
        long,
        value_name = "PIXELS",
        default_value_t = 1.0,
        requires = "realistic"
    )]
    tie_noise_px: f64,
    /// With --realistic: one offset of the attitude's clock for all images instead of line times of each.
    #[arg(long, requires = "realistic")]
    attitude_clock: bool,
    /// Also render the narrow-angle images, `images/*.imq`, which takes minutes; with --calibration `images/*.tif`.
    #[arg(long, conflicts_with_all = ["along", "plane"])]
    images: bool,
    /// With --images: coding of the images; the transform coding is lossy, as it was on board.
    #[arg(long, value_enum, default_value_t = Code::Predictive, requires = "images", conflicts_with = "calibration")]
    coder: Code,
    /// Use these kernels instead of the synthetic orbit.
    #[arg(long, value_name = "KERNELS.tm")]
    along: Option<PathBuf>,
    /// A net of rectified pictures for `areograph triangulate` instead of a mission.
    #[arg(long, conflicts_with_all = ["along", "realistic", "day_s"])]
    plane: bool,
    /// Two stereo lines of a camera for `areograph calibrate` instead of a mission; with --images three lines of one orbit,
    /// with their pixels and laser passes instead of tables of points.
    #[arg(long, conflicts_with_all = ["along", "realistic", "day_s", "plane"])]
    calibration: bool,
    /// A terrain model and laser passes over it for `areograph pedr match` instead of a mission.
    #[arg(long, conflicts_with_all = ["along", "realistic", "day_s", "images", "plane", "calibration"])]
    terrain_model: bool,
    /// An archive of this number of PEDR files, about a day each, with its kernels, instead of a mission: input of
    /// `areograph pedr`.
    #[arg(long, value_name = "FILES", conflicts_with_all = ["along", "realistic", "day_s", "plane", "calibration", "terrain_model"])]
    days: Option<u32>,
    /// An archive of about this many gigabytes of PEDR files, with its kernels, instead of a mission.
    #[arg(long, value_name = "GB", conflicts_with_all = ["along", "realistic", "day_s", "plane", "calibration", "terrain_model", "days"])]
    gb: Option<f64>,
    /// With --along: labels of images to put into the site file.
    #[arg(long, value_name = "FILE", requires = "along")]
    label: Vec<PathBuf>,
}

/// Roughness of the ground, as typed.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Ground {
    Plains,
    Medium,
    Rough,
    Varied,
}

/// Coding of the images, as typed.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Code {
    Predictive,
    Transform,
}

impl Code {
    const fn coder(self) -> Coder {
        match self {
            Self::Predictive => Coder::Predictive,
            Self::Transform => Coder::Transform,
        }
    }
}

impl Arguments {
    /// The requested archive, if any.
    fn archive(&self) -> Option<ArchiveOptions> {
        let seed = self.seed;
        let of_size = || Some(ArchiveOptions::of_size(seed, self.gb?));
        let of_days = self.days.map(|days| ArchiveOptions { seed, days });
        of_days.or_else(of_size)
    }

    fn errors(&self) -> SceneErrors {
        if !self.realistic {
            return SceneErrors::demo();
        }
        let realistic = SceneErrors::realistic(match self.roughness {
            Ground::Plains => Roughness::Plains,
            Ground::Medium => Roughness::Medium,
            Ground::Rough => Roughness::Rough,
            Ground::Varied => Roughness::Varied,
        });
        let drawn = if self.attitude_clock {
            realistic.with_attitude_clock()
        } else {
            realistic
        };
        SceneErrors {
            tie_noise_px: self.tie_noise_px,
            ..drawn.with_drawn_sizes(self.seed)
        }
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Error> {
    if arguments.plane {
        output::line(write_plane_scene(&arguments.directory, arguments.seed)?);
        return Ok(());
    }
    if arguments.calibration {
        let write = if arguments.images {
            write_calibration_loop_scene
        } else {
            write_calibration_scene
        };
        output::line(write(&arguments.directory, arguments.seed)?);
        return Ok(());
    }
    if arguments.terrain_model {
        output::line(write_terrain_model_scene(
            &arguments.directory,
            arguments.seed,
        )?);
        return Ok(());
    }
    if let Some(archive) = arguments.archive() {
        output::line(write_archive(&arguments.directory, &archive)?);
        return Ok(());
    }
    let options = SceneOptions {
        seed: arguments.seed,
        day_s: arguments.day_s,
        errors: arguments.errors(),
    };
    let summary = match &arguments.along {
        None if arguments.images => {
            let coder = arguments.coder.coder();
            write_scene_with_images(&arguments.directory, &options, coder)?
        }
        None => write_scene(&arguments.directory, &options)?,
        Some(kernels) => {
            write_scene_along(&arguments.directory, kernels, &arguments.label, &options)?
        }
    };
    output::line(summary);
    Ok(())
}
