//! Shots with ranges as lidar data of ISIS, for `jigsaw LIDARDATA=`.
//!
//! Kilometres for radii and ranges, metres for the standard deviation of a range, degrees; matrices are the
//! upper triangles of covariances of latitude, longitude and radius in radians and metres. Lines and samples
//! have the middle of the first pixel at 1.
//!
//! The matrix of a point contains the shift that all points of its profile share; `sharedErrors`, a member that ISIS does not
//! read, states it by profiles. The identifier of a point begins with its profile.
//!
//! Ranges are geometric. `jigsaw` computes them from its position of the spacecraft, which has the light time to the ground
//! with the adjusted kernels for ISIS, and agrees to 0.2 m; with the original kernels it has the light time to the centre of
//! the body, up to 330 m along the radius.
//!
//! ISIS (2024) takes the adjusted radius from the member `radius` when it reads such a file: the adjusted
//! members are for other readers.
//!
//! Source: `LidarData.cpp` of ISIS and its test data `LidarNetwork/lidarData.json`.

use std::{collections::BTreeSet, path::Path};

use nalgebra::Matrix3;
use serde::Serialize;

use super::{
    control_network::EDGE_TO_ISIS,
    points::{GroundEstimate, ImageMeasure, above_zero},
};
use crate::{error::ProductError, files::write_json};
use areograph_base::{
    error::{Locate, Result},
    time::Et,
    units::{METRES_PER_KM, RADIANS_PER_DEGREE},
};

/// A shot whose range constrains the images that were exposed at the time.
#[derive(Debug, Clone, PartialEq)]
pub struct LidarPoint<'a> {
    /// Identifier, unique in the file.
    pub id: &'a str,
    /// Instant of the shot by the clock of the images' lines: where a shift of line times is folded
    /// into the kernels that ISIS will use, the shot's own instant less that shift.
    pub et: Et,
    /// One-way range, metres.
    pub range_m: f64,
    /// Its standard deviation, metres.
    pub range_sigma_m: f64,
    /// The footprint before the adjustment.
    pub apriori: GroundEstimate,
    /// The footprint after it, if adjusted.
    pub adjusted: Option<GroundEstimate>,
    /// Serial numbers of the images that were exposed when the shot was fired.
    pub simultaneous_images: Vec<&'a str>,
    /// Coordinates of the footprint in images, by serial numbers.
    pub measures: Vec<ImageMeasure<'a>>,
}

/// Shift of a profile, an error that all its points share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProfileShift<'a> {
    /// Identifier of the profile.
    pub profile: &'a str,
    /// Standard deviations in east, north and height before the adjustment, metres.
    pub apriori_sigma_m: [f64; 3],
    /// Standard deviations in east, north and height after the adjustment, metres.
    pub adjusted_sigma_m: [f64; 3],
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Document<'a> {
    points: Vec<Point<'a>>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    shared_errors: Vec<SharedError<'a>>,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct SharedError<'a> {
    profile: &'a str,
    meaning: &'static str,
    apriori_sigma_east_north_up: [f64; 3],
    adjusted_sigma_east_north_up: [f64; 3],
}

const SHARED: &str = "standard deviations, metres, of a shift that all points of the profile share and that does not \
                      average out; the matrices of the points include its uncertainty";

/// Members in the order of ISIS, which is alphabetical.
#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Point<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    adjusted_latitude: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    adjusted_longitude: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    adjusted_matrix: Option<[f64; 6]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    adjusted_radius: Option<f64>,
    apriori_matrix: [f64; 6],
    id: &'a str,
    latitude: f64,
    longitude: f64,
    measures: Vec<Measure<'a>>,
    radius: f64,
    range: f64,
    sigma_range: f64,
    simultaneous_images: &'a [&'a str],
    time: f64,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Measure<'a> {
    line: f64,
    sample: f64,
    serial_number: &'a str,
}

/// Writes `points` to `path`, which must end in `.json` for ISIS to take it, and reads it back; `shifts` are the shifts
/// of their profiles.
///
/// # Errors
/// [`Kind::Bug`](areograph_base::error::Kind::Bug) for values that ISIS would reject or misread: ranges,
/// their standard deviations and variances that are not above 0, numbers that are not finite, two points of
/// one identifier; [`Kind::Io`](areograph_base::error::Kind::Io).
pub fn write_lidar_data(
    path: &Path,
    shifts: &[ProfileShift],
    points: &[LidarPoint],
) -> Result<u64> {
    let mut ids = BTreeSet::new();
    for point in points {
        check(point, &mut ids).in_file(path)?;
    }
    let points = points.iter().map(Point::new).collect();
    let shared = shifts.iter().map(|shift| SharedError {
        profile: shift.profile,
        meaning: SHARED,
        apriori_sigma_east_north_up: shift.apriori_sigma_m,
        adjusted_sigma_east_north_up: shift.adjusted_sigma_m,
    });
    let document = Document {
        points,
        shared_errors: shared.collect(),
    };
    write_json(path, &document)?;
    Ok(document.points.len() as u64)
}

fn check<'a>(
    point: &LidarPoint<'a>,
    ids: &mut BTreeSet<&'a str>,
) -> std::result::Result<(), ProductError> {
    let id = point.id;
    if !ids.insert(id) {
        let reason = format!("two points have the identifier {id}; expected unique identifiers");
        let action = "write a point";
        return Err(ProductError::Refused { action, reason });
    }
    above_zero(&format!("range of {id}, metres,"), point.range_m)?;
    above_zero(
        &format!("standard deviation of the range of {id}, metres,"),
        point.range_sigma_m,
    )?;
    for estimate in [Some(point.apriori), point.adjusted].into_iter().flatten() {
        for variance in estimate.spherical_covariance().diagonal().iter() {
            above_zero(
                &format!("variance of latitude, longitude or radius of {id}"),
                *variance,
            )?;
        }
    }
    Ok(())
}

impl<'a> Point<'a> {
    fn new(point: &'a LidarPoint) -> Self {
        let [latitude, longitude, radius] = degrees_and_km(&point.apriori);
        let adjusted = point.adjusted.as_ref();
        let [adjusted_latitude, adjusted_longitude, adjusted_radius] = adjusted
            .map(degrees_and_km)
            .map_or([None; 3], |values| values.map(Some));
        let upper = |estimate: &GroundEstimate| upper_triangle(&estimate.spherical_covariance());
        let measures = point.measures.iter().map(|measure| Measure {
            line: measure.line + EDGE_TO_ISIS,
            sample: measure.sample + EDGE_TO_ISIS,
            serial_number: measure.image,
        });
        Self {
            adjusted_latitude,
            adjusted_longitude,
            adjusted_matrix: adjusted.map(upper),
            adjusted_radius,
            apriori_matrix: upper(&point.apriori),
            id: point.id,
            latitude,
            longitude,
            measures: measures.collect(),
            radius,
            range: point.range_m / METRES_PER_KM,
            sigma_range: point.range_sigma_m,
            simultaneous_images: &point.simultaneous_images,
            time: point.et.seconds(),
        }
    }
}

/// Areocentric latitude and east longitude, degrees, and radius, kilometres.
fn degrees_and_km(estimate: &GroundEstimate) -> [f64; 3] {
    let spherical = estimate.spherical();
    [
        spherical.latitude.0 / RADIANS_PER_DEGREE,
        spherical.longitude_rad / RADIANS_PER_DEGREE,
        spherical.radius_m / METRES_PER_KM,
    ]
}

fn upper_triangle(matrix: &Matrix3<f64>) -> [f64; 6] {
    [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].map(|place| matrix[place])
}
