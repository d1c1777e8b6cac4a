//! `areograph scene`.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};

use super::{output, progress::Progress};
use crate::{
    error::Error,
    scene::{
        ArchiveOptions, CampaignOptions, Coder, OrbitsScene, Roughness, SceneErrors, SceneOptions,
        write_archive, write_calibration_images, write_calibration_loop_scene,
        write_calibration_orbits, write_calibration_scene, write_campaign, write_plane_scene,
        write_scene, write_scene_along, write_scene_with_images, write_terrain_model_scene,
    },
    units::SECONDS_PER_DAY,
    watch::Watch,
};

/// Milliradians to radians.
const RADIANS_PER_MRAD: f64 = 1e-3;

/// Writes synthetic input with known truth: a mission, a campaign, a net, a calibration, a terrain model or an archive.
///
/// Example: `areograph scene mission demo && areograph run demo/sites/*.toml --out products`
#[derive(Debug, Args)]
#[command(
    verbatim_doc_comment,
    // Errors print the usage alone: it names all scenes.
    subcommand_value_name = "mission|along|campaign|net|calibration|terrain-model|archive"
)]
pub(super) struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Mission(MissionArguments),
    Along(AlongArguments),
    Campaign(CampaignArguments),
    Net(NetArguments),
    Calibration(CalibrationArguments),
    TerrainModel(TerrainModelArguments),
    Archive(ArchiveArguments),
}

/// What every scene needs.
#[derive(Debug, Args)]
struct Target {
    /// Folder to write; an earlier scene in it is replaced if nothing was added or changed.
    directory: PathBuf,
    /// Seed of terrain and noise; the same seed gives the same bytes.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// Writes a mission: kernels, PEDR files, labels, site files, and the truth behind them.
///
/// Example: `areograph scene mission demo && areograph run demo/sites/*.toml --out products`
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
#[allow(clippy::struct_excessive_bools, reason = "flags of the command line")]
struct MissionArguments {
    #[command(flatten)]
    target: Target,
    /// Seconds of shots in the files of whole days, 600 to 90000; 600 suffice for images and windows.
    #[arg(long, value_name = "SECONDS", default_value_t = SECONDS_PER_DAY)]
    day_s: f64,
    /// Draw errors of the size that the real mission may have had, instead of those of the worked example: line times,
    /// attitude and jitter, orbit, camera, boresight of the laser, shifted MOLA profiles, noisy shots over rough ground. Their
    /// sizes are drawn as well, and are not those that areograph assumes.
    #[arg(long)]
    realistic: bool,
    /// With --realistic: roughness of the ground (heights 300 m apart differ by 5, 10 or 25 m).
    #[arg(long, value_enum, default_value_t = Ground::Plains, requires = "realistic")]
    roughness: Ground,
    /// With --realistic: noise of tie points in line and sample, 0 to 5; stereo matching reaches 0.22.
    #[arg(
        long,
        value_name = "PIXELS",
        default_value_t = 1.0,
        requires = "realistic"
    )]
    tie_noise_px: f64,
    /// With --realistic: one offset of the attitude clock for all images instead of line-time errors of
    /// single images.
    #[arg(long, requires = "realistic")]
    attitude_clock: bool,
    /// With --attitude-clock: this offset instead of a random one, -100 to 100.
    #[arg(
        long,
        value_name = "SECONDS",
        requires = "attitude_clock",
        allow_negative_numbers = true,
        value_parser = clock_offset
    )]
    attitude_clock_s: Option<f64>,
    /// With --realistic: these angles between the laser and its mounting, towards X and Y of the bus, instead of random ones, -10 to
    /// 10 each.
    #[arg(
        long,
        value_name = "MRAD,MRAD",
        requires = "realistic",
        allow_hyphen_values = true,
        value_parser = boresight
    )]
    boresight_mrad: Option<[f64; 2]>,
    /// Pairs of narrow-angle images of each site, 1 to 5: further pairs are a quarter of a year apart, with their own errors.
    #[arg(long, value_name = "COUNT", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=5))]
    pairs: u32,
    /// Further laser passes over each site of narrow-angle images, on days without an image, 0 to 1000.
    #[arg(long, value_name = "COUNT", default_value_t = 0, value_parser = clap::value_parser!(u32).range(..=1000))]
    passes: u32,
    /// Tie points of each site, 2 to 10000, in all images that show their place; fewer where the images hardly overlap.
    #[arg(long, value_name = "COUNT", default_value_t = 154, value_parser = clap::value_parser!(u32).range(2..=10_000))]
    ties: u32,
    /// Also write tie points at laser shots, up to 320 a site, as matching by areograph measures them
    #[arg(long)]
    ties_at_shots: bool,
    /// Also render the narrow-angle images, `images/*.imq`, which takes minutes.
    #[arg(long)]
    images: bool,
    /// With --images: coding of the images; the transform coding is lossy, as it was on board.
    #[arg(long, value_enum, default_value_t = Code::Predictive, requires = "images")]
    coder: Code,
}

/// Writes a mission along the orbit and attitude of existing kernels.
///
/// Example: `areograph scene along nav.tm demo --label m0402852.lbl && areograph run demo/sites/*.toml --out products`
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
struct AlongArguments {
    /// Metakernel with orbit and attitude.
    #[arg(value_name = "KERNELS.tm")]
    kernels: PathBuf,
    #[command(flatten)]
    target: Target,
    /// Labels of images to put into the site file.
    #[arg(long, value_name = "FILE")]
    label: Vec<PathBuf>,
}

/// Writes a campaign: image pairs and single images of five mission phases, with an index, kernels, PEDR files, labels, tie
/// points, and the truth behind them.
///
/// All images of a phase have the same offset of the attitude's clock, besides their own errors.
///
/// Example: areograph scene campaign demo && areograph image search demo/index/cumindex.tab --box 0,360,-90,90
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
struct CampaignArguments {
    #[command(flatten)]
    target: Target,
    /// Pairs of images, the second off nadir, 1 to 200.
    #[arg(long, value_name = "COUNT", default_value_t = 6, value_parser = clap::value_parser!(u32).range(1..=200))]
    pairs: u32,
    /// Images in no pair, 0 to 200.
    #[arg(long, value_name = "COUNT", default_value_t = 4, value_parser = clap::value_parser!(u32).range(..=200))]
    singles: u32,
}

/// Writes a net of rectified pictures for `areograph triangulate`.
///
/// Example: `areograph scene net demo && areograph triangulate demo/net.toml --out products`
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
struct NetArguments {
    #[command(flatten)]
    target: Target,
}

/// Writes two stereo lines of a camera for `areograph calibrate`, with tables of points.
///
/// Example: `areograph scene calibration demo && areograph calibrate demo/calibration.toml --out products`
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
struct CalibrationArguments {
    #[command(flatten)]
    target: Target,
    /// Three lines of one orbit, with their pixels, `images/*.tif`, and laser passes instead of tables of points.
    #[arg(long)]
    images: bool,
    /// This number of orbits, 2 to 50, a quarter of a year apart, with a calibration file each: input of `areograph calibrate series`.
    /// Profiles of the laser have shared errors. With --images, images also have shadows,
    /// unequal light and loss by compression, and the first calibration is validated in the other orbits.
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u32).range(2..=50))]
    orbits: Option<u32>,
    /// Errors of orbits and attitudes over those of Li et al. 2023, Table 2 (1000 m, 0.01 m per line, 0.025 degrees), 0 to 10.
    #[arg(long, value_name = "FACTOR", requires = "orbits", default_value_t = 1.0, value_parser = orbit_errors)]
    orbit_errors: f64,
    /// Ageing of the camera over the orbits: roll of the second line relative to the first, pixels per year, -100 to 100; scale
    /// and yaw change by half of this.
    #[arg(long, value_name = "PX_PER_YEAR", requires = "orbits", default_value_t = 0.5, allow_negative_numbers = true, value_parser = ageing)]
    ageing_px: f64,
}

/// Writes a terrain model and laser passes over it for `areograph pedr match`.
///
/// Example: areograph scene terrain-model demo && areograph pedr match demo/model.tif demo/pedr --isd s1=demo/isd/s1.json --isd s2=demo/isd/s2.json --out control
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
struct TerrainModelArguments {
    #[command(flatten)]
    target: Target,
}

/// Writes an archive of PEDR files, about a day each, with its kernels: input of `areograph pedr`.
///
/// Example: `areograph scene archive demo --days 5 && areograph pedr qa demo/pedr --kernels demo/kernels/archive.tm --out qa`
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
struct ArchiveArguments {
    #[command(flatten)]
    target: Target,
    #[command(flatten)]
    size: ArchiveSize,
}

/// Size of an archive, in files or in gigabytes.
#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct ArchiveSize {
    /// This number of PEDR files.
    #[arg(long, value_name = "FILES")]
    days: Option<u32>,
    /// About this many gigabytes of PEDR files.
    #[arg(long, value_name = "GB")]
    gb: Option<f64>,
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

/// Ageing as typed.
fn ageing(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(px_per_year) if px_per_year.abs() <= 100.0 => Ok(px_per_year),
        _ => Err("expected a number from -100 to 100".to_owned()),
    }
}

/// A factor of orbit errors as typed.
fn orbit_errors(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(factor) if (0.0..=10.0).contains(&factor) => Ok(factor),
        _ => Err("expected a number from 0 to 10".to_owned()),
    }
}

/// An offset as typed.
fn clock_offset(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(offset_s) if offset_s.abs() <= 100.0 => Ok(offset_s),
        _ => Err("expected a number from -100 to 100".to_owned()),
    }
}

/// Two angles as typed.
fn boresight(text: &str) -> Result<[f64; 2], String> {
    let angles: Option<Vec<f64>> = text.split(',').map(|of| of.trim().parse().ok()).collect();
    let angles = angles.and_then(|angles| <[f64; 2]>::try_from(angles).ok());
    angles
        .filter(|angles| angles.iter().all(|of| of.abs() <= 10.0))
        .ok_or_else(|| "expected two numbers from -10 to 10, such as 0.2,-0.5".to_owned())
}

impl MissionArguments {
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
            realistic.with_attitude_clock(self.attitude_clock_s)
        } else {
            realistic
        };
        let mut errors = SceneErrors {
            tie_noise_px: self.tie_noise_px,
            ..drawn.with_drawn_sizes(self.target.seed)
        };
        let radians = |of: [f64; 2]| of.map(|mrad| mrad * RADIANS_PER_MRAD);
        errors.altimeter.boresight_rad = self.boresight_mrad.map(radians);
        errors
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Error> {
    match &arguments.command {
        Command::Mission(arguments) => mission(arguments),
        Command::Along(arguments) => along(arguments),
        Command::Campaign(arguments) => campaign(arguments),
        Command::Net(NetArguments { target }) => {
            output::line(write_plane_scene(&target.directory, target.seed)?);
            Ok(())
        }
        Command::Calibration(arguments) => calibration(arguments),
        Command::TerrainModel(TerrainModelArguments { target }) => {
            output::line(working(|_| {
                write_terrain_model_scene(&target.directory, target.seed)
            })?);
            Ok(())
        }
        Command::Archive(arguments) => archive(arguments),
    }
}

fn calibration(arguments: &CalibrationArguments) -> Result<(), Error> {
    let Target { directory, seed } = &arguments.target;
    output::line(match arguments.orbits {
        Some(orbits) => {
            let scene = OrbitsScene {
                seed: *seed,
                orbits,
                orbit_errors: arguments.orbit_errors,
                ageing_px_per_year: arguments.ageing_px,
            };
            working(|watch| {
                if arguments.images {
                    write_calibration_images(directory, &scene, None, watch)
                } else {
                    write_calibration_orbits(directory, &scene)
                }
            })?
        }
        None if arguments.images => {
            working(|watch| write_calibration_loop_scene(directory, *seed, watch))?
        }
        None => write_calibration_scene(directory, *seed)?,
    });
    Ok(())
}

fn mission(arguments: &MissionArguments) -> Result<(), Error> {
    let Target { directory, seed } = &arguments.target;
    let options = SceneOptions {
        seed: *seed,
        day_s: arguments.day_s,
        pairs: arguments.pairs,
        passes: arguments.passes,
        ties: arguments.ties,
        ties_at_shots: arguments.ties_at_shots,
        errors: arguments.errors(),
    };
    let coder = arguments.coder.coder();
    output::line(working(|watch| {
        if arguments.images {
            write_scene_with_images(directory, &options, coder, watch)
        } else {
            write_scene(directory, &options)
        }
    })?);
    Ok(())
}

fn along(arguments: &AlongArguments) -> Result<(), Error> {
    let Target { directory, seed } = &arguments.target;
    let AlongArguments { kernels, label, .. } = arguments;
    output::line(working(|_| {
        write_scene_along(directory, kernels, label, *seed)
    })?);
    Ok(())
}

fn campaign(arguments: &CampaignArguments) -> Result<(), Error> {
    let Target { directory, seed } = &arguments.target;
    let options = CampaignOptions {
        seed: *seed,
        pairs: arguments.pairs,
        singles: arguments.singles,
    };
    output::line(working(|watch| write_campaign(directory, &options, watch))?);
    Ok(())
}

fn archive(arguments: &ArchiveArguments) -> Result<(), Error> {
    let ArchiveArguments { target, size } = arguments;
    let seed = target.seed;
    // Exactly one of the two is present.
    let options = match size.days {
        Some(days) => ArchiveOptions { seed, days },
        None => ArchiveOptions::of_size(seed, size.gb.unwrap_or_default()),
    };
    output::line(working(|watch| {
        write_archive(&target.directory, &options, watch)
    })?);
    Ok(())
}

/// Writes a scene, and shows the progress.
fn working<T>(write: impl FnOnce(Watch<'_>) -> T) -> T {
    Progress::of_work("scene").watch("writing", write)
}

#[cfg(test)]
mod tests {
    use clap::Args as _;

    use super::{Arguments, boresight};

    #[test]
    fn a_boresight_is_two_angles_of_at_most_ten_milliradians() {
        let [towards_x, towards_y] = boresight("0.2, -0.5").unwrap();
        assert!((towards_x - 0.2).abs() < 1e-12 && (towards_y + 0.5).abs() < 1e-12);
        for wrong in ["0.2", "0.2,a", "0.2,11", "0.1,0.2,0.3", "nan,0", ""] {
            assert!(boresight(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn usage_names_every_scene() {
        let mut command = Arguments::augment_args(clap::Command::new("scene"));
        let names: Vec<&str> = command
            .get_subcommands()
            .map(clap::Command::get_name)
            .collect();
        let names = format!("<{}>", names.join("|"));
        let usage = command.render_usage().to_string();
        assert!(usage.ends_with(&names), "{usage}");
    }
}
