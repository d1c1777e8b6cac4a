//! `areograph compare-readings`.

use std::path::PathBuf;

use clap::Args;

use super::output;
use crate::{
    error::Error,
    flow::{compare_readings, readings_answer, readings_decision, usual_sigmas},
    geom::readings::ReadingSigmas,
    report::readings_page,
    store::page::PagePath,
    units::{RADIANS_PER_ARCSECOND, SECONDS_PER_MS},
};

/// Compares possible causes of the along-track disagreement of images, over many pairs.
///
/// Either every image has its own error, in its line times or its attitude; or all attitudes were read with one time offset,
/// which displaces images that follow nadir, but not inertially held images. One pair does not distinguish the causes
/// (`adjustment.attitude_clock` is a decision); many pairs of one mission may. The products state the disagreement of each
/// pair, computed with the orientation from the kernels; every site must have complete products of this version. Images
/// are identified by `id`; the same two images in several sites are one observation. Omit the pairs of Shan et al. 2005: the
/// hypothesis of an offset and the default sizes come from them. A cause is supported if its odds are 150 to 1 or more.
///
/// Examples:
///   areograph compare-readings products --page readings.html
///   areograph compare-readings products --toml > readings.toml
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Products of a site, or output folders, of which every site is used.
    #[arg(required = true, value_name = "OUT")]
    folders: Vec<PathBuf>,
    /// Size of large errors of single images, as a standard deviation of line times, 1e-3 to 1e5; by default
    /// the default of `adjustment.line_time_sigma_ms`.
    #[arg(long, value_name = "MILLISECONDS", value_parser = sigma)]
    line_time_sigma_ms: Option<f64>,
    /// Size of small errors of single images, as a standard deviation of rotations, 1e-3 to 1e5; by default
    /// the default of `adjustment.attitude_clock_rotation_sigma_arcsec`.
    #[arg(long, value_name = "ARCSECONDS", value_parser = sigma)]
    rotation_sigma_arcsec: Option<f64>,
    /// A priori standard deviation of the offset of the attitude clock, 1e-3 to 1e5; by default
    /// the default of `adjustment.attitude_clock_sigma_s`.
    #[arg(long, value_name = "SECONDS", value_parser = sigma)]
    attitude_clock_sigma_s: Option<f64>,
    /// Print JSON, with all pairs.
    #[arg(long)]
    json: bool,
    /// Print the file that `adjustment.readings` of site files may name: sites then use one clock offset if the pairs support it.
    #[arg(long, conflicts_with = "json")]
    toml: bool,
    /// Write a page with a table and a plot to this file; its folder must exist, and products are not overwritten.
    #[arg(long, value_name = "FILE.html")]
    page: Option<PathBuf>,
}

/// A standard deviation as typed.
fn sigma(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(sigma) if (1e-3..=1e5).contains(&sigma) => Ok(sigma),
        _ => Err("expected a number from 1e-3 to 1e5".to_owned()),
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Error> {
    let page_path = arguments.page.as_deref().map(PagePath::new).transpose()?;
    let usual = usual_sigmas();
    let scaled =
        |typed: Option<f64>, unit: f64, usual: f64| typed.map_or(usual, |typed| typed * unit);
    let sigmas = ReadingSigmas {
        line_time_s: scaled(
            arguments.line_time_sigma_ms,
            SECONDS_PER_MS,
            usual.line_time_s,
        ),
        rotation_rad: scaled(
            arguments.rotation_sigma_arcsec,
            RADIANS_PER_ARCSECOND,
            usual.rotation_rad,
        ),
        clock_s: scaled(arguments.attitude_clock_sigma_s, 1.0, usual.clock_s),
    };
    let readings = compare_readings(&arguments.folders, sigmas)?;
    if let Some(path) = &page_path {
        path.write(&readings_page(&readings)?)?;
    }
    if arguments.json {
        output::json(&readings_answer(&readings));
        return Ok(());
    }
    if arguments.toml {
        output::text(readings_decision(&readings).to_toml().as_bytes());
        return Ok(());
    }
    output::line(readings.headline());
    readings.odds().iter().for_each(output::line);
    for (what, reason) in &readings.not_used {
        output::line(format_args!("not used: {what}: {reason}"));
    }
    if let Some(path) = &arguments.page {
        output::line(format_args!("page: {}", path.display()));
    }
    Ok(())
}
