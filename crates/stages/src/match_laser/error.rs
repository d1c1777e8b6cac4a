//! Reasons for the failure of a match.

use areograph_base::error::Cause;

/// A failed match.
#[derive(Debug, Clone, PartialEq, thiserror::Error, Cause)]
#[cause(Input)]
pub enum MatchError {
    /// Two files hold the same shots.
    #[error(
        "contains shots of {other}; every shot counts once, because withheld shots must not be used in the match"
    )]
    #[cause("name only one of the two files")]
    SharedShots {
        /// The other file.
        other: String,
    },
    /// No shot lies on the model.
    #[error(
        "no shot lies on {ground}, which extends from {west:.3} to {east:.3} degrees of east longitude and from \
         {south:.3} to {north:.3} degrees of latitude"
    )]
    #[cause(
        "name PEDR files of passes over this ground, and check its coordinates: longitudes are positive east, \
         latitudes areocentric"
    )]
    NoShots {
        /// The ground.
        ground: &'static str,
        /// Its edges, degrees.
        west: f64,
        /// East.
        east: f64,
        /// South.
        south: f64,
        /// North.
        north: f64,
    },
}
