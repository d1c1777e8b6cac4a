//! Two invented cameras over invented ground: every height is held against the ground that the images were made of.

use nalgebra::Vector3;

use super::*;
use crate::{
    geom::ellipsoid::spherical_to_xyz_m,
    stages::invented_pair::{
        LINES, RADIUS_M, Random, SAMPLES, camera, pyramid, rendered, view, waves,
    },
};

/// Edge of a cell, metres.
const CELL_M: f64 = 14.0;

/// Hills that shots do not show, some of them no larger than what is compared.
fn hill_m(place_m: &Vector3<f64>) -> f64 {
    let [east, north] = [place_m.y, place_m.z];
    15.0 * (north / 400.0).sin()
        + 10.0 * ((east + 0.3 * north) / 260.0).cos()
        + 3.0 * ((east - 0.6 * north) / 45.0).sin()
        + 1.0 * ((0.8 * east + north) / 18.0).sin()
}

/// What becomes of two images with these pixels, the second of which is believed to look `off_m` farther north and east.
fn mapped(pixels: [&[u8]; 2], off_m: [f64; 2], cell_m: f64) -> Surface {
    let folder = tempfile::tempdir().unwrap();
    let pyramids = pixels.map(|pixels| pyramid(folder.path(), pixels));
    let cameras = [camera(0, [0.0; 2]), camera(1, off_m)];
    let views = [0, 1].map(|number| view(&cameras[number], &pyramids[number]));
    let shots = (-30..=30).map(|shot| {
        let place_m = Vector3::new(RADIUS_M, 0.0, 300.0 * f64::from(shot));
        RADIUS_M * place_m.normalize()
    });
    let heights = Heights::at(Body::Mars, shots.collect());
    let options = Options {
        body: Body::Mars,
        cell_m,
        off_m: 30.0,
    };
    let never = AtomicBool::new(false);
    map_surface([&views[0], &views[1]], &heights, &options, (&never).into()).unwrap()
}

/// Errors of all heights, metres and in their standard deviations.
fn errors(surface: &Surface) -> Vec<[f64; 2]> {
    let model = &surface.model;
    let grid = &model.heights;
    let columns = grid.size[1];
    let known = grid.heights_m.iter().zip(&model.sigmas_m).enumerate();
    let known = known.filter(|(_, (height_m, _))| !height_m.is_nan());
    known
        .map(|(at, (height_m, sigma_m))| {
            let [longitude_rad, latitude_rad] =
                grid.place_rad([(at / columns) as f64, (at % columns) as f64]);
            // Where a line through the place and the centre meets the ground: hills change little over their own height.
            let place_m = spherical_to_xyz_m(longitude_rad, latitude_rad, RADIUS_M);
            let truth_m = RADIUS_M + hill_m(&place_m) - grid.radius_m;
            let error_m = f64::from(*height_m) - truth_m;
            [error_m, error_m / f64::from(*sigma_m)]
        })
        .collect()
}

fn root_mean_square(values: impl Iterator<Item = f64>) -> f64 {
    let squares: Vec<f64> = values.map(|value| value * value).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

fn pair_of_images() -> [Vec<u8>; 2] {
    [0, 1].map(|number| {
        rendered(
            &camera(number, [0.0; 2]),
            hill_m,
            &waves(5),
            number as u64 + 1,
        )
    })
}

#[test]
fn heights_are_within_what_they_state() {
    let [one, two] = pair_of_images();
    let surface = mapped([&one, &two], [0.0; 2], CELL_M);
    let SurfaceAccount { look, .. } = &surface.account;
    println!(
        "{:?}",
        SurfaceAccount {
            look: look.clone(),
            ..surface.account.clone()
        }
        .unfilled
    );
    let account = &surface.account;
    println!(
        "{} of {}, sigma {:.2} m, {:.2} m a pixel, correlation {:.3}, aside {:.3}, sample {:.2}, compared {:.1}",
        account.filled,
        account.cells,
        account.sigma_m,
        account.height_of_pixel_m,
        account.correlation,
        account.aside_m,
        account.sample_m,
        account.compared_m
    );
    let errors = errors(&surface);
    let rms_m = root_mean_square(errors.iter().map(|of| of[0]));
    let mean_m = errors.iter().map(|of| of[0]).sum::<f64>() / errors.len() as f64;
    let over = root_mean_square(errors.iter().map(|of| of[1]));
    let within = errors.iter().filter(|of| of[1].abs() <= 3.0).count();
    println!(
        "rms {rms_m:.3} m, mean {mean_m:.3}, {over:.3} sigma, {within} of {}",
        errors.len()
    );
    let mut sorted: Vec<f64> = errors.iter().map(|of| of[0].abs()).collect();
    sorted.sort_by(f64::total_cmp);
    println!(
        "median {:.2} 90% {:.2} 99% {:.2}",
        sorted[sorted.len() / 2],
        sorted[sorted.len() * 9 / 10],
        sorted[sorted.len() * 99 / 100]
    );
}
