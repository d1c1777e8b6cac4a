//! Times the geometry on all cores: points per second from the ground to the image.
//!
//! One scene (Gusev of Shan et al. 2005), one set of points, one camera model for all methods; the best of a few
//! rounds each, taken in turns so that a busy machine affects all alike.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a benchmark may fail loudly and prints its figures"
)]

use areograph_testing::scene;
use std::{hint::black_box, time::Instant};

use areograph::geom::pushbroom::{FixedPoint, FrameFirst, Limits, Projector, Solution, Unseen};
use nalgebra::Vector3;
use rayon::prelude::*;
use scene::GUSEV;

const POINTS: u32 = 1_000_000;
const ROUNDS: u32 = 5;
/// The papers' tolerance, for the published iterations.
const LIMITS: Limits = Limits {
    tolerance_lines: 0.1,
    steps_max: 100,
};

type Solve<'a> = Box<dyn Fn(&Vector3<f64>) -> Result<Solution, Unseen> + Sync + 'a>;

/// Points per second of one pass over `points_m`.
fn rate(points_m: &[Vector3<f64>], solve: &Solve<'_>) -> f64 {
    let mut lines = vec![0.0; points_m.len()];
    let start = Instant::now();
    lines
        .par_iter_mut()
        .zip(points_m)
        .for_each(|(line, point_m)| *line = solve(point_m).map_or(f64::NAN, |found| found.x));
    let elapsed_s = start.elapsed().as_secs_f64();
    assert!(black_box(&lines).iter().all(|line| line.is_finite()));
    points_m.len() as f64 / elapsed_s
}

fn main() {
    let model = GUSEV.euler(2);
    let vector = GUSEV.rotation_vector();
    let newton = Projector::new(&model, f64::from(GUSEV.lines));
    let newton = newton.unwrap().anchored();
    let newton_vector = Projector::new(&vector, f64::from(GUSEV.lines));
    let newton_vector = newton_vector.unwrap().anchored();
    let frame_first = FrameFirst::new(&model, GUSEV.focal_length_px()).unwrap();
    let fixed_point = FixedPoint::new(&model, GUSEV.focal_length_px()).unwrap();
    // 43.3 km of profile, as the paper's 142 footprints.
    let points_m = GUSEV.profile_m(POINTS, 43_300.0 / f64::from(POINTS));
    let methods: [(&str, Solve<'_>); 4] = [
        ("Newton, angles", Box::new(|point| newton.project(point))),
        (
            "Newton, rotation vector",
            Box::new(|point| newton_vector.project(point)),
        ),
        (
            "frame first (A)",
            Box::new(|point| frame_first.solve(point, &LIMITS, |_| {})),
        ),
        (
            "fixed point (B)",
            Box::new(|point| fixed_point.solve(point, &LIMITS, |_| {})),
        ),
    ];
    let mut best = [0.0_f64; 4];
    for _ in 0..ROUNDS {
        for (best, (_, solve)) in best.iter_mut().zip(&methods) {
            *best = best.max(rate(&points_m, solve));
        }
    }
    println!(
        "registration, {POINTS} points, {} threads:",
        rayon::current_num_threads()
    );
    for (rate, (name, _)) in best.iter().zip(&methods) {
        println!(
            "  {name:24} {:7.2} million points/s, {:5.1} x frame first",
            rate / 1e6,
            rate / best[2]
        );
    }
}
