//! Adjusted points for their writers.

use nalgebra::{Matrix3, RowVector3};

use crate::error::ProductError;
use areograph_base::frames::{BodyFixed, Position};
use areograph_geom::ellipsoid::Spherical;

/// A point on the ground with its covariance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GroundEstimate {
    /// Position, IAU 2000.
    pub position: Position<BodyFixed>,
    /// Covariance of its components, square metres.
    pub covariance_m2: Matrix3<f64>,
}

/// Coordinates of a point in an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImageMeasure<'a> {
    /// Name of the image for the reader of the file: a serial number for ISIS, a file for Ames Stereo Pipeline.
    pub image: &'a str,
    /// Line in the complete image, 0 at the outer edge of the first line and 0.5 at its middle.
    pub line: f64,
    /// Sample, 0 at the outer edge of the first pixel and 0.5 at its middle.
    pub sample: f64,
}

impl GroundEstimate {
    pub(super) fn spherical(&self) -> Spherical {
        Spherical::from_xyz_m(&self.position.xyz_m)
    }

    /// Covariance of areocentric latitude, east longitude and radius, radians and metres.
    ///
    /// Not finite on the axis of Mars, where there is no longitude.
    pub(super) fn spherical_covariance(&self) -> Matrix3<f64> {
        let spherical = self.spherical();
        let (sin_latitude, cos_latitude) = spherical.latitude.0.sin_cos();
        let (sin_longitude, cos_longitude) = spherical.longitude_rad.sin_cos();
        let by_latitude = RowVector3::new(
            -sin_latitude * cos_longitude,
            -sin_latitude * sin_longitude,
            cos_latitude,
        ) / spherical.radius_m;
        let equatorial_m = self.position.xyz_m.xy().norm();
        let by_longitude = RowVector3::new(-sin_longitude, cos_longitude, 0.0) / equatorial_m;
        let by_radius = self.position.xyz_m.transpose() / spherical.radius_m;
        let partials = Matrix3::from_rows(&[by_latitude, by_longitude, by_radius]);
        partials * self.covariance_m2 * partials.transpose()
    }
}

/// The error that tie points of a site share: standard deviations in east, north and height, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SharedSigmas {
    /// Of the error.
    pub sigma_m: [f64; 3],
    /// Of its part that the points of other sites have as well.
    pub of_all_sites_m: [f64; 3],
}

/// The error that tie points share, for the comments of formats that state each point alone.
pub(super) fn shared_in_words(shared: Option<&SharedSigmas>) -> String {
    let size = shared.map_or_else(
        || "the error of the a priori orientations".to_owned(),
        |shared| {
            let [east_m, north_m, up_m] = shared.sigma_m;
            format!(
                "an error with standard deviations of {east_m:.1} m east, {north_m:.1} m north and {up_m:.1} m up"
            )
        },
    );
    let elsewhere = shared.filter(|of| of.of_all_sites_m.iter().any(|of_m| *of_m >= SAID_M));
    let elsewhere = elsewhere.map_or_else(String::new, |shared| {
        let [east_m, north_m, up_m] = shared.of_all_sites_m;
        format!(
            "; other sites share a part of it, {east_m:.1} m east, {north_m:.1} m north and {up_m:.1} m up"
        )
    });
    format!(
        "all points share {size}{elsewhere}; the standard deviations of the points contain this error, which does not average out"
    )
}

/// A smaller part is 0 in the comments, metres.
const SAID_M: f64 = 0.05;

/// Rejects a value that is not above 0.
pub(super) fn above_zero(what: &str, value: f64) -> Result<(), ProductError> {
    // Written so that NaN is rejected too.
    if value > 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(ProductError::Refused {
        action: "write a point",
        reason: format!("{what} is {value}; expected a number above 0"),
    })
}
