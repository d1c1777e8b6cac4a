//! The lines of a camera before anything is measured: which two form the terrain model, how far all may be off, and the
//! ground by the laser.

use std::{f64::consts::SQRT_2, sync::atomic::AtomicBool};

use serde::{Deserialize, Serialize};

use super::{MatchLaser, shots_within};
use crate::{camera_lines::CameraLines, convert_datum::ConvertDatum, line_camera::LineCamera};
use areograph_base::{error::Result, units::wrap_pi};
use areograph_config::{APrioriConfig, CalibrationLaserConfig};
use areograph_store::{
    files::HashedFile,
    stage::{Called, InOrder, Input, Inputs, Stage, called},
    stage_inputs,
};

/// Shots that provide heights of the ground before a terrain model exists: kilometres apart, as relief requires.
const SHOTS: usize = 256;
/// Search range, standard deviations.
const SIGMAS: f64 = 3.0;

stage_inputs! {
    /// The lines by their given support data, and laser passes.
    pub struct SurveyLines<'a> {
        /// The lines.
        pub lines: CameraLines<'a>,
        /// A priori values.
        pub a_priori: &'a APrioriConfig,
        /// Which shots are taken, and which of their radii is the ground's.
        pub shots: ShotKeys<'a>,
        /// PEDR files.
        pub pedr: InOrder<'a, HashedFile>,
    }
}

/// The keys of the laser that choose shots.
#[derive(Debug, Clone, Copy)]
pub struct ShotKeys<'a>(pub &'a CalibrationLaserConfig);

impl Input for ShotKeys<'_> {
    fn add_to(&self, _field: &str, inputs: &mut Inputs) {
        inputs.setting("laser.crossover", &self.0.crossover);
        inputs.setting("laser.filter", &self.0.filter);
    }
}

/// What is known of the lines and of their ground before anything is measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Survey {
    /// The two lines with the largest convergence, by index.
    pub pair: [usize; 2],
    /// A priori uncertainty of the position at which a line sees a ground point, three standard deviations, metres on
    /// the ground.
    pub reach_m: f64,
    /// Shots over the ground that the lines see, body-fixed, metres.
    pub ground_m: Vec<[f64; 3]>,
}

impl Stage for SurveyLines<'_> {
    const NAME: &'static str = "survey_lines";
    const METHOD: u32 = 1;
    const CALLS: &'static [Called] = &[called::<MatchLaser<'_>>(), called::<ConvertDatum<'_>>()];
    type Output = Survey;
    stage_inputs!(fingerprint);

    fn run(&self, stop: &AtomicBool) -> Result<Survey> {
        let cameras = self.lines.cameras()?;
        let radius_m = self.lines.body.map().radius_m;
        let pair = widest(&cameras);
        let paths: Vec<_> = self.pedr.0.iter().map(|file| file.path.clone()).collect();
        let ShotKeys(laser) = self.shots;
        let shots = shots_within(
            edges_rad(&cameras, radius_m),
            &paths,
            laser.crossover,
            &laser.filter,
            SHOTS,
            stop,
        )?;
        Ok(Survey {
            pair,
            reach_m: reach_m(&cameras, pair, radius_m, self.a_priori),
            ground_m: shots.into_iter().map(Into::into).collect(),
        })
    }
}

/// West, south, east and north of the ground that the lines see.
fn edges_rad(lines: &[LineCamera], radius_m: f64) -> [f64; 4] {
    let mut edges = [
        f64::INFINITY,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::NEG_INFINITY,
    ];
    let mut middle_rad = None;
    for [longitude_rad, north] in lines.iter().flat_map(|line| line.corners_rad(radius_m)) {
        let middle = *middle_rad.get_or_insert(longitude_rad);
        let east = middle + wrap_pi(longitude_rad - middle);
        edges = [
            edges[0].min(east),
            edges[1].min(north),
            edges[2].max(east),
            edges[3].max(north),
        ];
    }
    edges
}

/// Three standard deviations of the position at which a line sees a ground point, metres on the ground.
fn reach_m(lines: &[LineCamera], pair: [usize; 2], radius_m: f64, known: &APrioriConfig) -> f64 {
    // Errors that lines share act through the height: the convergence turns a height error into a horizontal one.
    let apart = convergence_rad(lines, pair).tan();
    let pointing_m = SQRT_2 * known.angle_rad * lines[pair[0]].height_m(radius_m);
    SIGMAS * pointing_m.hypot(apart * known.orbit_bias_m)
}

/// Angle between the viewing directions of two lines in the middle of the image.
fn convergence_rad(lines: &[LineCamera], pair: [usize; 2]) -> f64 {
    let [one, other] = pair.map(|at| lines[at].looks());
    one.angle(&other)
}

/// The two lines with the largest convergence.
fn widest(lines: &[LineCamera]) -> [usize; 2] {
    let all =
        (0..lines.len()).flat_map(|one| (one + 1..lines.len()).map(move |other| [one, other]));
    let widest = all.max_by(|a, b| {
        let [a, b] = [a, b].map(|pair| convergence_rad(lines, *pair));
        a.total_cmp(&b)
    });
    widest.unwrap_or([0, 1])
}
