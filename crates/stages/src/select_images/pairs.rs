//! Pairs of images with common ground.

use std::collections::BTreeMap;

use areograph_base::units::RADIANS_PER_DEGREE;
use areograph_geom::{
    ellipsoid::spherical_to_xyz_m,
    image_outline::{Sight, angle_rad, convergence_rad},
};
use areograph_pds::image_index::IndexedImage;
use nalgebra::Vector3;

use super::{Found, RADIUS_M};

/// Two images of different orbits.
#[derive(Debug)]
pub struct Pair<'a> {
    /// The images, in the order in which they were found.
    pub images: [&'a Found; 2],
    /// Share of the smaller outline.
    pub overlap: f64,
    /// Whether index or times determine that they belong to different orbits.
    pub is_known_apart: bool,
    /// Angle between the rays to the spacecraft, see [`convergence_rad`]; `None` if the index lacks a spacecraft
    /// position.
    pub convergence_rad: Option<f64>,
    /// Larger pixel over smaller one.
    pub pixel_ratio: Option<f64>,
    /// Angle between the directions to the Sun at one place.
    pub sun_rad: Option<f64>,
    /// 0 to 1, best pairs first.
    pub score: f64,
}

/// Limits of a pair.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairLimits {
    /// Smallest share of the smaller outline, 0 to 1.
    pub overlap_min: f64,
    /// Smallest and largest angle between the rays to the spacecraft.
    pub convergence_rad: [f64; 2],
    /// Largest angle between the directions to the Sun.
    pub sun_max_rad: f64,
    /// Largest ratio of the pixel sizes.
    pub pixel_ratio_max: f64,
}

impl PairLimits {
    /// Whether a pair is within all limits. A quantity that is unknown is outside.
    #[must_use]
    pub fn admit(&self, pair: &Pair<'_>) -> bool {
        let [least, most] = self.convergence_rad;
        pair.is_known_apart
            && pair.overlap >= self.overlap_min
            && pair
                .convergence_rad
                .is_some_and(|angle| (least..=most).contains(&angle))
            && pair.sun_rad.is_some_and(|angle| angle <= self.sun_max_rad)
            && pair
                .pixel_ratio
                .is_some_and(|ratio| ratio <= self.pixel_ratio_max)
    }
}

/// Convergence beyond which the score does not increase, radians.
const CONVERGENCE_RAD: f64 = 20.0 * RADIANS_PER_DEGREE;

/// Images within this time belong to one orbit, seconds; an orbit of the mapping mission takes 118 minutes.
const ONE_ORBIT_S: i64 = 1_800;

/// All pairs, the best first; pairs of equal score in the order of their images.
///
/// Only images whose circumscribed circles meet are compared: the images are sorted by latitude, so that the mission's
/// index of 10⁵ small images takes seconds.
#[must_use]
pub fn pairs(found: &[Found]) -> Vec<Pair<'_>> {
    let circles: Vec<Circle> = found.iter().map(Circle::around).collect();
    let largest_rad = circles.iter().map(|circle| circle.radius_rad);
    let largest_rad = largest_rad.fold(0.0, f64::max);
    let mut order: Vec<usize> = (0..found.len()).collect();
    order.sort_by(|a, b| {
        circles[*a]
            .latitude_rad
            .total_cmp(&circles[*b].latitude_rad)
    });
    let mut near = Vec::new();
    for (place, one) in order.iter().enumerate() {
        let within_rad = circles[*one].radius_rad + largest_rad;
        let others = order[place + 1..].iter().take_while(|other| {
            circles[**other].latitude_rad - circles[*one].latitude_rad <= within_rad
        });
        near.extend(
            others
                .filter(|other| circles[*one].meets(&circles[**other]))
                .map(|other| [*one.min(other), *one.max(other)]),
        );
    }
    near.sort_unstable();
    let near = near.into_iter();
    let mut pairs: Vec<Pair<'_>> = near
        .filter_map(|images| pair(images.map(|number| &found[number])))
        .collect();
    pairs.sort_by(|a, b| b.score.total_cmp(&a.score));
    pairs
}

/// The pairs within the limits, best first, in which no image takes part more than `per_image_max` times.
#[must_use]
pub fn best_pairs<'a>(
    found: &'a [Found],
    limits: &PairLimits,
    per_image_max: usize,
) -> Vec<Pair<'a>> {
    let mut taken: BTreeMap<&str, usize> = BTreeMap::new();
    let mut best = pairs(found);
    best.retain(|pair| {
        let ids = pair.images.map(|found| &*found.image.product_id);
        let is_taken = |id: &str| taken.get(id).is_some_and(|times| *times >= per_image_max);
        if !limits.admit(pair) || ids.into_iter().any(is_taken) {
            return false;
        }
        for id in ids {
            *taken.entry(id).or_default() += 1;
        }
        true
    });
    best
}

/// A circle that contains the outline of an image.
struct Circle {
    centre: Vector3<f64>,
    latitude_rad: f64,
    radius_rad: f64,
}

impl Circle {
    fn around(found: &Found) -> Self {
        let [longitude_rad, latitude_rad] = found.centre_rad;
        let corners = found.outline.rings_rad().into_iter().flatten();
        let radii_rad = corners.map(|corner| angle_rad(found.centre_rad, corner));
        Self {
            centre: spherical_to_xyz_m(longitude_rad, latitude_rad, 1.0),
            latitude_rad,
            radius_rad: radii_rad.fold(0.0, f64::max),
        }
    }

    fn meets(&self, other: &Self) -> bool {
        let reach_rad = self.radius_rad + other.radius_rad;
        self.centre.dot(&other.centre) >= reach_rad.min(std::f64::consts::PI).cos()
    }
}

fn pair(images: [&Found; 2]) -> Option<Pair<'_>> {
    let [one, other] = images;
    let overlap = one.outline.overlap(&other.outline);
    let is_one_orbit = is_one_orbit(&one.image, &other.image);
    // Context images are taken together with narrow-angle images and form no stereo base.
    if overlap <= 0.0 || is_one_orbit == Some(true) {
        return None;
    }
    let sights = sight(one).zip(sight(other));
    let convergence_rad = sights.map(|(one, other)| convergence_rad(&one, &other, RADIUS_M));
    let suns = one.image.sub_solar_rad.zip(other.image.sub_solar_rad);
    let sun_rad = suns.map(|(one, other)| angle_rad(one, other));
    let pixels = one.image.pixel_m.zip(other.image.pixel_m);
    let pixel_ratio = pixels.map(|(one, other)| one.max(other) / one.min(other));
    let base = convergence_rad.map_or(1.0, |angle| (angle / CONVERGENCE_RAD).min(1.0));
    let light = sun_rad.map_or(1.0, |angle| (0.5 * angle).cos().powi(2));
    Some(Pair {
        images,
        overlap,
        is_known_apart: is_one_orbit.is_some(),
        convergence_rad,
        pixel_ratio,
        sun_rad,
        score: overlap * base * light / pixel_ratio.unwrap_or(1.0),
    })
}

fn sight(found: &Found) -> Option<Sight> {
    Some(Sight {
        centre_rad: found.centre_rad,
        below_rad: found.image.sub_spacecraft_rad?,
        altitude_m: found.image.altitude_m?,
    })
}

/// Whether two images belong to one orbit: by its number in their mission phase, else by their times; `None` if
/// neither is known.
fn is_one_orbit(one: &IndexedImage, other: &IndexedImage) -> Option<bool> {
    let orbits = one.orbit.as_ref().zip(other.orbit.as_ref());
    let by_number = orbits.map(|(one, other)| one == other);
    by_number.or_else(|| {
        let apart = one.utc()? - other.utc()?;
        Some(apart.num_seconds().abs() <= ONE_ORBIT_S)
    })
}
