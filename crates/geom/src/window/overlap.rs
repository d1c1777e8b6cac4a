//! Whether two regions share ground.

use std::f64::consts::TAU;

use geo::{Coord, Intersects as _, Polygon, Rect, Translate as _};

use super::{Piece, Region};

impl Region {
    /// Whether some direction lies in both; edges are straight in longitude and latitude, as for [`Region::contains`].
    #[must_use]
    pub fn intersects(&self, other: &Self) -> bool {
        let others: Vec<Polygon<f64>> = other.pieces.iter().map(Piece::polygon).collect();
        self.pieces.iter().map(Piece::polygon).any(|piece| {
            // Longitudes of both are unwrapped from their written values, within two turns.
            let copies = (-3..=3).map(|turns| piece.translate(f64::from(turns) * TAU, 0.0));
            copies
                .into_iter()
                .any(|copy| others.iter().any(|other| copy.intersects(other)))
        })
    }
}

impl Piece {
    fn polygon(&self) -> Polygon<f64> {
        match self {
            Self::Box(bounds) => {
                let corner = |x, y| Coord { x, y };
                let [least, most] = [
                    corner(bounds.west, bounds.south),
                    corner(bounds.east, bounds.north),
                ];
                Rect::new(least, most).to_polygon()
            }
            Self::Polygon { outer, holes } => {
                let holes = holes.iter().map(|hole| hole.polygon.exterior().clone());
                Polygon::new(outer.polygon.exterior().clone(), holes.collect())
            }
        }
    }
}
