//! An image for intersection and adjustment: orientation and detector together.

use nalgebra::{Vector2, Vector3};

use super::{
    intersection::Ray,
    pushbroom::{Detector, ExteriorOrientation, missed_m},
};
use areograph_base::line_times::LineTimes;

/// An image used in intersection or adjustment.
#[derive(Debug, Clone, PartialEq)]
pub struct OrientedCamera<M> {
    /// Identifier that measurements name.
    pub id: String,
    /// Exterior orientation as a function of [`LineTimes::offset`].
    pub orientation: M,
    /// Detector line.
    pub detector: Detector,
    /// Times of the lines of the complete image.
    pub line_times: LineTimes,
}

impl<M> OrientedCamera<M> {
    /// Lines of the complete image.
    #[must_use]
    pub fn lines(&self) -> f64 {
        f64::from(self.line_times.lines())
    }
}

impl<M: ExteriorOrientation> OrientedCamera<M> {
    /// Abscissa of the orientation, and focal coordinates along and across the track in pixels, of an image position.
    ///
    /// Lines and samples are 0 at the outer edge of the first one.
    #[must_use]
    pub fn focal_plane_coordinates(&self, line: f64, sample: f64) -> (f64, Vector2<f64>) {
        (
            self.line_times.offset_of_line(line),
            self.detector.place_px(sample),
        )
    }

    /// The ray of an image position, with a standard deviation of a pixel along the track and of a sample across it.
    #[must_use]
    pub fn ray(&self, line: f64, sample: f64) -> Ray {
        let (x_lines, focal_px) = self.focal_plane_coordinates(line, sample);
        let pose = self.orientation.pose(x_lines);
        Ray {
            position_m: pose.position_m,
            mars_to_camera: pose.mars_to_camera,
            focal_length_px: self.detector.focal_length_px,
            focal_px,
            along_sigma_px: 1.0,
            across_sigma_px: self.detector.focal_px_per_sample(focal_px.y),
        }
    }

    /// Point where the ray of an image position first meets a sphere, Mars-fixed, metres; `None` where the ray misses it.
    #[must_use]
    pub fn on_sphere_m(&self, line: f64, sample: f64, radius_m: f64) -> Option<Vector3<f64>> {
        let pose = self.orientation.pose(self.line_times.offset_of_line(line));
        let look = self.detector.look(sample);
        let direction = pose.mars_to_camera.tr_mul(&look).normalize();
        let along_m = -pose.position_m.dot(&direction);
        let square_m2 = radius_m * radius_m - (pose.position_m.norm_squared() - along_m * along_m);
        (square_m2 >= 0.0 && along_m > 0.0)
            .then(|| pose.position_m + (along_m - square_m2.sqrt()) * direction)
    }

    /// Whether a position lies in the image, its edges included.
    #[must_use]
    pub fn shows(&self, line: f64, sample: f64) -> bool {
        (0.0..=self.lines()).contains(&line) && (0.0..=self.detector.samples).contains(&sample)
    }

    /// Displacement of a ground point along the focal plane during a mean line period at `x_lines`, pixels.
    #[must_use]
    pub fn focal_px_per_line(&self, x_lines: f64, ground_m: &Vector3<f64>) -> f64 {
        let (pose, motion) = self.orientation.pose_and_rate(x_lines);
        let camera_m = pose.camera_vector_m(ground_m);
        let rate_m = motion.camera_vector_rate_m(&pose, &camera_m);
        let [_, missed_rate_m] = missed_m(&self.detector.distortion, &camera_m, &rate_m);
        // The point lies in the plane of its line, so that the change of its depth has no effect.
        self.detector.focal_length_px * missed_rate_m.abs() / camera_m.z
    }

    /// Distance on the ground between the line exposed at `x_lines` and the next at a point of it, metres,
    /// perpendicular to the ray.
    #[must_use]
    pub fn line_spacing_m(&self, x_lines: f64, ground_m: &Vector3<f64>) -> f64 {
        let depth_m = self.orientation.pose(x_lines).camera_vector_m(ground_m).z;
        let spacing_m =
            self.focal_px_per_line(x_lines, ground_m) * depth_m / self.detector.focal_length_px;
        spacing_m * self.line_times.offsets_per_line(x_lines)
    }
}
