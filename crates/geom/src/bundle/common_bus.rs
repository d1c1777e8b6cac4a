//! A laser on the bus that carries the cameras: where it points in them is fixed by their mounting.
//!
//! A shot that was fired while an image was exposed meets the ground where the mounting says, whatever the attitude was: in
//! the image that is a place of its own, the spot. The altimeter's record of the shot says where on Mars that is, so spots
//! tell the attitude, as well as profiles and boresight are known. These two err in common: all spots of a profile by where
//! it lies, all spots of all images by how the laser points.
//!
//! # Source
//! A choice; the boresight of the narrow-angle camera was found in flight against the altimeter (Kirk et al. 2001).

use nalgebra::{Matrix3, Vector3};

use super::{Residual, View};

/// A laser that shares its bus with the cameras of the images.
#[derive(Debug, Clone, PartialEq)]
pub struct CommonBus {
    /// Standard deviation of each of the two angles by which the laser points elsewhere than its mounting says, the same for
    /// all images, radians.
    pub boresight_sigma_rad: f64,
    /// Standard deviation of what the line times of an image are late by against the shots, one unknown an image, seconds;
    /// infinite where spots say nothing along the track, 0 where line times are right.
    pub line_time_sigma_s: f64,
    /// How far each profile of the ranges may be recorded from where it lies.
    pub profiles: Vec<RecordedProfile>,
    /// Points that are recorded with a profile, and its index.
    pub recorded: Vec<(usize, usize)>,
    /// Spots in images.
    pub spots: Vec<Spot>,
}

/// A profile that may be recorded elsewhere than it lies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecordedProfile {
    /// Its index on the surface.
    pub surface_profile: usize,
    /// East, north and up, Mars-fixed, one a row.
    pub axes: Matrix3<f64>,
    /// Standard deviations along these, metres.
    pub sigma_m: Vector3<f64>,
}

/// Where a shot is in an image that was exposed meanwhile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spot {
    /// Its place as the mounting has it, by the initial orientation.
    pub view: View,
    /// How the spot moves on the ground with each of the angles of the boresight, Mars-fixed, metres per radian.
    pub by_boresight_m: [Vector3<f64>; 2],
}

/// What spots say of laser and profiles.
#[derive(Debug, Clone, PartialEq)]
pub struct AdjustedBus {
    /// The angles of the boresight.
    pub boresight_rad: [Estimate; 2],
    /// What the lines of each image are late by, seconds, where it has spots and that is unknown.
    pub line_times_s: Vec<Option<Estimate>>,
    /// How far each profile is recorded from where it lies, towards east, north and up, metres.
    pub profile_shifts_m: Vec<[Estimate; 3]>,
    /// Residuals of the spots along and across the track, focal-plane pixels; `None` for dropped points.
    pub spots: Vec<Option<[Residual; 2]>>,
}

/// An unknown that was expected to be 0.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Estimate {
    /// Its value.
    pub value: f64,
    /// Square root of its cofactor.
    pub root_cofactor: f64,
    /// Residual of the expected value; `None` where that weighs nothing or the unknown is held.
    pub prior: Option<Residual>,
}
