//! `areograph pedr match`.

use std::{path::PathBuf, process::ExitCode};

use clap::{Args, ValueEnum};

use super::filter::{FilterArguments, GroundArgument};
use crate::{
    body::Body,
    cli::{
        report,
        single::{self, RunArguments},
    },
    error::Cause,
    flow::Task,
    stages::match_laser::{MatchImage, MatchOptions, MatchRequest, Similarity},
};

/// Finds laser control points: shots of PEDR files over a stereo terrain model, shifted until their heights fit.
///
/// Shots are grouped into segments with relief, and these into units of several passes; for each unit the command finds the
/// shift at which its heights fit the model (Li et al. 2023). Every fourth shot of a unit is withheld for validation. Products go
/// to --out: units with shift and reason, a control point of every unit that is kept, a page; with --isd also control.csv for
/// `areograph calibrate`. The exit code is 5 if too few units are kept, or if the withheld shots do not confirm them.
///
/// Example: areograph scene terrain-model demo && areograph pedr match demo/model.tif demo/pedr --isd s1=demo/isd/s1.json --isd s2=demo/isd/s2.json --out control
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// `GeoTIFF` of one band: heights above a sphere in metres, over longitude and latitude or in an equirectangular map.
    #[arg(value_name = "MODEL.tif")]
    model: PathBuf,
    /// PEDR files, and folders with .b files in and below them.
    #[arg(required = true, value_name = "PATH")]
    paths: Vec<PathBuf>,
    /// Folder of the products.
    #[arg(long, default_value = "match")]
    out: PathBuf,
    /// An image of the stereo model, by its support data; give two or more, with the names of the cameras of the calibration.
    #[arg(long, value_name = "NAME=FILE", value_parser = image)]
    isd: Vec<(String, PathBuf)>,
    /// Radius of the sphere to which heights of the model refer; the default is the radius of the map in the file.
    #[arg(long, value_name = "METRES")]
    radius_m: Option<f64>,
    /// Heights refer to the sphere of --radius-m, not to the sphere of the map in the file.
    #[arg(long, requires = "radius_m")]
    heights_apart: bool,
    /// Maximum number of shots in a segment.
    #[arg(long, default_value_t = 15, value_parser = clap::value_parser!(u16).range(3..=1_000))]
    segment_points: u16,
    /// Height variance that a segment must exceed, square metres.
    #[arg(long, value_name = "M2", default_value_t = 1_000.0, value_parser = above_zero)]
    least_variance: f64,
    /// Similarity of heights; auto uses pearson if the model is offset by more than a tenth of the relief or more than
    /// 100 m, else ccc.
    #[arg(long, value_enum, default_value_t = Measure::Auto)]
    similarity: Measure,
    /// Search radius of the shifts in each direction, cells.
    #[arg(long, value_name = "CELLS", default_value_t = 70, value_parser = clap::value_parser!(u16).range(1..=500))]
    search: u16,
    /// Similarity, below 1, that a unit must exceed.
    #[arg(long, default_value_t = 0.9, value_parser = share)]
    least_score: f64,
    /// Ratio that a unit must exceed: best similarity over the mean of all positive similarities.
    #[arg(long, default_value_t = 1.0, value_parser = above_zero)]
    least_contrast: f64,
    /// Largest root mean square of model minus laser at all withheld shots, bias removed, metres.
    #[arg(long, value_name = "METRES", default_value_t = 60.0, value_parser = above_zero)]
    limit_m: f64,
    /// Seed of the clusters.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    shots: FilterArguments,
    #[command(flatten)]
    ground: GroundArgument,
    #[command(flatten)]
    run: RunArguments,
}

/// A measure, as typed.
#[derive(Debug, Clone, Copy, ValueEnum)]
#[value(rename_all = "snake_case")]
enum Measure {
    Auto,
    Ccc,
    Pearson,
    CccBiasRemoved,
}

/// One image is given.
#[derive(Debug, thiserror::Error, Cause)]
#[error("--isd names the images {0:?}; expected two or more with distinct names")]
#[cause(Configuration: "give --isd NAME=FILE for every image from which the model was made, or for none")]
struct Images(Vec<String>);

fn image(text: &str) -> Result<(String, PathBuf), String> {
    let parts = text.split_once('=');
    let parts = parts.filter(|(name, file)| !name.is_empty() && !file.is_empty());
    let (name, file) = parts.ok_or("expected a name and a file: s1=isd/s1.json")?;
    Ok((name.to_owned(), file.into()))
}

fn above_zero(text: &str) -> Result<f64, String> {
    let number: Option<f64> = text.parse().ok();
    let number = number.filter(|number| *number > 0.0 && number.is_finite());
    number.ok_or_else(|| "expected a number above 0".to_owned())
}

fn share(text: &str) -> Result<f64, String> {
    let number = above_zero(text).ok().filter(|number| *number < 1.0);
    number.ok_or_else(|| "expected a number between 0 and 1".to_owned())
}

impl Arguments {
    fn request(&self) -> Result<MatchRequest, Images> {
        let names: std::collections::BTreeSet<&String> =
            self.isd.iter().map(|(name, _)| name).collect();
        if self.isd.len() == 1 || names.len() < self.isd.len() {
            return Err(Images(
                self.isd.iter().map(|named| named.0.clone()).collect(),
            ));
        }
        let images = self.isd.iter().cloned();
        Ok(MatchRequest {
            options: MatchOptions {
                segment_points: usize::from(self.segment_points),
                segment_drift: None,
                least_variance_m2: self.least_variance,
                similarity: match self.similarity {
                    Measure::Auto => None,
                    Measure::Ccc => Some(Similarity::Ccc),
                    Measure::Pearson => Some(Similarity::Pearson),
                    Measure::CccBiasRemoved => Some(Similarity::CccBiasRemoved),
                },
                search_cells: u32::from(self.search),
                least_score: self.least_score,
                least_contrast: self.least_contrast,
                limit_m: self.limit_m,
                seed: self.seed,
                ground: self.ground.ground(),
                filter: self.shots.filter(),
            },
            body: Body::Mars,
            radius_m: self.radius_m,
            heights_apart: self.heights_apart,
            model: self.model.clone(),
            pedr: self.paths.clone(),
            images: images.map(|(name, isd)| MatchImage { name, isd }).collect(),
        })
    }
}

/// Matches and reports the outcome.
pub(super) fn run(arguments: &Arguments) -> ExitCode {
    let request = match arguments.request() {
        Ok(request) => request,
        Err(failure) => return report(&failure.into()),
    };
    let name = crate::files::file_name(&arguments.model);
    let task = Task::Match(&request);
    single::run(task, &name, &arguments.out, &arguments.run, |count| {
        format!(
            "{} of {} units kept, {} shots in {} passes, {} withheld",
            count("units_kept"),
            count("units"),
            count("shots"),
            count("tracks"),
            count("held_out_shots"),
        )
    })
}
