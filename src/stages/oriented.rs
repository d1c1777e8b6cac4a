//! An image with its orientation in every form: what the geometric stages see through.

use super::{
    fit_sensor_model::SensorModel,
    sample_orientation::{Orientation, OrientationSample},
    tag_times::ImageTimes,
};
use crate::{
    error::{Fault, Kind, Result},
    geom::{
        attitude::matrix_of_spice_quaternion,
        pushbroom::{
            CameraModel, Detector, EulerPolynomial, ExteriorOrientation, Pose, Projector,
            RotationVectorPolynomial, SampledOrientation, SamplesFault, Unseen,
        },
        stereo::StereoImage,
    },
};

/// An image with its orientation in every form.
#[derive(Debug)]
pub struct OrientedImage<'a> {
    /// Line times.
    pub image: &'a ImageTimes,
    /// Detector line.
    pub detector: Detector,
    /// Polynomials of first order.
    pub first_order: EulerPolynomial,
    /// Polynomials of second order.
    pub second_order: EulerPolynomial,
    rotation_vector: RotationVectorPolynomial,
    samples: SampledOrientation,
}

/// Samples that are no orientation.
#[derive(Debug, thiserror::Error)]
#[error("image {image}: {fault}")]
struct NoOrientation {
    image: String,
    fault: SamplesFault,
}

impl Fault for NoOrientation {
    fn kind(&self) -> Kind {
        Kind::Input
    }

    fn advice(&self) -> String {
        "raise orientation.intervals, and check the kernels of the image's time".to_owned()
    }
}

impl<'a> OrientedImage<'a> {
    /// The image as its orientation and model have it.
    ///
    /// # Errors
    /// Samples that are no orientation.
    pub fn of(
        image: &'a ImageTimes,
        orientation: &Orientation,
        model: &SensorModel,
    ) -> Result<Self> {
        let sampled = SampledOrientation::new(&poses(&orientation.samples)).map_err(|fault| {
            let image = image.id.clone();
            NoOrientation { image, fault }
        })?;
        Ok(Self {
            image,
            detector: image.detector(),
            first_order: model.first_order.orientation(),
            second_order: model.second_order.orientation(),
            rotation_vector: model.rotation_vector_orientation(),
            samples: sampled,
        })
    }

    /// Lines of the header image.
    #[must_use]
    pub fn lines(&self) -> f64 {
        f64::from(self.image.lines_header)
    }

    /// The orientation in the form `wanted`.
    #[must_use]
    pub fn orientation(&self, wanted: CameraModel) -> &(dyn ExteriorOrientation + 'static) {
        match wanted {
            CameraModel::FirstOrder => &self.first_order,
            CameraModel::SecondOrder => &self.second_order,
            CameraModel::RotationVector => &self.rotation_vector,
            CameraModel::Samples => &self.samples,
        }
    }

    /// Finds lines for points with the form `wanted`.
    ///
    /// # Errors
    /// An orientation that sees nothing.
    pub fn projector(
        &self,
        wanted: CameraModel,
    ) -> std::result::Result<Projector<'_, dyn ExteriorOrientation>, Unseen> {
        let projector = Projector::new(self.orientation(wanted), self.lines())?;
        Ok(projector.through(self.detector.distortion))
    }

    /// The image for intersection and adjustment, with the form `wanted`.
    #[must_use]
    pub fn stereo(&self, wanted: CameraModel) -> StereoImage<&(dyn ExteriorOrientation + 'static)> {
        StereoImage {
            id: self.image.id.clone(),
            orientation: self.orientation(wanted),
            detector: self.detector,
            lines: self.lines(),
        }
    }
}

/// Every sample as a line with its pose.
fn poses(samples: &[OrientationSample]) -> Vec<(f64, Pose)> {
    let pose = |sample: &OrientationSample| Pose {
        position_m: sample.position_m.into(),
        mars_to_camera: matrix_of_spice_quaternion(sample.camera_to_mars).transpose(),
    };
    samples
        .iter()
        .map(|sample| (sample.line_offset, pose(sample)))
        .collect()
}
