//! Pairs of images with common ground.

use super::{Found, RADIUS_M};
use crate::{
    geom::image_outline::{angle_rad, view},
    units::RADIANS_PER_DEGREE,
};

/// Two images of different orbits.
#[derive(Debug)]
pub(super) struct Pair<'a> {
    pub(super) images: [&'a Found; 2],
    /// Share of the smaller outline.
    pub(super) overlap: f64,
    /// Angle between the rays to the spacecraft at one place; where the index tells where it was.
    pub(super) convergence_rad: Option<f64>,
    /// Larger pixel over smaller one.
    pub(super) pixel_ratio: Option<f64>,
    /// Angle between the directions to the Sun at one place.
    pub(super) sun_rad: Option<f64>,
    /// 0 to 1, best pairs first.
    pub(super) score: f64,
}

/// Convergence from which on more is not better, radians.
const CONVERGENCE_RAD: f64 = 20.0 * RADIANS_PER_DEGREE;

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
    // Context images are taken in the same seconds as those of the narrow angle: no base between them.
    let is_same_time = one.image.utc_start.get(..16) == other.image.utc_start.get(..16);
    if overlap <= 0.0 || is_same_time {
        return None;
    }
    // Both look at the middle between their centres.
    let middle_rad = middle([one.centre_rad, other.centre_rad]);
    let ray = |found: &Found| {
        let image = &found.image;
        Some(view(
            middle_rad,
            image.sub_spacecraft_rad?,
            RADIUS_M,
            image.altitude_m?,
        ))
    };
    let convergence_rad = ray(one)
        .zip(ray(other))
        .map(|(one, other)| one.angle(&other));
    let suns = one.image.sub_solar_rad.zip(other.image.sub_solar_rad);
    let sun_rad = suns.map(|(one, other)| angle_rad(one, other));
    let pixels = one.image.pixel_m.zip(other.image.pixel_m);
    let pixel_ratio = pixels.map(|(one, other)| one.max(other) / one.min(other));
    let base = convergence_rad.map_or(1.0, |angle| (angle / CONVERGENCE_RAD).min(1.0));
    let light = sun_rad.map_or(1.0, |angle| (0.5 * angle).cos().powi(2));
    Some(Pair {
        images,
        overlap,
        convergence_rad,
        pixel_ratio,
        sun_rad,
        score: overlap * base * light / pixel_ratio.unwrap_or(1.0),
    })
}

fn middle([one, other]: [[f64; 2]; 2]) -> [f64; 2] {
    let step = crate::units::longitude_step_rad(other[0] - one[0]);
    [one[0] + 0.5 * step, 0.5 * (one[1] + other[1])]
}
