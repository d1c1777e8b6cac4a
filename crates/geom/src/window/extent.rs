//! Whether windows may contain directions of an extent of ground.

use std::f64::consts::TAU;

use super::{Region, half_width_rad};
use areograph_base::units::wrap_two_pi;

/// A box in longitude and latitude, radians, with the margin of the directions that belong to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extent {
    /// Western edge.
    pub west_rad: f64,
    /// Width from west to east, not negative.
    pub width_rad: f64,
    /// Southern edge.
    pub south_rad: f64,
    /// Northern edge.
    pub north_rad: f64,
    /// Maximum great-circle distance from the box of a direction that belongs to it.
    pub reach_rad: f64,
}

/// Rounding of the tests, radians; see [`Region::may_contain_within`].
const ROUNDING_RAD: f64 = 1e-8;

impl Region {
    /// Never false when the region may hold a direction within reach of some direction in the extent.
    #[must_use]
    pub fn meets(&self, extent: &Extent) -> bool {
        let reach_rad = extent.reach_rad + ROUNDING_RAD;
        let farthest_rad = extent.south_rad.abs().max(extent.north_rad.abs());
        let half_width_rad = half_width_rad(farthest_rad, reach_rad);
        self.pieces.iter().any(|piece| {
            let bounds = piece.bounds();
            if extent.north_rad + reach_rad < bounds.south
                || extent.south_rad - reach_rad > bounds.north
            {
                return false;
            }
            let Some(half_width_rad) = half_width_rad else {
                return true;
            };
            let margin_rad = half_width_rad + ROUNDING_RAD;
            let west_rad = extent.west_rad - margin_rad;
            let width_rad = extent.width_rad + 2.0 * margin_rad;
            let ahead_rad = wrap_two_pi(bounds.west - west_rad);
            ahead_rad <= width_rad || ahead_rad + (bounds.east - bounds.west) >= TAU
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::window::WindowShape;
    use areograph_base::units::RADIANS_PER_DEGREE as DEGREE;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_region_near_a_direction_of_an_extent_meets_the_extent(
            west in -360.0..360.0_f64, width in 0.0..200.0_f64,
            south in -90.0..90.0_f64, share in 0.0..1.0_f64,
            [along, up] in [0.0..1.0_f64, 0.0..1.0_f64],
            window_west in 0.0..360.0_f64, window_width in 0.01..300.0_f64,
            window_south in -90.0..89.0_f64, window_share in 0.001..0.3_f64,
            reach in 0.0..2.0_f64,
        ) {
            let north = south + share * (90.0 - south);
            let extent = Extent {
                west_rad: west * DEGREE,
                width_rad: width * DEGREE,
                south_rad: south * DEGREE,
                north_rad: north * DEGREE,
                reach_rad: reach * DEGREE,
            };
            let region = Region::new(&WindowShape::Box {
                west_rad: window_west * DEGREE,
                east_rad: (window_west + window_width).rem_euclid(360.0) * DEGREE,
                south_rad: window_south * DEGREE,
                north_rad: (window_south + window_share * (90.0 - window_south)) * DEGREE,
            });
            let longitude = (west + along * width) * DEGREE;
            let latitude = (south + up * (north - south)) * DEGREE;
            if region.may_contain_within(longitude, latitude, reach * DEGREE) {
                prop_assert!(region.meets(&extent));
            }
        }
    }

    #[test]
    fn what_is_far_does_not_meet() {
        let region = Region::new(&WindowShape::Box {
            west_rad: 350.0 * DEGREE,
            east_rad: 10.0 * DEGREE,
            south_rad: 0.0,
            north_rad: 10.0 * DEGREE,
        });
        let meets = |west: f64, width: f64, south: f64| {
            region.meets(&Extent {
                west_rad: west * DEGREE,
                width_rad: width * DEGREE,
                south_rad: south * DEGREE,
                north_rad: (south + 5.0) * DEGREE,
                reach_rad: 0.1 * DEGREE,
            })
        };
        assert!(meets(11.0, 340.0, 0.0) && !meets(11.0, 338.0, 0.0));
        assert!(meets(355.0, 1.0, 10.05) && !meets(355.0, 1.0, 10.2) && meets(-5.0, 1.0, -5.05));
    }
}
