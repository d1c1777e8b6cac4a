//! The ground between scattered points: its height by universal kriging from neighbours, tested at the points
//! themselves.
//!
//! The smoothness of the ground is not known beforehand. Every point is predicted from its neighbours, for some powers
//! of the generalised covariance `|h|^β` and some shares of noise; those with the smallest errors are used. The errors
//! at the points then represent the errors between them, with the tail of this ground.
//!
//! # Source
//! Generalised covariances: Matheron 1973, "The intrinsic random functions and their applications", Adv. Appl. Probab.
//! 5, 439–468.

use nalgebra::{DMatrix, DVector, Matrix2, Vector2, Vector3};

use crate::{ellipsoid::local_axes, statistics::Summary};

/// Minimum number of points, of which each is predicted from others.
pub const POINTS_MIN: usize = 20;
/// Neighbours from which a height is predicted.
const NEIGHBOURS: usize = 20;
/// Points at which errors are measured, at most: every second, third … of more.
const TESTED_MAX: usize = 250;
/// Powers of distance: rough ground, and smooth.
const POWERS: [f64; 4] = [1.0, 1.5, 2.5, 3.0];
/// Variance of noise over the variance of the ground at the usual distance of neighbours.
const NOISES: [f64; 4] = [1e-3, 1e-2, 1e-1, 1.0];
/// Smallest product of the variances of neighbours along their principal axes, over the square of the sum of both: a
/// tenth in width.
const SPREAD_MIN: f64 = 0.01;
/// Share of the points that have smaller errors than `tail` standard deviations.
const TAIL: f64 = 0.99;

/// A predicted height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PredictedHeight {
    /// Distance from the centre of the body, metres.
    pub radius_m: f64,
    /// Standard deviation, metres.
    pub sigma_m: f64,
}

/// The ground from scattered points.
#[derive(Debug, Clone)]
pub struct ScatteredHeights {
    points_m: Vec<Vector3<f64>>,
    /// Usual distance of the nearest neighbour, metres.
    spacing_m: f64,
    model: Model,
    /// Root of the variance of the ground at the usual distance, metres.
    scale_m: f64,
    /// Error in standard deviations that one in a hundred of the points exceeds.
    pub tail: f64,
}

/// A generalised covariance, at the usual distance 1.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Model {
    power: f64,
    noise: f64,
}

impl Model {
    /// Covariance of two points at a distance, in usual distances.
    fn between(self, distance: f64) -> f64 {
        let sign = if self.power < 2.0 { -1.0 } else { 1.0 };
        sign * distance.powf(self.power)
    }
}

impl ScatteredHeights {
    /// The ground of `points_m`, body-fixed; `None` for fewer than [`POINTS_MIN`], or points nearly on a line.
    #[must_use]
    pub fn new(points_m: &[Vector3<f64>]) -> Option<Self> {
        if points_m.len() < POINTS_MIN {
            return None;
        }
        let (tested, neighbours) = tested(points_m);
        let nearest = tested.iter().zip(&neighbours).filter_map(|(index, near)| {
            let distance_m = (on_sphere(&points_m[*index], &points_m[*near.first()?])).norm();
            Some(distance_m)
        });
        let spacing_m = Summary::of(&nearest.collect::<Vec<_>>()).median;
        if !(spacing_m > 0.0) {
            return None;
        }
        let mut best: Option<(f64, Self)> = None;
        for power in POWERS {
            for noise in NOISES {
                let mut of = Self {
                    points_m: points_m.to_vec(),
                    spacing_m,
                    model: Model { power, noise },
                    scale_m: 1.0,
                    tail: 0.0,
                };
                let Some(size_m) = of.measure(&tested, &neighbours) else {
                    continue;
                };
                if best.as_ref().is_none_or(|(least_m, _)| size_m < *least_m) {
                    best = Some((size_m, of));
                }
            }
        }
        best.map(|(_, of)| of)
    }

    /// The ground of these points and more ones, as smooth as before; scale and tail are measured anew. `None` where most
    /// points are not predicted.
    #[must_use]
    pub fn with(&self, more_m: &[Vector3<f64>]) -> Option<Self> {
        let mut of = self.clone();
        of.points_m.extend(more_m);
        let (tested, neighbours) = tested(&of.points_m);
        of.measure(&tested, &neighbours).map(|_| of)
    }

    /// Predicts the tested points from their neighbours, and sets scale and tail; returns the geometric mean of their
    /// standard deviations, metres. `None` where most are not predicted.
    fn measure(&mut self, tested: &[usize], neighbours: &[Vec<usize>]) -> Option<f64> {
        let mut normalised = Vec::new();
        let mut logarithms = 0.0;
        for (index, near) in tested.iter().zip(neighbours) {
            let place_m = &self.points_m[*index];
            if let Some((radius_m, variance)) = self.krige(place_m, near) {
                // The point has its own noise.
                let sigma = (variance + self.model.noise).sqrt();
                normalised.push((place_m.norm() - radius_m) / sigma);
                logarithms += sigma.ln();
            }
        }
        if 2 * normalised.len() < tested.len() {
            return None;
        }
        let summary = Summary::of(&normalised);
        self.scale_m = summary.nmad;
        let mut sizes: Vec<f64> = normalised.iter().map(|of| of.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a share of a number of points"
        )]
        let at = (TAIL * (sizes.len() - 1) as f64).round() as usize;
        self.tail = sizes[at] / self.scale_m;
        let mean = logarithms / normalised.len() as f64;
        (self.scale_m > 0.0).then(|| self.scale_m * mean.exp())
    }

    /// The ground at a place; its own radius has no influence. `None` where neighbours lie on a line.
    #[must_use]
    pub fn at(&self, place_m: &Vector3<f64>) -> Option<PredictedHeight> {
        let near = neighbours(&self.points_m, place_m, None);
        let (radius_m, variance) = self.krige(place_m, &near)?;
        Some(PredictedHeight {
            radius_m,
            sigma_m: self.scale_m * variance.sqrt(),
        })
    }

    /// The ground at one of the points from its neighbours, without itself, and the indices of these.
    #[must_use]
    pub fn at_point(&self, index: usize) -> Option<(PredictedHeight, Vec<usize>)> {
        let place_m = self.points_m.get(index)?;
        let near = neighbours(&self.points_m, place_m, Some(index));
        let (radius_m, variance) = self.krige(place_m, &near)?;
        let sigma_m = self.scale_m * variance.sqrt();
        Some((PredictedHeight { radius_m, sigma_m }, near))
    }

    /// Radius from neighbours, and its variance in units of the scale.
    fn krige(&self, place_m: &Vector3<f64>, near: &[usize]) -> Option<(f64, f64)> {
        let axes = local_axes(place_m);
        let at: Vec<Vector2<f64>> = near
            .iter()
            .map(|index| {
                let towards = axes * on_sphere(place_m, &self.points_m[*index]);
                towards.xy() / self.spacing_m
            })
            .collect();
        if !is_spread(&at) {
            return None;
        }
        let count = near.len();
        let drift = |at: &Vector2<f64>| [1.0, at.x, at.y];
        let mut matrix = DMatrix::zeros(count + 3, count + 3);
        let mut right = DVector::zeros(count + 3);
        for (row, one) in at.iter().enumerate() {
            for (column, other) in at.iter().enumerate() {
                matrix[(row, column)] = self.model.between((one - other).norm());
            }
            matrix[(row, row)] += self.model.noise;
            for (term, value) in drift(one).into_iter().enumerate() {
                matrix[(row, count + term)] = value;
                matrix[(count + term, row)] = value;
            }
            right[row] = self.model.between(one.norm());
        }
        right[count] = 1.0;
        let weights = matrix.lu().solve(&right)?;
        let variance = -weights.dot(&right);
        let radii = near.iter().map(|index| self.points_m[*index].norm());
        let radius_m: f64 = radii
            .zip(weights.iter())
            .map(|(of, weight)| of * weight)
            .sum();
        (radius_m.is_finite() && variance > 0.0).then_some((radius_m, variance))
    }
}

/// The points at which errors are measured, and the neighbours of each.
fn tested(points_m: &[Vector3<f64>]) -> (Vec<usize>, Vec<Vec<usize>>) {
    let step = points_m.len().div_ceil(TESTED_MAX);
    let tested: Vec<usize> = (0..points_m.len()).step_by(step).collect();
    let near = |index: &usize| neighbours(points_m, &points_m[*index], Some(*index));
    let neighbours = tested.iter().map(near).collect();
    (tested, neighbours)
}

/// Whether places are not nearly on a line, across which they would determine no slope.
fn is_spread(places: &[Vector2<f64>]) -> bool {
    let middle = places.iter().sum::<Vector2<f64>>() / places.len().max(1) as f64;
    let spread = places
        .iter()
        .map(|place| (place - middle) * (place - middle).transpose());
    let spread: Matrix2<f64> = spread.sum();
    // Written so that NaN counts.
    spread.determinant() > SPREAD_MIN * spread.trace().powi(2)
}

/// From a place to a point on the sphere through the place.
fn on_sphere(place_m: &Vector3<f64>, point_m: &Vector3<f64>) -> Vector3<f64> {
    point_m * (place_m.norm() / point_m.norm()) - place_m
}

/// The nearest points to a place, without one of them, the nearest first.
fn neighbours(
    points_m: &[Vector3<f64>],
    place_m: &Vector3<f64>,
    without: Option<usize>,
) -> Vec<usize> {
    let points = points_m.iter().enumerate();
    let mut all: Vec<(f64, usize)> = points
        .filter(|(index, _)| Some(*index) != without)
        .map(|(index, point)| (on_sphere(place_m, point).norm_squared(), index))
        .collect();
    let order =
        |one: &(f64, usize), two: &(f64, usize)| one.0.total_cmp(&two.0).then(one.1.cmp(&two.1));
    if all.len() > NEIGHBOURS {
        all.select_nth_unstable_by(NEIGHBOURS, order);
        all.truncate(NEIGHBOURS);
    }
    all.sort_by(order);
    all.into_iter().map(|(_, index)| index).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    const RADIUS_M: f64 = 3_396_000.0;

    /// Points of a strip of 80 by 300 km, on waves of a length, with noise.
    fn strip(count: usize, wave_m: f64, noise_m: f64) -> Vec<Vector3<f64>> {
        let mut random = Random::new(1, "scattered heights");
        let points = (0..count).map(|_| {
            let [x, y] = [80_000.0, 300_000.0].map(|side_m| random.between(0.0, side_m));
            let [east, north] = [x, y].map(|of| of / RADIUS_M);
            let up = Vector3::new(
                north.cos() * east.cos(),
                north.cos() * east.sin(),
                north.sin(),
            );
            let phase = std::f64::consts::TAU / wave_m;
            let height_m = 300.0 * (phase * x).sin() * (phase * y).cos();
            up * (RADIUS_M + height_m + noise_m * random.normal())
        });
        points.collect()
    }

    #[test]
    fn standard_deviations_hold_on_smooth_and_on_rough_ground() {
        // Points lie 7 km apart: waves of 80 km are smooth, waves of 10 km hardly sampled.
        for (wave_m, sigmas_m) in [(80_000.0, 5.0..30.0), (10_000.0, 80.0..400.0)] {
            let all = strip(700, wave_m, 5.0);
            let (known, others) = all.split_at(400);
            let surface = ScatteredHeights::new(known).unwrap();
            let found: Vec<(f64, f64)> = others
                .iter()
                .filter_map(|of| {
                    let found = surface.at(of)?;
                    Some((of.norm() - found.radius_m, found.sigma_m))
                })
                .collect();
            assert!(found.len() > 290, "{}", found.len());
            let sigma_m = Summary::of(&found.iter().map(|of| of.1).collect::<Vec<_>>()).median;
            let errors: Vec<f64> = found.iter().map(|of| of.0 / of.1).collect();
            let z = Summary::of(&errors).nmad;
            println!(
                "{wave_m} m: {sigma_m:.1} m, {z:.2}, tail {:.1}",
                surface.tail
            );
            // Noise of 5 m in addition to the variation of the ground between the points; 300 points, and one draw of
            // the others.
            assert!(sigmas_m.contains(&sigma_m), "{wave_m}: {sigma_m} m");
            // The kernel of the errors; tests of single points take the tail.
            assert!((0.7..1.6).contains(&z), "{wave_m}: {z}");
            assert!(
                (1.5..6.0).contains(&surface.tail),
                "{wave_m}: {}",
                surface.tail
            );
        }
    }

    #[test]
    fn too_few_points_and_points_on_a_line_have_no_surface() {
        assert!(ScatteredHeights::new(&strip(19, 1e5, 1.0)).is_none());
        let line: Vec<Vector3<f64>> = (0..40)
            .map(|index| {
                let north = f64::from(index) * 1e-3;
                Vector3::new(north.cos(), 0.0, north.sin())
                    * (RADIUS_M + 100.0 * (9e3 * north).sin())
            })
            .collect();
        assert!(ScatteredHeights::new(&line).is_none());
    }
}
