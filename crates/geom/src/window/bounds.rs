//! The smallest box around regions.

use std::f64::consts::{PI, TAU};

use super::{Bounds, Region};
use areograph_base::units::wrap_pi;

/// West, south, east and north edge of the smallest box that contains all regions, radians: `west` within `-π..π`,
/// `east` not below it and at most a turn beyond.
#[must_use]
pub fn bounds_rad(regions: &[Region]) -> Option<[f64; 4]> {
    let bounds = regions.iter().flat_map(|region| &region.pieces);
    let bounds: Vec<Bounds> = bounds.map(|piece| *piece.bounds()).collect();
    let south = bounds.iter().map(|of| of.south).reduce(f64::min)?;
    let north = bounds.iter().map(|of| of.north).reduce(f64::max)?;
    // The box omits the widest stretch of longitudes that no region touches.
    let mut arcs: Vec<[f64; 2]> = bounds
        .iter()
        .map(|of| {
            let west = wrap_pi(of.west);
            [west, west + (of.east - of.west).min(TAU)]
        })
        .collect();
    arcs.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let first = arcs[0][0];
    let (mut reached, mut widest, mut edges) = (arcs[0][1], 0.0, None);
    for next in arcs[1..]
        .iter()
        .copied()
        .chain([[first + TAU, first + TAU]])
    {
        if next[0] - reached > widest {
            widest = next[0] - reached;
            edges = Some([wrap_pi(next[0]), wrap_pi(reached)]);
        }
        reached = reached.max(next[1]);
    }
    let [west, east] = edges.unwrap_or([-PI, PI]);
    let east = if east < west { east + TAU } else { east };
    Some([west, south, east, north])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::window::WindowShape;
    use areograph_base::units::RADIANS_PER_DEGREE as DEGREE;

    fn box_deg(west: f64, east: f64, south: f64, north: f64) -> Region {
        Region::new(&WindowShape::Box {
            west_rad: west * DEGREE,
            east_rad: east * DEGREE,
            south_rad: south * DEGREE,
            north_rad: north * DEGREE,
        })
    }

    #[test]
    fn bounds_leave_out_the_widest_empty_stretch() {
        let bounds = |regions: &[Region]| {
            bounds_rad(regions).map(|edges| edges.map(|edge| (edge / DEGREE * 1e6).round() / 1e6))
        };
        assert_eq!(bounds(&[]), None);
        let (gusev, isidis) = (
            box_deg(174.0, 176.0, -15.0, -14.0),
            box_deg(87.0, 89.0, 4.0, 5.0),
        );
        let tharsis = box_deg(240.0, 260.0, 0.0, 10.0);
        assert_eq!(
            bounds(std::slice::from_ref(&tharsis)),
            Some([-120.0, 0.0, -100.0, 10.0])
        );
        assert_eq!(
            bounds(&[gusev.clone(), isidis.clone()]),
            Some([87.0, -15.0, 176.0, 5.0])
        );
        assert_eq!(
            bounds(&[tharsis, gusev.clone()]),
            Some([174.0, -15.0, 260.0, 10.0])
        );
        let across = box_deg(350.0, 10.0, 0.0, 20.0);
        assert_eq!(
            bounds(std::slice::from_ref(&across)),
            Some([-10.0, 0.0, 10.0, 20.0])
        );
        assert_eq!(bounds(&[across, gusev]), Some([-10.0, -15.0, 176.0, 20.0]));
        let all = box_deg(0.0, 360.0, 60.0, 90.0);
        assert_eq!(bounds(&[all, isidis]), Some([-180.0, 4.0, 180.0, 90.0]));
    }
}
