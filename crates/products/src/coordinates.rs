//! Degrees of maps.

use areograph_base::{body::Body, units::RADIANS_PER_DEGREE};

/// Statement of products beside the CRS code, since no code exists for the frame of the products.
///
/// For Mars, `pck00011.tpc` (IAU 2015, CSPICE N0067) differs from [`MARS_IAU2000`](areograph_base::body::MARS_IAU2000),
/// sampled daily over 1999 to 2001, by −0.00184° to −0.00136° on the equator and by 0.00048° at most between the poles.
pub(super) fn frame(body: Body) -> &'static str {
    &body.names().frame
}

/// Degrees of an angle in radians.
pub(super) fn degrees(angle_rad: f64) -> f64 {
    angle_rad / RADIANS_PER_DEGREE
}

/// East longitude in `-180..180` degrees, as GIS expects it, of one in `0..2π` radians.
pub(super) fn signed_longitude_deg(longitude_rad: f64) -> f64 {
    let east_deg = degrees(longitude_rad);
    if east_deg >= 180.0 {
        east_deg - 360.0
    } else {
        east_deg
    }
}

/// Points of all longitudes surround a pole when all lie poleward of this latitude, degrees; farther from it
/// they are a belt round Mars.
const POLAR_DEG: f64 = 60.0;

/// West, south, east and north of points in degrees; `None` without points.
///
/// `west > east` when the shortest box crosses the antimeridian, as RFC 7946 (5.2) and GeoParquet state. Points
/// that surround a pole have all longitudes and reach to the pole (5.3).
pub(super) fn bounding_box_deg(points: &[[f64; 2]]) -> Option<[f64; 4]> {
    let mut longitudes: Vec<f64> = points.iter().map(|point| point[0]).collect();
    longitudes.sort_by(f64::total_cmp);
    let (first, last) = (*longitudes.first()?, *longitudes.last()?);
    // The box leaves out the widest empty stretch of longitudes; the one over the antimeridian unless
    // another is wider.
    let mut widest = first + 360.0 - last;
    let (mut west, mut east) = (first, last);
    for pair in longitudes.windows(2) {
        if pair[1] - pair[0] > widest {
            widest = pair[1] - pair[0];
            (west, east) = (pair[1], pair[0]);
        }
    }
    let latitudes = || points.iter().map(|point| point[1]);
    let south = latitudes().fold(f64::INFINITY, f64::min);
    let north = latitudes().fold(f64::NEG_INFINITY, f64::max);
    let surrounded = widest < 180.0;
    Some(if surrounded && south > POLAR_DEG {
        [-180.0, south, 180.0, 90.0]
    } else if surrounded && north < -POLAR_DEG {
        [-180.0, -90.0, 180.0, north]
    } else {
        [west, south, east, north]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn longitudes_fold_at_the_antimeridian() {
        assert!((signed_longitude_deg(PI) + 180.0).abs() < 1e-12); // rounding of degrees
        assert!((signed_longitude_deg(1.5 * PI) + 90.0).abs() < 1e-12);
        assert!((signed_longitude_deg(0.5 * PI) - 90.0).abs() < 1e-12);
    }

    #[test]
    fn boxes_cross_the_antimeridian_when_that_is_shorter() {
        let across = [[179.5, 1.0], [-179.0, 3.0], [179.9, 2.0]];
        assert_eq!(bounding_box_deg(&across), Some([179.5, 1.0, -179.0, 3.0]));
        let greenwich = [[-1.0, -5.0], [2.0, -6.0]];
        assert_eq!(bounding_box_deg(&greenwich), Some([-1.0, -6.0, 2.0, -5.0]));
        assert_eq!(bounding_box_deg(&[]), None);
    }

    #[test]
    fn boxes_round_a_pole_reach_it() {
        let round = |latitude: f64| [-170.0, -50.0, 60.0, 160.0].map(|east| [east, latitude]);
        let north = Some([-180.0, 86.0, 180.0, 90.0]);
        assert_eq!(bounding_box_deg(&round(86.0)), north);
        let south = Some([-180.0, -90.0, 180.0, -86.0]);
        assert_eq!(bounding_box_deg(&round(-86.0)), south);
        // A track that passes beside the pole, and a belt.
        let track = [[10.0, 88.0], [100.0, 89.0], [180.0, 87.0]];
        assert_eq!(bounding_box_deg(&track), Some([10.0, 87.0, 180.0, 89.0]));
        let belt = Some([-50.0, 5.0, -170.0, 5.0]);
        assert_eq!(bounding_box_deg(&round(5.0)), belt);
    }
}
