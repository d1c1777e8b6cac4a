//! Windows on the ground as sets of directions from the centre of Mars.

mod bounds;
mod extent;
mod grid;
mod overlap;

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use geo::{BoundingRect, Coord, Intersects, LineString, Polygon};
use serde::{Deserialize, Serialize};

pub use bounds::bounds_rad;
pub use extent::Extent;
pub use grid::WindowGrid;

use areograph_base::units::{longitude_step_rad, wrap_pi, wrap_two_pi};

/// Outline of a window, radians.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WindowShape {
    /// From `west_rad` eastwards to `east_rad`, both `0..2π`; `west > east` crosses 0°. A box over all longitudes has
    /// `west = 0`, `east = 2π`, and contains a pole when it extends to ±π/2.
    Box {
        /// Western edge, radians.
        west_rad: f64,
        /// Eastern edge, radians.
        east_rad: f64,
        /// Southern edge, radians.
        south_rad: f64,
        /// Northern edge, radians.
        north_rad: f64,
    },
    /// GeoJSON polygons; each is an outer ring followed by holes, rings of (longitude, latitude) as written.
    Polygons {
        /// Polygons, rings, vertices: radians.
        polygons: Vec<Vec<Vec<[f64; 2]>>>,
    },
    /// The ground that an image sees, from its times and the kernels; empty until these are applied.
    Image {
        /// Identifier of the image.
        image: String,
        /// Margin of the window beyond its outline, metres.
        margin_m: f64,
    },
}

/// A window prepared for many tests.
#[derive(Debug, Clone, PartialEq)]
pub struct Region {
    pieces: Vec<Piece>,
}

#[derive(Debug, Clone, PartialEq)]
enum Piece {
    Box(Bounds),
    Polygon { outer: Ring, holes: Vec<Ring> },
}

/// Longitudes from `west` eastwards to `east`, which is not below it, and latitudes in between; radians.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Bounds {
    west: f64,
    east: f64,
    south: f64,
    north: f64,
}

/// A closed ring in the plane of longitude and latitude, its longitudes unwrapped.
#[derive(Debug, Clone, PartialEq)]
struct Ring {
    polygon: Polygon<f64>,
    bounds: Bounds,
}

impl Region {
    /// The region of a window's outline.
    ///
    /// Edges of polygons are straight in longitude and latitude (RFC 7946) and go the shorter way round Mars; an edge
    /// along a full turn keeps it. A ring that winds once round Mars is closed along the pole nearer to its vertices. A
    /// ring of fewer than three vertices is empty.
    #[must_use]
    pub fn new(shape: &WindowShape) -> Self {
        let pieces = match shape {
            WindowShape::Box {
                west_rad,
                east_rad,
                south_rad,
                north_rad,
            } => vec![Piece::Box(Bounds {
                west: *west_rad,
                east: if west_rad <= east_rad {
                    *east_rad
                } else {
                    east_rad + TAU
                },
                south: *south_rad,
                north: *north_rad,
            })],
            WindowShape::Polygons { polygons } => polygons
                .iter()
                .filter_map(|rings| {
                    let mut rings = rings.iter();
                    let outer = Ring::new(rings.next()?)?;
                    let holes = rings.filter_map(|ring| Ring::new(ring)).collect();
                    Some(Piece::Polygon { outer, holes })
                })
                .collect(),
            WindowShape::Image { .. } => Vec::new(),
        };
        Self { pieces }
    }

    /// Whether the direction lies inside; longitude in radians of any turn, areocentric latitude in radians.
    ///
    /// The boundary of a box or of an outer ring is inside, the boundary of a hole outside.
    #[must_use]
    pub fn contains(&self, longitude_rad: f64, latitude_rad: f64) -> bool {
        self.pieces.iter().any(|piece| match piece {
            Piece::Box(bounds) => bounds.contain(longitude_rad, latitude_rad),
            Piece::Polygon { outer, holes } => {
                outer.contains(longitude_rad, latitude_rad)
                    && !holes
                        .iter()
                        .any(|hole| hole.contains(longitude_rad, latitude_rad))
            }
        })
    }

    /// A box around each part, radians: longitude from the first edge eastwards to the second, of any turn, then latitude from
    /// the third to the fourth. None for the outline of an image.
    pub fn boxes_rad(&self) -> impl Iterator<Item = [f64; 4]> {
        let bounds = self.pieces.iter().map(Piece::bounds);
        bounds.map(|of| [of.west, of.east, of.south, of.north])
    }

    /// Whether some direction within `margin_rad` (great circle) of this one may lie inside.
    ///
    /// Never false when such a direction exists; may be true when none does.
    #[must_use]
    pub fn may_contain_within(
        &self,
        longitude_rad: f64,
        latitude_rad: f64,
        margin_rad: f64,
    ) -> bool {
        self.may_touch(&Cap::new(longitude_rad, latitude_rad, margin_rad))
    }

    fn may_touch(&self, cap: &Cap) -> bool {
        self.pieces.iter().any(|piece| piece.bounds().reach(cap))
    }
}

impl Piece {
    const fn bounds(&self) -> &Bounds {
        match self {
            Self::Box(bounds) => bounds,
            Self::Polygon { outer, .. } => &outer.bounds,
        }
    }
}

/// The directions within a margin of one, prepared for tests against many windows.
struct Cap {
    longitude_rad: f64,
    south_rad: f64,
    north_rad: f64,
    /// See [`half_width_rad`].
    half_width_rad: Option<f64>,
}

impl Cap {
    fn new(longitude_rad: f64, latitude_rad: f64, margin_rad: f64) -> Self {
        // Rounding of the tests, a nanoradian, is 3 mm on the ground.
        let margin_rad = margin_rad + 1e-9;
        Self {
            longitude_rad,
            south_rad: latitude_rad - margin_rad,
            north_rad: latitude_rad + margin_rad,
            half_width_rad: half_width_rad(latitude_rad, margin_rad),
        }
    }
}

/// Half the width in longitude, radians, of a cap about a direction of this latitude; `None` for a cap that contains a
/// pole.
pub(super) fn half_width_rad(latitude_rad: f64, cap_rad: f64) -> Option<f64> {
    let holds_pole = latitude_rad.abs() + cap_rad >= FRAC_PI_2;
    (!holds_pole).then(|| (cap_rad.sin() / latitude_rad.cos()).min(1.0).asin())
}

impl Bounds {
    fn contain(&self, longitude_rad: f64, latitude_rad: f64) -> bool {
        if !(self.south..=self.north).contains(&latitude_rad) {
            return false;
        }
        // Edges are compared as written, so that points on them are inside to the last bit.
        let longitude_rad = wrap_two_pi(longitude_rad);
        let between = |longitude_rad| (self.west..=self.east).contains(&longitude_rad);
        between(longitude_rad) || between(longitude_rad + TAU)
    }

    /// Whether the cap may touch the bounds.
    fn reach(&self, cap: &Cap) -> bool {
        if cap.north_rad < self.south || cap.south_rad > self.north {
            return false;
        }
        let Some(half_width_rad) = cap.half_width_rad else {
            return true;
        };
        let middle_rad = 0.5 * (self.west + self.east);
        let from_middle_rad = wrap_pi(cap.longitude_rad - middle_rad).abs();
        from_middle_rad <= 0.5 * (self.east - self.west) + half_width_rad + 1e-9
    }
}

impl Ring {
    fn new(vertices: &[[f64; 2]]) -> Option<Self> {
        let finite = vertices.iter().flatten().all(|angle| angle.is_finite());
        if vertices.len() < 3 || !finite {
            return None;
        }
        let mut line: Vec<Coord<f64>> = Vec::with_capacity(vertices.len() + 3);
        let (mut x, mut written) = (vertices[0][0], vertices[0][0]);
        for &[longitude, latitude] in vertices.iter().chain(vertices.first()) {
            x += longitude_step_rad(longitude - written);
            written = longitude;
            line.push(Coord { x, y: latitude });
        }
        let turn = line.last()?.x - line.first()?.x;
        if turn.abs() > PI {
            close_along_pole(&mut line, turn);
        }
        let polygon = Polygon::new(LineString::new(line), Vec::new());
        let rectangle = polygon.bounding_rect()?;
        let bounds = Bounds {
            west: rectangle.min().x,
            east: rectangle.max().x,
            south: rectangle.min().y,
            north: rectangle.max().y,
        };
        Some(Self { polygon, bounds })
    }

    fn contains(&self, longitude_rad: f64, latitude_rad: f64) -> bool {
        let west_rad = self.bounds.west;
        if !(self.bounds.south..=self.bounds.north).contains(&latitude_rad) {
            return false;
        }
        // The copies of the point that can lie within the ring; a point on the seam of a ring round a pole has one at
        // either end.
        let first = west_rad + wrap_two_pi(longitude_rad - west_rad);
        [first - TAU, first, first + TAU].into_iter().any(|x| {
            let point = Coord { x, y: latitude_rad };
            self.polygon.intersects(&point)
        })
    }
}

/// Closes a line that winds once round Mars along the pole nearer to its vertices.
fn close_along_pole(line: &mut Vec<Coord<f64>>, turn: f64) {
    let mean_latitude = line.iter().map(|vertex| vertex.y).sum::<f64>() / line.len() as f64;
    let pole = FRAC_PI_2.copysign(mean_latitude);
    let start = line[0].x;
    // The sum of many steps misses the turn by rounding, which would leave a slit.
    let end = start + TAU.copysign(turn);
    if let Some(last) = line.last_mut() {
        last.x = end;
    }
    line.push(Coord { x: end, y: pole });
    line.push(Coord { x: start, y: pole });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ellipsoid::spherical_to_xyz_m;
    use areograph_base::units::RADIANS_PER_DEGREE as DEGREE;
    use proptest::prelude::*;

    fn box_deg(west: f64, east: f64, south: f64, north: f64) -> Region {
        Region::new(&WindowShape::Box {
            west_rad: west * DEGREE,
            east_rad: east * DEGREE,
            south_rad: south * DEGREE,
            north_rad: north * DEGREE,
        })
    }

    fn polygon_deg(rings: &[&[[f64; 2]]]) -> Region {
        let ring = |ring: &&[[f64; 2]]| ring.iter().map(|v| v.map(|d| d * DEGREE)).collect();
        Region::new(&WindowShape::Polygons {
            polygons: vec![rings.iter().map(ring).collect()],
        })
    }

    fn inside(region: &Region, longitude_deg: f64, latitude_deg: f64) -> bool {
        region.contains(longitude_deg * DEGREE, latitude_deg * DEGREE)
    }

    /// The definition, step by step in degrees.
    fn box_by_hand(west: f64, width: f64, south: f64, north: f64, point: [f64; 2]) -> bool {
        let east_of_west = (point[0] - west).rem_euclid(360.0);
        east_of_west <= width && south <= point[1] && point[1] <= north
    }

    proptest! {
        #[test]
        fn a_box_and_the_polygon_of_its_corners_hold_what_the_definition_says(
            west in 0.0..360.0_f64, width in 0.1..179.0_f64,
            south in -90.0..89.0_f64, share in 0.01..1.0_f64,
            longitude in 0.0..360.0_f64, latitude in -90.0..90.0_f64,
            turns in -2..3_i32, written in -1..2_i32,
        ) {
            let north = south + share * (90.0 - south);
            let away = |a: f64, b: f64| (a - b + 180.0).rem_euclid(360.0) - 180.0;
            // Edges belong to the box by convention; here only points that are off them by more than rounding.
            prop_assume!(away(longitude, west).abs() > 1e-9 && away(longitude, west + width).abs() > 1e-9);
            prop_assume!((latitude - south).abs() > 1e-9 && (latitude - north).abs() > 1e-9);
            let expected = box_by_hand(west, width, south, north, [longitude, latitude]);
            let longitude = longitude + 360.0 * f64::from(turns);
            let region = box_deg(west, (west + width).rem_euclid(360.0), south, north);
            prop_assert_eq!(inside(&region, longitude, latitude), expected);
            let east = west + width + 360.0 * f64::from(written);
            let region = polygon_deg(&[&[[west, south], [east, south], [east, north], [west, north]]]);
            prop_assert_eq!(inside(&region, longitude, latitude), expected);
        }

        #[test]
        fn the_prefilter_never_loses_a_direction(
            west in 0.0..360.0_f64, width in 0.1..170.0_f64,
            south in -90.0..89.0_f64, share in 0.01..1.0_f64,
            along in 0.0..1.0_f64, up in 0.0..1.0_f64,
            margin_deg in 0.0..3.0_f64, distance in 0.0..1.0_f64, azimuth in 0.0..TAU,
        ) {
            let north = south + share * (90.0 - south);
            let (longitude, latitude) = (west + along * width, south + up * (north - south));
            // A frame's middle, `distance` margins away on a great circle.
            let at = spherical_to_xyz_m(longitude * DEGREE, latitude * DEGREE, 1.0);
            let east = spherical_to_xyz_m(longitude * DEGREE + FRAC_PI_2, 0.0, 1.0);
            let towards = azimuth.sin() * east + azimuth.cos() * at.cross(&east);
            let angle_rad = distance * margin_deg * DEGREE;
            let middle = angle_rad.cos() * at + angle_rad.sin() * towards;
            let (middle_longitude, middle_latitude) = (middle.y.atan2(middle.x), middle.z.clamp(-1.0, 1.0).asin());
            let corners = [[west, south], [west + width, south], [west + width, north], [west, north]];
            for region in [
                box_deg(west, (west + width).rem_euclid(360.0), south, north),
                polygon_deg(&[&corners]),
            ] {
                prop_assert!(region.may_contain_within(middle_longitude, middle_latitude, margin_deg * DEGREE));
            }
        }
    }

    #[test]
    fn edges_of_a_box_are_inside() {
        let region = box_deg(350.0, 10.0, -5.0, 5.0);
        for (longitude, latitude) in [(350.0, 0.0), (-10.0, 5.0), (10.0, -5.0), (370.0, 0.0)] {
            assert!(
                inside(&region, longitude, latitude),
                "{longitude} {latitude}"
            );
        }
        assert!(!inside(&region, 10.000_001, 0.0) && !inside(&region, 349.999_999, 0.0));
        let up_to_zero = box_deg(350.0, 360.0, -5.0, 5.0);
        assert!(inside(&up_to_zero, 0.0, 0.0) && inside(&up_to_zero, 360.0, 0.0));
        assert!(!inside(&up_to_zero, 0.000_001, 0.0));
    }

    #[test]
    fn boxes_over_all_longitudes_hold_the_pole() {
        let cap = box_deg(0.0, 360.0, 80.0, 90.0);
        for longitude in [-180.0, -0.000_001, 0.0, 90.0, 359.999_999, 360.0] {
            assert!(inside(&cap, longitude, 90.0) && inside(&cap, longitude, 80.0));
            assert!(!inside(&cap, longitude, 79.999_999));
        }
    }

    #[test]
    fn a_ring_round_mars_holds_the_nearer_pole_whichever_way_it_runs() {
        let mut ring = [[0.0, 80.0], [90.0, 70.0], [180.0, 80.0], [-90.0, 80.0]];
        for _ in 0..2 {
            let north = polygon_deg(&[&ring]);
            let south = polygon_deg(&[&ring.map(|[longitude, latitude]| [longitude, -latitude])]);
            for longitude in [0.0, 45.0, 90.0, 180.0, 270.0, 360.0] {
                assert!(inside(&north, longitude, 90.0) && inside(&south, longitude, -90.0));
                assert!(inside(&north, longitude, 80.001) && !inside(&north, longitude, 69.0));
                assert!(!inside(&north, longitude, -80.0));
            }
            // On the straight line in longitude and latitude between the first two vertices.
            assert!(inside(&north, 45.0, 75.001) && !inside(&north, 45.0, 74.999));
            ring.reverse();
        }
        let cap = polygon_deg(&[&[[-180.0, 60.0], [180.0, 60.0], [180.0, 90.0], [-180.0, 90.0]]]);
        assert!(inside(&cap, 10.0, 75.0) && inside(&cap, 180.0, 75.0) && !inside(&cap, 10.0, 59.0));
    }

    #[test]
    fn holes_are_outside_wherever_their_longitudes_are_written() {
        let outer = [[350.0, -10.0], [10.0, -10.0], [10.0, 10.0], [350.0, 10.0]];
        let hole = [
            [-1.0, -1.0],
            [1.0, -1.0],
            [1.0, 1.0],
            [-1.0, 1.0],
            [-1.0, -1.0],
        ];
        let region = polygon_deg(&[&outer, &hole]);
        assert!(!inside(&region, 0.0, 0.0) && !inside(&region, 360.5, 0.5));
        assert!(inside(&region, 2.0, 0.0) && inside(&region, 355.0, 0.5));
        // A band about the pole: the hole winds round Mars as well.
        let ring = |latitude| [[0.0, latitude], [120.0, latitude], [240.0, latitude]];
        let band = polygon_deg(&[&ring(60.0), &ring(80.0)]);
        for longitude in [0.0, 60.0, 300.0] {
            assert!(inside(&band, longitude, 70.0) && !inside(&band, longitude, 85.0));
        }
    }

    #[test]
    fn the_prefilter_leaves_out_what_is_far() {
        let region = box_deg(10.0, 20.0, 60.0, 61.0);
        let near = |longitude: f64, latitude: f64| {
            region.may_contain_within(longitude * DEGREE, latitude * DEGREE, 0.1 * DEGREE)
        };
        // At 60.5 degrees 0.1 degree of arc is 0.203 degree of longitude.
        assert!(near(9.8, 60.5) && !near(9.79, 60.5) && near(15.0, 61.1) && !near(15.0, 61.11));
    }

    #[test]
    fn rings_that_are_none_hold_nothing() {
        for ring in [&[][..], &[[0.0, 0.0], [1.0, 1.0]], &[[0.0, f64::NAN]; 4]] {
            assert!(!inside(&polygon_deg(&[ring]), 0.0, 0.0));
        }
    }
}
