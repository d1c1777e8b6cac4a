//! The terrain model of two lines of one camera.

use std::sync::atomic::AtomicBool;

use nalgebra::Vector3;

use super::{Options, Surface, SurfaceError, map_surface};
use crate::{image_view::View, line_camera::LineCamera, shot_heights::Heights};
use areograph_base::{body::Body, error::Result};
use areograph_pds::pixel_file::Pyramid;

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
pub fn map_lines(lines: &LinesToMap<'_>, stop: &AtomicBool) -> Result<Surface> {
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
    map_surface([&views[0], &views[1]], &heights, &options, stop.into())
}
