//! Times of the combined adjustment: the recipe, and many tie points in twenty images.
//!
//! Where `AREOGRAPH_NETWORK` names a file, the recipe goes there for `scripts/ceres.py`.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::disallowed_methods,
    reason = "a benchmark prints its times, writes no product and may fail loudly"
)]

#[path = "../tests/network/recipe.rs"]
mod recipe;
#[path = "../tests/pushbroom/scene.rs"]
mod scene;

use std::time::Instant;

use areograph::geom::{
    bundle::{Adjustment, BundleOptions, Network, View, solve},
    collinearity::by_camera_point,
    pushbroom::{
        CorrectedOrientation, Distortion, EulerPolynomial, ExteriorOrientation, Pose,
        SampledOrientation, Sighting,
    },
};
use recipe::{Normals, Recipe, Simulated};
use serde_json::json;

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

/// Noise of the ties in the ring, lines and pixels: ten times what matching attains, the standard deviation that
/// the published adjustment takes.
const NOISE: f64 = 1.0;

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
            network.views.push(View {
                image: image % IMAGES,
                x_lines: view.x_lines + NOISE * normals.next(),
                y_px: view.y_px + NOISE * normals.next(),
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

/// Median of `runs` adjustments, seconds, with the last of them.
fn time(what: &str, network: &Network<SampledOrientation>, runs: usize) -> (f64, Adjustment) {
    let mut seconds: Vec<f64> = Vec::new();
    let mut result = None;
    for _ in 0..runs {
        let start = Instant::now();
        let adjustment = solve(network, &BundleOptions::default()).unwrap();
        seconds.push(start.elapsed().as_secs_f64());
        result = Some(adjustment);
    }
    seconds.sort_by(f64::total_cmp);
    let (seconds, adjustment) = (seconds[runs / 2], result.unwrap());
    println!(
        "adjustment, {what}: {seconds:.4} s ({} steps, {} views, sigma0 {:.6})",
        adjustment.steps(),
        network.views.len(),
        adjustment.sigma0()
    );
    (seconds, adjustment)
}

/// The network as another program can adjust it, with our result.
fn document(
    network: &Network<SampledOrientation>,
    seconds: f64,
    adjustment: &Adjustment,
) -> serde_json::Value {
    let images = network.images.iter().map(|image| {
        json!({
            "half_lines": image.half_lines,
            "focal_length_px": image.focal_length_px,
            "sigmas": image.sigmas,
        })
    });
    let points = network.points.iter().map(|point| {
        json!({
            "ground_m": point.ground_m.as_slice(),
            "sigma_m": point.known.map(|known| [known.sigma_m.x, known.sigma_m.y, known.sigma_m.z]),
        })
    });
    let views = network.views.iter().map(|view| {
        let base = &network.images[view.image].base;
        let correction = adjustment.images[view.image].correction;
        let ground_m = adjustment.points[view.point].unwrap().ground_m;
        let adjusted = CorrectedOrientation { base, correction };
        let x_lines = Sighting::near(&adjusted, &Distortion::NONE, view.x_lines, &ground_m, 1e-3)
            .unwrap()
            .solution
            .x;
        let (pose, motion) = base.pose_and_rate(x_lines);
        let rows: [[f64; 3]; 3] = pose.mars_to_camera.transpose().into();
        let (initial, advance) = base.pose_and_rate(view.x_lines);
        let camera_m = initial.camera_vector_m(&network.points[view.point].ground_m);
        let rate_m = advance.camera_vector_rate_m(&initial, &camera_m);
        let focal_length_px = network.images[view.image].focal_length_px;
        let rate_px = by_camera_point(&camera_m, focal_length_px) * rate_m;
        json!({
            "point": view.point,
            "image": view.image,
            "x_lines": view.x_lines,
            "y_px": view.y_px,
            "sigma_px": view.sigma_px.as_slice(),
            "px_per_line": rate_px.x,
            "near": {
                "x_lines": x_lines,
                "position_m": pose.position_m.as_slice(),
                "mars_to_camera": rows,
                "advance_m": motion.advance_m.as_slice(),
                "turn_rad": motion.turn_rad.as_slice(),
            },
        })
    });
    let ranges = network.ranges.iter().map(|range| {
        let base = network.images[range.image].base.pose(range.x_lines);
        json!({
            "point": range.point,
            "image": range.image,
            "x_lines": range.x_lines,
            "range_m": range.range_m,
            "sigma_m": range.sigma_m,
            "position_m": base.position_m.as_slice(),
        })
    });
    json!({
        "images": images.collect::<Vec<_>>(),
        "points": points.collect::<Vec<_>>(),
        "views": views.collect::<Vec<_>>(),
        "ranges": ranges.collect::<Vec<_>>(),
        "areograph": {
            "seconds": seconds,
            "sigma0": adjustment.sigma0(),
            "degrees_of_freedom": adjustment.degrees_of_freedom(),
        },
    })
}

fn main() {
    let recipe = sampled(&Recipe::GUSEV.simulate());
    let (seconds, adjustment) = time("recipe", &recipe, 11);
    if let Some(path) = std::env::var_os("AREOGRAPH_NETWORK") {
        let document = document(&recipe, seconds, &adjustment);
        std::fs::write(path, serde_json::to_vec(&document).unwrap()).unwrap();
    }
    for ties in [25_000, 50_000, 100_000] {
        time(&format!("{ties} ties in 20 images"), &ring(ties), 3);
    }
}
