//! From the ground to the image by Newton's method on `q1(x) = M1(x)·(P − C(x))`, or with distortion on
//! `q1 − q3 g(q2/q3)`, `g` the tangent along the track of the detector line.

use nalgebra::Vector3;

use super::{
    Anchor, Distortion, ExteriorOrientation, Pose, PoseRate, Solution, Unseen, flight_sense,
};

/// Lines of the table that start the iteration, equally spaced over the image.
const NODES: u32 = 65;
/// A step below this many lines ends the iteration: `q1` is so nearly linear that the remaining error is below 1e-8
/// lines.
const LAST_STEP_LINES: f64 = 1e-2;
/// Maximum number of evaluations.
const EVALUATIONS_MAX: u32 = 20;

/// A point with the line that sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sighting {
    /// The line, and the camera vector there.
    pub solution: Solution,
    /// Pose of the line.
    pub pose: Pose,
    /// Change of the camera vector per line, metres.
    pub rate_m: Vector3<f64>,
}

impl Sighting {
    /// Finds the line of `model` that sees `point_m` (Mars-fixed) through `distortion` by steps from line `x`; a step
    /// of at most `last_step_lines` ends the iteration. The change per line is the change before the last step.
    ///
    /// # Errors
    /// [`Unseen::BehindCamera`], [`Unseen::NotConverged`], [`Unseen::NotFinite`].
    pub fn near(
        model: &(impl ExteriorOrientation + ?Sized),
        distortion: &Distortion,
        x: f64,
        point_m: &Vector3<f64>,
        last_step_lines: f64,
    ) -> Result<Self, Unseen> {
        let pose_and_rate = |x| model.pose_and_rate(x);
        Self::with(pose_and_rate, distortion, x, point_m, last_step_lines)
    }

    /// As [`Self::near`], with the pose and its change per line that `pose_and_rate` gives for a line.
    fn with(
        pose_and_rate: impl Fn(f64) -> (Pose, PoseRate),
        distortion: &Distortion,
        mut x: f64,
        point_m: &Vector3<f64>,
        last_step_lines: f64,
    ) -> Result<Self, Unseen> {
        for evaluations in 1..=EVALUATIONS_MAX {
            let (pose, motion) = pose_and_rate(x);
            let camera_m = pose.camera_vector_m(point_m);
            let rate_m = motion.camera_vector_rate_m(&pose, &camera_m);
            let [missed_m, missed_rate_m] = missed_m(distortion, &camera_m, &rate_m);
            let step_lines = -missed_m / missed_rate_m;
            x += step_lines;
            if !x.is_finite() {
                return Err(Unseen::NotFinite);
            }
            if step_lines.abs() <= last_step_lines {
                let solution = Solution {
                    x,
                    camera_m: camera_m + rate_m * step_lines,
                    evaluations,
                    step_lines,
                };
                let turn_rad = motion.turn_rad * step_lines;
                return Ok(Self {
                    solution: solution.in_front()?,
                    pose: Pose {
                        position_m: pose.position_m + motion.advance_m * step_lines,
                        mars_to_camera: pose.mars_to_camera
                            + turn_rad.cross_matrix() * pose.mars_to_camera,
                    },
                    rate_m,
                });
            }
        }
        Err(Unseen::NotConverged)
    }
}

/// Distance of the detector line from a point along the track, and its change with the point, metres in the plane of
/// the point.
pub(crate) fn missed_m(
    distortion: &Distortion,
    camera_m: &Vector3<f64>,
    rate_m: &Vector3<f64>,
) -> [f64; 2] {
    let across = camera_m.y / camera_m.z;
    let [along, slope] = distortion.curve(across);
    [
        camera_m.x - along * camera_m.z,
        rate_m.x - along * rate_m.z - slope * (rate_m.y - across * rate_m.z),
    ]
}

/// Finds the line that sees a point, for many points of one image.
///
/// `q1` and its slope are tabulated at a few lines, so that a point in the image needs one or two
/// evaluations of the orientation.
#[derive(Debug, Clone)]
pub struct Projector<'a, M: ?Sized> {
    model: &'a M,
    distortion: Distortion,
    /// Whether poses follow from those of the nodes.
    is_anchored: bool,
    half_lines: f64,
    nodes_per_line: f64,
    nodes: Vec<Node>,
}

/// `q1` of any point and its slope, at one line.
#[derive(Debug, Clone, Copy)]
struct Node {
    x: f64,
    position_m: Vector3<f64>,
    axis: Vector3<f64>,
    axis_rate: Vector3<f64>,
    advance_m: f64,
    anchor: Anchor,
}

impl Node {
    fn of(model: &(impl ExteriorOrientation + ?Sized), x: f64) -> Self {
        let (pose, motion) = model.pose_and_rate(x);
        let m = &pose.mars_to_camera;
        let turn = &motion.turn_rad;
        let axis = m.row(0).transpose();
        Self {
            x,
            position_m: pose.position_m,
            axis,
            // The first row of [Ω]× M.
            axis_rate: m.row(2).transpose() * turn.y - m.row(1).transpose() * turn.z,
            advance_m: axis.dot(&motion.advance_m),
            anchor: model.anchor(x),
        }
    }

    fn newton(&self, point_m: &Vector3<f64>) -> f64 {
        let away_m = point_m - self.position_m;
        self.x - self.axis.dot(&away_m) / (self.axis_rate.dot(&away_m) - self.advance_m)
    }
}

impl<'a, M: ExteriorOrientation + ?Sized> Projector<'a, M> {
    /// Prepares an image of `lines` lines of a camera without distortion.
    ///
    /// # Errors
    /// [`Unseen::AcrossFlight`] and [`Unseen::NotFinite`] for orientations that see nothing.
    pub fn new(model: &'a M, lines: f64) -> Result<Self, Unseen> {
        flight_sense(model)?;
        if !(lines > 0.0 && lines.is_finite()) {
            return Err(Unseen::NotFinite);
        }
        let half_lines = 0.5 * lines;
        let spacing = lines / f64::from(NODES - 1);
        let nodes = (0..NODES)
            .map(|node| Node::of(model, f64::from(node) * spacing - half_lines))
            .collect();
        Ok(Self {
            model,
            distortion: Distortion::NONE,
            is_anchored: false,
            half_lines,
            nodes_per_line: spacing.recip(),
            nodes,
        })
    }

    /// The image, seen through `distortion`.
    #[must_use]
    pub fn through(self, distortion: Distortion) -> Self {
        Self { distortion, ..self }
    }

    /// For many points and orientations by angles: poses follow from those of the nodes by short series. Lines are the same within 1e-10.
    #[must_use]
    pub fn anchored(self) -> Self {
        Self {
            is_anchored: true,
            ..self
        }
    }

    /// The orientation.
    #[must_use]
    pub const fn model(&self) -> &'a M {
        self.model
    }

    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the number is clamped to the table first; NaN becomes 0"
    )]
    fn nearest(&self, x: f64) -> &Node {
        let place = (x + self.half_lines) * self.nodes_per_line + 0.5;
        &self.nodes[place.clamp(0.0, f64::from(NODES - 1)) as usize]
    }

    /// The line that sees `point_m` (Mars-fixed), also outside the image.
    ///
    /// # Errors
    /// [`Unseen::BehindCamera`], [`Unseen::NotConverged`], [`Unseen::NotFinite`].
    pub fn project(&self, point_m: &Vector3<f64>) -> Result<Solution, Unseen> {
        let start = self.nearest(0.0).newton(point_m);
        let node = self.nearest(start);
        let (distortion, x) = (&self.distortion, node.newton(point_m));
        let sighting = if self.is_anchored {
            let pose_and_rate = |x| self.model.pose_and_rate_near(x, &node.anchor);
            Sighting::with(pose_and_rate, distortion, x, point_m, LAST_STEP_LINES)
        } else {
            Sighting::near(self.model, distortion, x, point_m, LAST_STEP_LINES)
        };
        Ok(sighting?.solution)
    }
}
