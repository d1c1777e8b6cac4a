//! The published iterations on the points of one image.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::super::oriented::OrientedImage;
use areograph_base::{error::Result, schema::none_negative, watch::Watch};
use areograph_config::RegistrationConfig;
use areograph_geom::{
    pushbroom::{CameraModel, FixedPoint, FrameFirst, Limits, Solution, Unseen},
    statistics::Summary,
};

/// A published iteration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Iteration that treats the image as a frame with the orientation of the current line (Konecny et al. 1987, Wang
    /// 1990).
    FrameFirst,
    /// Iteration of equation 4 of Shan et al. 2005.
    FixedPoint,
}

/// Results of one iteration with one model for all points within the lines of the image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MethodRun {
    /// The iteration.
    pub method: Method,
    /// Order of the orientation polynomials: first as in Shan, Lee & Yoon 2002, or second as in Shan et al. 2005.
    #[schemars(extend("enum" = ["first_order", "second_order"]))]
    pub model: CameraModel,
    /// Number of points that were tried.
    pub points: u64,
    /// Numbers of points without a result, by reason.
    pub rejected: BTreeMap<String, u64>,
    /// Number of evaluations of the iteration formula per point with a result.
    pub evaluations: Summary,
    /// Line from this iteration minus line from Newton's method with the same model.
    pub difference_lines: Summary,
    /// Mean |step| of each iteration over the points with a result, lines; a point whose iteration has ended counts as
    /// 0.
    #[schemars(transform = none_negative)]
    pub mean_step_lines: Vec<f64>,
}

/// The steps of an iteration to the line of one point, and its result.
type Way = (Vec<f64>, std::result::Result<Solution, Unseen>);

/// All iterations, each with the evaluations of every point (0 without a result).
pub(super) fn run(
    camera: &OrientedImage<'_>,
    ground: &[Vector3<f64>],
    config: &RegistrationConfig,
    watch: Watch<'_>,
) -> Result<Vec<(MethodRun, Vec<u32>)>> {
    let limits = Limits {
        tolerance_lines: config.tolerance_lines,
        steps_max: config.steps_max,
    };
    let (focal_length_px, distortion) =
        (camera.detector.focal_length_px, camera.detector.distortion);
    let mut runs = Vec::new();
    // Two methods with two models.
    watch.announce(4 * ground.len());
    for (model, euler) in [
        (CameraModel::FirstOrder, &camera.first_order),
        (CameraModel::SecondOrder, &camera.second_order),
    ] {
        watch.check()?;
        let frame_first = FrameFirst::new(euler, focal_length_px);
        let ways = all_ways(ground, |point_m, on_step| {
            frame_first?
                .through(distortion)
                .solve(point_m, &limits, on_step)
        });
        runs.push(summed(camera, (Method::FrameFirst, model), ground, &ways));
        watch.step(ground.len() as u64, "points");
        watch.check()?;
        let fixed_point = FixedPoint::new(euler, focal_length_px);
        let ways = all_ways(ground, |point_m, on_step| {
            fixed_point?
                .through(distortion)
                .solve(point_m, &limits, on_step)
        });
        runs.push(summed(camera, (Method::FixedPoint, model), ground, &ways));
        watch.step(ground.len() as u64, "points");
    }
    Ok(runs)
}

fn all_ways(
    ground: &[Vector3<f64>],
    solve: impl Fn(&Vector3<f64>, &mut dyn FnMut(f64)) -> std::result::Result<Solution, Unseen> + Sync,
) -> Vec<Way> {
    let way = |point_m: &Vector3<f64>| {
        let mut steps = Vec::new();
        let solution = solve(point_m, &mut |step| steps.push(step));
        (steps, solution)
    };
    ground.par_iter().map(way).collect()
}

fn summed(
    camera: &OrientedImage<'_>,
    (method, model): (Method, CameraModel),
    ground: &[Vector3<f64>],
    ways: &[Way],
) -> (MethodRun, Vec<u32>) {
    let newton = camera.projector_of(model);
    let mut rejected = BTreeMap::new();
    let (mut evaluations, mut differences, mut each) = (Vec::new(), Vec::new(), Vec::new());
    let mut sums: Vec<f64> = Vec::new();
    for (point_m, (steps, solution)) in ground.iter().zip(ways) {
        match solution {
            Err(unseen) => {
                *rejected.entry(unseen.to_string()).or_insert(0) += 1;
                each.push(0);
            }
            Ok(solution) => {
                each.push(solution.evaluations);
                evaluations.push(f64::from(solution.evaluations));
                let exact = newton.as_ref().map(|newton| newton.project(point_m));
                if let Ok(Ok(exact)) = exact {
                    differences.push(solution.x - exact.x);
                }
                sums.resize(sums.len().max(steps.len()), 0.0);
                for (sum, step) in sums.iter_mut().zip(steps) {
                    *sum += step.abs();
                }
            }
        }
    }
    let converged = evaluations.len().max(1) as f64;
    let run = MethodRun {
        method,
        model,
        points: ground.len() as u64,
        rejected,
        evaluations: Summary::of(&evaluations),
        difference_lines: Summary::of(&differences),
        mean_step_lines: sums.into_iter().map(|sum| sum / converged).collect(),
    };
    (run, each)
}
