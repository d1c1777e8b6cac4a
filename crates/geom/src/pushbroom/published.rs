//! The two published iterations from the ground to the image.

use nalgebra::Vector3;

use super::{Distortion, ExteriorOrientation, PolynomialPath, Unseen, flight_sense};
use crate::collinearity::project;

/// Limits of an iteration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// A step below this ends it, lines (the papers: 0.1).
    pub tolerance_lines: f64,
    /// Maximum number of steps.
    pub steps_max: u32,
}

/// The line that sees a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solution {
    /// Line offset from the middle of the header image, lines.
    pub x: f64,
    /// Camera vector of the point at that line, metres; its z component is positive.
    pub camera_m: Vector3<f64>,
    /// Evaluations of the iteration's formula.
    pub evaluations: u32,
    /// The last step, lines.
    pub step_lines: f64,
}

impl Solution {
    /// The solution, unless it lies behind the camera.
    pub(super) fn in_front(self) -> Result<Self, Unseen> {
        if self.camera_m.z > 0.0 {
            Ok(self)
        } else {
            Err(Unseen::BehindCamera)
        }
    }
}

/// Frame first: the image is a frame with the orientation of the current line, and `x` moves by the
/// along-track frame coordinate.
///
/// It converges by the factor `1 − ρ`, with `ρ` the line spacing over the ground size of a pixel, and
/// diverges when `ρ > 2`.
///
/// # Source
/// Konecny et al. 1987, Wang 1990; Shan, Lee & Yoon 2002 with an orientation of first order.
#[derive(Debug, Clone, Copy)]
pub struct FrameFirst<'a, M> {
    model: &'a M,
    focal_length_px: f64,
    distortion: Distortion,
    /// +1 where the camera flies along −X.
    sense: f64,
}

impl<'a, M: ExteriorOrientation> FrameFirst<'a, M> {
    /// The iteration for a camera of this focal length, image pixels.
    ///
    /// # Errors
    /// [`Unseen::AcrossFlight`] and [`Unseen::NotFinite`] for orientations that see nothing.
    pub fn new(model: &'a M, focal_length_px: f64) -> Result<Self, Unseen> {
        Ok(Self {
            model,
            focal_length_px,
            distortion: Distortion::NONE,
            sense: -flight_sense(model)?,
        })
    }

    /// The iteration for a camera with distortion.
    #[must_use]
    pub const fn through(self, distortion: Distortion) -> Self {
        Self { distortion, ..self }
    }

    /// Along-track frame coordinate of a point from the detector line, with the orientation of line `x`, pixels along
    /// the flight.
    fn ahead_px(&self, x: f64, point_m: &Vector3<f64>) -> Result<f64, Unseen> {
        let camera_m = self.model.pose(x).camera_vector_m(point_m);
        if camera_m.z.is_nan() {
            return Err(Unseen::NotFinite);
        }
        let focal_px =
            project(&camera_m, self.focal_length_px).map_err(|_| Unseen::BehindCamera)?;
        let [along, _] = self.distortion.curve(camera_m.y / camera_m.z);
        Ok(self.sense * (focal_px.x + self.focal_length_px * along))
    }

    /// Finds the line of `point_m` from the middle of the image; `on_step` receives every step, lines.
    ///
    /// # Errors
    /// The reason why no line was found.
    pub fn solve(
        &self,
        point_m: &Vector3<f64>,
        limits: &Limits,
        on_step: impl FnMut(f64),
    ) -> Result<Solution, Unseen> {
        self.solve_from(0.0, point_m, limits, on_step)
    }

    /// Finds the line of `point_m`, starting from another line.
    ///
    /// # Errors
    /// The reason why no line was found.
    pub fn solve_from(
        &self,
        start: f64,
        point_m: &Vector3<f64>,
        limits: &Limits,
        on_step: impl FnMut(f64),
    ) -> Result<Solution, Unseen> {
        let step = |x| Ok(x + self.ahead_px(x, point_m)?);
        iterate(self.model, start, point_m, limits, step, on_step)
    }
}

/// The fixed point of the exact line: the positions' constant and linear terms solved for `x`.
///
/// `x ← M1(x)·(P − C0 − C2 x²) / (M1(x)·C1)`; neither focal length nor pixel pitch enters. It converges by
/// about turn per line × range over flight per line: 0.1 for images that track nadir.
///
/// # Source
/// Shan et al. 2005, eq. 4.
#[derive(Debug, Clone, Copy)]
pub struct FixedPoint<'a, M> {
    model: &'a M,
    frame: FrameFirst<'a, M>,
}

impl<'a, M: PolynomialPath> FixedPoint<'a, M> {
    /// The iteration; the focal length, image pixels, is used for the start only.
    ///
    /// # Errors
    /// [`Unseen::AcrossFlight`] and [`Unseen::NotFinite`] for orientations that see nothing.
    pub fn new(model: &'a M, focal_length_px: f64) -> Result<Self, Unseen> {
        Ok(Self {
            model,
            frame: FrameFirst::new(model, focal_length_px)?,
        })
    }

    /// The iteration for a camera with distortion: the plane of the line belongs to the point's sample.
    #[must_use]
    pub const fn through(self, distortion: Distortion) -> Self {
        Self {
            frame: self.frame.through(distortion),
            ..self
        }
    }

    /// Finds the line of `point_m` from its frame coordinate; `on_step` receives every step, lines.
    ///
    /// # Errors
    /// The reason why no line was found.
    pub fn solve(
        &self,
        point_m: &Vector3<f64>,
        limits: &Limits,
        on_step: impl FnMut(f64),
    ) -> Result<Solution, Unseen> {
        let start = self.frame.ahead_px(0.0, point_m)?;
        self.solve_from(start, point_m, limits, on_step)
    }

    /// Finds the line of `point_m`, starting from another line.
    ///
    /// # Errors
    /// The reason why no line was found.
    pub fn solve_from(
        &self,
        start: f64,
        point_m: &Vector3<f64>,
        limits: &Limits,
        on_step: impl FnMut(f64),
    ) -> Result<Solution, Unseen> {
        let [constant, linear, square] = &self.model.path_m().coefficients;
        let least_m = super::ALONG_SHARE_MIN * linear.norm();
        let step = |x: f64| {
            let pose = self.model.pose(x);
            let camera_m = pose.camera_vector_m(point_m);
            let [along, _] = self.frame.distortion.curve(camera_m.y / camera_m.z);
            let matrix = pose.mars_to_camera;
            let axis = matrix.row(0) - matrix.row(2) * along;
            let along_m = axis.dot(&linear.transpose());
            if along_m.abs() <= least_m {
                return Err(Unseen::AcrossFlight);
            }
            let rest_m = point_m - constant - square * (x * x);
            Ok(axis.dot(&rest_m.transpose()) / along_m)
        };
        iterate(self.model, start, point_m, limits, step, on_step)
    }
}

/// Consecutive growing steps that count as divergence.
const GROWING_STEPS: u32 = 3;

/// Repeats `next` from `start` until a step is below the tolerance.
fn iterate(
    model: &impl ExteriorOrientation,
    start: f64,
    point_m: &Vector3<f64>,
    limits: &Limits,
    next: impl Fn(f64) -> Result<f64, Unseen>,
    mut on_step: impl FnMut(f64),
) -> Result<Solution, Unseen> {
    let (mut x, mut last_size, mut growing) = (start, f64::INFINITY, 0);
    for evaluations in 1..=limits.steps_max {
        let after = next(x)?;
        let step_lines = after - x;
        if !step_lines.is_finite() {
            return Err(Unseen::NotFinite);
        }
        on_step(step_lines);
        x = after;
        if step_lines.abs() < limits.tolerance_lines {
            let solution = Solution {
                x,
                camera_m: model.pose(x).camera_vector_m(point_m),
                evaluations,
                step_lines,
            };
            return solution.in_front();
        }
        growing = if step_lines.abs() > last_size {
            growing + 1
        } else {
            0
        };
        if growing >= GROWING_STEPS {
            return Err(Unseen::Diverged);
        }
        last_size = step_lines.abs();
    }
    Err(Unseen::NotConverged)
}
