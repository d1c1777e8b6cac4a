//! Rings on a map: windows and images.

use std::f64::consts::{FRAC_PI_2, TAU};

use super::many::{self, DrawnImage};
use areograph_geom::window::WindowShape;
use areograph_products::SiteProducts;

/// Number of points along the edge of a box window.
const EDGE_POINTS: u32 = 72;

/// A named ring of (longitude, latitude), radians.
pub struct Outline {
    /// Identifier of the window or image.
    pub name: String,
    /// Whether a map has its name.
    pub(super) is_named: bool,
    /// Its corners, and points between them where edges are bent.
    pub ring: Vec<(f64, f64)>,
}

/// Outlines of the images on maps, if their complete edge is on the ground.
pub(super) fn images(site: &SiteProducts) -> Vec<Outline> {
    let outline = |drawn: &DrawnImage| {
        let image = drawn.image;
        let points = image.orientation.outline.as_ref()?.iter();
        Some(Outline {
            name: image.times.id.clone(),
            is_named: drawn.is_named,
            ring: points
                .map(|point| (point.longitude_rad, point.latitude_rad))
                .collect(),
        })
    };
    many::drawn(site).iter().filter_map(outline).collect()
}

/// Rings of the windows; the outline of an image stands for a window that is the view of this image.
#[must_use]
pub fn windows(site: &SiteProducts) -> Vec<Outline> {
    let rings = site.config.windows.iter().flat_map(|window| {
        let rings: Vec<Vec<(f64, f64)>> = match &window.shape {
            WindowShape::Box {
                west_rad,
                east_rad,
                south_rad,
                north_rad,
            } => box_rings(*west_rad, *east_rad, *south_rad, *north_rad),
            WindowShape::Polygons { polygons } => polygons
                .iter()
                .flatten()
                .map(|ring| {
                    ring.iter()
                        .map(|[longitude, latitude]| (*longitude, *latitude))
                        .collect()
                })
                .collect(),
            // The image itself is drawn.
            WindowShape::Image { .. } => Vec::new(),
        };
        rings.into_iter().map(|ring| Outline {
            name: window.id.clone(),
            is_named: true,
            ring,
        })
    });
    rings.collect()
}

/// The edges of a box, bent as the parallels are; around the globe they are two circles.
fn box_rings(west: f64, east: f64, south: f64, north: f64) -> Vec<Vec<(f64, f64)>> {
    let width = if east < west {
        east + TAU - west
    } else {
        east - west
    };
    let shares = (0..=EDGE_POINTS).map(|k| f64::from(k) / f64::from(EDGE_POINTS));
    let parallel = |latitude: f64| -> Vec<(f64, f64)> {
        let shares = shares.clone();
        shares
            .map(|share| (west + share * width, latitude))
            .collect()
    };
    if width > TAU - 1e-9 {
        let circles = [south, north].into_iter();
        // A pole is not a circle.
        let circles = circles.filter(|latitude| latitude.abs() < FRAC_PI_2 - 1e-9);
        return circles.map(parallel).collect();
    }
    let meridian = |longitude: f64| -> Vec<(f64, f64)> {
        let shares = shares.clone();
        shares
            .map(|share| (longitude, south + share * (north - south)))
            .collect()
    };
    let (northern, western) = (
        parallel(north).into_iter().rev(),
        meridian(west).into_iter().rev(),
    );
    let eastern = meridian(west + width).into_iter();
    let ring = parallel(south).into_iter().chain(eastern);
    vec![ring.chain(northern).chain(western).collect()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_across_the_prime_meridian_stays_narrow() {
        let rings = box_rings(6.2, 0.1, -0.1, 0.1);
        let (first, last) = (rings[0][0].0, rings[0][EDGE_POINTS as usize].0);
        assert!(last > first && last - first < 0.2);
    }

    #[test]
    fn a_cap_around_a_pole_has_one_edge() {
        assert_eq!(box_rings(0.0, TAU, 1.4, FRAC_PI_2).len(), 1);
        assert_eq!(box_rings(0.0, TAU, -0.2, 0.2).len(), 2);
    }
}
