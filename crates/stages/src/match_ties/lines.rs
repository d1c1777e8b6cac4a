//! Tie points between the lines of one camera, which fly together.

use std::sync::atomic::AtomicBool;

use nalgebra::Vector3;

use super::{Margin, MatchError, Matched, match_pair, points, remarks};
use crate::{image_view::View, line_camera::LineCamera, shot_heights::Heights};
use areograph_base::{
    body::Body,
    error::Result,
    ties::{MatchedPair, TiePoint},
};
use areograph_pds::pixel_file::Pyramid;

/// Lines of a camera with their pixels, and known places of the ground.
#[derive(Debug, Clone, Copy)]
pub struct LinesToMatch<'a> {
    /// The body.
    pub body: Body,
    /// The lines.
    pub cameras: &'a [LineCamera],
    /// Their pixels.
    pub pixels: &'a [Pyramid],
    /// Places of the ground, body-fixed, metres.
    pub ground_m: &'a [Vector3<f64>],
    /// Largest distance of a place from its expected position in another line, metres on the ground.
    pub reach_m: f64,
}

/// Tie points between lines, and statistics of every pair.
#[derive(Debug)]
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
pub fn match_lines(lines: &LinesToMatch<'_>, stop: &AtomicBool) -> Result<TiesOfLines> {
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
            matched.extend(match_pair([first, second], &heights, &margin, stop.into())?);
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
