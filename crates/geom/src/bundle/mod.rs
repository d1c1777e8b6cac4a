//! Combined bundle adjustment of pushbroom images, ground points and laser ranges.
//!
//! The unknowns are 18 coefficients of a correction to each image's orientation, the ground points and, if requested, a
//! time bias of each image and a range bias of each profile. The orientation itself may be of any form. Coefficients
//! belong to powers of `t = x/L`, `L` half the number of lines, so all positions are metres, all rotations radians, of
//! similar size.
//! The observations are focal coordinates, ranges, and the initial values themselves with their standard deviations.
//! Residuals are observed minus computed.
//!
//! A view is compared with the projection of its point: the line that sees it, and the position in that line. Lines are
//! converted to focal-plane pixels at the initial scale.
//!
//! This module uses indices and numbers; `stages/adjust` adds identifiers and statistics. Corrections apply to an
//! orientation of any form, so that the sampled orientation itself can be adjusted. Unknowns with a standard deviation
//! of 0 have no column.
//!
//! An orthogonal transformation of its rows eliminates the coordinates of each point (`reduce`). Points with the same
//! images are summed as one small dense matrix, in groups of fixed size, so that the number of threads does not change
//! the sums. The reduced equations are kept in blocks of images that share points (`block_equations`), so that memory
//! grows with the number of images. `quasi_newton` supplies the curvature that Gauss–Newton omits.
//!
//! # Source
//! Yoon & Shan 2004. They adjust the coefficients of ω, φ and κ, which near the equator cannot be separated; here a
//! rotation about the camera's own axes is added to them. They state one standard deviation per image for 18 unknowns,
//! in metres; here each unknown has its own. Their along-track residual is the point's position in the focal plane of
//! the measured line. An error of the line then counts as more pixels the faster the image flies over the ground, and
//! noisy lines bias the adjustment towards a slow flight: a bias of errors in variables.
//!
//! ```
//! use areograph_geom::{
//!     bundle::{BundleImage, BundleOptions, BundlePoint, Network, View, solve},
//!     collinearity::project,
//!     pushbroom::{Distortion, EulerPolynomial, Sighting, VectorPolynomial},
//! };
//! use nalgebra::{Vector2, Vector3};
//!
//! // Two cameras fly north over the equator side by side; the second looks to the first one's ground.
//! let camera = |east_m, north_m, roll_rad| EulerPolynomial {
//!     path_m: VectorPolynomial {
//!         coefficients: [Vector3::new(3_776e3, east_m, north_m), Vector3::new(0.0, 0.0, 4.4), Vector3::zeros()],
//!     },
//!     angles_rad: VectorPolynomial {
//!         coefficients: [
//!             Vector3::new(roll_rad, std::f64::consts::FRAC_PI_2, 0.0),
//!             Vector3::zeros(),
//!             Vector3::zeros(),
//!         ],
//!     },
//! };
//! // In truth the second flew 20 m farther north than its orbit states.
//! let truth = [camera(0.0, 0.0, 0.0), camera(-150e3, 20.0, 0.39)];
//! let orbit = [truth[0], camera(-150e3, 0.0, 0.39)];
//!
//! let focal_length_px = 3_500.0 / 0.026;
//! let mut network = Network::default();
//! for (number, base) in orbit.into_iter().enumerate() {
//!     // The first image is held fixed; of the second, Z of the position is free.
//!     let mut sigmas = [0.0; 18];
//!     if number == 1 {
//!         sigmas[6] = f64::INFINITY;
//!     }
//!     network.images.push(BundleImage {
//!         base,
//!         half_lines: 2_000.0,
//!         line_period_s: 1.4e-3,
//!         focal_length_px,
//!         distortion: Distortion::default(),
//!         sigmas,
//!         time_bias_sigma_s: 0.0,
//!     });
//! }
//! for point in 0..5_u32 {
//!     let ground_m = Vector3::new(3_396e3, 300.0 * f64::from(point), 1_500.0 * (f64::from(point) - 2.0));
//!     network.points.push(BundlePoint { ground_m, known: None });
//!     for (image, camera) in truth.iter().enumerate() {
//!         let seen = Sighting::near(camera, &Distortion::default(), 0.0, &ground_m, 1e-3)?.solution;
//!         network.views.push(View {
//!             point: point as usize,
//!             image,
//!             x_lines: seen.x,
//!             y_px: project(&seen.camera_m, focal_length_px)?.y,
//!             sigma_px: Vector2::new(1.0, 1.0),
//!         });
//!     }
//! }
//!
//! let adjustment = solve(&network, &BundleOptions::default())?;
//! assert_eq!(adjustment.degrees_of_freedom(), 20 - 16);
//! let north_m = adjustment.images[1].correction.position_m[0].z;
//! assert!((north_m - 20.0).abs() < 1e-3); // metres; the observations are free of errors
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod attitude_clock;
mod check;
mod common_bus;
mod common_pass;
mod compared_heights;
mod control;
mod error;
mod estimates;
mod factor;
mod groups;
mod heights;
mod jitter;
mod known;
mod layout;
mod mean_parts;
mod part;
mod point_rows;
mod quality;
mod quasi_newton;
mod reduce;
mod reduced_heights;
mod relative;
mod relief;
mod rows;
mod solve;
mod spots;
mod unknowns;

#[cfg(test)]
mod bus_tests;
#[cfg(test)]
mod height_tests;
#[cfg(test)]
mod jitter_tests;
#[cfg(test)]
mod mean_parts_tests;
#[cfg(test)]
mod pass_tests;
#[cfg(test)]
mod prior_tests;
#[cfg(test)]
mod tests;

use nalgebra::{DMatrix, Matrix3, Vector2, Vector3};

pub use attitude_clock::AttitudeClock;
pub use common_bus::{AdjustedBus, CommonBus, Estimate, RecordedProfile, SharedRotation, Spot};
pub use common_pass::CommonPass;
pub use control::{CommonNoise, HeightControl, Jitter};
pub use error::BundleError;
pub use known::KnownCoordinates;
pub use mean_parts::MeanParts;
pub use part::Part;
pub use relief::{ProfileShift, ReliefOfSite};
pub use solve::{solve, solve_comparing};
pub use unknowns::Unknown;

use super::{
    pushbroom::{Distortion, OrientationCorrection},
    robust::RobustWeight,
};

/// Orientation unknowns of an image: X, Y, Z and the rotations about the camera's x, y and z axis, each with
/// powers 0, 1 and 2 of `t`.
pub const ORIENTATION_UNKNOWNS: usize = 18;

/// An image with its initial orientation.
#[derive(Debug, Clone, PartialEq)]
pub struct BundleImage<M> {
    /// Initial orientation, abscissa in lines from the middle.
    pub base: M,
    /// Half the number of lines of the orientation, `L`.
    pub half_lines: f64,
    /// Time from line to line, seconds.
    pub line_period_s: f64,
    /// Focal length, pixels of the image.
    pub focal_length_px: f64,
    /// Position of its detector line in the focal plane.
    pub distortion: Distortion,
    /// Standard deviation of each unknown, initially zero, at `[3·quantity + power]`, metres and radians;
    /// infinite leaves it free, 0 holds it fixed.
    pub sigmas: [f64; ORIENTATION_UNKNOWNS],
    /// Standard deviation of a bias of all line times of the image, seconds; 0 for no such unknown.
    pub time_bias_sigma_s: f64,
}

/// A ground point with its initial coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BundlePoint {
    /// Initial coordinates, Mars-fixed, metres.
    pub ground_m: Vector3<f64>,
    /// Their a priori uncertainty, when they are observations.
    pub known: Option<KnownCoordinates>,
}

/// A point measured in an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Index of the point.
    pub point: usize,
    /// Index of the image.
    pub image: usize,
    /// Measured line, from the middle of the image.
    pub x_lines: f64,
    /// Measured position in the line, pixels from the principal point.
    pub y_px: f64,
    /// Standard deviations along and across the track, focal-plane pixels.
    pub sigma_px: Vector2<f64>,
}

/// A laser range to a point, from the orbit of an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// Index of the point.
    pub point: usize,
    /// Index of the image that was exposed meanwhile.
    pub image: usize,
    /// The instant of the shot as a line, `(t_shot − t_mid)/τ`: not the line that the point falls in.
    pub x_lines: f64,
    /// From the origin of the image's rays at that instant to the laser, Mars-fixed, metres: light time and aberration.
    pub to_laser_m: Vector3<f64>,
    /// Measured distance, metres.
    pub range_m: f64,
    /// Its standard deviation, metres.
    pub sigma_m: f64,
    /// Index of its profile's bias.
    pub profile: usize,
}

/// The input of an adjustment.
#[derive(Debug, Clone)]
pub struct Network<M> {
    /// Images.
    pub images: Vec<BundleImage<M>>,
    /// Points.
    pub points: Vec<BundlePoint>,
    /// Image coordinates.
    pub views: Vec<View>,
    /// Ranges.
    pub ranges: Vec<Range>,
    /// Standard deviation of each profile's range bias, metres; 0 for no such unknown.
    pub range_bias_sigmas_m: Vec<f64>,
    /// Heights of points above a surface.
    pub heights: Option<HeightControl>,
    /// An attitude clock offset, where it is an unknown.
    pub attitude_clock: Option<AttitudeClock>,
    /// A laser on the bus of the cameras, where its spots in the images are observations.
    pub common_bus: Option<CommonBus>,
    /// Expected position of each image relative to its initial orientation, Mars-fixed, metres: the a priori values of
    /// its constant position unknowns. Empty where they are zero for all.
    pub expected_m: Vec<Vector3<f64>>,
    /// Images whose a priori orientations are correlated.
    pub passes: Vec<CommonPass>,
}

impl<M> Default for Network<M> {
    fn default() -> Self {
        Self {
            images: Vec::new(),
            points: Vec::new(),
            views: Vec::new(),
            ranges: Vec::new(),
            range_bias_sigmas_m: Vec::new(),
            heights: None,
            attitude_clock: None,
            common_bus: None,
            expected_m: Vec::new(),
            passes: Vec::new(),
        }
    }
}

/// Options of an adjustment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BundleOptions {
    /// Weights of image coordinates once the quadratic adjustment has converged.
    pub robust: Option<RobustWeight>,
    /// Maximum number of steps in each of the two.
    pub steps_max: u32,
    /// Maximum number of iterations of the surface and weights of observed heights.
    pub height_rounds_max: u32,
}

impl Default for BundleOptions {
    fn default() -> Self {
        Self {
            robust: None,
            steps_max: 100,
            height_rounds_max: 15,
        }
    }
}

/// Reasons why a point is not adjusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, thiserror::Error)]
pub enum PointRejection {
    /// It is observed in fewer than two images and has no a priori coordinates.
    #[error("too few rays to determine the point")]
    Undetermined,
    /// It lies behind a camera that has measured it.
    #[error("behind the camera of one of its images")]
    BehindCamera,
    /// No line of a camera that has measured it sees it.
    #[error("not in the plane of any line of one of its images")]
    Unseen,
}

/// One scalar observation after the adjustment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Residual {
    /// Observed minus computed, in the unit of the observation.
    pub value: f64,
    /// Its a priori standard deviation.
    pub sigma: f64,
    /// Redundancy number, `0..=1`: the share of an error of the observation that its residual shows.
    pub redundancy: f64,
    /// Factor of its weight from robust estimation; 1 without it.
    pub weight_factor: f64,
}

/// Below this redundancy number a residual carries no information about its observation.
const REDUNDANCY_MIN: f64 = 1e-6;

impl Residual {
    /// Residual over its own standard deviation when the a priori ones are true; `None` when the
    /// observation is not controlled by others.
    #[must_use]
    pub fn standardised(&self) -> Option<f64> {
        (self.redundancy > REDUNDANCY_MIN)
            .then(|| self.value / (self.sigma * self.redundancy.sqrt()))
    }

    /// Its part of the weighted sum of squares.
    #[must_use]
    pub fn weighted_square(&self) -> f64 {
        self.weight_factor * (self.value / self.sigma).powi(2)
    }
}

/// Height of an adjusted point above the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeightResidual {
    /// Index of the point.
    pub point: usize,
    /// Height above the surface, metres.
    pub above_m: f64,
    /// Standard deviation of the surface, metres, without robust weights.
    pub surface_sigma_m: f64,
    /// Standard deviation that the point's own rays leave in its height when orientations are known, metres.
    pub ray_sigma_m: f64,
    /// Distance of the nearest shot, metres.
    pub nearest_shot_m: f64,
    /// Factor of its weight from robust estimation; 1 without it.
    pub weight_factor: f64,
    /// Redundancy number; 0 of heights that are only compared.
    pub redundancy: f64,
}

/// An adjusted image.
#[derive(Debug, Clone, PartialEq)]
pub struct AdjustedImage {
    /// Correction added to the initial orientation; its coefficients are the unknowns.
    pub correction: OrientationCorrection,
    /// Cofactors of the unknowns in the same order, rows of fixed ones zero; σ0² times these is the covariance.
    pub cofactors: DMatrix<f64>,
    /// Residuals of the initial values, `None` where free or fixed; they exclude the part of the correction due to the
    /// attitude clock.
    pub priors: [Option<Residual>; ORIENTATION_UNKNOWNS],
    /// Time bias, seconds, with the square root of its cofactor, when it is unknown.
    pub time_bias_s: Option<(f64, f64)>,
}

/// An adjusted point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AdjustedPoint {
    /// Coordinates, Mars-fixed, metres.
    pub ground_m: Vector3<f64>,
    /// Cofactors, m²; σ0² times these is the covariance.
    pub cofactor_m2: Matrix3<f64>,
    /// Cofactors without an error that it shares, m²: for a point that is recorded with a profile, against the shift of
    /// the profile; for others, against the mean of the points with an observed height; `None` without either.
    pub relative_m2: Option<Matrix3<f64>>,
    /// Residuals of the initial coordinates along their principal axes, when they were observed.
    pub priors: Option<[Residual; 3]>,
}

/// The adjusted network.
#[derive(Debug, Clone, PartialEq)]
pub struct Adjustment {
    /// Images, in the order of the network.
    pub images: Vec<AdjustedImage>,
    /// Points, in the order of the network.
    pub points: Vec<Result<AdjustedPoint, PointRejection>>,
    /// Residuals along and across the track of each view, focal-plane pixels; `None` for dropped points.
    pub views: Vec<Option<[Residual; 2]>>,
    /// Residuals of the ranges, metres; `None` for dropped points.
    pub ranges: Vec<Option<Residual>>,
    /// Range bias of each profile with the square root of its cofactor, metres, when it is unknown.
    pub range_biases_m: Vec<Option<(f64, f64)>>,
    /// Attitude clock offset with the square root of its cofactor, seconds, when it is unknown: the attitudes read are
    /// the attitudes of the images this much later.
    pub attitude_clock_s: Option<(f64, f64)>,
    /// Estimates from spots of a laser on the same bus, where they are observations.
    pub common_bus: Option<AdjustedBus>,
    /// Heights that are observations.
    pub heights: Vec<HeightResidual>,
    /// Whether surface and weights had converged in the last iteration.
    pub heights_settled: bool,
    /// Heights that are compared, each with the standard deviation from its own rays and the surface only.
    pub compared: Vec<HeightResidual>,
    /// Weighted sum of squares of the observed heights, with their full covariance.
    pub height_squares: f64,
    /// Planimetric information from the relief under the points with an observed height, where the ground has relief.
    pub relief: Option<ReliefOfSite>,
    /// Cofactors of the mean of the points with an observed height, m²: common errors do not average out.
    pub mean_cofactor_m2: Option<Matrix3<f64>>,
    /// Parts of these by cause.
    pub mean_parts: Option<MeanParts>,
    /// Scalar observations, initial values with a standard deviation included.
    pub observations: usize,
    /// Unknowns.
    pub unknowns: usize,
    /// Weighted sum of squared residuals.
    pub weighted_squares: f64,
    /// The weighted sum before each step and after the last.
    pub history: Vec<f64>,
    /// Pairs of unknowns, of one image or of images that share points, that are correlated by more than 0.95, with the
    /// coefficient.
    pub correlated: Vec<(Unknown, Unknown, f64)>,
}

impl Adjustment {
    /// Degrees of freedom: observations minus unknowns.
    #[must_use]
    pub fn degrees_of_freedom(&self) -> usize {
        self.observations - self.unknowns
    }

    /// A posteriori standard deviation of unit weight, pixels; 1 without redundancy.
    #[must_use]
    pub fn sigma0(&self) -> f64 {
        match self.degrees_of_freedom() {
            0 => 1.0,
            free => (self.weighted_squares / free as f64).sqrt(),
        }
    }

    /// Steps that were taken.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.history.len() - 1
    }
}
