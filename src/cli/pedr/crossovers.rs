//! `areograph pedr crossovers`.

use std::path::PathBuf;

use clap::{ArgGroup, Args};
use serde_json::{Value, json};

use super::filter::{FilterArguments, GroundArgument};
use crate::{
    cli::{output, stop::Signals, windows::WindowArguments},
    config::{MolaSurfaceConfig, WindowConfig},
    error::{Cause, Error, Result},
    flow::tables_among,
    footprints::{AsRead, Footprints, SourceFile},
    geom::{ellipsoid::Spherical, window::Region},
    pds::archive::{Found, Judged, Opened, Query, Seen, Sink, Source, search, search_tables},
    stages::{
        check_profiles::{ProfileCheck, cross_profiles},
        convert_datum::convert_at_tags,
        group_profiles::{Profile, group_profiles},
    },
    units::RADIANS_PER_DEGREE,
};

/// Finds the crossovers of the profiles of an archive in windows, and estimates the shift of each profile.
///
/// The answer is JSON: every crossover with its position, the difference of the two heights and its standard deviation;
/// for each profile its shift to the east, to the north and along the radius with covariance; and profiles that are
/// inconsistent with the others. Profiles are named by window and orbit. Shifts are relative: a shift that all profiles share
/// is not determined.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("where").required(true).multiple(true).args(["box", "polygons", "windows"]))]
#[command(
    after_help = "Example: areograph pedr crossovers archive --box 137.0,138.0,-5.5,-4.0 > crossovers.json"
)]
pub(super) struct Arguments {
    /// PEDR files, and folders with .b files in and below them; or tables of the Orbital Data Explorer's PEDR query.
    #[arg(required = true, value_name = "PATH")]
    paths: Vec<PathBuf>,
    #[command(flatten)]
    windows: WindowArguments,
    #[command(flatten)]
    shots: FilterArguments,
    #[command(flatten)]
    ground: GroundArgument,
}

/// More windows than a shot records.
const WINDOWS_MAX: usize = 64;
/// The normal equations of more profiles would take more than a gigabyte.
const PROFILES_MAX: usize = 2_000;

/// Requests without windows, or too large.
#[derive(Debug, thiserror::Error, Cause)]
#[cause(Configuration)]
enum Request {
    #[error("{0} windows; expected 1 to {WINDOWS_MAX}")]
    #[cause("give --box, --polygon or --windows; distribute more windows over several commands")]
    Windows(usize),
    #[error("{0} profiles in the windows; expected at most {PROFILES_MAX}")]
    #[cause("give smaller windows")]
    Profiles(usize),
}

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    let windows = arguments.windows.windows()?;
    if windows.is_empty() || windows.len() > WINDOWS_MAX {
        return Err(Request::Windows(windows.len()).into());
    }
    let signals = Signals::heard()?;
    let filter = arguments.shots.filter();
    let regions = windows.iter().map(|window| Region::new(&window.shape));
    let query = Query::new(regions.collect(), &filter, Judged::Near);
    let mut shots = if tables_among(&arguments.paths)? {
        let found = search_tables(&arguments.paths, &query, None, signals.stop())?;
        let files = found.tables.iter().map(|table| table.file.clone());
        let mut shots = Shots::of(files.collect(), found.failures);
        shots.found(0, found.found)?;
        shots
    } else {
        let Opened { sources, failures } = Opened::all(&arguments.paths)?;
        let mut shots = Shots::of(sources.iter().map(Source::file).collect(), failures);
        search(&sources, &query, signals.stop(), &mut shots)?;
        shots
    };
    shots.footprints.ground = arguments.ground.ground();
    let answer = shots.crossed(&windows)?;
    output::json(&answer);
    shots.end()
}

/// The shots of all files, each once.
struct Shots {
    files: Vec<SourceFile>,
    footprints: Footprints<AsRead>,
    seen: Seen,
    /// Shots that an earlier file contains.
    repeated: u64,
    complaints: u64,
    failures: Vec<Error>,
}

impl Shots {
    fn of(files: Vec<SourceFile>, failures: Vec<Error>) -> Self {
        Self {
            files,
            footprints: Footprints::new(Vec::new()),
            seen: Seen::default(),
            repeated: 0,
            complaints: 0,
            failures,
        }
    }

    /// The answer.
    fn crossed(&self, windows: &[WindowConfig]) -> Result<Value> {
        let footprints = convert_at_tags(self.footprints.clone(), &self.files);
        let profiles = group_profiles(&footprints, windows, &[]);
        if profiles.len() > PROFILES_MAX {
            return Err(Request::Profiles(profiles.len()).into());
        }
        let priors = MolaSurfaceConfig::default();
        let options = priors.options(footprints.body);
        let check = cross_profiles(&footprints, &profiles, &options);
        Ok(json!({
            "complete": self.failures.is_empty() && self.complaints == 0,
            "failures": self.failures.iter().map(ToString::to_string).collect::<Vec<_>>(),
            "complaints": self.complaints,
            "repeated_shots": self.repeated,
            "shots": footprints.len(),
            "profiles": profiles.len(),
            "ground_radius": footprints.ground_choice(),
            "a_priori_sigma_m": {
                "shot": priors.shot_sigma_m,
                "profile": priors.profile_sigma_m,
                "profile_plan": priors.profile_plan_sigma_m,
            },
            "differences_m": check.differences_m,
            "profile_sigma_m": check.profile_sigma_m,
            "crossovers": crossovers(&check, &profiles),
            "shifts": check.shifts,
            "left_out": check.left_out,
            "areograph": env!("CARGO_PKG_VERSION"),
        }))
    }

    /// The failures of an answer that does not meet the request.
    fn end(self) -> Result<()> {
        let mut failures = self.failures.into_iter();
        let Some(first) = failures.next() else {
            return Ok(());
        };
        failures.for_each(output::error);
        Err(first)
    }
}

fn crossovers(check: &ProfileCheck, profiles: &[Profile]) -> Vec<Value> {
    let all = check.crossovers.iter();
    let described = all.map(|of| {
        let place = Spherical::from_xyz_m(&of.ground.xyz_m);
        json!({
            "profiles": of.profiles.map(|profile| &*profiles[profile].id),
            "longitude_deg": (place.longitude_rad / RADIANS_PER_DEGREE).rem_euclid(360.0),
            "latitude_deg": place.latitude.0 / RADIANS_PER_DEGREE,
            "difference_m": of.difference_m,
            "sigma_m": of.sigma_m,
        })
    });
    described.collect()
}

impl Sink for Shots {
    fn found(&mut self, file: usize, found: Found) -> Result<()> {
        self.complaints += found.complaint_counts.values().sum::<u64>();
        for row in 0..found.footprints.len() {
            let shot = found.footprints.row(row);
            // Tables have been compared with each other by their reader.
            let is_table = self.files[usize::from(shot.file)].is_table;
            if !is_table && self.seen.take(file, shot.et_tag_s).is_some() {
                self.repeated += 1;
            } else {
                self.footprints.push(&shot);
            }
        }
        Ok(())
    }

    fn failed(&mut self, _file: usize, failure: Error) -> Result<()> {
        self.failures.push(failure);
        Ok(())
    }
}
