//! Rings of longitude and latitude: their longitudes in one stretch, round a pole, and cut at the antimeridian.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::convex::{area, clipped};
use areograph_base::units::wrap_pi;

/// The points of a ring, each the shorter way in longitude from the point before it, the first from `near_rad`.
#[must_use]
pub fn in_one_stretch(near_rad: f64, ring_rad: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut before_rad = near_rad;
    let places = ring_rad.iter().map(|[longitude, latitude]| {
        before_rad += wrap_pi(longitude - before_rad);
        [before_rad, *latitude]
    });
    places.collect()
}

/// Total change of longitude along a closed ring: 0, or a turn of either sign where it goes round a pole.
fn turn_rad(ring_rad: &[[f64; 2]]) -> f64 {
    let next = ring_rad.iter().cycle().skip(1);
    let steps = ring_rad
        .iter()
        .zip(next)
        .map(|(from, to)| wrap_pi(to[0] - from[0]));
    steps.sum()
}

/// Whether a ring goes round a pole.
#[must_use]
pub fn goes_round_pole(ring_rad: &[[f64; 2]]) -> bool {
    turn_rad(ring_rad).abs() > PI
}

/// A ring as closed rings within -π..π, counterclockwise: cut at the antimeridian, and closed along the nearer pole
/// where it goes round one (RFC 7946, 3.1.6 and 3.1.9). A ring wider than half a turn is cut at the prime meridian too,
/// since not every reader accepts a ring as wide as Mars. Edges are straight in longitude and latitude.
#[must_use]
pub fn cut_at_antimeridian(ring_rad: &[[f64; 2]]) -> Vec<Vec<[f64; 2]>> {
    let Some(first) = ring_rad.first() else {
        return Vec::new();
    };
    let mut ring = in_one_stretch(wrap_pi(first[0]), ring_rad);
    if goes_round_pole(ring_rad) {
        let latitudes_rad: f64 = ring.iter().map(|place| place[1]).sum();
        let pole_rad = FRAC_PI_2.copysign(latitudes_rad);
        let turn_rad = TAU.copysign(turn_rad(ring_rad));
        let start = ring[0];
        ring.push([start[0] + turn_rad, start[1]]);
        ring.push([start[0] + turn_rad, pole_rad]);
        ring.push([start[0], pole_rad]);
    }
    if area(&ring) < 0.0 {
        ring.reverse();
    }
    let longitudes = ring.iter().map(|place| place[0]);
    let (west, east) = longitudes.fold((f64::INFINITY, f64::NEG_INFINITY), |(west, east), x| {
        (west.min(x), east.max(x))
    });
    // From a point within -π..π on, a ring extends no farther than a turn.
    let strips: Vec<(i32, i32)> = if east - west > PI {
        [-3, -2, -1, 0, 1, 2].map(|half| (half, half + 1)).to_vec()
    } else {
        vec![(-3, -1), (-1, 1), (1, 3)]
    };
    let pieces = strips.into_iter().map(|(west, east)| {
        let turns_rad = TAU * f64::from((west + 1).div_euclid(2));
        let [west, east] = [west, east].map(|half| PI * f64::from(half));
        let strip = [
            [west, -FRAC_PI_2],
            [east, -FRAC_PI_2],
            [east, FRAC_PI_2],
            [west, FRAC_PI_2],
        ];
        let mut piece = clipped(ring.clone(), &strip);
        for place in &mut piece {
            place[0] -= turns_rad;
        }
        piece.extend(piece.first().copied());
        piece
    });
    pieces.filter(|piece| area(piece) > 0.0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::window::{Region, WindowShape};
    use areograph_base::units::RADIANS_PER_DEGREE as DEGREE;

    fn radians(ring_deg: &[[f64; 2]]) -> Vec<[f64; 2]> {
        ring_deg
            .iter()
            .map(|place| place.map(|angle| angle * DEGREE))
            .collect()
    }

    #[test]
    fn cut_rings_hold_what_the_ring_holds() {
        for (ring, pieces) in [
            (
                &[[349.0, 1.0], [351.0, 1.0], [351.0, 3.0], [349.0, 3.0]][..],
                1,
            ),
            (
                &[[179.0, 3.0], [179.5, 1.0], [-178.0, 1.0], [-178.5, 3.0]],
                2,
            ),
            (&[[181.0, 3.0], [180.5, 1.0], [178.0, 1.0], [178.5, 3.0]], 2),
            // Round the poles, either way.
            (
                &[[10.0, 82.0], [100.0, 84.0], [190.0, 81.0], [280.0, 85.0]],
                3,
            ),
            (
                &[
                    [280.0, -85.0],
                    [190.0, -81.0],
                    [100.0, -84.0],
                    [10.0, -82.0],
                ],
                3,
            ),
        ] {
            let ring = radians(ring);
            let cut = cut_at_antimeridian(&ring);
            assert!(cut.len() <= pieces, "{cut:?}");
            for place in cut.iter().flatten() {
                // Rounding of a turn.
                assert!(place[0].abs() <= PI + 1e-12 && place[1].abs() <= FRAC_PI_2);
            }
            for closed in &cut {
                assert!(closed.first() == closed.last() && area(closed) > 0.0);
            }
            let region = |rings: Vec<Vec<[f64; 2]>>| {
                let polygons = rings.into_iter().map(|ring| vec![ring]).collect();
                Region::new(&WindowShape::Polygons { polygons })
            };
            let (whole, cut) = (region(vec![ring]), region(cut));
            let mut inside = 0;
            for step in 0..7200 {
                for latitude in [-88.1, -83.3, -80.2, 1.7, 2.3, 80.2, 83.3, 88.1] {
                    let longitude = (f64::from(step) * 0.05 + 0.013) * DEGREE;
                    let is_in = whole.contains(longitude, latitude * DEGREE);
                    assert_eq!(cut.contains(longitude, latitude * DEGREE), is_in);
                    inside += u32::from(is_in);
                }
            }
            assert!(inside > 10);
        }
    }

    #[test]
    fn stretches_follow_the_ring() {
        let ring = radians(&[[350.0, 88.0], [80.0, 86.0], [100.0, 86.0], [140.0, 88.0]]);
        let stretch = in_one_stretch(0.0, &ring);
        let longitudes: Vec<f64> = stretch
            .iter()
            .map(|place| (place[0] / DEGREE).round())
            .collect();
        assert_eq!(longitudes, [-10.0, 80.0, 100.0, 140.0]);
        assert!(!goes_round_pole(&ring));
        assert!(goes_round_pole(&radians(&[
            [0.0, 80.0],
            [120.0, 80.0],
            [240.0, 80.0]
        ])));
        assert_eq!(cut_at_antimeridian(&[]), Vec::<Vec<[f64; 2]>>::new());
    }
}
