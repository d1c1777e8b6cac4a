//! Control of heights by a surface.

use crate::surface::LaserSurface;

/// Points whose height is compared with a surface.
#[derive(Debug, Clone)]
pub struct HeightControl {
    /// The ground.
    pub surface: LaserSurface,
    /// Jitter of the attitudes, an error of heights that determine planimetry; `None` for steady attitudes.
    pub jitter: Option<Jitter>,
    /// Noise that measurements of neighbouring points have in common, likewise.
    pub common_noise: Option<CommonNoise>,
    /// Indices of the points whose height is compared with it.
    pub compared: Vec<usize>,
    /// Indices of the points whose height is an observation; the covariance of the heights is full.
    pub observed: Vec<usize>,
}

/// Oscillation of attitudes faster than the unknowns of an orientation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jitter {
    /// Standard deviation of the rotation about the camera's x axis, radians.
    pub sigma_rad: f64,
    /// Time over which its correlation falls to 1/e, seconds.
    pub time_s: f64,
}

/// Errors of measurements that neighbours have in common, as errors of matching are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CommonNoise {
    /// Correlation of the errors of points at the same place, 0 to 1.
    pub share: f64,
    /// Distance over which the correlation falls to 1/e, metres.
    pub reach_m: f64,
}
