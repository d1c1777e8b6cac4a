//! A pushbroom camera: its pose as a function of the image line, and the line that sees a point.
//!
//! The image line is `x`, in lines from the middle of the header image. `M` takes Mars-fixed components to camera
//! components; the camera looks along +Z. A ground point `P` has the camera vector `q = M (P − C)`, and is seen by the
//! line where `q1 = 0`, or where `q1/q3` equals the value of the distorted detector at `q2/q3`.
//!
//! ```
//! use areograph_geom::pushbroom::{Distortion, EulerPolynomial, ExteriorOrientation, Sighting, VectorPolynomial};
//! use nalgebra::Vector3;
//!
//! // A camera that flies north over the equator, 4.4 m per line, and looks straight down.
//! let camera = EulerPolynomial {
//!     path_m: VectorPolynomial {
//!         coefficients: [Vector3::new(3_776e3, 0.0, 0.0), Vector3::new(0.0, 0.0, 4.4), Vector3::zeros()],
//!     },
//!     angles_rad: VectorPolynomial {
//!         coefficients: [Vector3::new(0.0, std::f64::consts::FRAC_PI_2, 0.0), Vector3::zeros(), Vector3::zeros()],
//!     },
//! };
//! // The point below line 250 is seen by line 250.
//! let below_m = camera.pose(250.0).position_m - Vector3::new(380e3, 0.0, 0.0);
//! let seen = Sighting::near(&camera, &Distortion::NONE, 0.0, &below_m, 1e-2)?;
//! assert!((seen.solution.x - 250.0).abs() < 1e-6); // lines; the last step is below 1e-2
//! # Ok::<(), areograph_geom::pushbroom::Unseen>(())
//! ```

mod corrected;
mod detector;
mod distortion;
mod models;
mod newton;
mod published;
mod sampled;

use nalgebra::{Matrix3, Vector3};

pub use corrected::{CorrectedOrientation, OrientationCorrection};
pub use detector::{Detector, RadialFit};
pub use distortion::{Distortion, FoldedLine};
pub use models::{
    Anchor, CameraModel, EulerPolynomial, RotationVectorPolynomial, VectorPolynomial,
};
pub(super) use newton::missed_m;
pub use newton::{Projector, Sighting};
pub use published::{FixedPoint, FrameFirst, Limits, Solution};
pub use sampled::{SampledOrientation, SamplesError};

/// Position and attitude of the camera while one line is exposed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Perspective centre, Mars-fixed, metres.
    pub position_m: Vector3<f64>,
    /// Rotation `M` from Mars-fixed to camera components.
    pub mars_to_camera: Matrix3<f64>,
}

/// Change of a [`Pose`] from line to line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseRate {
    /// `dC/dx`, Mars-fixed, metres per line.
    pub advance_m: Vector3<f64>,
    /// `Ω` with `dM/dx = [Ω]× M`, camera components, radians per line.
    pub turn_rad: Vector3<f64>,
}

/// Exterior orientation of an image as a function of its line.
pub trait ExteriorOrientation: Sync {
    /// Pose at `x` lines from the middle; outside the image an extrapolation.
    fn pose(&self, x: f64) -> Pose;

    /// The pose with its change per line.
    fn pose_and_rate(&self, x: f64) -> (Pose, PoseRate);

    /// What [`Self::pose_and_rate_near`] needs of a line.
    fn anchor(&self, _x: f64) -> Anchor {
        Anchor::default()
    }

    /// [`Self::pose_and_rate`] within rounding, faster at lines near that of `anchor`.
    fn pose_and_rate_near(&self, x: f64, _anchor: &Anchor) -> (Pose, PoseRate) {
        self.pose_and_rate(x)
    }
}

impl<M: ExteriorOrientation + ?Sized> ExteriorOrientation for &M {
    fn pose(&self, x: f64) -> Pose {
        (**self).pose(x)
    }

    fn pose_and_rate(&self, x: f64) -> (Pose, PoseRate) {
        (**self).pose_and_rate(x)
    }

    fn anchor(&self, x: f64) -> Anchor {
        (**self).anchor(x)
    }

    fn pose_and_rate_near(&self, x: f64, anchor: &Anchor) -> (Pose, PoseRate) {
        (**self).pose_and_rate_near(x, anchor)
    }
}

/// An orientation whose positions are a polynomial of at most second order, as eq. 4 of Shan et al. 2005 needs.
pub trait PolynomialPath: ExteriorOrientation {
    /// The positions, metres.
    fn path_m(&self) -> &VectorPolynomial;
}

/// Reasons why an image has no line for a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, thiserror::Error)]
pub enum Unseen {
    /// The point lies behind the camera.
    #[error("behind the camera")]
    BehindCamera,
    /// The camera's x axis lies within 0.6° of across the flight: lines do not follow each other on the ground.
    #[error("the camera moves along its detector line")]
    AcrossFlight,
    /// The steps grew three times in a row.
    #[error("the iteration diverges")]
    Diverged,
    /// The steps stayed above the tolerance.
    #[error("the iteration does not converge")]
    NotConverged,
    /// A coordinate or a coefficient is not a finite number.
    #[error("not a finite number")]
    NotFinite,
}

impl Pose {
    /// Camera vector `q = M (P − C)` of a Mars-fixed point, metres.
    #[must_use]
    pub fn camera_vector_m(&self, point_m: &Vector3<f64>) -> Vector3<f64> {
        self.mars_to_camera * (point_m - self.position_m)
    }
}

impl PoseRate {
    /// `dq/dx` of the camera vector `camera_m` of a fixed point, metres per line.
    #[must_use]
    pub fn camera_vector_rate_m(&self, pose: &Pose, camera_m: &Vector3<f64>) -> Vector3<f64> {
        self.turn_rad.cross(camera_m) - pose.mars_to_camera * self.advance_m
    }
}

/// Smallest share of the advance per line that must lie along the camera's x axis.
const ALONG_SHARE_MIN: f64 = 0.01;

/// Sense of the camera's x axis along the flight: +1 or −1 (MOC flies along −X).
///
/// # Errors
/// [`Unseen::AcrossFlight`], [`Unseen::NotFinite`].
fn flight_sense(model: &(impl ExteriorOrientation + ?Sized)) -> Result<f64, Unseen> {
    let (pose, motion) = model.pose_and_rate(0.0);
    let along_m = (pose.mars_to_camera * motion.advance_m).x;
    if !along_m.is_finite() {
        return Err(Unseen::NotFinite);
    }
    if along_m.abs() <= ALONG_SHARE_MIN * motion.advance_m.norm() {
        return Err(Unseen::AcrossFlight);
    }
    Ok(along_m.signum())
}
