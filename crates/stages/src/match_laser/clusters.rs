//! Units of points that lie together: k-means with seeds spread by k-means++.

use rayon::prelude::*;

use areograph_geom::random::Random;

/// Points of a unit: at the initial number of units, and at the largest.
const POINTS: [f64; 2] = [100.0, 30.0];
/// Factor by which the number of units grows until they are compact.
const GROWTH: f64 = 1.25;
/// Units are compact when the largest radius is below this, metres, and below the smallest distance of two centres.
const RADIUS_M: f64 = 15_000.0;
/// Limit of an iteration that normally stops long before.
const STEPS_MAX: usize = 100;

/// The unit of every point.
///
/// # Source
/// Li et al. 2023, section 2.2.3 (eq. 17): `R`, the largest radius over the smallest distance of two centres, determines
/// the number of units; the paper gives no limit; 1 is a choice of areograph.
pub(super) fn clusters(places_m: &[[f64; 2]], seed: u64) -> Vec<usize> {
    let count = places_m.len() as f64;
    let [mut units, most] = POINTS.map(|points| (count / points).round().max(1.0));
    loop {
        let centres = seeded(places_m, units, &mut Random::new(seed, "matching units"));
        let (centres, unit_of) = settled(places_m, centres);
        if units >= most || are_compact(places_m, &centres, &unit_of) {
            return unit_of;
        }
        units = (units * GROWTH).ceil().min(most);
    }
}

fn square_m2(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2)
}

/// Seeds by k-means++: each one drawn among the points by the square of their distances from those before.
fn seeded(places_m: &[[f64; 2]], units: f64, random: &mut Random) -> Vec<[f64; 2]> {
    let mut squares = vec![1.0; places_m.len()];
    let mut centres: Vec<[f64; 2]> = Vec::new();
    while (centres.len() as f64) < units {
        let total: f64 = squares.iter().sum();
        if !(total > 0.0) {
            break;
        }
        let mut left = random.between(0.0, total);
        let drawn = squares.iter().position(|square| {
            left -= square;
            left < 0.0
        });
        let last = squares.iter().rposition(|square| *square > 0.0);
        let Some(centre) = drawn.or(last).map(|at| places_m[at]) else {
            break;
        };
        let is_first = centres.is_empty();
        centres.push(centre);
        squares
            .par_iter_mut()
            .zip(places_m)
            .for_each(|(square, place_m)| {
                let to_centre = square_m2(*place_m, centre);
                *square = if is_first {
                    to_centre
                } else {
                    square.min(to_centre)
                };
            });
    }
    centres
}

/// Moves centres to the middle of their points until no point changes its unit. Sums run in the order of the points, so that
/// threads change nothing.
fn settled(places_m: &[[f64; 2]], mut centres: Vec<[f64; 2]>) -> (Vec<[f64; 2]>, Vec<usize>) {
    let nearest = |centres: &[[f64; 2]]| -> Vec<usize> {
        let of = |place_m: &[f64; 2]| {
            let distances = centres.iter().map(|centre| square_m2(*place_m, *centre));
            let nearest = distances.enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
            nearest.map_or(0, |(unit, _)| unit)
        };
        places_m.par_iter().map(of).collect()
    };
    let mut unit_of = nearest(&centres);
    for _ in 0..STEPS_MAX {
        let mut sums = vec![[0.0; 3]; centres.len()];
        for (place_m, unit) in places_m.iter().zip(&unit_of) {
            let sum = &mut sums[*unit];
            *sum = [sum[0] + place_m[0], sum[1] + place_m[1], sum[2] + 1.0];
        }
        for (centre, [x, y, count]) in centres.iter_mut().zip(sums) {
            if count > 0.0 {
                *centre = [x / count, y / count];
            }
        }
        let next = nearest(&centres);
        if next == unit_of {
            break;
        }
        unit_of = next;
    }
    (centres, unit_of)
}

fn are_compact(places_m: &[[f64; 2]], centres: &[[f64; 2]], unit_of: &[usize]) -> bool {
    let radii = places_m.iter().zip(unit_of);
    let largest = radii
        .map(|(place_m, unit)| square_m2(*place_m, centres[*unit]).sqrt())
        .fold(0.0, f64::max);
    let apart = centres.iter().enumerate().flat_map(|(index, centre)| {
        let others = centres[..index].iter();
        others.map(|other| square_m2(*centre, *other).sqrt())
    });
    largest <= RADIUS_M && largest <= apart.fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four heaps of 100 points, 40 km apart, 2 km wide.
    fn heaps() -> Vec<[f64; 2]> {
        let mut random = Random::new(3, "heaps");
        let heaps = [[0.0, 0.0], [40e3, 0.0], [0.0, 40e3], [40e3, 40e3]];
        let points = (0..400).map(|index| {
            let heap: [f64; 2] = heaps[index % 4];
            heap.map(|of| of + random.between(-1e3, 1e3))
        });
        points.collect()
    }

    #[test]
    fn heaps_are_found_whole() {
        let places_m = heaps();
        let unit_of = clusters(&places_m, 1);
        for (index, unit) in unit_of.iter().enumerate() {
            // Points of one heap are in one unit, as four units are compact.
            assert_eq!(*unit, unit_of[index % 4], "point {index}");
        }
        assert_eq!(unit_of.iter().max(), Some(&3));
    }

    #[test]
    fn threads_change_nothing_and_the_seed_does() {
        let mut random = Random::new(5, "evenly");
        let places_m: Vec<[f64; 2]> = (0..900)
            .map(|_| [0.0; 2].map(|_| random.between(-50e3, 50e3)))
            .collect();
        let with = |threads: usize, seed: u64| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.map(|pool| pool.install(|| clusters(&places_m, seed)))
                .ok()
        };
        let one = with(1, 7);
        assert!(one.is_some());
        assert_eq!(one, with(4, 7));
        assert_ne!(one, with(1, 8));
    }

    #[test]
    fn points_on_one_place_are_one_unit() {
        assert_eq!(clusters(&[[1.0, 2.0]; 250], 1), [0; 250]);
    }
}
