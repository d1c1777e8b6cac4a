//! Stated standard deviations against 500 nets with other noise.

use areograph::{
    geom::plane::{Place, Solution},
    scene::PlaneRecipe,
};

use super::{errors, nine, weighted};

const RUNS: u64 = 500;
const NOISE_M: f64 = 250.0;
const CONTROL_M: f64 = 400.0;

#[test]
fn stated_sigmas_are_those_of_five_hundred_runs() {
    let recipe = PlaneRecipe {
        control_sigma_m: CONTROL_M,
        points: 120,
        controls: 8,
        ..nine(NOISE_M)
    };
    // The geometry of one seed; the noise of others.
    let truth = PlaneRecipe {
        noise_m: 0.0,
        control_sigma_m: 0.0,
        ..recipe
    }
    .simulate(1);
    let weight = (NOISE_M / CONTROL_M).powi(2);
    let (net, exact) = weighted(&truth, weight);
    let of_point = Solution::measurements_of(&net);
    let precision = exact.precision();
    let given = |point: usize| {
        net.controls
            .iter()
            .any(|control| control.point == point)
            .then_some(weight)
    };
    let stated: Vec<f64> = (0..net.points)
        .map(|point| NOISE_M * precision.place(&net, &of_point[point], given(point)).sqrt())
        .collect();
    let stated_pictures: Vec<[f64; 2]> = (0..net.pictures)
        .map(|picture| precision.picture(picture).map(|of| NOISE_M * of.sqrt()))
        .collect();
    let stated_deviations: Vec<f64> = (0..net.measurements.len())
        .map(|index| {
            let of = &of_point[net.measurements[index].point];
            NOISE_M * precision.deviation(&net, of, index).sqrt()
        })
        .collect();
    let mut squares = vec![0.0; net.points];
    let mut turns = vec![0.0; net.pictures];
    let mut deviations = vec![0.0; net.measurements.len()];
    let (mut sigma, mut normals) = (0.0, Normals(9));
    for _ in 0..RUNS {
        let mut noisy = truth.clone();
        for measured in &mut noisy.net.measurements {
            measured.at += normals.place() * NOISE_M / truth.pictures[measured.picture].turn;
        }
        for control in &mut noisy.net.controls {
            // Of a control both errors make one, by its weight.
            let count = of_point[control.point].len() as f64;
            let own_m = (CONTROL_M.powi(2) - NOISE_M.powi(2) / count).sqrt();
            control.at += normals.place() * own_m;
        }
        let (noisy, solution) = weighted(&noisy, weight);
        for (sum, error) in squares.iter_mut().zip(errors(&truth, &solution.places)) {
            *sum += 0.5 * error.norm_sqr();
        }
        for (sum, (found, of)) in turns
            .iter_mut()
            .zip(solution.pictures.iter().zip(&truth.pictures))
        {
            *sum += 0.5 * (found.turn - of.turn).norm_sqr();
        }
        for (sum, of) in deviations.iter_mut().zip(&solution.deviations) {
            *sum += 0.5 * of.norm_sqr();
        }
        sigma += solution.sigma(&noisy).unwrap();
    }
    let spread = |sum: &f64| (sum / RUNS as f64).sqrt();
    for (point, (sum, stated)) in squares.iter().zip(&stated).enumerate() {
        // A standard deviation from 1000 coordinates is known to 2.2 %; 10 % are four and a half of these.
        let ratio = spread(sum) / stated;
        assert!((ratio - 1.0).abs() < 0.1, "point {point}: {ratio}");
    }
    for (picture, (sum, stated)) in turns.iter().zip(&stated_pictures).enumerate() {
        let ratio = spread(sum) / stated[0];
        assert!((ratio - 1.0).abs() < 0.1, "picture {picture}: {ratio}");
    }
    for (index, (sum, stated)) in deviations.iter().zip(&stated_deviations).enumerate() {
        // Of a point on one picture there is none.
        if *stated > 1e-6 * NOISE_M {
            let ratio = spread(sum) / stated;
            assert!((ratio - 1.0).abs() < 0.1, "measurement {index}: {ratio}");
        }
    }
    // Mean of 500, and the loss of a degree of freedom or two to the size of the figure.
    let ratio = sigma / RUNS as f64 / NOISE_M;
    assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
}

/// Normal numbers of a linear congruential generator, by Box and Muller.
pub(crate) struct Normals(pub(crate) u64);

impl Normals {
    fn uniform(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    }

    pub(crate) fn place(&mut self) -> Place {
        let size = (-2.0 * self.uniform().ln()).sqrt();
        Place::from_polar(size, std::f64::consts::TAU * self.uniform())
    }
}
