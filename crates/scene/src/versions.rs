//! Three rival orbits of the same flight: the true one and two with smooth errors.

use nalgebra::Vector3;

use super::{
    orbit::{Orbit, OrbitState},
    random::Random,
};
use areograph_base::time::Et;
use areograph_geom::orbit_axes::radial_along_cross;

/// Families of orbit solutions, named as in the archive.
pub(super) const FAMILIES: [&str; 3] = ["nav", "gsfc", "ipng"];

/// One family's orbit of one arc.
#[derive(Debug, Clone)]
pub(super) struct Version {
    /// Family.
    pub family: &'static str,
    /// Middle of the arc.
    middle: Et,
    /// Radial, along-track and cross-track difference from the truth at the middle, metres.
    pub offset_m: Vector3<f64>,
}

impl Version {
    /// The orbit of `family` on the day of `image`; `gsfc`, the orbit of the PEDR files, is the truth.
    ///
    /// Differences stay below 50 m and are mostly across the track.
    pub(super) fn new(family: &'static str, image: &str, seed: u64, middle: Et) -> Self {
        let mut random = Random::new(seed, &format!("{family} {image}"));
        // Largest radial and along-track difference; least and largest across the track.
        let [radial_m, along_m, least_m, most_m] = match family {
            "nav" => [2.0, 6.0, 6.0, 18.0],
            "ipng" => [3.0, 10.0, 20.0, 40.0],
            _ => [0.0; 4],
        };
        let side = if random.between(0.0, 1.0) < 0.5 {
            -1.0
        } else {
            1.0
        };
        let offset_m = Vector3::new(
            random.between(-radial_m, radial_m),
            random.between(-along_m, along_m),
            side * random.between(least_m, most_m),
        );
        Self {
            family,
            middle,
            offset_m,
        }
    }

    /// Position of this version at `et`, J2000, metres.
    pub(super) fn position_m(&self, orbit: &Orbit, et: Et) -> Vector3<f64> {
        let state = orbit.state(et);
        if self.offset_m.norm_squared() <= 0.0 {
            return state.position_m;
        }
        let axes = radial_along_cross(&state.position_m, &state.velocity_m_s);
        state.position_m + axes * self.radial_along_cross_m(et)
    }

    /// This version minus the truth at `et` along the axes of the true orbit, metres.
    pub(super) fn radial_along_cross_m(&self, et: Et) -> Vector3<f64> {
        // A tenth of the difference varies with the revolution.
        let slow = 1.0 + 0.1 * (Orbit::mean_motion_rad_s() * et.since(self.middle)).sin();
        slow * self.offset_m
    }

    /// State of this version at `et`; the difference from the true velocity is a central difference, accurate to 1e-8
    /// m/s.
    pub(super) fn state(&self, orbit: &Orbit, et: Et) -> OrbitState {
        const STEP_S: f64 = 1.0;
        let truth = orbit.state(et);
        let off = |et: Et| self.position_m(orbit, et) - orbit.state(et).position_m;
        let drift = (off(et.plus(STEP_S)) - off(et.plus(-STEP_S))) / (2.0 * STEP_S);
        OrbitState {
            position_m: self.position_m(orbit, et),
            velocity_m_s: truth.velocity_m_s + drift,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_are_apart_by_less_than_50_m_mostly_across_the_track() {
        let middle = Et::from_seconds(3.9e7);
        let orbit = Orbit::new(middle, 0.4, 1.3);
        for seed in 0..20 {
            for family in FAMILIES {
                let version = Version::new(family, "E02-00665", seed, middle);
                let off_m = (version.position_m(&orbit, middle.plus(1_000.0))
                    - orbit.state(middle.plus(1_000.0)).position_m)
                    .norm();
                assert!(off_m < 50.0, "{family} {off_m}");
                assert_eq!(family == "gsfc", off_m <= 0.0, "{family} {off_m}");
                assert!(version.offset_m.z.abs() >= 0.5 * version.offset_m.norm());
            }
        }
    }
}
