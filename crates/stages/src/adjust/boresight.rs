//! Adjusted boresight of a laser on the bus of the cameras.

use nalgebra::Matrix2;
use serde::{Deserialize, Serialize};

use super::{boresight_prior::BoresightPrior, relief::ProfileOffset};
use areograph_geom::{boresight::BoresightInformation, statistics::Summary};

/// Boresight of a laser on the bus of the cameras.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BoresightSummary {
    /// Two angles by which the boresight differs from the laser's file and the frame kernels, radians: towards X of the
    /// bus, and towards the axis that completes the right-handed set.
    pub angles_rad: [f64; 2],
    /// Standard deviations of these, radians.
    pub sigma_rad: [f64; 2],
    /// Covariance of these, rad².
    pub covariance_rad2: Matrix2<f64>,
    /// A priori values.
    pub prior: BoresightPrior,
    /// What the observations of the site state without these; `None` where an angle is held.
    pub information: Option<BoresightInformation>,
    /// Images with spots.
    pub images: Vec<SpotsOfImage>,
    /// Offset of each of their profiles as recorded.
    pub profile_shifts: Vec<ProfileOffset>,
    /// Images without a simultaneous profile.
    pub without: Vec<String>,
    /// The unknown of laser, profiles and line times that is farthest from its a priori value, and its distance in
    /// standard deviations of the contradiction; `None` where nothing tests them.
    pub farthest: Option<(String, f64)>,
}

/// Spots in one image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SpotsOfImage {
    /// Identifier.
    pub image: String,
    /// Spots.
    pub spots: usize,
    /// Delay of its lines against the shots with its standard deviation, seconds, where it is an unknown.
    pub line_time_s: Option<(f64, f64)>,
    /// Footprints in the initial orientation minus the laser's position from the mounting: along the track in lines,
    /// across it in focal-plane pixels.
    pub footprints_off: [Summary; 2],
    /// Direction of the beam by the mounting, components in the camera.
    pub beam: [f64; 3],
}
