//! One image through its orientation: from a place to the ground, from the ground to a place, and to the place in
//! another image.

use nalgebra::{Matrix2, Matrix3x2, Vector2, Vector3};

use super::shot_heights::Heights;
use crate::oriented::OrientedImage;
use areograph_geom::{
    imaging::Affine,
    oriented_camera::OrientedCamera,
    pushbroom::{ExteriorOrientation, Projector, Unseen},
};
use areograph_pds::pixel_file::Pyramid;

/// Half the distance over which the distortion between two images is measured, pixels: the size of a template.
const SPAN_PX: f64 = 16.0;
/// Steps of the search for the height on a ray: the ground changes little over their shifts.
const HEIGHT_STEPS: u32 = 4;
/// Change of height for the direction of parallax, metres.
const HEIGHT_CHANGE_M: f64 = 100.0;

/// An image with its camera and pixels.
pub(crate) struct View<'a> {
    pub(crate) camera: OrientedCamera<&'a (dyn ExteriorOrientation + 'static)>,
    projector: Projector<'a, dyn ExteriorOrientation>,
    pub(crate) pixels: &'a Pyramid,
}

/// The predicted position of a place in another image.
pub(crate) struct Prediction {
    /// From the image to the other.
    pub(crate) affine: Affine,
    /// Lines and samples of the other image for a standard deviation of the height.
    pub(crate) height_px: Vector2<f64>,
    /// Metres on the ground of a line and a sample of the image, and of the other.
    pub(crate) spacing_m: [Vector2<f64>; 2],
    /// Ground position of the place, Mars-fixed, metres.
    pub(crate) ground_m: Vector3<f64>,
}

impl<'a> View<'a> {
    pub(crate) fn of(image: &'a OrientedImage<'a>, pixels: &'a Pyramid) -> Result<Self, Unseen> {
        Self::through(image.oriented_camera(), pixels)
    }

    pub(crate) fn through(
        camera: OrientedCamera<&'a (dyn ExteriorOrientation + 'static)>,
        pixels: &'a Pyramid,
    ) -> Result<Self, Unseen> {
        let projector = Projector::new(camera.orientation, camera.lines())?;
        Ok(Self {
            projector: projector.through(camera.detector.distortion),
            camera,
            pixels,
        })
    }

    /// Lines and samples of the available pixels.
    pub(crate) fn size_px(&self) -> Vector2<f64> {
        let [lines, samples] = self.pixels.size(0);
        Vector2::new(lines as f64, samples as f64)
    }

    /// Whether a place lies in the image.
    pub(crate) fn holds(&self, place: &Vector2<f64>) -> bool {
        let size = self.size_px();
        (0.0..size.x).contains(&place.x) && (0.0..size.y).contains(&place.y)
    }

    /// Point where the ray of a place meets a sphere, metres; `None` where the ray misses the sphere.
    pub(crate) fn on_sphere_m(&self, place: &Vector2<f64>, radius_m: f64) -> Option<Vector3<f64>> {
        self.camera.on_sphere_m(place.x, place.y, radius_m)
    }

    /// The ground of a place by a priori heights, and the standard deviation of its height, metres.
    fn ground_m(&self, place: &Vector2<f64>, heights: &Heights) -> Option<(Vector3<f64>, f64)> {
        let start_m = self.camera.orientation.pose(0.0).position_m;
        let mut height = heights.near(&start_m);
        let mut ground_m = self.on_sphere_m(place, height.radius_m)?;
        for _ in 0..HEIGHT_STEPS {
            height = heights.near(&ground_m);
            ground_m = self.on_sphere_m(place, height.radius_m)?;
        }
        Some((ground_m, height.sigma_m))
    }

    /// Line and sample of a point, in the image or beyond it.
    pub(crate) fn place(&self, ground_m: &Vector3<f64>) -> Option<Vector2<f64>> {
        let seen = self.projector.project(ground_m).ok()?;
        let focal_px = self.camera.detector.focal_px(&seen.camera_m).ok()?;
        Some(Vector2::new(
            self.camera.line_times.line_of_offset(seen.x),
            self.camera.detector.sample(focal_px.y),
        ))
    }

    /// The predicted position of `place` in `other`.
    pub(crate) fn predict(
        &self,
        other: &View<'_>,
        place: &Vector2<f64>,
        heights: &Heights,
    ) -> Option<Prediction> {
        let (ground_m, sigma_m) = self.ground_m(place, heights)?;
        let radius_m = ground_m.norm();
        let to = other.place(&ground_m)?;
        let mut matrix = Matrix2::zeros();
        let mut spacing = Matrix3x2::zeros();
        for axis in 0..2 {
            let mut step = Vector2::zeros();
            step[axis] = SPAN_PX;
            let ends = [place - step, place + step];
            let [back_m, ahead_m] = ends.map(|end| self.on_sphere_m(&end, radius_m));
            let (back_m, ahead_m) = (back_m?, ahead_m?);
            let across = other.place(&ahead_m)? - other.place(&back_m)?;
            matrix.set_column(axis, &(across / (2.0 * SPAN_PX)));
            spacing.set_column(axis, &((ahead_m - back_m) / (2.0 * SPAN_PX)));
        }
        let higher_m = self.on_sphere_m(place, radius_m + HEIGHT_CHANGE_M)?;
        let there = spacing * matrix.try_inverse()?;
        let lengths = |of: &Matrix3x2<f64>| Vector2::new(of.column(0).norm(), of.column(1).norm());
        Some(Prediction {
            affine: Affine {
                from: *place,
                to,
                matrix,
            },
            height_px: (other.place(&higher_m)? - to) * (sigma_m / HEIGHT_CHANGE_M),
            spacing_m: [lengths(&spacing), lengths(&there)],
            ground_m,
        })
    }
}
