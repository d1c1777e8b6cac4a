//! Self-affine ground around a site: noise in octaves from 51 km to 25 m, and craters.
//!
//! A height is a sum of octaves of value noise on square lattices whose nodes are hashed, so that nothing is stored and
//! the cost is the same everywhere: about a quarter of a microsecond, plus the craters nearby.

use std::collections::HashMap;

use nalgebra::{Vector2, Vector3};

use super::{
    error_sources::Roughness,
    random::{Random, mix, unit_of},
};

/// Spacing of the finest lattice, metres: the shortest wavelength is twice that.
const FINEST_M: f64 = 12.5;
/// Octaves; the coarsest lattice has 51.2 km.
const OCTAVES: i32 = 13;
/// Hurst exponent of ground that is not varied.
const HURST: f64 = 0.7;
/// Amplitude of an octave in units of `ν (spacing / 300 m)^H` for which the sum of all octaves has the structure
/// function `ν² (d / 300 m)^2H`, to 4 % in height from 50 m to 2 km.
const OCTAVE_SHARE: f64 = 0.4251;
/// Structure function of an octave of unit amplitude at 300 m, from the finest octave on: mean square difference over
/// places and directions, by numerical integration of the covariance of its nodes.
const STRUCTURE_AT_300_M: [f64; OCTAVES as usize] = [
    1.228,
    1.228,
    1.228,
    1.228,
    1.220,
    0.7914,
    0.2766,
    0.076_13,
    0.0195,
    0.004_905,
    0.001_23,
    0.000_307_6,
    0.000_076_9,
];
/// Hurst exponents of varied ground; fits to MOLA shots in windows of a degree give 0.38 at Gusev and 0.94 at Gale.
const VARIED_HURST: [f64; 2] = [0.4, 0.95];
/// Least roughness of varied ground at 300 m, metres. At the largest, the shortest waves are, where the ground is
/// roughest, as steep as the waves of [`Roughness::Rough`]: on steeper ground a beam would meet several places.
const VARIED_MIN_M: f64 = 3.0;
const SHORTEST_M: f64 = 2.0 * FINEST_M;
/// Lattice on which the roughness of varied ground changes, metres, and the natural logarithm by which a node changes it:
/// nodes reach √3 times that, a factor of two.
const CHANGE_M: f64 = 15_000.0;
const CHANGE: f64 = 0.4;
/// Full roughness up to the first distance from the site, zero beyond the second, metres; windows extend to 33 km.
const REACH_M: [f64; 2] = [40_000.0, 60_000.0];

/// Craters with a diameter of 100 m or more per square kilometre; the number falls with the square of the diameter,
/// hence one of 1 km in 1 000 km². The order of magnitude of Martian plains.
const CRATERS_PER_KM2: f64 = 0.1;
/// Smallest and largest radius, metres.
const CRATER_RADIUS_M: [f64; 2] = [50.0, 2_000.0];
/// Depth over radius of degraded craters; fresh ones have 0.4.
const CRATER_DEPTH: f64 = 0.16;
/// Edge of a cell of the crater grid, metres.
const CELL_M: f64 = 1_000.0;

/// The ground around one site, added to the terrain below it.
#[derive(Debug)]
pub(super) struct RoughPatch {
    centre: Vector3<f64>,
    east: Vector3<f64>,
    north: Vector3<f64>,
    octaves: Vec<Octave>,
    /// Logarithm of the factor by which the roughness changes; `None` where it is the same everywhere.
    change: Option<Octave>,
    craters: Vec<Crater>,
    cells: HashMap<[i32; 2], Vec<usize>>,
}

/// Noise on a square lattice.
#[derive(Debug)]
struct Octave {
    /// Lattice spacings a metre, and their direction.
    per_m: Vector2<f64>,
    offset: Vector2<f64>,
    height_m: f64,
    key: u64,
}

/// A bowl with a raised rim.
#[derive(Debug)]
pub(super) struct Bowl {
    pub radius_m: f64,
    pub depth_m: f64,
}

#[derive(Debug)]
struct Crater {
    centre_m: Vector2<f64>,
    bowl: Bowl,
}

impl RoughPatch {
    /// The ground of this roughness around `centre`, a direction.
    pub(super) fn new(seed: u64, centre: &Vector3<f64>, roughness: Roughness) -> Self {
        let place = [centre.x, centre.y, centre.z].map(f64::to_bits);
        let key = place.into_iter().fold(seed, |key, bits| mix(key ^ bits));
        let law = Law::of(roughness, key);
        let mut random = Random::new(key, "roughness");
        let east = Vector3::z().cross(centre).normalize();
        let octaves = (0..OCTAVES).map(|octave| {
            let spacing_m = FINEST_M * 2.0_f64.powi(octave);
            Octave::new(spacing_m, law.height_m(spacing_m), &mut random)
        });
        let octaves = octaves.collect();
        let craters = craters(&mut random);
        Self {
            centre: *centre,
            east,
            north: centre.cross(&east),
            octaves,
            change: law.change,
            cells: grid(&craters),
            craters,
        }
    }

    /// Height at a point on the reference sphere, metres; `None` outside the patch.
    pub(super) fn height_m(&self, place_m: &Vector3<f64>) -> Option<f64> {
        let plan_m = Vector2::new(self.east.dot(place_m), self.north.dot(place_m));
        let distance_m = plan_m.norm();
        let [full_m, end_m] = REACH_M;
        if distance_m >= end_m || self.centre.dot(place_m) < 0.0 {
            return None;
        }
        let share = ((end_m - distance_m) / (end_m - full_m)).min(1.0);
        let near = self.cells.get(&cell(&plan_m)).into_iter().flatten();
        let bowls_m: f64 = near
            .map(|&index| {
                let crater = &self.craters[index];
                crater.bowl.height_m((plan_m - crater.centre_m).norm())
            })
            .sum();
        Some(fade(share) * (self.noise_m(&plan_m) + bowls_m))
    }

    /// Height without craters, metres.
    fn noise_m(&self, plan_m: &Vector2<f64>) -> f64 {
        let octaves = self.octaves.iter();
        let height_m: f64 = octaves.map(|octave| octave.height_m(plan_m)).sum();
        let change = self.change.as_ref();
        change.map_or(height_m, |change| height_m * change.height_m(plan_m).exp())
    }
}

/// Differences of heights with distance around a site.
struct Law {
    /// Difference 300 m apart, metres.
    at_300_m: f64,
    hurst: f64,
    /// Amplitude of an octave in units of `at_300_m (spacing / 300 m)^hurst`.
    share: f64,
    change: Option<Octave>,
}

impl Law {
    fn of(roughness: Roughness, key: u64) -> Self {
        if let Some(at_300_m) = roughness.height_difference_at_300_m() {
            return Self {
                at_300_m,
                hurst: HURST,
                share: OCTAVE_SHARE,
                change: None,
            };
        }
        let mut random = Random::new(key, "varied ground");
        let hurst = random.between(VARIED_HURST[0], VARIED_HURST[1]);
        let squares = (0..OCTAVES)
            .zip(STRUCTURE_AT_300_M)
            .map(|(octave, square)| {
                let spacing_m = FINEST_M * 2.0_f64.powi(octave);
                (spacing_m / 300.0).powf(2.0 * hurst) * square
            });
        let rough_m = Roughness::Rough.height_difference_at_300_m();
        let most_m =
            0.5 * rough_m.unwrap_or(VARIED_MIN_M) * (SHORTEST_M / 300.0).powf(HURST - hurst);
        Self {
            at_300_m: random.between_log(VARIED_MIN_M, most_m),
            hurst,
            share: squares.sum::<f64>().sqrt().recip(),
            change: Some(Octave::new(CHANGE_M, CHANGE, &mut random)),
        }
    }

    /// Amplitude of the octave with this spacing, metres.
    fn height_m(&self, spacing_m: f64) -> f64 {
        self.share * self.at_300_m * (spacing_m / 300.0).powf(self.hurst)
    }
}

impl Octave {
    fn new(spacing_m: f64, height_m: f64, random: &mut Random) -> Self {
        let (sin, cos) = random.between(0.0, std::f64::consts::TAU).sin_cos();
        Self {
            per_m: Vector2::new(cos, sin) / spacing_m,
            offset: Vector2::from_fn(|_, _| random.between(0.0, 1.0)),
            height_m,
            key: random.bits(),
        }
    }

    fn height_m(&self, plan_m: &Vector2<f64>) -> f64 {
        let x = self.per_m.dot(plan_m) + self.offset.x;
        let y = self.per_m.perp(plan_m) + self.offset.y;
        let (west, south) = (x.floor(), y.floor());
        let (along_x, along_y) = (fade(x - west), fade(y - south));
        let node = |east: f64, north: f64| self.node(west + east, south + north);
        let between = |from: f64, to: f64, share: f64| from + share * (to - from);
        let lower = between(node(0.0, 0.0), node(1.0, 0.0), along_x);
        let upper = between(node(0.0, 1.0), node(1.0, 1.0), along_x);
        self.height_m * between(lower, upper, along_y)
    }

    /// Value of a node: uniform, of mean 0 and standard deviation 1.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a patch is about ten thousand nodes wide; negative indices wrap into other hashes"
    )]
    fn node(&self, x: f64, y: f64) -> f64 {
        let place = u64::from(x as i32 as u32) << 32 | u64::from(y as i32 as u32);
        f64::sqrt(12.0) * (unit_of(mix(self.key ^ mix(place))) - 0.5)
    }
}

impl Bowl {
    /// Extent of the ejecta in crater radii.
    pub(super) const REACH: f64 = 2.5;

    /// Height at a distance from the centre, metres.
    pub(super) fn height_m(&self, distance_m: f64) -> f64 {
        let distance = distance_m / self.radius_m;
        let rim_m = 0.2 * self.depth_m;
        if distance < 1.0 {
            rim_m + self.depth_m * (distance * distance - 1.0)
        } else if distance < Self::REACH {
            rim_m * ((Self::REACH - distance) / (Self::REACH - 1.0)).powi(2)
        } else {
            0.0
        }
    }
}

/// Rises from 0 to 1 with two derivatives of 0 at either end.
fn fade(share: f64) -> f64 {
    share * share * share * (10.0 + share * (6.0 * share - 15.0))
}

/// Craters of the square around the site that contains the patch.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "some thousand craters"
)]
fn craters(random: &mut Random) -> Vec<Crater> {
    let [smallest_m, largest_m] = CRATER_RADIUS_M;
    let half_m = REACH_M[1];
    let count = CRATERS_PER_KM2 * (2.0 * half_m / 1_000.0).powi(2);
    (0..count as usize)
        .map(|_| {
            // The share of larger craters falls with the square of the radius.
            let share = random.between((smallest_m / largest_m).powi(2), 1.0);
            let radius_m = smallest_m / share.sqrt();
            Crater {
                centre_m: Vector2::from_fn(|_, _| random.between(-half_m, half_m)),
                bowl: Bowl {
                    radius_m,
                    depth_m: CRATER_DEPTH * radius_m,
                },
            }
        })
        .collect()
}

#[allow(
    clippy::cast_possible_truncation,
    reason = "a patch is about a hundred cells wide"
)]
fn cell(plan_m: &Vector2<f64>) -> [i32; 2] {
    [plan_m.x, plan_m.y].map(|component_m| (component_m / CELL_M).floor() as i32)
}

/// Craters that can extend into each cell.
fn grid(craters: &[Crater]) -> HashMap<[i32; 2], Vec<usize>> {
    let mut cells: HashMap<[i32; 2], Vec<usize>> = HashMap::new();
    for (index, crater) in craters.iter().enumerate() {
        let reach_m = Vector2::repeat(Bowl::REACH * crater.bowl.radius_m);
        let low = cell(&(crater.centre_m - reach_m));
        let high = cell(&(crater.centre_m + reach_m));
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                cells.entry([x, y]).or_default().push(index);
            }
        }
    }
    cells
}

#[cfg(test)]
mod surface_tests;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::terrain::REFERENCE_RADIUS_M;

    const SITE: Vector3<f64> = Vector3::new(0.6, 0.8, 0.0);

    /// Differences of heights `apart_m` apart (root mean square), over points and directions of some patches, metres.
    fn differ_m(roughness: Roughness, apart_m: f64) -> f64 {
        const PATCHES: u64 = 12;
        const PAIRS: u64 = 1_500;
        let mut squares_m2 = 0.0;
        for seed in 0..PATCHES {
            let patch = RoughPatch::new(seed, &SITE, roughness);
            let mut random = Random::new(seed, "pairs");
            for _ in 0..PAIRS {
                let from_m = Vector2::from_fn(|_, _| random.between(-30_000.0, 30_000.0));
                let (sin, cos) = random.between(0.0, std::f64::consts::TAU).sin_cos();
                let to_m = from_m + apart_m * Vector2::new(cos, sin);
                squares_m2 += (patch.noise_m(&to_m) - patch.noise_m(&from_m)).powi(2);
            }
        }
        (squares_m2 / (PATCHES * PAIRS) as f64).sqrt()
    }

    #[test]
    fn heights_differ_as_the_structure_function_says() {
        for roughness in [Roughness::Plains, Roughness::Medium, Roughness::Rough] {
            for apart_m in [50.0, 100.0, 300.0, 1_000.0, 2_000.0_f64] {
                let expected_m =
                    roughness.height_difference_at_300_m().unwrap() * (apart_m / 300.0).powf(HURST);
                let found_m = differ_m(roughness, apart_m);
                println!("{roughness:?} {apart_m} m: {found_m:.3} m, expected {expected_m:.3} m");
                // 4 % because there are only thirteen octaves; 18 000 pairs, fewer independent ones at 2 km: 1 %.
                assert!(
                    (found_m / expected_m - 1.0).abs() < 0.07,
                    "{found_m} {expected_m}"
                );
            }
        }
    }

    #[test]
    fn varied_ground_differs_between_sites_and_within_one() {
        let laws: Vec<Law> = (0..200)
            .map(|key| Law::of(Roughness::Varied, key))
            .collect();
        let spread = |of: fn(&Law) -> f64| {
            let values = laws.iter().map(of);
            values.fold([f64::INFINITY, 0.0], |[low, high]: [f64; 2], value| {
                [low.min(value), high.max(value)]
            })
        };
        // The outermost of two hundred drawn laws lie within a twentieth of the range of the limits.
        let [low, high] = spread(|law| law.hurst);
        assert!(low < 0.43 && high > 0.92, "{low} {high}");
        let [low, high] = spread(|law| law.at_300_m);
        assert!(low < 3.4 && (12.0..25.0).contains(&high), "{low} {high}");
        // By the table, an octave share equals the constant where the exponent does, to 1 %.
        let usual = laws
            .iter()
            .map(|law| ((law.hurst - HURST).abs(), law.share));
        let nearest = usual.reduce(|one, other| if other.0 < one.0 { other } else { one });
        assert!((nearest.unwrap().1 / OCTAVE_SHARE - 1.0).abs() < 0.01);
        // Root mean square difference of heights 300 m apart in squares of 10 km.
        let patch = RoughPatch::new(3, &SITE, Roughness::Varied);
        let mut random = Random::new(3, "pairs");
        let mut squares = Vec::new();
        for corner in 0..36 {
            let corner_m = Vector2::new(f64::from(corner % 6 - 3), f64::from(corner / 6 - 3));
            let mut square_m2 = 0.0;
            for _ in 0..400 {
                let within = Vector2::from_fn(|_, _| random.between(0.0, 1.0));
                let from_m = 10_000.0 * (corner_m + within);
                let (sin, cos) = random.between(0.0, std::f64::consts::TAU).sin_cos();
                let to_m = from_m + 300.0 * Vector2::new(cos, sin);
                square_m2 += (patch.noise_m(&to_m) - patch.noise_m(&from_m)).powi(2);
            }
            squares.push((square_m2 / 400.0_f64).sqrt());
        }
        let most = squares.iter().fold(0.0_f64, |most, of| most.max(*of));
        let least = squares
            .iter()
            .fold(f64::INFINITY, |least, of| least.min(*of));
        // Factors of one half to two, averaged over squares of two thirds of the lattice; without a change the scatter of
        // 400 pairs is a fourteenth.
        assert!(most / least > 1.6, "{least} {most}");
    }

    #[test]
    fn the_finest_waves_are_some_25_m_long() {
        // Below the finest lattice the ground is smooth: heights differ in proportion to the distance.
        let [near_m, nearer_m] = [2.0, 1.0].map(|apart_m| differ_m(Roughness::Medium, apart_m));
        assert!(
            (near_m / nearer_m - 2.0).abs() < 0.05,
            "{near_m} {nearer_m}"
        ); // 2^0.7 = 1.62 if it went on
    }

    #[test]
    fn craters_are_as_many_as_told_and_few_are_large() {
        let craters = craters(&mut Random::new(1, "craters"));
        assert_eq!(craters.len(), 1_440); // 120 km squared, 0.1 a square kilometre
        let beyond = |radius_m: f64| {
            let larger = craters
                .iter()
                .filter(|crater| crater.bowl.radius_m > radius_m);
            larger.count()
        };
        // A quarter has diameters above 200 m: 360, with a standard deviation of 16; times four.
        assert!(beyond(100.0).abs_diff(360) < 65, "{}", beyond(100.0));
        assert!((3..30).contains(&beyond(500.0)), "{}", beyond(500.0)); // 14 of 1 km
        let all_in = craters.iter().all(|crater| {
            (CRATER_RADIUS_M[0]..=CRATER_RADIUS_M[1]).contains(&crater.bowl.radius_m)
        });
        assert!(all_in);
    }

    #[test]
    fn a_patch_ends_without_a_step() {
        let patch = RoughPatch::new(1, &SITE, Roughness::Rough);
        let place = |north_m: f64| {
            let angle_rad = north_m / REFERENCE_RADIUS_M;
            REFERENCE_RADIUS_M * (angle_rad.cos() * SITE + angle_rad.sin() * Vector3::z())
        };
        assert!(patch.height_m(&place(30_000.0)).unwrap().abs() > 0.1);
        // A metre before the end the height is zero; beyond it, and on the other side of Mars, it is undefined.
        assert!(patch.height_m(&place(59_998.0)).unwrap().abs() < 1e-3);
        assert!(patch.height_m(&place(60_010.0)).is_none());
        assert!(patch.height_m(&-place(0.0)).is_none());
    }
}
