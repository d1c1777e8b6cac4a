//! Similarities of the plane, from picture to map.

use super::Place;

/// From picture to map, equation 3: `X = P x − Q y + A`, `Y = P y + Q x + B`, or `Z = turn · z + shift`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Similarity {
    /// `P + iQ`: scale, map units per picture unit, and angle.
    pub turn: Place,
    /// `A + iB`, map units.
    pub shift: Place,
}

impl Similarity {
    /// The identity.
    pub const IDENTITY: Self = Self {
        turn: Place::new(1.0, 0.0),
        shift: Place::new(0.0, 0.0),
    };

    /// The map position of a point in the picture.
    #[must_use]
    pub fn map(&self, place: Place) -> Place {
        self.turn * place + self.shift
    }

    /// Map units per picture unit, `1/μ = √(P² + Q²)`.
    #[must_use]
    pub fn scale(&self) -> f64 {
        self.turn.norm()
    }

    /// Angle from the map's x axis to the picture's on the map, anticlockwise, radians: `θ = atan2(Q, P)`.
    #[must_use]
    pub fn angle_rad(&self) -> f64 {
        self.turn.arg()
    }

    /// The composition of this similarity after `first`.
    #[must_use]
    pub fn after(&self, first: &Self) -> Self {
        Self {
            turn: self.turn * first.turn,
            shift: self.map(first.shift),
        }
    }
}

/// Departure of an orthographic picture from a conformal map beyond a similarity, metres: a floor under all deviations
/// that no adjustment removes.
///
/// * `half_side_m` – half of the picture's side on the ground
/// * `scale_gradient` – change of the map's scale with distance, `|∇ ln k|`, per metre: `tan φ / R` of Mercator's
///   projection, `tan(c/2) / R` of the stereographic one at the angle `c` from its centre
/// * `radius_m` – radius of the sphere
///
/// The first term is at the middle of an edge, the second (an orthographic picture against a conformal azimuthal map
/// about its own centre) at the corner, `√2` times farther out.
#[must_use]
pub fn projection_floor_m(half_side_m: f64, scale_gradient: f64, radius_m: f64) -> f64 {
    let corner_m = half_side_m * std::f64::consts::SQRT_2;
    0.5 * scale_gradient * half_side_m.powi(2) + corner_m.powi(3) / (4.0 * radius_m.powi(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    const RADIUS_M: f64 = 3_396_000.0;

    #[test]
    fn one_after_the_other() {
        let first = Similarity {
            turn: Place::new(0.5, 2.0),
            shift: Place::new(1.0, -1.0),
        };
        let second = Similarity {
            turn: Place::new(-1.0, 0.25),
            shift: Place::new(9.0, 4.0),
        };
        let place = Place::new(2.0, 3.0);
        let expected = second.map(first.map(place));
        assert!((second.after(&first).map(place) - expected).norm() < 1e-14); // rounding
        assert!((Similarity::IDENTITY.after(&first).map(place) - first.map(place)).norm() < 1e-15);
    }

    #[test]
    fn the_floor_of_viking_pictures() {
        let half_m = 12_500.0;
        // 25 km at 22.5° latitude: 9.5 m against Mercator's projection, 0.12 m against an azimuthal one; published
        // digits.
        let mercator = 22.5_f64.to_radians().tan() / RADIUS_M;
        let azimuthal_m = projection_floor_m(half_m, 0.0, RADIUS_M);
        assert!((azimuthal_m - 0.12).abs() < 0.005, "{azimuthal_m}");
        let floor_m = projection_floor_m(half_m, mercator, RADIUS_M) - azimuthal_m;
        assert!((floor_m - 9.5).abs() < 0.05, "{floor_m}");
    }
}
