//! Synthetic relief: an ellipsoid with swells, craters, and small hills or rough ground around the sites, reproducible
//! by its seed.
//!
//! All terms are functions of the direction in three dimensions, so that there is no seam in longitude and no
//! singularity at the poles. One radius costs about 25 sines and the craters of one grid cell, well under a
//! microsecond; on rough ground three quarters of one.

use std::collections::HashMap;

use nalgebra::Vector3;

use areograph_base::body::MARS_IAU2000;

use super::{
    error_sources::Relief,
    random::Random,
    roughness::{Bowl, RoughPatch},
};

/// Radius of the sphere on which lengths along the ground are counted, metres.
pub(super) const REFERENCE_RADIUS_M: f64 = 3_390_000.0;
/// Edge of a cell of the crater grid, metres; no smaller than the extent of the largest crater.
const CELL_M: f64 = 130_000.0;
/// Large craters are kept this far from the sites, metres beyond their extent.
const SITE_CLEARANCE_M: f64 = 60_000.0;

/// A plane wave through space, seen where it cuts the surface.
#[derive(Debug)]
struct Wave {
    vector_per_m: Vector3<f64>,
    phase_rad: f64,
    height_m: f64,
}

/// A bowl and its position.
#[derive(Debug)]
struct Crater {
    centre_m: Vector3<f64>,
    bowl: Bowl,
}

/// The shape of the synthetic Mars, in IAU 2000 body-fixed components.
#[derive(Debug)]
pub(super) struct Terrain {
    areoid: Vec<Wave>,
    relief: Vec<Wave>,
    craters: Vec<Crater>,
    cells: HashMap<[i32; 3], Vec<usize>>,
    rough: Vec<RoughPatch>,
}

impl Terrain {
    /// The terrain of `seed`; around `sites` (directions) there are no large craters, and the ground is `near_sites`.
    pub(super) fn new(seed: u64, sites: &[Vector3<f64>], near_sites: Relief) -> Self {
        let mut random = Random::new(seed, "terrain");
        // Number, wavelengths and heights: swells of kilometres, plains, hills.
        let areoid = waves(&mut random, 4, [3.0e6, 9.0e6], |_| 40.0);
        let mut relief = waves(&mut random, 5, [4.0e6, 1.2e7], |_| 1_100.0);
        relief.extend(waves(&mut random, 8, [1.5e5, 6.0e5], |length_m| {
            3e-4 * length_m
        }));
        let hills = waves(&mut random, 8, [4.0e3, 3.0e4], |length_m| 7e-4 * length_m);
        let is_gentle = near_sites == Relief::Gentle;
        if is_gentle {
            relief.extend(hills);
        }

        let mut craters = Vec::new();
        while craters.len() < 1_500 {
            let centre_m = REFERENCE_RADIUS_M * random.direction();
            let radius_m = random.between_log(4_000.0, 50_000.0);
            let clear = sites.iter().all(|site| {
                (REFERENCE_RADIUS_M * site - centre_m).norm()
                    > Bowl::REACH * radius_m + SITE_CLEARANCE_M
            });
            if clear {
                let depth_m = 0.08 * radius_m;
                craters.push(Crater {
                    centre_m,
                    bowl: Bowl { radius_m, depth_m },
                });
            }
        }
        for site in sites.iter().filter(|_| is_gentle) {
            for _ in 0..40 {
                let offset = 0.012 * random.between(0.0, 1.0).sqrt() * random.direction();
                let radius_m = random.between_log(500.0, 2_000.0);
                let depth_m = 0.06 * radius_m;
                craters.push(Crater {
                    centre_m: REFERENCE_RADIUS_M * (site + offset).normalize(),
                    bowl: Bowl { radius_m, depth_m },
                });
            }
        }
        let cells = grid(&craters);
        let rough = match near_sites {
            Relief::Gentle => Vec::new(),
            Relief::SelfAffine(roughness) => sites
                .iter()
                .map(|site| RoughPatch::new(seed, site, roughness))
                .collect(),
        };
        Self {
            areoid,
            relief,
            craters,
            cells,
            rough,
        }
    }

    /// Radius of the areoid in a `direction` of unit length, metres.
    pub(super) fn areoid_radius_m(&self, direction: &Vector3<f64>) -> f64 {
        ellipsoid_radius_m(direction) + height_m(&self.areoid, &(REFERENCE_RADIUS_M * direction))
    }

    /// Radius of the ground in a `direction` of unit length, metres.
    pub(super) fn radius_m(&self, direction: &Vector3<f64>) -> f64 {
        let place_m = REFERENCE_RADIUS_M * direction;
        let bowls_m: f64 = self
            .cells
            .get(&cell(&place_m))
            .into_iter()
            .flatten()
            .map(|&index| self.craters[index].height_m(&place_m))
            .sum();
        let smooth_m = self.areoid_radius_m(direction) + height_m(&self.relief, &place_m) + bowls_m;
        smooth_m + self.roughness_m(&place_m).unwrap_or(0.0)
    }

    /// Contribution of the rough ground near a site, metres; `None` elsewhere.
    fn roughness_m(&self, place_m: &Vector3<f64>) -> Option<f64> {
        self.rough.iter().find_map(|patch| patch.height_m(place_m))
    }

    /// Excess of the mean range over a round spot against the range along the beam's axis, metres; 0 on smooth ground.
    ///
    /// * `ground_m` – intersection of the axis with the ground
    /// * `direction` – of the beam, unit length
    /// * `diameter_m` – of the spot, in the plane across the beam
    pub(super) fn spot_farther_m(
        &self,
        ground_m: &Vector3<f64>,
        direction: &Vector3<f64>,
        diameter_m: f64,
    ) -> f64 {
        /// Points on each of two circles that represent equal areas, and radii of the circles.
        const POINTS: u32 = 6;
        const CIRCLES: [f64; 2] = [0.5, 0.866_025_403_784_438_6];
        let up = ground_m.normalize();
        if self.roughness_m(&(REFERENCE_RADIUS_M * up)).is_none() {
            return 0.0;
        }
        let side = direction.cross(&Vector3::z()).normalize();
        let other = direction.cross(&side);
        let mut above_m = 0.0;
        for circle in CIRCLES {
            for point in 0..POINTS {
                let angle_rad = std::f64::consts::TAU * f64::from(point) / f64::from(POINTS);
                let (sin, cos) = angle_rad.sin_cos();
                let place_m = ground_m + 0.5 * diameter_m * circle * (cos * side + sin * other);
                above_m += place_m.norm() - self.radius_m(&place_m.normalize());
            }
        }
        let mean_m = above_m / f64::from(2 * POINTS);
        mean_m / -up.dot(direction)
    }

    /// Distance from `origin_m` along `direction` (unit length) to the ground, metres; `None` when the
    /// beam misses Mars.
    ///
    /// # Accuracy
    /// 0.01 mm. Each step corrects the height error as if the ground were level, so the error shrinks by
    /// the product of slope and tangent of the incidence, below 0.2 for looks up to 30°.
    pub(super) fn range_m(&self, origin_m: &Vector3<f64>, direction: &Vector3<f64>) -> Option<f64> {
        let sphere_b = origin_m.dot(direction);
        let sphere_c = origin_m.norm_squared() - REFERENCE_RADIUS_M * REFERENCE_RADIUS_M;
        let discriminant = sphere_b * sphere_b - sphere_c;
        if !(discriminant > 0.0 && sphere_b < 0.0) {
            return None;
        }
        let start_m = -sphere_b - discriminant.sqrt();
        self.range_near_m(origin_m, direction, start_m, 1e-5)
    }

    /// The range by steps from `range_m`, the last of which corrects a height error below `tolerance_m`.
    pub(super) fn range_near_m(
        &self,
        origin_m: &Vector3<f64>,
        direction: &Vector3<f64>,
        mut range_m: f64,
        tolerance_m: f64,
    ) -> Option<f64> {
        for _ in 0..60 {
            let place_m = origin_m + range_m * direction;
            let radius_m = place_m.norm();
            let up = place_m / radius_m;
            let height_m = radius_m - self.radius_m(&up);
            range_m += height_m / -up.dot(direction);
            if height_m.abs() < tolerance_m {
                return Some(range_m);
            }
        }
        None
    }
}

impl Crater {
    fn height_m(&self, place_m: &Vector3<f64>) -> f64 {
        self.bowl.height_m((place_m - self.centre_m).norm())
    }
}

fn waves(
    random: &mut Random,
    count: usize,
    [shortest_m, longest_m]: [f64; 2],
    height_m: impl Fn(f64) -> f64,
) -> Vec<Wave> {
    (0..count)
        .map(|_| {
            let length_m = random.between_log(shortest_m, longest_m);
            Wave {
                vector_per_m: std::f64::consts::TAU / length_m * random.direction(),
                phase_rad: random.between(0.0, std::f64::consts::TAU),
                height_m: height_m(length_m),
            }
        })
        .collect()
}

fn height_m(waves: &[Wave], place_m: &Vector3<f64>) -> f64 {
    waves
        .iter()
        .map(|wave| wave.height_m * (wave.vector_per_m.dot(place_m) + wave.phase_rad).sin())
        .sum()
}

fn ellipsoid_radius_m(direction: &Vector3<f64>) -> f64 {
    let equatorial = direction.x.hypot(direction.y) / MARS_IAU2000.equatorial_radius_m;
    let polar = direction.z / MARS_IAU2000.polar_radius_m;
    1.0 / equatorial.hypot(polar)
}

#[allow(
    clippy::cast_possible_truncation,
    reason = "Mars is about fifty cells wide"
)]
fn cell(place_m: &Vector3<f64>) -> [i32; 3] {
    [place_m.x, place_m.y, place_m.z].map(|component| (component / CELL_M).floor() as i32)
}

/// Craters that can extend into each cell.
fn grid(craters: &[Crater]) -> HashMap<[i32; 3], Vec<usize>> {
    let mut cells: HashMap<[i32; 3], Vec<usize>> = HashMap::new();
    for (index, crater) in craters.iter().enumerate() {
        let reach_m = Vector3::repeat(Bowl::REACH * crater.bowl.radius_m);
        let low = cell(&(crater.centre_m - reach_m));
        let high = cell(&(crater.centre_m + reach_m));
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    cells.entry([x, y, z]).or_default().push(index);
                }
            }
        }
    }
    cells
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error_sources::Roughness;
    use proptest::prelude::*;
    use std::sync::LazyLock;

    static TERRAIN: LazyLock<Terrain> =
        LazyLock::new(|| Terrain::new(7, &[Vector3::x()], Relief::Gentle));

    proptest! {
        #[test]
        fn a_beam_ends_on_the_ground(
            x in -1.0..1.0_f64, y in -1.0..1.0_f64, z in -1.0..1.0_f64,
            look_rad in 0.0..0.4_f64, azimuth_rad in 0.0..std::f64::consts::TAU,
        ) {
            let up = Vector3::new(x, y, z);
            prop_assume!(up.norm() > 0.1);
            let up = up.normalize();
            let side = up.cross(&Vector3::new(0.3, -0.5, 0.81)).normalize();
            let other = up.cross(&side);
            let sideways = azimuth_rad.cos() * side + azimuth_rad.sin() * other;
            let direction = (-look_rad.cos() * up + look_rad.sin() * sideways).normalize();
            let origin = 3_776_000.0 * up;
            let range_m = TERRAIN.range_m(&origin, &direction).unwrap();
            let hit = origin + range_m * direction;
            let error_m = hit.norm() - TERRAIN.radius_m(&hit.normalize());
            prop_assert!(error_m.abs() < 1e-4, "{error_m}"); // metres: a tenth of the resolution of a PEDR file
            prop_assert!((hit.norm() - 3.39e6).abs() < 25_000.0);
        }

        #[test]
        fn neighbours_have_neighbouring_radii(longitude_rad in 0.0..std::f64::consts::TAU, latitude_rad in -1.57..1.57_f64) {
            // Across the meridian, at the poles and over cell edges: 1 m aside the ground rises by less than 1 m.
            let place = |longitude: f64, latitude: f64| {
                areograph_geom::ellipsoid::spherical_to_xyz_m(longitude, latitude, 1.0)
            };
            let here = TERRAIN.radius_m(&place(longitude_rad, latitude_rad));
            for there in [place(longitude_rad, latitude_rad + 3e-7), place(longitude_rad + 3e-7, latitude_rad)] {
                prop_assert!((TERRAIN.radius_m(&there) - here).abs() < 1.0);
            }
        }
    }

    static ROUGH: LazyLock<Terrain> =
        LazyLock::new(|| Terrain::new(7, &[Vector3::x()], Relief::SelfAffine(Roughness::Rough)));

    proptest! {
        #[test]
        fn a_beam_ends_on_rough_ground(
            east in -0.009..0.009_f64, north in -0.009..0.009_f64,
            look_rad in 0.0..0.4_f64, azimuth_rad in 0.0..std::f64::consts::TAU,
        ) {
            let up = Vector3::new(1.0, east, north).normalize();
            let (sin, cos) = azimuth_rad.sin_cos();
            let direction =
                (-look_rad.cos() * up + look_rad.sin() * Vector3::new(0.0, cos, sin)).normalize();
            let ground_m = ROUGH.radius_m(&up) * up;
            let origin = ground_m - 385_000.0 * direction;
            let range_m = ROUGH.range_m(&origin, &direction).unwrap();
            let hit = origin + range_m * direction;
            let error_m = hit.norm() - ROUGH.radius_m(&hit.normalize());
            prop_assert!(error_m.abs() < 1e-4, "{error_m}"); // metres: a tenth of the resolution of a PEDR file
            // The mean over a spot deviates less from the ground than the relief within it: slopes are up to 1.
            let farther_m = ROUGH.spot_farther_m(&hit, &direction, 75.0);
            prop_assert!(farther_m.abs() < 75.0, "{farther_m}");
        }
    }

    #[test]
    fn a_spot_on_smooth_ground_is_measured_in_its_middle() {
        let far = ROUGH.radius_m(&Vector3::y()) * Vector3::y();
        assert!(ROUGH.spot_farther_m(&far, &-Vector3::y(), 75.0).abs() <= 0.0);
    }

    #[test]
    fn the_same_seed_makes_the_same_ground_and_another_seed_another() {
        let direction = Vector3::new(0.4, -0.5, 0.2).normalize();
        let again = Terrain::new(7, &[Vector3::x()], Relief::Gentle);
        assert_eq!(
            again.radius_m(&direction).to_bits(),
            TERRAIN.radius_m(&direction).to_bits()
        );
        let other = Terrain::new(8, &[Vector3::x()], Relief::Gentle);
        assert!((other.radius_m(&direction) - TERRAIN.radius_m(&direction)).abs() > 1.0);
    }

    #[test]
    fn a_beam_into_space_has_no_range() {
        let origin = Vector3::new(3_776_000.0, 0.0, 0.0);
        assert!(TERRAIN.range_m(&origin, &Vector3::x()).is_none());
        assert!(TERRAIN.range_m(&origin, &Vector3::y()).is_none());
    }
}
