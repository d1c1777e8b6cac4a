//! Tie points between the lines of one camera, which fly together.

use std::sync::atomic::AtomicBool;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::{Margin, MatchError, MatchTies, Matched, match_pair, points, remarks};
use crate::{
    camera_lines::{CameraLines, LinePixels, LinesRound},
    image_view::View,
    line_camera::LineCamera,
    match_laser::Survey,
    shot_heights::Heights,
};
use areograph_base::{
    body::Body,
    error::Result,
    ties::{MatchedPair, TiePoint},
    watch::Watch,
};
use areograph_pds::pixel_file::Pyramid;
use areograph_store::{
    stage::{Called, Output, Stage, called},
    stage_inputs,
};

/// Search range once the lines agree, pixels: errors of heights between tie points exceed errors of the cameras.
const LATER_PX: f64 = 20.0;

stage_inputs! {
    /// The lines of a camera with their pixels, and what is known of the ground.
    pub struct MatchLines<'a> {
        /// The round.
        pub round: LinesRound,
        /// The lines.
        pub lines: CameraLines<'a>,
        /// Their pixels.
        pub pixels: &'a LinePixels,
        /// The ground before a calibration provides tie points, and how far the lines may be off.
        pub survey: &'a Output<Survey>,
    }
}

impl Stage for MatchLines<'_> {
    const NAME: &'static str = "match_ties";
    const METHOD: u32 = 1;
    const CALLS: &'static [Called] = &[called::<MatchTies<'_>>()];
    type Output = TiesOfLines;
    stage_inputs!(fingerprint);

    fn part(&self) -> Option<String> {
        self.round.part()
    }

    fn run(&self, stop: &AtomicBool) -> Result<TiesOfLines> {
        self.run_watched(stop.into())
    }

    fn run_watched(&self, watch: Watch<'_>) -> Result<TiesOfLines> {
        let (cameras, survey) = (self.lines.cameras()?, self.survey.value()?);
        let radius_m = self.lines.body.map().radius_m;
        let reach_m = match self.lines.calibrated {
            Some(_) => LATER_PX * cameras[survey.pair[0]].pixel_m(radius_m),
            // Such a wide search finds few points, but they suffice for a narrow one.
            None => survey.reach_m,
        };
        let lines = LinesToMatch {
            body: self.lines.body,
            cameras: &cameras,
            pixels: self.pixels.decoded(&cameras)?,
            ground_m: &self.lines.ground_m(&survey.ground_m)?,
            reach_m,
        };
        match_lines(&lines, watch)
    }
}

/// Lines of a camera with their pixels, and known places of the ground.
#[derive(Debug, Clone, Copy)]
struct LinesToMatch<'a> {
    /// The body.
    body: Body,
    /// The lines.
    cameras: &'a [LineCamera],
    /// Their pixels.
    pixels: &'a [Pyramid],
    /// Places of the ground, body-fixed, metres.
    ground_m: &'a [Vector3<f64>],
    /// Largest distance of a place from its expected position in another line, metres on the ground.
    reach_m: f64,
}

/// Tie points between lines, and statistics of every pair.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TiesOfLines {
    /// The points, their images by index.
    pub points: Vec<TiePoint>,
    /// The pairs.
    pub pairs: Vec<MatchedPair>,
}

/// Measures tie points between all pairs of lines.
///
/// # Errors
/// An orientation that sees no ground; lines with no ground in common; no tie point; a stop.
fn match_lines(lines: &LinesToMatch<'_>, watch: Watch<'_>) -> Result<TiesOfLines> {
    let heights = Heights::at(lines.body, lines.ground_m.to_vec());
    let margin = Margin::within(lines.cameras.len(), lines.reach_m);
    let mut views = Vec::new();
    for (index, (line, pixels)) in lines.cameras.iter().zip(lines.pixels).enumerate() {
        let view = View::through(line.seen(), pixels).map_err(|unseen| {
            let image = line.camera.id.clone();
            MatchError::Unseen { image, unseen }
        })?;
        views.push((index, view));
    }
    let mut matched: Vec<Matched> = Vec::new();
    for (at, first) in views.iter().enumerate() {
        for second in &views[at + 1..] {
            matched.extend(match_pair([first, second], &heights, &margin, watch)?);
        }
    }
    if matched.is_empty() {
        return Err(MatchError::NothingInCommon.into());
    }
    let points = points(&matched);
    if points.is_empty() {
        let name = |index: usize| {
            lines
                .cameras
                .get(index)
                .map_or("", |camera| &*camera.camera.id)
        };
        let remarks_on_lines = matched.iter().flat_map(|of| remarks(&of.account, name));
        let remarks_on_lines: Vec<String> = remarks_on_lines.collect();
        return Err(MatchError::NothingMatched(remarks_on_lines.join("; ")).into());
    }
    Ok(TiesOfLines {
        points,
        pairs: matched.into_iter().map(|of| of.account).collect(),
    })
}
