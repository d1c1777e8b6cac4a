//! Outlines of images on the ground, known by their corners, and how two images of one place see it.

use nalgebra::Vector3;

use crate::{
    geom::{
        ellipsoid::spherical_to_xyz_m,
        window::{Region, WindowShape},
    },
    units::{RADIANS_PER_DEGREE, longitude_step_rad, wrap_two_pi},
};

/// How far the corners of the index may be off, radians of latitude: the kind of its latitudes is not known, ...
pub const INDEX_LATITUDE_RAD: f64 = 0.35 * RADIANS_PER_DEGREE;
/// ... and of longitude at the equator: nor is its prime meridian.
pub const INDEX_LONGITUDE_RAD: f64 = 0.3 * RADIANS_PER_DEGREE;
/// Corners farther from the centre than this are none, radians.
const CORNER_RAD: f64 = 60.0 * RADIANS_PER_DEGREE;
/// Beyond this latitude, its margin included, an outline reaches round the pole, radians.
const POLAR_RAD: f64 = 89.0 * RADIANS_PER_DEGREE;

/// A convex outline in the plane of longitude and latitude, its longitudes unwrapped around its centre.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageOutline {
    /// (longitude, latitude) of the corners in their order round the image, radians.
    corners_rad: Vec<[f64; 2]>,
}

impl ImageOutline {
    /// The outline of corners around a centre; where some of them are no corners of this image, a box that holds it
    /// whichever way it lies, `half_diagonal_rad` to all sides.
    #[must_use]
    pub fn new(
        corners_rad: [Option<[f64; 2]>; 4],
        centre_rad: [f64; 2],
        half_diagonal_rad: f64,
    ) -> Self {
        let near = |corner: Option<[f64; 2]>| {
            let [longitude, latitude] = corner?;
            let step = longitude_step_rad(longitude - centre_rad[0]);
            let is_near =
                direction(centre_rad).dot(&direction([longitude, latitude])) > CORNER_RAD.cos();
            is_near.then_some([centre_rad[0] + step, latitude])
        };
        let corners: Option<Vec<[f64; 2]>> = corners_rad.into_iter().map(near).collect();
        let distinct = corners.filter(|corners| {
            corners
                .iter()
                .any(|corner| angle_rad(*corner, corners[0]) > 0.0)
        });
        let corners_rad = distinct.unwrap_or_else(|| {
            let height = half_diagonal_rad;
            let width = (height / centre_rad[1].cos().max(1e-3)).min(std::f64::consts::PI);
            let [longitude, latitude] = centre_rad;
            let ends = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
            let corner = |(east, north): (f64, f64)| {
                let limit = std::f64::consts::FRAC_PI_2;
                [
                    longitude + east * width,
                    (latitude + north * height).clamp(-limit, limit),
                ]
            };
            ends.map(corner).to_vec()
        });
        Self { corners_rad }
    }

    /// The corners, radians, longitudes in one stretch.
    #[must_use]
    pub fn corners_rad(&self) -> &[[f64; 2]] {
        &self.corners_rad
    }

    /// The ground that the image may show when its corners are off by `latitude_rad` in latitude, and by
    /// `longitude_rad` over the cosine of latitude in longitude; see [`widened`].
    #[must_use]
    pub fn widened(&self, latitude_rad: f64, longitude_rad: f64) -> Region {
        Region::new(&widened(&self.corners_rad, latitude_rad, longitude_rad))
    }

    /// The share of the smaller of two outlines that the other one shows, 0 to 1.
    #[must_use]
    pub fn overlap(&self, other: &Self) -> f64 {
        let away = longitude_step_rad(other.corners_rad[0][0] - self.corners_rad[0][0]);
        let shift = self.corners_rad[0][0] + away - other.corners_rad[0][0];
        let [one, two] = [(self, 0.0), (other, shift)].map(|(outline, shift)| {
            let moved = outline
                .corners_rad
                .iter()
                .map(|[longitude, latitude]| [longitude + shift, *latitude]);
            hull(moved.collect())
        });
        let smaller = area(&one).min(area(&two));
        if smaller > 0.0 {
            (area(&clipped(one, &two)) / smaller).clamp(0.0, 1.0)
        } else {
            0.0
        }
    }
}

/// The convex outline of places (longitude, latitude; radians, longitudes in one stretch), widened by `latitude_rad` in
/// latitude and by `longitude_rad` over the cosine of the farthest latitude in longitude; near a pole a whole cap.
#[must_use]
pub fn widened(places_rad: &[[f64; 2]], latitude_rad: f64, longitude_rad: f64) -> WindowShape {
    let limit = std::f64::consts::FRAC_PI_2;
    let latitudes = places_rad.iter().map(|place| place[1]);
    let (south, north) = latitudes.fold((limit, -limit), |(south, north), latitude| {
        (south.min(latitude), north.max(latitude))
    });
    let farthest = north.abs().max(south.abs());
    if farthest + latitude_rad > POLAR_RAD {
        let is_north = north.abs() > south.abs();
        return WindowShape::Box {
            west_rad: 0.0,
            east_rad: std::f64::consts::TAU,
            south_rad: if is_north {
                (south - latitude_rad).max(-limit)
            } else {
                -limit
            },
            north_rad: if is_north {
                limit
            } else {
                (north + latitude_rad).min(limit)
            },
        };
    }
    let longitude_rad = longitude_rad / farthest.cos();
    let around = places_rad.iter().flat_map(|[longitude, latitude]| {
        let signs = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        signs.map(|(east, north)| {
            [
                longitude + east * longitude_rad,
                latitude + north * latitude_rad,
            ]
        })
    });
    WindowShape::Polygons {
        polygons: vec![vec![hull(around.collect())]],
    }
}

/// Twice the area of the triangle of three points, positive when it is walked counterclockwise.
fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// The convex hull, counterclockwise (Andrew's monotone chain).
fn hull(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let mut ring: Vec<[f64; 2]> = Vec::new();
    let back = points.clone().into_iter().rev();
    for points in [points, back.collect()] {
        let start = ring.len();
        for point in points {
            while ring.len() >= start + 2
                && turn(ring[ring.len() - 2], ring[ring.len() - 1], point) <= 0.0
            {
                ring.pop();
            }
            ring.push(point);
        }
        ring.pop();
    }
    ring
}

fn area(ring: &[[f64; 2]]) -> f64 {
    let triangles = (2..ring.len()).map(|next| turn(ring[0], ring[next - 1], ring[next]));
    0.5 * triangles.sum::<f64>()
}

/// What two convex rings share, both counterclockwise (Sutherland and Hodgman).
fn clipped(ring: Vec<[f64; 2]>, by: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut ring = ring;
    for (edge, from) in by.iter().enumerate() {
        let to = by[(edge + 1) % by.len()];
        let mut inside = Vec::with_capacity(ring.len() + 2);
        for (number, point) in ring.iter().enumerate() {
            let next = ring[(number + 1) % ring.len()];
            let (here, there) = (turn(*from, to, *point), turn(*from, to, next));
            if here >= 0.0 {
                inside.push(*point);
            }
            if here * there < 0.0 {
                let share = here / (here - there);
                inside.push([0, 1].map(|axis| point[axis] + share * (next[axis] - point[axis])));
            }
        }
        ring = inside;
    }
    ring
}

fn direction([longitude_rad, latitude_rad]: [f64; 2]) -> Vector3<f64> {
    spherical_to_xyz_m(wrap_two_pi(longitude_rad), latitude_rad, 1.0)
}

/// The angle between two directions from the centre of Mars, radians; such as those to the Sun.
#[must_use]
pub fn angle_rad(one_rad: [f64; 2], other_rad: [f64; 2]) -> f64 {
    let (one, other) = (direction(one_rad), direction(other_rad));
    one.cross(&other).norm().atan2(one.dot(&other))
}

/// The direction from a place on a sphere to a spacecraft above another place; unit vector.
#[must_use]
pub fn view(
    place_rad: [f64; 2],
    below_rad: [f64; 2],
    radius_m: f64,
    altitude_m: f64,
) -> Vector3<f64> {
    let ray = direction(below_rad) * (radius_m + altitude_m) - direction(place_rad) * radius_m;
    ray.normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outline(corners_deg: [[f64; 2]; 4]) -> ImageOutline {
        let corners =
            corners_deg.map(|corner| Some(corner.map(|degrees| degrees * RADIANS_PER_DEGREE)));
        let mean = |axis: usize| {
            corners_deg.iter().map(|corner| corner[axis]).sum::<f64>() / 4.0 * RADIANS_PER_DEGREE
        };
        ImageOutline::new(corners, [mean(0), mean(1)], 0.01)
    }

    #[test]
    fn overlaps_are_shares_of_the_smaller_outline() {
        let square = outline([[10.0, 0.0], [12.0, 0.0], [12.0, 2.0], [10.0, 2.0]]);
        for (other, share) in [
            ([[11.0, 0.0], [13.0, 0.0], [13.0, 2.0], [11.0, 2.0]], 0.5),
            // The other way round, and within.
            ([[10.5, 1.5], [11.5, 1.5], [11.5, 0.5], [10.5, 0.5]], 1.0),
            ([[20.0, 0.0], [22.0, 0.0], [22.0, 2.0], [20.0, 2.0]], 0.0),
            // A diamond with its middle on a corner: a quarter of it.
            ([[12.0, 1.0], [13.0, 2.0], [12.0, 3.0], [11.0, 2.0]], 0.25),
        ] {
            let overlap = square.overlap(&outline(other));
            // Rounding of a few radians.
            assert!((overlap - share).abs() < 1e-12, "{overlap} for {share}");
            assert!((outline(other).overlap(&square) - share).abs() < 1e-12);
        }
        let across = outline([[359.0, 0.0], [361.0, 0.0], [361.0, 2.0], [359.0, 2.0]]);
        let east = outline([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]);
        assert!((across.overlap(&east) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn convergence_of_two_views_of_a_place() {
        // 45° to either side as seen from the place, on a sphere much larger than the height.
        let radius_m = 1e9;
        let views = [1.0, -1.0]
            .map(|side| view([0.0, 0.0], [side * 400e3 / radius_m, 0.0], radius_m, 400e3));
        // Curvature: 400 km of 10^9 m.
        assert!((views[0].angle(&views[1]) - std::f64::consts::FRAC_PI_2).abs() < 1e-3);
    }
}
