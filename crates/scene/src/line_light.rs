//! Light on the ground that a line of a stereo camera sees.

use nalgebra::Vector3;

use super::{
    pushbroom_pair::{Orbit, StereoLine},
    terrain::Terrain,
};
use areograph_geom::ellipsoid::local_axes;

/// Towards the Sun from the middle of the ground: east, north and up.
const SUN: [f64; 3] = [-0.75, 0.25, 0.61];
/// The Sun of a scene with shadows: 21° above the horizon.
const LOW_SUN: [f64; 3] = [-0.85, 0.35, 0.36];
/// Part of the light that comes from the sky and not from the Sun: a choice.
const SKY: f64 = 0.1;
/// Weight of the lunar part of the reflection, the rest of which follows Lambert: a choice near those of `McEwen` 1991 for these angles.
const LUNAR: f64 = 0.55;
/// Distances towards the Sun at which the ground may cast a shadow, metres: the finest relief has 25 m.
const CASTS_M: [f64; 5] = [25.0, 50.0, 100.0, 200.0, 400.0];

/// Illumination of a line while it is exposed.
pub(super) enum Light {
    /// The same Sun for all lines, and reflection after Lambert.
    Steady {
        /// Towards the Sun, Mars-fixed.
        sun: Vector3<f64>,
    },
    /// Sun and reflection of the line's own time and look direction, shadows, and light from the sky.
    OfLine {
        /// Towards the Sun, Mars-fixed.
        sun: Vector3<f64>,
        /// The camera, Mars-fixed metres.
        camera_m: Vector3<f64>,
    },
}

impl Light {
    pub(super) fn steady(orbit: &Orbit) -> Self {
        Self::Steady {
            sun: sun(orbit, SUN),
        }
    }

    /// * `camera_m` – the camera while it exposes `at_line`, Mars-fixed
    pub(super) fn of_line(
        orbit: &Orbit,
        line: &StereoLine,
        at_line: f64,
        camera_m: Vector3<f64>,
    ) -> Self {
        // The Sun stands still while Mars rotates.
        let [then, now] = [orbit.start_et_s, orbit.exposed_s(line, at_line)].map(Orbit::to_mars);
        Self::OfLine {
            sun: now * then.tr_mul(&sun(orbit, LOW_SUN)),
            camera_m,
        }
    }

    /// Brightness of a ground point relative to that of level ground, seen from above.
    ///
    /// * `normal` – of the ground, unit vector upwards
    pub(super) fn on(
        &self,
        terrain: &Terrain,
        ground_m: &Vector3<f64>,
        normal: &Vector3<f64>,
    ) -> f64 {
        let up = ground_m.normalize();
        match self {
            Self::Steady { sun } => normal.dot(sun).max(0.0) / sun.dot(&up),
            Self::OfLine { sun, camera_m } => {
                let to_camera = (camera_m - ground_m).normalize();
                let direct = if normal.dot(sun) <= 0.0 || is_in_shadow(terrain, ground_m, sun) {
                    0.0
                } else {
                    reflected(normal.dot(sun), normal.dot(&to_camera))
                        / reflected(sun.dot(&up), 1.0)
                };
                SKY * normal.dot(&up) + (1.0 - SKY) * direct
            }
        }
    }
}

/// Reflection by the cosines of incidence and emission.
fn reflected(incidence: f64, emission: f64) -> f64 {
    let lunar = 2.0 * incidence / (incidence + emission.max(0.0));
    LUNAR * lunar + (1.0 - LUNAR) * incidence
}

fn is_in_shadow(terrain: &Terrain, ground_m: &Vector3<f64>, sun: &Vector3<f64>) -> bool {
    CASTS_M.iter().any(|away_m| {
        let place_m = ground_m + *away_m * sun;
        terrain.radius_m(&place_m.normalize()) > place_m.norm()
    })
}

fn sun(orbit: &Orbit, direction: [f64; 3]) -> Vector3<f64> {
    let middle = orbit.ground(0.5, 0.0);
    local_axes(&middle)
        .tr_mul(&Vector3::from(direction))
        .normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error_sources::{Relief, Roughness};

    #[test]
    fn level_ground_from_above_has_the_mean_brightness_and_steep_ground_a_shadow() {
        let place = Vector3::new(1.0, 0.0, 0.0);
        let relief = Relief::SelfAffine(Roughness::Rough);
        let terrain = Terrain::new(3, &[place], relief);
        let ground_m = place * terrain.radius_m(&place);
        let high = Light::OfLine {
            sun: place,
            camera_m: 2.0 * ground_m,
        };
        assert!((high.on(&terrain, &ground_m, &place) - 1.0).abs() < 1e-9);
        // Below the horizon of the place: only the sky.
        let low = Light::OfLine {
            sun: Vector3::new(-0.05, 1.0, 0.0).normalize(),
            camera_m: 2.0 * ground_m,
        };
        assert!((low.on(&terrain, &ground_m, &place) - SKY).abs() < 1e-9);
        // Some places on rough ground are in the shadow of a Sun 21° high, and most are not.
        let sun = Vector3::new(0.36, 0.9, 0.25).normalize();
        let places = (0..4_000).map(|at| {
            let aside = f64::from(at) * 5e-6;
            let place = Vector3::new(1.0, aside * 0.3, aside).normalize();
            place * terrain.radius_m(&place)
        });
        let dark = places.filter(|ground_m| is_in_shadow(&terrain, ground_m, &sun));
        let dark = dark.count();
        assert!((40..1_000).contains(&dark), "{dark}");
    }

    #[test]
    fn ground_is_brighter_towards_the_look_direction_that_it_faces() {
        // Emission under 0° and 45°: the lunar part grows as the ground is seen from aside.
        assert!(reflected(0.36, 0.7) > reflected(0.36, 1.0));
    }
}
