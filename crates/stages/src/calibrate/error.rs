//! Reasons for the failure of a calibration, with the names of cameras and points.

use areograph_base::error::Cause;

/// A failed calibration.
#[derive(Debug, Clone, PartialEq, thiserror::Error, Cause)]
#[cause(Input)]
pub enum CalibrateError {
    /// Two images are mounted on different frames.
    #[error(
        "camera {camera} is mounted on frame {found} (instrument_pointing.time_dependent_frames), but camera {first} \
         on {expected}; expected the spacecraft's frame for all cameras"
    )]
    #[cause(
        "write support data in which instrument_pointing ends in the spacecraft's frame and constant_rotation leads \
         from this frame to the camera"
    )]
    OtherFrame {
        /// The camera.
        camera: String,
        /// Its frame.
        found: i32,
        /// The first camera.
        first: String,
        /// Frame of the first camera.
        expected: i32,
    },
    /// Two cameras have one sensor.
    #[error(
        "cameras {first} and {second} have the same sensor, {sensor}; expected support data of different lines"
    )]
    #[cause(
        "name_sensor distinguishes the lines of the camera: check the files in cameras.isd and validation.isd; support \
         data that ALE wrote from PDS labels do not distinguish lines, those of areograph do"
    )]
    SameSensor {
        /// A camera.
        first: String,
        /// Another camera.
        second: String,
        /// The sensor of both.
        sensor: String,
    },
    /// No axis of the spacecraft is near nadir, or near the direction of flight.
    #[error("no spacecraft axis lies within {limit_deg} degrees of {what}")]
    #[cause(like = OtherFrame)]
    NoAxis {
        /// The direction.
        what: &'static str,
        /// Largest allowed angle, degrees.
        limit_deg: f64,
    },
    /// A camera does not look down.
    #[error(
        "camera {camera} looks upwards or sideways: tangents about the downward axis cannot represent its look directions"
    )]
    #[cause(like = OtherFrame)]
    LooksUp {
        /// The camera.
        camera: String,
    },
    /// A table names an unknown camera.
    #[error("point {point} is in camera {camera:?}; expected one of {expected}")]
    #[cause("use the camera identifiers of the configuration in the table")]
    UnknownCamera {
        /// The point.
        point: String,
        /// The name in the table.
        camera: String,
        /// The cameras.
        expected: String,
    },
    /// Too few tie points.
    #[error(
        "{found} usable tie points link camera {camera} to another camera; expected at least {expected} for every camera"
    )]
    #[cause("measure more points that are visible in several lines")]
    TooFewTies {
        /// The camera with the fewest.
        camera: String,
        /// Number found.
        found: usize,
        /// Number required.
        expected: usize,
    },
    /// Too few control points.
    #[error(
        "{found} control points are usable, {held_back} are withheld; expected at least {expected} of each"
    )]
    #[cause(
        "give more laser points, or omit the table [control]: without control, only differential parameters are \
         estimated"
    )]
    TooFewControls {
        /// Number found.
        found: usize,
        /// Number withheld.
        held_back: usize,
        /// Number required.
        expected: usize,
    },
    /// Most points do not fit.
    #[error("{misfits} of {all} {what} do not fit the support data, for example {point}: {why}")]
    #[cause(
        "check that every camera has the support data of its own image, that samples are counted from the same edge as \
         in the support data, and that positions refer to the same epoch and body"
    )]
    Misfit {
        /// `tie points` or `control points`.
        what: &'static str,
        /// Number of points that do not fit.
        misfits: usize,
        /// Number found.
        all: usize,
        /// One of them.
        point: String,
        /// Reason why it does not fit.
        why: String,
    },
    /// A control point has two places.
    #[error(
        "control point {point} has two positions; expected the same longitude, latitude and radius in all its rows"
    )]
    #[cause("give every laser point a unique name")]
    TwoPlaces {
        /// The point.
        point: String,
    },
    /// A validation orbit has a different number of files, or a different sensor.
    #[error("validation {orbit}: no support data of {sensor}, the sensor of camera {camera}")]
    #[cause(like = SameSensor)]
    NoSupport {
        /// The orbit.
        orbit: String,
        /// The sensor.
        sensor: String,
        /// Its camera.
        camera: String,
    },
    /// The calibrated cameras cannot see a control point.
    #[error("control point {point} cannot validate the calibration: {problem}")]
    #[cause("check the position of this point and its lines and samples")]
    Unseen {
        /// The point.
        point: String,
        /// Reason.
        problem: String,
    },
    /// Another orbit has too little laser control.
    #[error("validation {orbit}: {found} control points are usable; expected at least {expected}")]
    #[cause("give this orbit more laser points, or omit it from [[validation]]")]
    ThinValidation {
        /// The orbit.
        orbit: String,
        /// Number found.
        found: usize,
        /// Number required.
        expected: usize,
    },
    /// Another orbit has a file of the calibration.
    #[error(
        "validation {orbit}: {file} is identical to a file of the calibration itself; expected files of another orbit"
    )]
    #[cause(
        "data used in a calibration cannot validate it: give files of another orbit, or omit this validation"
    )]
    SameFile {
        /// The orbit.
        orbit: String,
        /// The file.
        file: String,
    },
    /// The camera of another orbit is mounted differently.
    #[error(
        "validation {orbit}: the direction of camera {camera} differs by {off_px:.2} px from its direction in the \
         calibrated orbit; expected the same mounting and focal plane within {limit_px} px"
    )]
    #[cause(
        "give support data with the same mounting, focal length and focal plane: the calibration is an offset from \
         these values"
    )]
    OtherMounting {
        /// The orbit.
        orbit: String,
        /// The camera.
        camera: String,
        /// The difference, pixels.
        off_px: f64,
        /// Largest allowed difference, pixels.
        limit_px: f64,
    },
    /// The adjustment fails.
    #[error("step {step}: {problem}")]
    #[cause(
        "check that tie points and laser points were measured in these images and cover the images, and check the \
         standard deviations of these points"
    )]
    Adjustment {
        /// The step.
        step: &'static str,
        /// The problem.
        problem: String,
    },
}
