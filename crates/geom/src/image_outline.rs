//! Outlines of images on the ground from their corners, and the overlap and convergence of two images.

use std::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::{Rotation3, Vector3};

use crate::{
    convex::{area, clipped, hull},
    ellipsoid::spherical_to_xyz_m,
    longitude_ring::{cut_at_antimeridian, goes_round_pole, in_one_stretch},
    window::{Region, WindowShape, half_width_rad},
};
use areograph_base::units::{RADIANS_PER_DEGREE, wrap_two_pi};

/// Error bound of the corners in the index, radians of latitude: the kind of its latitudes is not known, ...
pub const INDEX_LATITUDE_RAD: f64 = 0.35 * RADIANS_PER_DEGREE;
/// ... and of longitude at the equator: nor is its prime meridian.
pub const INDEX_LONGITUDE_RAD: f64 = 0.3 * RADIANS_PER_DEGREE;
/// Corners farther from the centre than this are invalid, radians.
const CORNER_RAD: f64 = 60.0 * RADIANS_PER_DEGREE;
/// Beyond this latitude, its margin included, an outline reaches round the pole, radians.
const POLAR_RAD: f64 = 89.0 * RADIANS_PER_DEGREE;
/// From this latitude on areas are compared in the plane of the pole, radians.
const PLANE_RAD: f64 = 75.0 * RADIANS_PER_DEGREE;
/// Edges are sampled in pieces no longer than this, radians.
const PIECE_RAD: f64 = RADIANS_PER_DEGREE;

/// The outline of an image from its corners, with great circles between them.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageOutline {
    /// (longitude, latitude) of the corners in their order round the image, radians.
    corners_rad: Vec<[f64; 2]>,
}

impl ImageOutline {
    /// The outline of corners around a centre. Where some corners are invalid, a square of `half_diagonal_rad` to all
    /// sides that contains the image in any orientation; `None` where that is not known either.
    #[must_use]
    pub fn new(
        corners_rad: [Option<[f64; 2]>; 4],
        centre_rad: [f64; 2],
        half_diagonal_rad: Option<f64>,
    ) -> Option<Self> {
        let is_near = |corner: &[f64; 2]| angle_rad(centre_rad, *corner) < CORNER_RAD;
        let near = corners_rad.into_iter().map(|corner| corner.filter(is_near));
        let corners: Option<Vec<[f64; 2]>> = near.collect();
        let distinct = corners.filter(|corners| {
            let mut others = corners.iter();
            others.any(|corner| angle_rad(*corner, corners[0]) > 0.0)
        });
        let corners_rad = match distinct {
            Some(corners) => in_one_stretch(centre_rad[0], &corners),
            None => square(centre_rad, half_diagonal_rad?),
        };
        Some(Self { corners_rad })
    }

    /// The outline as closed rings, radians; see [`cut_at_antimeridian`].
    #[must_use]
    pub fn rings_rad(&self) -> Vec<Vec<[f64; 2]>> {
        cut_at_antimeridian(&self.corners_rad)
    }

    /// The ground that the image may show when its corners are in error by `latitude_rad` in latitude, and by
    /// `longitude_rad` over the cosine of latitude in longitude; see [`widened`].
    #[must_use]
    pub fn widened(&self, latitude_rad: f64, longitude_rad: f64) -> Region {
        Region::new(&widened(&self.corners_rad, latitude_rad, longitude_rad))
    }

    /// The share of the smaller of two outlines that the other one covers, 0 to 1.
    #[must_use]
    pub fn overlap(&self, other: &Self) -> f64 {
        let both = [self, other].map(|outline| &*outline.corners_rad);
        let [one, two] = if both.iter().any(|ring| is_polar(ring)) {
            let north = both.concat().iter().map(|place| place[1]).sum::<f64>() > 0.0;
            both.map(|ring| {
                hull(
                    ring.iter()
                        .map(|place| in_polar_plane(*place, north))
                        .collect(),
                )
            })
        } else {
            both.map(|ring| hull(in_one_stretch(both[0][0][0], ring)))
        };
        let smaller = area(&one).min(area(&two));
        if smaller > 0.0 {
            (area(&clipped(one, &two)) / smaller).clamp(0.0, 1.0)
        } else {
            0.0
        }
    }
}

/// The corners of a box about a centre; four points round the pole where the box contains it.
fn square([longitude, latitude]: [f64; 2], half_rad: f64) -> Vec<[f64; 2]> {
    let Some(width) = half_width_rad(latitude, half_rad) else {
        let lowest = latitude - half_rad.copysign(latitude);
        return [0.0, 1.0, 2.0, 3.0]
            .map(|quarter| [longitude + quarter * FRAC_PI_2, lowest])
            .to_vec();
    };
    let (south, north) = (latitude - half_rad, latitude + half_rad);
    vec![
        [longitude - width, south],
        [longitude + width, south],
        [longitude + width, north],
        [longitude - width, north],
    ]
}

/// Whether a ring is too close to a pole for longitudes to locate it.
fn is_polar(ring_rad: &[[f64; 2]]) -> bool {
    goes_round_pole(ring_rad) || ring_rad.iter().any(|place| place[1].abs() > PLANE_RAD)
}

/// A point in the plane of a pole, its distance from the pole kept.
fn in_polar_plane([longitude, latitude]: [f64; 2], north: bool) -> [f64; 2] {
    let side = if north { 1.0 } else { -1.0 };
    let distance = FRAC_PI_2 - side * latitude;
    [
        distance * longitude.cos(),
        side * distance * longitude.sin(),
    ]
}

/// The ground within a ring of points (longitude, latitude; radians) with great circles between them, and around it: by
/// `latitude_rad` in latitude, by a cap of radius `longitude_rad` at the farthest latitude in longitude. The result is
/// a convex outline in the plane of longitude and latitude that contains all of it, or a full cap where the ring goes
/// round a pole or close to it.
#[must_use]
pub fn widened(ring_rad: &[[f64; 2]], latitude_rad: f64, longitude_rad: f64) -> WindowShape {
    let edge = walked(ring_rad);
    let (south, north) = edge
        .iter()
        .fold((FRAC_PI_2, -FRAC_PI_2), |(south, north), place| {
            (place[1].min(south), place[1].max(north))
        });
    let farthest = north.abs().max(south.abs());
    let is_far = |latitude: f64| latitude + latitude_rad > POLAR_RAD;
    let longitude_rad = half_width_rad(farthest, longitude_rad);
    let Some(longitude_rad) =
        longitude_rad.filter(|_| !goes_round_pole(ring_rad) && !is_far(farthest))
    else {
        let is_north = north.abs() > south.abs();
        return WindowShape::Box {
            west_rad: 0.0,
            east_rad: TAU,
            south_rad: if is_north && !is_far(-south) {
                south - latitude_rad
            } else {
                -FRAC_PI_2
            },
            north_rad: if is_north || is_far(north) {
                FRAC_PI_2
            } else {
                north + latitude_rad
            },
        };
    };
    let around = edge.iter().flat_map(|[longitude, latitude]| {
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

/// Points along the edges of a ring and just beyond them towards the poles, longitudes in one stretch: straight lines
/// round all of them in the plane of longitude and latitude contain the great circles.
fn walked(ring_rad: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let next = ring_rad.iter().cycle().skip(1);
    let edges = ring_rad.iter().zip(next).flat_map(|(from, to)| {
        let (start, end) = (direction(*from), direction(*to));
        let length_rad = angle_rad(*from, *to);
        let pieces = (length_rad / PIECE_RAD).ceil().max(1.0);
        // A great circle bends by s² tan(latitude) / 8 over a length s; twice that, since it bends more towards the pole.
        let bend_rad = (length_rad / pieces).powi(2) / 4.0;
        let steps = std::iter::successors(Some(0.0), |step| Some(step + 1.0));
        let steps = steps.take_while(move |step| *step <= pieces);
        steps.flat_map(move |step| {
            let at = start.slerp(&end, step / pieces);
            let (longitude, latitude) = (at.y.atan2(at.x), at.z.clamp(-1.0, 1.0).asin());
            let beyond = latitude + bend_rad * latitude.tan();
            [latitude, beyond.clamp(-FRAC_PI_2, FRAC_PI_2)].map(|latitude| [longitude, latitude])
        })
    });
    let places: Vec<[f64; 2]> = edges.collect();
    in_one_stretch(ring_rad.first().map_or(0.0, |place| place[0]), &places)
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

/// Viewing geometry of an image, as known for its centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sight {
    /// (longitude, latitude) of its centre, radians.
    pub centre_rad: [f64; 2],
    /// (longitude, latitude) of the point below the spacecraft, radians.
    pub below_rad: [f64; 2],
    /// Height of the spacecraft, metres.
    pub altitude_m: f64,
}

impl Sight {
    /// Up at the centre, and the direction from there to the spacecraft, on a sphere.
    fn up_and_ray(&self, radius_m: f64) -> (Vector3<f64>, Vector3<f64>) {
        let up = direction(self.centre_rad);
        let spacecraft_m = direction(self.below_rad) * (radius_m + self.altitude_m);
        (up, spacecraft_m - up * radius_m)
    }
}

/// The angle between the rays of two images to their spacecraft, radians.
///
/// A pushbroom image views every line from above that line: the viewing direction is constant along the track, and does
/// not vary about the centre as in a frame. So each image has the ray of its own centre, and one ray is carried along
/// the great circle to the centre of the other.
#[must_use]
pub fn convergence_rad(one: &Sight, other: &Sight, radius_m: f64) -> f64 {
    let (one_up, one_ray) = one.up_and_ray(radius_m);
    let (other_up, other_ray) = other.up_and_ray(radius_m);
    let carried = Rotation3::rotation_between(&one_up, &other_up);
    // Undefined for centres on opposite sides of Mars, which share no ground.
    (carried.unwrap_or_else(Rotation3::identity) * one_ray).angle(&other_ray)
}

#[cfg(test)]
mod tests;
