//! `areograph estimate-boresight`.

use std::path::PathBuf;

use clap::Args;

use super::output;
use crate::{
    error::Error,
    flow::{estimate_boresight, usual_boresight_sigma_rad},
    units::RADIANS_PER_ARCSECOND,
};

/// Estimates the boresight of the laser relative to its mounting, over many sites.
///
/// An error of the mounting of 0.1 mrad moves the position of a site with `adjustment.common_bus` by 38 m, and one site hardly
/// determines it. Sites with the same cameras, altimeter file and frame kernels have the same error. The products of each site
/// state what its own observations show of the angles, without a priori values; these statements are added, and the a priori
/// values enter once. Sites that share an image or an orbit with an earlier one, invalid sites, and sites that contradict the others
/// are not used. If the statements scatter more than their standard deviations, those of the result increase by the same factor.
/// Orientations and profile positions of different sites are assumed to be in error independently; an error common to all sites is
/// not included.
///
/// Examples:
///   areograph estimate-boresight products
///   areograph estimate-boresight products --toml > boresight.toml
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Products of a site, or output folders, of which every site is used.
    #[arg(required = true, value_name = "OUT")]
    folders: Vec<PathBuf>,
    /// A priori standard deviation of each angle, 1e-3 to 1e5; by default the default of `adjustment.boresight_sigma_arcsec`.
    #[arg(long, value_name = "ARCSECONDS", value_parser = sigma)]
    prior_sigma_arcsec: Option<f64>,
    /// Print JSON, with the statements of all sites.
    #[arg(long)]
    json: bool,
    /// Print the file that `adjustment.boresight` of site files may name.
    #[arg(long, conflicts_with = "json")]
    toml: bool,
}

/// A standard deviation as typed.
fn sigma(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(sigma) if (1e-3..=1e5).contains(&sigma) => Ok(sigma),
        _ => Err("expected a number from 1e-3 to 1e5".to_owned()),
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Error> {
    let typed = arguments.prior_sigma_arcsec;
    let prior_sigma_rad = typed.map_or_else(usual_boresight_sigma_rad, |arcseconds| {
        arcseconds * RADIANS_PER_ARCSECOND
    });
    let estimated = estimate_boresight(&arguments.folders, prior_sigma_rad)?;
    if arguments.json {
        output::json(&estimated.answer());
        return Ok(());
    }
    if arguments.toml {
        output::text(estimated.statements.to_toml().as_bytes());
        return Ok(());
    }
    estimated.sentences().iter().for_each(output::line);
    for (what, reason) in &estimated.not_used {
        output::line(format_args!("not used: {what}: {reason}"));
    }
    Ok(())
}
