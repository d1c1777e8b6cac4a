//! Positions of footprints in an image, before the adjustment and after it.

use std::collections::BTreeMap;

use crate::SiteProducts;
use areograph_stages::register::{ImageRegistration, RegisteredPoints};

/// A footprint in an image: line and sample, 0 at the outer edge of the first one.
#[derive(Debug, Clone, Copy)]
pub(super) struct MarkedFootprint {
    /// Index of the profile.
    pub(super) profile: usize,
    /// Number of the shot in the profile, from 1.
    pub(super) number: usize,
    /// Row of the footprint.
    pub(super) row: u32,
    /// With the orientation from the kernels.
    pub(super) before: Option<[f64; 2]>,
    /// With the adjusted one.
    pub(super) after: Option<[f64; 2]>,
}

/// The footprints that the image shows with one of the orientations, by profile and number.
pub(super) fn footprints(site: &SiteProducts, image: usize) -> Vec<MarkedFootprint> {
    let adjusted = site
        .adjustment()
        .and_then(|(_, adjustment)| adjustment.images.get(image));
    let before = places(site.images[image].registration);
    let after = adjusted.map_or_else(BTreeMap::new, |image| places(image.registration));
    let mut footprints = Vec::new();
    for (index, profile) in site.profiles.iter().enumerate() {
        for (number, row) in (1..).zip(&profile.rows) {
            let key = (u32::try_from(index).unwrap_or(u32::MAX), *row);
            let [before, after] = [&before, &after].map(|places| places.get(&key));
            if [before, after].iter().flatten().any(|place| place.1) {
                footprints.push(MarkedFootprint {
                    profile: index,
                    number,
                    row: *row,
                    before: before.map(|place| place.0),
                    after: after.map(|place| place.0),
                });
            }
        }
    }
    footprints
}

/// Line, sample, and whether the image shows the place, by profile and row.
fn places(registration: &ImageRegistration) -> BTreeMap<(u32, u32), ([f64; 2], bool)> {
    let points: &RegisteredPoints = &registration.points;
    let all = 0..points.len();
    all.map(|at| {
        let key = (points.profile.at(at), points.row.at(at));
        (
            key,
            (
                [points.line.at(at), points.sample.at(at)],
                points.inside.at(at),
            ),
        )
    })
    .collect()
}
