//! Pairs of images with common ground.

use super::{Found, RADIUS_M};
use crate::{
    geom::image_outline::{Sight, angle_rad, convergence_rad},
    pds::image_index::IndexedImage,
    units::RADIANS_PER_DEGREE,
};

/// Two images of different orbits.
#[derive(Debug)]
pub(super) struct Pair<'a> {
    pub(super) images: [&'a Found; 2],
    /// Share of the smaller outline.
    pub(super) overlap: f64,
    /// Whether index or times determine that they belong to different orbits.
    pub(super) is_known_apart: bool,
    /// Angle between the rays to the spacecraft, see [`convergence_rad`]; `None` if the index lacks a spacecraft
    /// position.
    pub(super) convergence_rad: Option<f64>,
    /// Larger pixel over smaller one.
    pub(super) pixel_ratio: Option<f64>,
    /// Angle between the directions to the Sun at one place.
    pub(super) sun_rad: Option<f64>,
    /// 0 to 1, best pairs first.
    pub(super) score: f64,
}

/// Convergence beyond which the score does not increase, radians.
const CONVERGENCE_RAD: f64 = 20.0 * RADIANS_PER_DEGREE;

/// Images within this time belong to one orbit, seconds; an orbit of the mapping mission takes 118 minutes.
const ONE_ORBIT_S: i64 = 1_800;

/// All pairs, the best first.
pub(super) fn pairs(found: &[Found]) -> Vec<Pair<'_>> {
    let all = found.iter().enumerate().flat_map(|(number, one)| {
        let others = found[number + 1..].iter();
        others.filter_map(move |other| pair([one, other]))
    });
    let mut pairs: Vec<Pair<'_>> = all.collect();
    pairs.sort_by(|a, b| b.score.total_cmp(&a.score));
    pairs
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
