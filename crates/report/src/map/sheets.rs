//! Division of a site into sheets: windows far apart have separate maps.

use nalgebra::Vector3;

use super::super::outlines::{Outline, images, windows};
use areograph_base::column::Column;
use areograph_geom::ellipsoid::spherical_to_xyz_m;
use areograph_products::SiteProducts;

/// Windows farther apart than this many of their radii have separate maps.
const APART_RADII: f64 = 4.0;

/// Contents of one map.
pub(super) struct Shown {
    pub(super) windows: Vec<Outline>,
    pub(super) images: Vec<Outline>,
    /// Rows of the footprints.
    pub(super) rows: Column<u32>,
}

/// A ring on the sphere: its middle as a direction, and the distance of its points from it, radians.
struct Extent {
    middle: Vector3<f64>,
    radius_rad: f64,
}

impl Extent {
    fn of(outlines: &[&Outline]) -> Self {
        let points = || {
            let rings = outlines.iter().flat_map(|outline| &outline.ring);
            rings.map(|(longitude, latitude)| spherical_to_xyz_m(*longitude, *latitude, 1.0))
        };
        let sum: Vector3<f64> = points().sum();
        let middle = sum.try_normalize(f64::EPSILON).unwrap_or_else(Vector3::x);
        let radius_rad = points()
            .map(|point| point.angle(&middle))
            .fold(0.0, f64::max);
        Self { middle, radius_rad }
    }

    fn is_near(&self, other: &Self) -> bool {
        let apart_rad = self.middle.angle(&other.middle);
        apart_rad <= APART_RADII * (self.radius_rad + other.radius_rad)
    }
}

/// The sheets of a site, in the order of its windows; one without any.
pub(super) fn sheets(site: &SiteProducts) -> Vec<Shown> {
    let rings = windows(site);
    let configured = &site.config.windows;
    let extents: Vec<Extent> = configured
        .iter()
        .map(|window| {
            let own = rings.iter().filter(|ring| ring.name == window.id);
            Extent::of(&own.collect::<Vec<_>>())
        })
        .collect();
    let sheet_of = grouped(&extents);
    let count = sheet_of.iter().max().map_or(1, |last| last + 1);
    let mut sheets: Vec<Shown> = (0..count)
        .map(|_| Shown {
            windows: Vec::new(),
            images: Vec::new(),
            rows: Column::new(),
        })
        .collect();
    for ring in rings {
        let window = configured.iter().position(|window| window.id == ring.name);
        sheets[window.map_or(0, |window| sheet_of[window])]
            .windows
            .push(ring);
    }
    for image in images(site) {
        let own = Extent::of(&[&image]);
        let angles = extents
            .iter()
            .map(|extent| extent.middle.angle(&own.middle));
        let nearest = angles
            .enumerate()
            .min_by(|one, other| one.1.total_cmp(&other.1));
        let sheet = nearest.map_or(0, |(window, _)| sheet_of[window]);
        sheets[sheet].images.push(image);
    }
    for (row, mask) in (0..).zip(&site.footprints.windows) {
        let window = mask.trailing_zeros() as usize;
        let sheet = sheet_of.get(window).copied().unwrap_or_default();
        sheets[sheet].rows.push(row);
    }
    sheets
}

/// The sheet of each window: neighbouring windows share one.
fn grouped(extents: &[Extent]) -> Vec<usize> {
    let mut sheet_of: Vec<usize> = Vec::with_capacity(extents.len());
    for (index, extent) in extents.iter().enumerate() {
        let near: Vec<usize> = (0..index)
            .filter(|earlier| extents[*earlier].is_near(extent))
            .map(|earlier| sheet_of[earlier])
            .collect();
        let next = sheet_of.iter().max().map_or(0, |last| last + 1);
        let sheet = near.iter().copied().min().unwrap_or(next);
        // A window between two sheets joins them.
        for other in &mut sheet_of {
            if near.contains(other) {
                *other = sheet;
            }
        }
        sheet_of.push(sheet);
    }
    let mut kept = sheet_of.clone();
    kept.sort_unstable();
    kept.dedup();
    let place = |sheet: &usize| kept.iter().position(|own| own == sheet).unwrap_or_default();
    sheet_of.iter().map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use areograph_base::units::RADIANS_PER_DEGREE;

    fn at(longitude_deg: f64, radius_deg: f64) -> Extent {
        Extent {
            middle: spherical_to_xyz_m(longitude_deg * RADIANS_PER_DEGREE, 0.0, 1.0),
            radius_rad: radius_deg * RADIANS_PER_DEGREE,
        }
    }

    #[test]
    fn neighbours_share_a_sheet_and_a_window_between_joins_two() {
        assert_eq!(
            grouped(&[at(0.0, 1.0), at(90.0, 1.0), at(359.0, 1.0)]),
            [0, 1, 0]
        );
        assert_eq!(
            grouped(&[at(0.0, 1.0), at(12.0, 1.0), at(6.0, 1.0)]),
            [0, 0, 0]
        );
        assert_eq!(grouped(&[]), Vec::<usize>::new());
    }
}
