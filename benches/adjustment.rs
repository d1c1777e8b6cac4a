//! Times of the combined adjustment: the recipe, and many tie points in twenty images.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a benchmark prints its times and may fail loudly"
)]

#[path = "../tests/network/recipe.rs"]
mod recipe;
#[path = "../tests/pushbroom/scene.rs"]
mod scene;

use std::time::Instant;

use areograph::geom::{
    bundle::{BundleOptions, Network, View, solve},
    pushbroom::{EulerPolynomial, ExteriorOrientation, Pose, SampledOrientation},
};
use recipe::{Normals, Recipe, Simulated, place_px};

const IMAGES: usize = 20;

/// The simulated network with its initial orientations through 31 samples, as the flow has them.
fn sampled(simulated: &Simulated<EulerPolynomial>) -> Network<SampledOrientation> {
    simulated.based_on(|image| {
        let samples: Vec<(f64, Pose)> = (-15..=15)
            .map(|k| f64::from(k) / 15.0 * image.half_lines)
            .map(|x| (x, image.base.pose(x)))
            .collect();
        SampledOrientation::new(&samples).unwrap()
    })
}

/// Noise of the ties in the ring, lines and pixels: what matching attains.
///
/// With noise of a whole line in so many ties, corrections of images without footprints drift to ten and more
/// of their prior standard deviations, and the iteration takes dozens of steps: see ARCHITECTURE.md.
const NOISE: f64 = 0.1;

/// Ties in three of twenty images each, so that the images hang together in a ring.
fn ring(ties: usize) -> Network<SampledOrientation> {
    let simulated = Recipe {
        ties,
        tie_noise: 0.0,
        ..Recipe::GUSEV
    }
    .simulate();
    let mut network = sampled(&simulated);
    let pair = [network.images[0].clone(), network.images[1].clone()];
    network.images = (0..IMAGES).map(|image| pair[image % 2].clone()).collect();
    let exact: Vec<View> = (network.views.iter().copied())
        .filter(|view| view.point >= simulated.shots)
        .collect();
    network.views.retain(|view| view.point < simulated.shots);
    let mut normals = Normals::new(1);
    for view in exact {
        let first = 2 * (view.point % (IMAGES / 2));
        let mut measure = |image: usize| {
            let (truth, entry) = (&simulated.orientations[view.image], &pair[view.image]);
            let x_lines = view.x_lines + NOISE * normals.next();
            let point_m = &simulated.points_m[view.point];
            let y_px =
                place_px(truth, entry.focal_length_px, x_lines, point_m) + NOISE * normals.next();
            network.views.push(View {
                image: image % IMAGES,
                x_lines,
                y_px,
                ..view
            });
        };
        measure(first + view.image);
        if view.image == 0 {
            measure(first + 2);
        }
    }
    network
}

/// Median of `runs` adjustments, seconds, with steps and σ0.
fn time(what: &str, network: &Network<SampledOrientation>, runs: usize) {
    let mut seconds: Vec<f64> = Vec::new();
    let mut result = None;
    for _ in 0..runs {
        let start = Instant::now();
        let adjustment = solve(network, &BundleOptions::default()).unwrap();
        seconds.push(start.elapsed().as_secs_f64());
        result = Some((adjustment.steps(), adjustment.sigma0()));
    }
    seconds.sort_by(f64::total_cmp);
    let (steps, sigma0) = result.unwrap();
    println!(
        "adjustment, {what}: {:.4} s ({steps} steps, {} views, sigma0 {sigma0:.6})",
        seconds[runs / 2],
        network.views.len()
    );
}

fn main() {
    time("recipe", &sampled(&Recipe::GUSEV.simulate()), 11);
    for ties in [25_000, 50_000, 100_000] {
        time(&format!("{ties} ties in 20 images"), &ring(ties), 3);
    }
}
