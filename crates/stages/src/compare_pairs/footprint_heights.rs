//! Heights of footprints from a pair of images: rays to the places of a footprint, one transferred through tie points,
//! intersect at a height that the altimeter tests.

use serde::{Deserialize, Serialize};

use areograph_base::{
    footprints::Footprints,
    frames::{BodyFixed, Position},
};
use areograph_geom::{
    ellipsoid::{height_m, spherical_to_xyz_m},
    intersection::{IntersectionLimits, intersect},
    misregistration::ImageToImage,
    oriented_camera::OrientedCamera,
    pushbroom::ExteriorOrientation,
};

/// A footprint from the rays of a pair.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FootprintHeight {
    /// Row of the footprint.
    pub row: u32,
    /// Point where the rays meet.
    pub ground: Position<BodyFixed>,
    /// Height of this point above the ellipsoid along the radius, metres.
    pub height_m: f64,
    /// Height of the footprint above the ellipsoid along the radius, metres.
    pub mola_m: f64,
}

impl FootprintHeight {
    /// Height from the images above that from the altimeter, metres.
    #[must_use]
    pub fn above_m(&self) -> f64 {
        self.height_m - self.mola_m
    }
}

/// Heights of the footprints of `rows` that the first image shows at `places`; without those beyond the tie points, and
/// those whose rays do not intersect.
///
/// The transformation represents the ground between tie points as a surface of second order at most: relief makes
/// single heights uncertain, but their median only little.
pub(super) fn footprint_heights<M: ExteriorOrientation>(
    images: [&OrientedCamera<M>; 2],
    fit: &ImageToImage,
    rows: &[(u32, [f64; 2])],
    footprints: &Footprints<BodyFixed>,
) -> Vec<FootprintHeight> {
    let (limits, model) = (
        IntersectionLimits::on(footprints.body),
        footprints.body.model(),
    );
    let height = |(row, first): &(u32, [f64; 2])| {
        let second = fit.second(*first)?;
        let rays = [(images[0], *first), (images[1], second)];
        let rays = rays.map(|(image, [line, sample])| image.ray(line, sample));
        let ground_m = intersect(&rays, &limits).ok()?.ground_m;
        let at = *row as usize;
        let footprint_m = spherical_to_xyz_m(
            footprints.longitude_rad.at(at),
            footprints.latitude_rad.at(at),
            footprints.ground_radius_m(at),
        );
        Some(FootprintHeight {
            row: *row,
            ground: Position::new(ground_m),
            height_m: height_m(model, &ground_m).0,
            mola_m: height_m(model, &footprint_m).0,
        })
    };
    rows.iter().filter_map(height).collect()
}
