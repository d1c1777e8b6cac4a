//! Two invented cameras over invented ground: every height is compared with the ground from which the images were
//! rendered.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "numbers of a byte"
)]

use nalgebra::Vector3;

use super::*;
use crate::invented_pair::{Invented, LINES, RADIUS_M, SAMPLES};
use areograph_geom::{
    ellipsoid::spherical_to_xyz_m,
    intersection::{IntersectionLimits, intersect},
};

/// Edge of a cell, metres: three pixels.
const CELL_M: f64 = 14.0;
/// A cell for tests that need no fine ground, compared in halved images.
const COARSE_M: f64 = 45.0;

/// Hills that shots do not show, the smallest of them no larger than the square that is compared for a height.
fn hill_m(place_m: &Vector3<f64>) -> f64 {
    let [east, north] = [place_m.y, place_m.z];
    15.0 * (north / 400.0).sin()
        + 10.0 * ((east + 0.3 * north) / 260.0).cos()
        + 3.0 * ((east - 0.6 * north) / 45.0).sin()
        + ((0.8 * east + north) / 18.0).sin()
        + 0.4 * ((east - 0.2 * north) / 9.0).cos()
}

/// Terrain model of two images with these pixels; the assumed pointing of the second is `off_m` too far north and east.
fn mapped(pixels: [&[u8]; 2], off_m: [f64; 2], cell_m: f64) -> Result<Surface> {
    let folder = tempfile::tempdir().unwrap();
    let pyramids = pixels.map(|pixels| Invented::pyramid(folder.path(), pixels));
    let cameras = [Invented::camera(0, [0.0; 2]), Invented::camera(1, off_m)];
    let views = [0, 1].map(|number| Invented::view(&cameras[number], &pyramids[number]));
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
    map_surface([&views[0], &views[1]], &heights, &options, (&never).into())
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
            // Hills change by less than a millimetre over the displacement that their height causes.
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

/// Rendered lines of an image: enough of the ground.
const DOWN: u32 = 560;

/// The first lines of an image.
fn image(number: usize, waves: &[[f64; 5]]) -> Vec<u8> {
    let seed = number as u64 + 1;
    Invented::rendered(
        &Invented::camera(number, [0.0; 2]),
        DOWN,
        hill_m,
        waves,
        seed,
    )
}

fn pair_of_images() -> [Vec<u8>; 2] {
    [0, 1].map(|number| image(number, &Invented::waves(5)))
}

#[test]
fn heights_are_within_what_they_state_and_their_bytes_are_those_of_any_thread() {
    let [one, two] = pair_of_images();
    let surface = mapped([&one, &two], [0.0; 2], CELL_M).unwrap();
    let account = &surface.account;
    let errors = errors(&surface);
    let rms_m = root_mean_square(errors.iter().map(|of| of[0]));
    let mean_m = errors.iter().map(|of| of[0]).sum::<f64>() / errors.len() as f64;
    let over = root_mean_square(errors.iter().map(|of| of[1]));
    let within = errors.iter().filter(|of| of[1].abs() <= 3.0).count();
    println!(
        "{} of {} cells, {:?}; rms {rms_m:.2} m of {:.1} m a pixel, stated {:.2} m, mean {mean_m:.3} m, {over:.2} sigma, {within} \
         within; aside {:.3} m",
        account.filled,
        account.cells,
        account.unfilled,
        account.height_of_pixel_m,
        account.sigma_m,
        account.aside_m
    );
    // Cells that both images show whole have heights; near an edge the compared square is incomplete.
    assert!(account.filled * 100 >= account.searched() * 99);
    assert!(account.filled > 5_000);
    // A twentieth of a pixel, and the hills that are smaller than the compared square.
    assert!(rms_m <= 0.05 * account.height_of_pixel_m + 0.4, "{rms_m}");
    // Ground as smooth as this is matched better than 0.06 pixels, the least stated uncertainty of a tie point.
    assert!((0.35..1.2).contains(&over), "{over}");
    assert!(within * 100 >= errors.len() * 99, "{within}");
    assert!(mean_m.abs() <= 0.3 * account.sigma_m, "{mean_m}");

    let coarse = mapped([&one, &two], [0.0; 2], COARSE_M).unwrap();
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    let alone = pool.install(|| mapped([&one, &two], [0.0; 2], COARSE_M).unwrap());
    assert_eq!(bits(&alone), bits(&coarse));
}

fn bits(surface: &Surface) -> Vec<u8> {
    postcard::to_allocvec(surface).unwrap()
}

#[test]
fn a_metre_of_height_is_what_rays_that_meet_say() {
    let cameras = [Invented::camera(0, [0.0; 2]), Invented::camera(1, [0.0; 2])];
    let folder = tempfile::tempdir().unwrap();
    let blank = Invented::pyramid(folder.path(), &vec![0; (LINES * SAMPLES) as usize]);
    let views = [0, 1].map(|number| Invented::view(&cameras[number], &blank));
    let shots_m = vec![Vector3::new(RADIUS_M, 0.0, 0.0)];
    let heights = Heights::at(Body::Mars, shots_m.clone());
    let common = Common::of([&views[0], &views[1]], Body::Mars, &heights, CELL_M).unwrap();
    let rays = [0, 1].map(|image: usize| {
        let place = views[image].place(&shots_m[0]).unwrap();
        cameras[image].ray(place.x, place.y)
    });
    let met = intersect(&rays, &IntersectionLimits::default()).unwrap();
    // Each image gets half of the variance of a place in one against the other: a pixel of either makes √2 of parallax.
    let up = shots_m[0].normalize();
    let sigma_m = up.dot(&(met.cofactor_m2 * up)).sqrt() / 2.0_f64.sqrt();
    let pixel_m = root_mean_square(common.pixels_m.into_iter());
    let of_pixel_m = common.height_of_sample_m() * pixel_m / common.sample_m();
    println!("{sigma_m:.2} m by intersection, {of_pixel_m:.2} m");
    // Line and sample spacings agree to a third, which the intersection takes into account and the edge of a pixel does not.
    assert!((sigma_m / of_pixel_m - 1.0).abs() < 0.3);
}

#[test]
fn other_pixels_and_other_orientations_give_no_surface_that_is_believed() {
    let [one, two] = pair_of_images();
    let samples = SAMPLES as usize;
    let mirrored: Vec<u8> = two
        .chunks_exact(samples)
        .flat_map(|line| line.iter().rev().copied())
        .collect();
    let elsewhere = image(1, &Invented::waves(6));
    let flat = vec![90; one.len()];
    for (what, first, second, off_m) in [
        ("mirrored", &one, &mirrored, [0.0; 2]),
        ("of another place", &one, &elsewhere, [0.0; 2]),
        ("flat", &flat, &two, [0.0; 2]),
        // Four hundred metres along the flight: no ground is where it is expected.
        ("late", &one, &two, [400.0, 0.0]),
    ] {
        let account = mapped([first, second], off_m, COARSE_M).unwrap().account;
        println!(
            "{what}: {} of {}: {:?}",
            account.filled, account.cells, account.unfilled
        );
        assert!(account.is_refused, "{what}: {account:?}");
        assert!(account.look.heights.heights_m.iter().all(|of| of.is_nan()));
    }
    // Exchanged pixels resemble orientation errors: relief comes out inverted, where anything is found at all.
    let exchanged = mapped([&two, &one], [0.0; 2], COARSE_M).unwrap();
    println!(
        "exchanged: {} of {}",
        exchanged.account.filled, exchanged.account.cells
    );
    if !exchanged.account.is_refused {
        let rms_m = root_mean_square(errors(&exchanged).iter().map(|of| of[0]));
        assert!(rms_m > 10.0 * exchanged.account.sigma_m, "{rms_m}");
    }
    // Missing lines are counted, and the rest has heights.
    let lines = (DOWN * 6 / 10 * SAMPLES) as usize;
    let account = mapped([&one, &two[..lines]], [0.0; 2], COARSE_M)
        .unwrap()
        .account;
    assert!(account.filled > 200, "{account:?}");
    // Cells finer than a pixel, and images that look the same way, are rejected with advice.
    let fine = mapped([&one, &two], [0.0; 2], 1.0).unwrap_err();
    assert!(
        fine.to_string()
            .contains("surface.cell_m is 1; expected at least"),
        "{fine}"
    );
}
