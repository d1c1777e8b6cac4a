//! `areograph calibrate`.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    process::ExitCode,
};

use clap::{Args, Subcommand};

use super::{
    finish, load, output, report,
    single::{self, RunArguments},
};
use crate::{
    config::{CalibrationConfig, CamerasConfig},
    error::{Cause, IoError, Locate as _, Result},
    flow::{Task, calibration_series, series_answer},
    pds::isd::{ImageSupport, read_isd},
    report::calibration_series_page,
    stages::calibrate::apply_calibration,
    store::{
        atomic,
        files::file_name,
        page::PagePath,
        published::{is_site_folder, read_published},
    },
};

/// Calibrates the lines of a camera in orbit, first from tie points, then from laser points, some of which are withheld for
/// validation.
///
/// Points are read from tables; with `ties.match` and `[laser]` they are measured in the images, in rounds until convergence. A
/// calibration that was stopped or killed resumes at the first incomplete stage of its round.
///
/// Products go to `<out>/<calibration>`, with calibrated support data (ISD) of every line. Angles that tie points cannot determine
/// are detected and reported. `calibrate apply` puts the calibrated cameras in support data of other images, and `calibration.from`
/// of a site uses them with label and kernels. `calibrate series` compares calibrations of several orbits.
///
/// Example: `areograph scene calibration hrsc --images && areograph calibrate hrsc/calibration.toml --out products`
#[derive(Debug, Args)]
#[command(
    verbatim_doc_comment,
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    arg_required_else_help = true
)]
pub(super) struct Arguments {
    /// Calibration file (TOML); config/calibrations/example.toml documents every key.
    #[arg(value_name = "CALIBRATION.toml", required = true)]
    calibration: Option<PathBuf>,
    /// Output folder; the calibration is written to a subfolder.
    #[arg(long, default_value = "out")]
    out: PathBuf,
    #[command(flatten)]
    run: RunArguments,
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Debug, Subcommand)]
enum Command {
    Apply(ApplyArguments),
    Series(SeriesArguments),
}

/// Compares calibrations of one camera in several orbits: changes since the calibration in use, drift, and whether the camera
/// must be calibrated again.
///
/// The first folder is the calibration in use; the order of the others does not matter. Changes are stated with standard
/// deviations that include the errors of the orbits: differences between lines are known far better than common parts.
/// A significant change of more than 0.3 px requires a new calibration. With `--page`, a page shows all orbits.
///
/// Example: `areograph calibrate series out/i864 out/i818 out/i863 --page series.html`
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
struct SeriesArguments {
    /// Products of calibrations; first the one in use.
    #[arg(value_name = "OUT/CALIBRATION", required = true, num_args = 2..)]
    folders: Vec<PathBuf>,
    /// Print JSON, with all parameters of all orbits.
    #[arg(long)]
    json: bool,
    /// Write a page with tables and plots to this file; its folder must exist, and products are not overwritten.
    #[arg(long, value_name = "FILE.html")]
    page: Option<PathBuf>,
}

/// Puts the calibrated cameras in support data of other images of the same lines.
///
/// Mounting, optics and look directions of a line are replaced; orbit, attitude and line times of the image are unchanged. The
/// line is identified by `name_sensor`.
///
/// Example: `areograph calibrate apply out/h5270 out/h5280/images/*/isd.json --to calibrated`
#[derive(Debug, Args)]
#[allow(clippy::doc_markdown, reason = "examples are printed verbatim")]
#[command(verbatim_doc_comment)]
struct ApplyArguments {
    /// Products of a calibration.
    #[arg(value_name = "OUT/CALIBRATION")]
    folder: PathBuf,
    /// Image support data.
    #[arg(value_name = "ISD.json", required = true)]
    isds: Vec<PathBuf>,
    /// Folder for the files, created if missing. A file keeps its name; `isd.json` is named after its folder.
    #[arg(long, value_name = "DIR", default_value = "calibrated")]
    to: PathBuf,
}

/// Support data that cannot be written.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Configuration)]
enum ApplyError {
    #[error("{0} holds no calibrated cameras; expected the products of `areograph calibrate`")]
    #[cause("name the folder of the calibration")]
    NoCalibration(String),
    #[error("two inputs would be written to {0}; expected different names")]
    #[cause("apply the calibration in two steps, with different folders after --to")]
    SameName(String),
    #[error("--to is {0}, in the products of a run; expected a folder apart from products")]
    #[cause("name another folder with --to")]
    Products(String),
    #[error("exists, and is not calibrated support data; expected no file of this name")]
    #[cause("name another folder with --to")]
    Exists,
}

/// Runs the calibration and reports the outcome, or applies one.
pub(super) fn run(arguments: &Arguments) -> ExitCode {
    match &arguments.command {
        Some(Command::Apply(arguments)) => return finish(apply(arguments)),
        Some(Command::Series(arguments)) => return finish(series(arguments)),
        None => {}
    }
    // Required without a subcommand.
    let file = arguments.calibration.clone().unwrap_or_default();
    let calibration: CalibrationConfig = match load(&file) {
        Ok(calibration) => calibration,
        Err(failure) => return report(&failure),
    };
    let (task, name) = (Task::Calibration(&calibration), &calibration.calibration);
    single::run(task, name, &arguments.out, &arguments.run, |count| {
        format!(
            "{} lines, {} tie points, {} laser points, {} more withheld, {} rejected",
            count("cameras"),
            count("ties"),
            count("controls"),
            count("held_back_controls"),
            count("left_out"),
        )
    })
}

fn series(arguments: &SeriesArguments) -> Result<()> {
    let page_path = arguments.page.as_deref().map(PagePath::new).transpose()?;
    let series = calibration_series(&arguments.folders)?;
    if let Some(path) = &page_path {
        path.write(&calibration_series_page(&series)?)?;
    }
    if arguments.json {
        output::json(&series_answer(&series));
        return Ok(());
    }
    output::line(series.headline());
    series.findings().iter().for_each(output::line);
    for (what, reason) in &series.not_used {
        output::line(format_args!("not used: {what}: {reason}"));
    }
    if let Some(path) = &arguments.page {
        output::line(format_args!("page: {}", path.display()));
    }
    Ok(())
}

/// Writes the support data only after all of them have been computed.
fn apply(arguments: &ApplyArguments) -> Result<()> {
    let folder = &arguments.folder;
    read_published(folder)?;
    let cameras = CamerasConfig {
        from: Some(folder.clone()),
    }
    .cameras();
    if cameras.is_empty() {
        return Err(ApplyError::NoCalibration(folder.display().to_string()).into());
    }
    let to = std::path::absolute(&arguments.to)
        .map_err(IoError::on("find"))
        .in_file(&arguments.to)?;
    if to.ancestors().any(is_site_folder) {
        return Err(ApplyError::Products(arguments.to.display().to_string()).into());
    }
    let mut applied = BTreeMap::new();
    for isd in &arguments.isds {
        let path = arguments.to.join(name_of(isd));
        let is_replaced = |found: ImageSupport| found.instrument.calibration.is_some();
        if path.exists() && !read_isd(&path).is_ok_and(is_replaced) {
            return Err(ApplyError::Exists).in_file(&path);
        }
        let result = apply_calibration(&cameras, isd)?;
        if applied.insert(path.clone(), result).is_some() {
            return Err(ApplyError::SameName(path.display().to_string()).into());
        }
    }
    fs::create_dir_all(&arguments.to)
        .map_err(IoError::on("create"))
        .in_file(&arguments.to)?;
    for (path, of) in &applied {
        atomic::write(path, of.isd.as_bytes())?;
        output::line(format_args!(
            "{}: camera {} of {}, look directions moved by up to {:.2} px",
            path.display(),
            of.camera,
            of.calibration,
            of.moved_px
        ));
    }
    if let Some(of) = applied.values().next() {
        output::line(format_args!(
            "remark: the offset angles of {} contain the mean error of the calibrated orbit; sites with these support data state \
             this remark",
            of.calibration
        ));
    }
    Ok(())
}

/// File name of the support data; products of sites, `isd.json`, are named after their folder, the image.
fn name_of(isd: &Path) -> String {
    let name = file_name(isd);
    let isd = isd.canonicalize().unwrap_or_else(|_| isd.to_owned());
    match isd.parent().and_then(Path::file_name) {
        Some(image) if name == "isd.json" => format!("{}.json", image.to_string_lossy()),
        _ => name,
    }
}
