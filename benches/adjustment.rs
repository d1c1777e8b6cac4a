//! Times of the combined adjustment: the recipe, many tie points in twenty images, and a thousand images.
//!
//! If `AREOGRAPH_NETWORKS` names a folder, the networks are written there for `benches/ceres.cpp`.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::disallowed_methods,
    reason = "a benchmark prints its times, writes no product and may fail loudly"
)]

use areograph_testing::{orbits, recipe};
use std::{path::Path, time::Instant};

use areograph::geom::{
    attitude::rotation_vector,
    bundle::{Adjustment, BundleOptions, Network, solve},
    collinearity::by_camera_point,
    pushbroom::{ExteriorOrientation, SampledOrientation},
};
use orbits::{ORBITS, Orbits, instants, sampled};
use recipe::Recipe;

/// A thousand images: ties connect images that are up to this far apart, in groups along the flight.
const THOUSAND: Orbits = Orbits {
    places: 1_000 / ORBITS,
    ties: 500_000,
    ..TWENTY
};
/// Twenty images with the noise that the published adjustment takes for standard deviations, ten times that of
/// matching.
const TWENTY: Orbits = Orbits {
    places: 1,
    ties: 100_000,
    noise: 1.0,
    shift_lines: 25.0,
    position_bias_m: 20.0,
};

/// Adjusts a network `runs` times and prints the median time.
fn time(what: &str, network: &Network<SampledOrientation>, runs: usize) {
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
    if let Some(folder) = std::env::var_os("AREOGRAPH_NETWORKS") {
        let numbers = numbers(network, seconds, &adjustment);
        let bytes: Vec<u8> = numbers.into_iter().flat_map(f64::to_le_bytes).collect();
        std::fs::write(Path::new(&folder).join(what), bytes).unwrap();
    }
}

/// The network in a form for other programs, with our time and sum of squares, one number after the other.
fn numbers(
    network: &Network<SampledOrientation>,
    seconds: f64,
    adjustment: &Adjustment,
) -> Vec<f64> {
    let mut numbers = vec![network.images.len() as f64];
    for image in &network.images {
        let lines = instants(image.half_lines);
        let samples: Vec<_> = lines.iter().map(|x| (*x, image.base.pose(*x))).collect();
        let reference = samples[samples.len() / 2].1.mars_to_camera;
        numbers.extend([image.half_lines, image.focal_length_px]);
        numbers.extend(image.sigmas);
        numbers.extend(reference.transpose().iter());
        numbers.push(samples.len() as f64);
        for (x, pose) in samples {
            numbers.push(x);
            numbers.extend(pose.position_m.iter());
            numbers.extend(rotation_vector(&(pose.mars_to_camera * reference.transpose())).iter());
        }
    }
    numbers.push(network.points.len() as f64);
    for point in &network.points {
        numbers.extend(point.ground_m.iter());
        let sigma_m = point.known.map(|known| known.sigma_m);
        numbers.extend(sigma_m.unwrap_or_default().iter());
    }
    numbers.push(network.views.len() as f64);
    for view in &network.views {
        let image = &network.images[view.image];
        let (initial, advance) = image.base.pose_and_rate(view.x_lines);
        let camera_m = initial.camera_vector_m(&network.points[view.point].ground_m);
        let rate_m = advance.camera_vector_rate_m(&initial, &camera_m);
        let rate_px = by_camera_point(&camera_m, image.focal_length_px) * rate_m;
        numbers.extend([
            view.point as f64,
            view.image as f64,
            view.x_lines,
            view.y_px,
        ]);
        numbers.extend([view.sigma_px.x, view.sigma_px.y, rate_px.x]);
    }
    numbers.push(network.ranges.len() as f64);
    for range in &network.ranges {
        let base = network.images[range.image].base.pose(range.x_lines);
        numbers.extend([range.point as f64, range.image as f64, range.x_lines]);
        numbers.extend([range.range_m, range.sigma_m]);
        numbers.extend(base.position_m.iter());
    }
    numbers.extend([seconds, adjustment.weighted_squares]);
    numbers
}

/// Peak memory of this process, if the system reports it.
fn peak_memory() -> String {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    peak.map_or("not known".to_owned(), |peak| peak.trim().to_owned())
}

fn main() {
    let simulated = Recipe::GUSEV.simulate();
    let recipe = simulated.based_on(|image| sampled(&image.base, image.half_lines));
    time("recipe", &recipe, 11);
    for ties in [25_000, 50_000, 100_000] {
        let network = Orbits { ties, ..TWENTY }.network();
        time(&format!("{ties} ties in 20 images"), &network, 3);
    }
    let network = THOUSAND.network();
    time("500000 ties in 1000 images", &network, 1);
    println!("adjustment, memory at most: {}", peak_memory());
}
