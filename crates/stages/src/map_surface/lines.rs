//! The terrain model of two lines of one camera.

use std::sync::atomic::AtomicBool;

use nalgebra::Vector3;

use super::{MapSurface, Options, Surface, SurfaceError, map_surface};
use crate::{
    camera_lines::{CameraLines, LinePixels, LinesRound},
    image_view::View,
    line_camera::LineCamera,
    match_laser::Survey,
    shot_heights::Heights,
};
use areograph_base::{body::Body, error::Result, watch::Watch};
use areograph_pds::pixel_file::Pyramid;
use areograph_store::{
    stage::{Called, Output, Stage, called},
    stage_inputs,
};

/// Largest common error of the heights of tie points, pixels.
const OFF_PX: f64 = 3.0;

stage_inputs! {
    /// The lines of a camera that agree at their tie points.
    pub struct MapLines<'a> {
        /// The round.
        pub round: LinesRound,
        /// The lines.
        pub lines: CameraLines<'a>,
        /// Their pixels.
        pub pixels: &'a LinePixels,
        /// The pair with the largest convergence.
        pub survey: &'a Output<Survey>,
        /// Edge of a cell, metres.
        pub cell_m: &'a f64,
    }
}

impl Stage for MapLines<'_> {
    const NAME: &'static str = "map_surface";
    const METHOD: u32 = 1;
    const CALLS: &'static [Called] = &[called::<MapSurface<'_>>()];
    type Output = Surface;
    stage_inputs!(fingerprint);

    fn part(&self) -> Option<String> {
        self.round.part()
    }

    fn run(&self, stop: &AtomicBool) -> Result<Surface> {
        self.run_watched(stop.into())
    }

    fn run_watched(&self, watch: Watch<'_>) -> Result<Surface> {
        let cameras = self.lines.cameras()?;
        let pixels = self.pixels.decoded(&cameras)?;
        let survey = self.survey.value()?;
        let ([one, other], body) = (survey.pair, self.lines.body);
        let lines = LinesToMap {
            body,
            pair: [one, other].map(|at| (&cameras[at], &pixels[at])),
            ground_m: &self.lines.ground_m(&survey.ground_m)?,
            off_m: OFF_PX * cameras[one].pixel_m(body.map().radius_m),
            cell_m: *self.cell_m,
        };
        map_lines(&lines, watch)
    }
}

/// Two lines with their pixels, and known places of the ground.
#[derive(Debug, Clone, Copy)]
pub struct LinesToMap<'a> {
    /// The body.
    pub body: Body,
    /// The lines.
    pub pair: [(&'a LineCamera, &'a Pyramid); 2],
    /// Places of the ground as these lines see it, body-fixed, metres.
    pub ground_m: &'a [Vector3<f64>],
    /// Largest common error of heights against these, metres.
    pub off_m: f64,
    /// Edge of a cell, metres.
    pub cell_m: f64,
}

/// Makes the terrain model of two lines.
///
/// # Errors
/// An orientation that sees no ground; lines with no ground in common, or that look in one direction; cells that are too small; the
/// system's refusal to read pixels; a stop.
pub fn map_lines(lines: &LinesToMap<'_>, watch: Watch<'_>) -> Result<Surface> {
    let heights = Heights::at(lines.body, lines.ground_m.to_vec());
    let through = |at: usize| {
        let (line, pixels) = lines.pair[at];
        View::through(line.seen(), pixels).map_err(|unseen| SurfaceError::Unseen {
            image: line.camera.id.clone(),
            unseen,
        })
    };
    let views = [through(0)?, through(1)?];
    let options = Options {
        body: lines.body,
        cell_m: lines.cell_m,
        off_m: lines.off_m,
    };
    map_surface([&views[0], &views[1]], &heights, &options, watch)
}
