//! Lines and samples in the ISIS convention: what a user enters in `qview` and `campt`.
//!
//! They count from 1 at the centres of the first line and pixel, in the delivered image file, which begins with the first
//! line of the header image. ISIS and ALE read the kernels with light time to the centre of the body, so that footprints
//! have other lines there than with another convention; support data and adjusted kernels give ISIS the same rays. The
//! orientation is that of the camera tables: those are the numbers that camera models read.

use nalgebra::Vector3;

use crate::{orientation::Orientation, tag_times::ImageTimes};
use areograph_base::error::{Cause, Result};
use areograph_geom::{
    ellipsoid::is_above_horizon,
    pushbroom::{Detector, ExteriorOrientation as _, Projector, SampledOrientation, SamplesError},
};

/// Lines and samples of ISIS count from 1 at the centre of the first pixel, ours from 0 at its edge.
const EDGE_TO_ISIS: f64 = 0.5;

/// Line and sample of a point that the image does not show to ISIS.
pub(super) const UNSEEN: [f64; 2] = [0.0; 2];

/// Camera tables that do not form an orientation.
#[derive(Debug, thiserror::Error, Cause)]
#[error("image {image}, camera tables: {source}")]
#[cause(Bug: "report this with the site's configuration and the log")]
struct NoOrientation {
    image: String,
    source: SamplesError,
}

/// An image as ISIS sees it.
pub(super) struct IsisImage<'a> {
    image: &'a ImageTimes,
    detector: Detector,
    orientation: SampledOrientation,
}

impl<'a> IsisImage<'a> {
    /// # Errors
    /// Tables that do not form an orientation.
    pub(super) fn of(image: &'a ImageTimes, orientation: &Orientation) -> Result<Self> {
        let (tables, _) = orientation.as_isis_sees(image);
        let sampled = SampledOrientation::new(&tables.poses(image));
        Ok(Self {
            image,
            detector: image.detector(),
            orientation: sampled.map_err(|source| NoOrientation {
                image: image.id.clone(),
                source,
            })?,
        })
    }

    /// Finds lines for points; `None` for an orientation that sees no ground.
    pub(super) fn projector(&self) -> Option<Projector<'_, SampledOrientation>> {
        let lines = f64::from(self.image.line_times.lines());
        let projector = Projector::new(&self.orientation, lines).ok()?;
        Some(projector.through(self.detector.distortion))
    }

    /// Line and sample of a point in the delivered file; [`UNSEEN`] outside it.
    pub(super) fn place(
        &self,
        projector: &Projector<'_, SampledOrientation>,
        point_m: &Vector3<f64>,
    ) -> [f64; 2] {
        let place = projector.project(point_m).ok().and_then(|seen| {
            let pose = self.orientation.pose(seen.x);
            let focal_px = self.detector.focal_px(&seen.camera_m).ok()?;
            let line = self.image.line_times.line_of_offset(seen.x);
            let sample = self.detector.sample(focal_px.y);
            let is_shown = (0.0..=f64::from(self.image.lines_delivered)).contains(&line)
                && (0.0..=self.detector.samples).contains(&sample)
                && !self.image.line_times.in_gap(seen.x)
                && is_above_horizon(&pose.position_m, point_m);
            is_shown.then_some([line + EDGE_TO_ISIS, sample + EDGE_TO_ISIS])
        });
        place.unwrap_or(UNSEEN)
    }
}
