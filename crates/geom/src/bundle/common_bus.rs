//! A laser on the bus that carries the cameras: its pointing in the cameras is fixed by their mounting.
//!
//! A shot fired while an image was exposed meets the ground in the direction fixed by the mounting, whatever the
//! attitude was: in the image that is a fixed position, the spot. The record of the shot states where on Mars that is,
//! so spots determine the attitude as well as profiles and boresight are known. These two have common errors: all spots
//! of a profile share the shift of the profile, all spots of all images share the pointing of the laser.
//!
//! # Source
//! A choice; the boresight of the narrow-angle camera was found in flight against the altimeter (Kirk et al. 2001).

use nalgebra::{Matrix2, Matrix3, Vector3};

use super::{Residual, View};
use crate::boresight::BoresightAngles;

/// A laser that shares its bus with the cameras of the images.
#[derive(Debug, Clone, PartialEq)]
pub struct CommonBus {
    /// A priori values of the two angles between the laser's actual pointing and its mounting, the same for all images.
    pub boresight: BoresightAngles,
    /// Standard deviation of the delay of an image's line times against the shots, one unknown an image, seconds;
    /// infinite where spots give no information along the track, 0 where line times are exact.
    pub line_time_sigma_s: f64,
    /// Offsets between the recorded and the true position of each profile of the ranges.
    pub profiles: Vec<RecordedProfile>,
    /// Points that are recorded with a profile, and its index.
    pub recorded: Vec<(usize, usize)>,
    /// Spots in images.
    pub spots: Vec<Spot>,
}

/// A profile that may be recorded with an offset from its true position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecordedProfile {
    /// Its index on the surface.
    pub surface_profile: usize,
    /// East, north and up, Mars-fixed, one a row.
    pub axes: Matrix3<f64>,
    /// Standard deviations along these, metres.
    pub sigma_m: Vector3<f64>,
    /// The rotation of an image that the recorded position contains a part of.
    pub shared: Option<SharedRotation>,
}

/// Part of the attitude error of an image in the recorded position of a profile: both were computed from one attitude.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SharedRotation {
    /// Index of the image.
    pub image: usize,
    /// Expected offset of the profile for a constant rotation about the camera's x axis by a radian, along the axes of the
    /// profile, metres.
    pub by_rotation_m: Vector3<f64>,
}

/// Position of a shot in an image that was exposed meanwhile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spot {
    /// Its position by the mounting and the initial orientation.
    pub view: View,
    /// How the spot moves on the ground with each of the angles of the boresight, Mars-fixed, metres per radian.
    pub by_boresight_m: [Vector3<f64>; 2],
}

/// Adjusted laser and profiles, as determined by spots.
#[derive(Debug, Clone, PartialEq)]
pub struct AdjustedBus {
    /// The angles of the boresight.
    pub boresight_rad: [Estimate; 2],
    /// Cofactors of these.
    pub boresight_cofactors: Matrix2<f64>,
    /// Delay of the lines of each image, seconds, where it has spots and the delay is unknown.
    pub line_times_s: Vec<Option<Estimate>>,
    /// Recorded minus true position of each profile, towards east, north and up, metres.
    pub profile_shifts_m: Vec<[Estimate; 3]>,
    /// Residuals of the spots along and across the track, focal-plane pixels; `None` for dropped points.
    pub spots: Vec<Option<[Residual; 2]>>,
}

/// An unknown whose expected value is 0, or a multiple of another unknown.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Estimate {
    /// Its value.
    pub value: f64,
    /// Square root of its cofactor.
    pub root_cofactor: f64,
    /// Residual of the expected value; `None` where that has no weight or the unknown is held.
    pub prior: Option<Residual>,
}
