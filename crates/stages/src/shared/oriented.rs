//! An image with its orientation in every form, for the geometric stages.

use nalgebra::{Vector2, Vector3};

use super::orientation::Orientation;
use crate::{fit_sensor_model::SensorModel, tag_times::ImageTimes};
use areograph_base::error::{Cause, Result};
use areograph_geom::{
    oriented_camera::OrientedCamera,
    pushbroom::{
        CameraModel, Detector, EulerPolynomial, ExteriorOrientation, Projector,
        RotationVectorPolynomial, SampledOrientation, SamplesError, Unseen,
    },
};

/// An image with its orientation in every form.
#[derive(Debug)]
pub struct OrientedImage<'a> {
    /// Line times.
    pub image: &'a ImageTimes,
    /// Detector line.
    pub detector: Detector,
    /// The form in use.
    pub model: CameraModel,
    /// Polynomials of first order.
    pub first_order: EulerPolynomial,
    /// Polynomials of second order.
    pub second_order: EulerPolynomial,
    rotation_vector: RotationVectorPolynomial,
    samples: SampledOrientation,
}

/// Samples that do not form an orientation.
#[derive(Debug, thiserror::Error, Cause)]
#[error("image {image}: {error}")]
#[cause(Input: "increase orientation.intervals, and check the kernels at the time of the image")]
struct NoOrientation {
    image: String,
    error: SamplesError,
}

impl<'a> OrientedImage<'a> {
    /// The image with its orientation and model.
    ///
    /// # Errors
    /// Samples that do not form an orientation.
    pub fn of(
        image: &'a ImageTimes,
        orientation: &Orientation,
        model: &SensorModel,
    ) -> Result<Self> {
        let samples = orientation.samples.iter();
        let poses: Vec<_> = samples
            .map(|sample| (sample.line_offset, sample.pose()))
            .collect();
        let sampled = SampledOrientation::new(&poses).map_err(|error| {
            let image = image.id.clone();
            NoOrientation { image, error }
        })?;
        Ok(Self {
            image,
            detector: image.detector(),
            model: model.model,
            first_order: model.first_order.orientation(),
            second_order: model.second_order.orientation(),
            rotation_vector: model.rotation_vector_orientation(),
            samples: sampled,
        })
    }

    /// Lines of the header image.
    #[must_use]
    pub fn lines(&self) -> f64 {
        f64::from(self.image.line_times.lines())
    }

    /// The orientation in the form `required`.
    #[must_use]
    pub fn orientation(&self, required: CameraModel) -> &(dyn ExteriorOrientation + 'static) {
        match required {
            CameraModel::FirstOrder => &self.first_order,
            CameraModel::SecondOrder => &self.second_order,
            CameraModel::RotationVector => &self.rotation_vector,
            CameraModel::Samples => &self.samples,
        }
    }

    /// Finds lines for points with the form in use.
    ///
    /// # Errors
    /// An orientation that sees no ground.
    pub fn projector(&self) -> std::result::Result<Projector<'_, dyn ExteriorOrientation>, Unseen> {
        self.projector_of(self.model)
    }

    /// Finds lines for points with the form `required`.
    ///
    /// # Errors
    /// An orientation that sees no ground.
    pub fn projector_of(
        &self,
        required: CameraModel,
    ) -> std::result::Result<Projector<'_, dyn ExteriorOrientation>, Unseen> {
        let projector = Projector::new(self.orientation(required), self.lines())?;
        Ok(projector.through(self.detector.distortion).anchored())
    }

    /// Line and sample at which `projector` sees a point, in the image or outside it.
    ///
    /// # Errors
    /// A point that the image has no line for.
    pub fn line_and_sample(
        &self,
        projector: &Projector<'_, dyn ExteriorOrientation>,
        point_m: &Vector3<f64>,
    ) -> std::result::Result<Vector2<f64>, Unseen> {
        let seen = projector.project(point_m)?;
        let focal_px = self.detector.focal_px(&seen.camera_m);
        let focal_px = focal_px.map_err(|_| Unseen::BehindCamera)?;
        Ok(Vector2::new(
            self.image.line_times.line_of_offset(seen.x),
            self.detector.sample(focal_px.y),
        ))
    }

    /// The image for intersection and adjustment, with the form in use.
    #[must_use]
    pub fn oriented_camera(&self) -> OrientedCamera<&(dyn ExteriorOrientation + 'static)> {
        OrientedCamera {
            id: self.image.id.clone(),
            orientation: self.orientation(self.model),
            detector: self.detector,
            line_times: self.image.line_times.clone(),
        }
    }
}
