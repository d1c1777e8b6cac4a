//! Degrees of maps.

use areograph_base::{body::Body, units::RADIANS_PER_DEGREE};

/// Statement of products beside the CRS code, since no code exists for the frame of the products.
///
/// For Mars, `pck00011.tpc` (IAU 2015, CSPICE N0067) differs from [`MARS_IAU2000`](areograph_base::body::MARS_IAU2000),
/// sampled daily over 1999 to 2001, by −0.00184° to −0.00136° on the equator and by 0.00048° at most between the poles.
pub(super) fn frame(body: Body) -> &'static str {
    &body.names().frame
}

/// Degrees of an angle in radians.
pub(super) fn degrees(angle_rad: f64) -> f64 {
    angle_rad / RADIANS_PER_DEGREE
}

/// East longitude in `-180..180` degrees, as GIS expects it, of one in `0..2π` radians.
pub(super) fn signed_longitude_deg(longitude_rad: f64) -> f64 {
    let east_deg = degrees(longitude_rad);
    if east_deg >= 180.0 {
        east_deg - 360.0
    } else {
        east_deg
    }
}

/// Points of all longitudes surround a pole when all lie poleward of this latitude, degrees; farther from it
/// they are a belt round Mars.
const POLAR_DEG: f64 = 60.0;

/// West, south, east and north of points in degrees; `None` without points.
///
/// `west > east` when the shortest box crosses the antimeridian, as RFC 7946 (5.2) and GeoParquet state. Points
/// that surround a pole have all longitudes and reach to the pole (5.3).
pub(super) fn bounding_box_deg(points: impl Iterator<Item = [f64; 2]> + Clone) -> Option<[f64; 4]> {
    let longitudes = || points.clone().map(|point| point[0]);
    let stretch = widest_stretch(ends_of_cells(longitudes()))?;
    // A stretch as wide as a cell does not lie in one.
    let [west, east] = if stretch[2] >= CELL_DEG {
        [stretch[0], stretch[1]]
    } else {
        let mut each: Vec<f64> = longitudes().collect();
        each.sort_by(f64::total_cmp);
        let [west, east, _] = widest_stretch(each.into_iter())?;
        [west, east]
    };
    let widest = if west > east {
        west - east
    } else {
        west + 360.0 - east
    };
    let nothing = (f64::INFINITY, f64::NEG_INFINITY);
    let (south, north) = points.fold(nothing, |(south, north), point| {
        (south.min(point[1]), north.max(point[1]))
    });
    let surrounded = widest < 180.0;
    Some(if surrounded && south > POLAR_DEG {
        [-180.0, south, 180.0, 90.0]
    } else if surrounded && north < -POLAR_DEG {
        [-180.0, -90.0, 180.0, north]
    } else {
        [west, south, east, north]
    })
}

/// Width of a cell of longitudes, degrees.
const CELL_DEG: f64 = 360.0 / CELLS as f64;
/// Number of cells around the planet.
const CELLS: usize = 1 << 16;

/// The smallest and the largest longitude in each cell, in ascending order.
fn ends_of_cells(longitudes: impl Iterator<Item = f64>) -> impl Iterator<Item = f64> {
    let mut cells = vec![[f64::INFINITY, f64::NEG_INFINITY]; CELLS];
    for east_deg in longitudes {
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "longitudes begin at -180 degrees, and the last cell is the largest"
        )]
        let cell = ((east_deg + 180.0) / CELL_DEG) as usize;
        let ends = &mut cells[cell.min(CELLS - 1)];
        *ends = [ends[0].min(east_deg), ends[1].max(east_deg)];
    }
    let full = cells.into_iter().filter(|ends| ends[0] <= ends[1]);
    full.flatten()
}

/// West and east of the box that leaves out the widest empty stretch of ascending longitudes, and the width of the
/// stretch; the stretch over the antimeridian unless another is wider. `None` without a longitude.
fn widest_stretch(mut longitudes: impl Iterator<Item = f64>) -> Option<[f64; 3]> {
    let first = longitudes.next()?;
    let (mut last, mut inner) = (first, [first, first, 0.0]);
    for east_deg in longitudes {
        if east_deg - last > inner[2] {
            inner = [east_deg, last, east_deg - last];
        }
        last = east_deg;
    }
    let outer = first + 360.0 - last;
    Some(if inner[2] > outer {
        inner
    } else {
        [first, last, outer]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn longitudes_fold_at_the_antimeridian() {
        assert!((signed_longitude_deg(PI) + 180.0).abs() < 1e-12); // rounding of degrees
        assert!((signed_longitude_deg(1.5 * PI) + 90.0).abs() < 1e-12);
        assert!((signed_longitude_deg(0.5 * PI) - 90.0).abs() < 1e-12);
    }

    #[test]
    fn boxes_cross_the_antimeridian_when_that_is_shorter() {
        let across = [[179.5, 1.0], [-179.0, 3.0], [179.9, 2.0]];
        assert_eq!(
            bounding_box_deg(across.into_iter()),
            Some([179.5, 1.0, -179.0, 3.0])
        );
        let greenwich = [[-1.0, -5.0], [2.0, -6.0]];
        assert_eq!(
            bounding_box_deg(greenwich.into_iter()),
            Some([-1.0, -6.0, 2.0, -5.0])
        );
        assert_eq!(bounding_box_deg(std::iter::empty()), None);
    }

    #[test]
    fn cells_of_longitudes_give_the_widest_stretch_of_sorted_ones() {
        // Multiples of an irrational angle: dense ones have no stretch as wide as a cell.
        for (count, part_deg) in [(1, 360.0), (7, 360.0), (1_000, 200.0), (200_000, 360.0)] {
            let longitudes = (1..=count).map(|index| {
                let turns = f64::from(index) * 0.618_033_988_749_894_9;
                turns.fract() * part_deg - 180.0
            });
            let mut sorted: Vec<f64> = longitudes.clone().collect();
            sorted.sort_by(f64::total_cmp);
            let expected = widest_stretch(sorted.into_iter()).unwrap();
            let found = bounding_box_deg(longitudes.map(|east| [east, 0.0])).unwrap();
            let bits = |of: [f64; 2]| of.map(f64::to_bits);
            let found = [found[0], found[2]];
            assert_eq!(bits(found), bits([expected[0], expected[1]]), "{count}");
        }
    }

    #[test]
    fn boxes_round_a_pole_reach_it() {
        let round = |latitude: f64| [-170.0, -50.0, 60.0, 160.0].map(|east| [east, latitude]);
        let north = Some([-180.0, 86.0, 180.0, 90.0]);
        assert_eq!(bounding_box_deg(round(86.0).into_iter()), north);
        let south = Some([-180.0, -90.0, 180.0, -86.0]);
        assert_eq!(bounding_box_deg(round(-86.0).into_iter()), south);
        // A track that passes beside the pole, and a belt.
        let track = [[10.0, 88.0], [100.0, 89.0], [180.0, 87.0]];
        assert_eq!(
            bounding_box_deg(track.into_iter()),
            Some([10.0, 87.0, 180.0, 89.0])
        );
        let belt = Some([-50.0, 5.0, -170.0, 5.0]);
        assert_eq!(bounding_box_deg(round(5.0).into_iter()), belt);
    }
}
