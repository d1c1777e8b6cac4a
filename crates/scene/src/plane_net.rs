//! A synthetic net of overlapping rectified pictures with true values; points are random.

use super::random::Random;
use areograph_geom::plane::{Control, Measurement, Net, Place, Similarity};

/// Parameters of a synthetic net. Lengths are metres on the map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneRecipe {
    /// Pictures from west to east, and from south to north.
    pub grid: [usize; 2],
    /// Side of a picture.
    pub side_m: f64,
    /// Distance between the middles of neighbours.
    pub spacing_m: f64,
    /// Number of points, uniformly distributed; each is measured in every picture that shows it.
    pub points: usize,
    /// Standard deviation of a measured coordinate, on the map.
    pub noise_m: f64,
    /// Number of controls, as far apart as possible.
    pub controls: usize,
    /// Standard deviation of a control coordinate.
    pub control_sigma_m: f64,
}

impl PlaneRecipe {
    /// Nine pictures of 100 km, 80 km apart, 200 points, exact.
    pub const NINE: Self = Self {
        grid: [3, 3],
        side_m: 100_000.0,
        spacing_m: 80_000.0,
        points: 200,
        noise_m: 0.0,
        controls: 12,
        control_sigma_m: 0.0,
    };

    /// Twenty-five pictures of 25 km, as in the tertiary net of the paper, 20 km apart, 500 points, exact.
    pub const TERTIARY: Self = Self {
        grid: [5, 5],
        side_m: 25_000.0,
        spacing_m: 20_000.0,
        points: 500,
        controls: 6,
        ..Self::NINE
    };
}

/// A synthetic net and its true values.
#[derive(Debug, Clone, PartialEq)]
pub struct PlaneScene {
    /// Measurements and controls; controls have weight 1.
    pub net: Net,
    /// True similarity from every picture to the map.
    pub pictures: Vec<Similarity>,
    /// True map position of every point.
    pub points: Vec<Place>,
}

impl PlaneRecipe {
    /// The net of `seed`. Pictures have sizes of 700 to 1400 units and any orientation.
    #[must_use]
    pub fn simulate(&self, seed: u64) -> PlaneScene {
        let mut random = Random::new(seed, "plane pictures");
        let [columns, rows] = self.grid;
        let middles: Vec<Place> = (0..columns * rows)
            .map(|index| {
                Place::new((index % columns) as f64, (index / columns) as f64) * self.spacing_m
            })
            .collect();
        let pictures: Vec<Similarity> = middles
            .iter()
            .map(|middle| {
                let scale = self.side_m / random.between(700.0, 1_400.0);
                let turn = Place::from_polar(scale, random.between(0.0, std::f64::consts::TAU));
                let corner = Place::new(random.between(0.0, 2_000.0), random.between(0.0, 2_000.0));
                Similarity {
                    turn,
                    shift: middle - turn * corner,
                }
            })
            .collect();
        let half = 0.5 * self.side_m;
        let far = |count: usize| (count - 1) as f64 * self.spacing_m + half;
        let mut random = Random::new(seed, "plane points");
        let points: Vec<Place> = (0..self.points)
            .map(|_| {
                Place::new(
                    random.between(-half, far(columns)),
                    random.between(-half, far(rows)),
                )
            })
            .collect();
        let mut random = Random::new(seed, "plane measurements");
        let mut measurements = Vec::new();
        for (point, place) in points.iter().enumerate() {
            for picture in around(*place, self.spacing_m, half, self.grid) {
                let off = Place::new(random.normal(), random.normal()) * self.noise_m;
                let way = &pictures[picture];
                measurements.push(Measurement {
                    picture,
                    point,
                    at: (place + off - way.shift) / way.turn,
                });
            }
        }
        let mut random = Random::new(seed, "plane controls");
        let controls = far_apart(&points, self.controls).into_iter().map(|point| {
            let off = Place::new(random.normal(), random.normal()) * self.control_sigma_m;
            Control {
                point,
                at: points[point] + off,
                weight: 1.0,
            }
        });
        PlaneScene {
            net: Net {
                pictures: pictures.len(),
                points: points.len(),
                controls: controls.collect(),
                measurements,
            },
            pictures,
            points,
        }
    }
}

/// Pictures of the grid that show `place`, ascending.
fn around(place: Place, spacing: f64, half: f64, grid: [usize; 2]) -> Vec<usize> {
    let span = |at: f64, count: usize| {
        let shows = move |index: &usize| (at - *index as f64 * spacing).abs() <= half;
        (0..count).filter(shows)
    };
    let [columns, rows] = grid;
    span(place.im, rows)
        .flat_map(|row| span(place.re, columns).map(move |column| row * columns + column))
        .collect()
}

/// Points as far apart as possible, one after the other.
fn far_apart(points: &[Place], count: usize) -> Vec<usize> {
    let mut chosen = Vec::with_capacity(count);
    let middle = points.iter().sum::<Place>() / points.len().max(1) as f64;
    // The first is the farthest from the middle, each further one the farthest from those before it.
    let mut distance: Vec<f64> = points.iter().map(|of| (of - middle).norm()).collect();
    while chosen.len() < count.min(points.len()) {
        let farthest = (0..points.len()).fold(0, |best, next| {
            if distance[next] > distance[best] {
                next
            } else {
                best
            }
        });
        if chosen.is_empty() {
            distance.fill(f64::INFINITY);
        }
        chosen.push(farthest);
        for (of, place) in distance.iter_mut().zip(points) {
            *of = of.min((place - points[farthest]).norm());
        }
    }
    chosen
}
