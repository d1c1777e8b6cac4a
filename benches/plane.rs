//! Time of a plane triangulation of ten thousand pictures.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a benchmark prints its times and may fail loudly"
)]

use std::time::Instant;

use areograph::{
    geom::plane::{Solution, solve},
    scene::PlaneRecipe,
};

fn main() {
    let scene = PlaneRecipe {
        grid: [100, 100],
        spacing_m: 50_000.0,
        points: 200_000,
        noise_m: 250.0,
        controls: 100,
        ..PlaneRecipe::NINE
    }
    .simulate(1);
    let net = scene.net;
    let start = Instant::now();
    let solution = solve(&net).unwrap();
    let solved_s = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let precision = solution.precision();
    let of_point = Solution::measurements_of(&net);
    let worst = (0..net.points)
        .map(|point| precision.place(&net, &of_point[point], None))
        .fold(0.0, f64::max);
    println!(
        "plane, {} pictures, {} points, {} measurements: solved in {solved_s:.2} s, sigma {:.3} m; covariances in {:.2} s, \
         largest {:.0} m",
        net.pictures,
        net.points,
        net.measurements.len(),
        solution.sigma(&net).unwrap(),
        start.elapsed().as_secs_f64(),
        250.0 * worst.sqrt(),
    );
}
