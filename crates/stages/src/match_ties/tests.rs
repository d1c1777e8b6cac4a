//! Two invented cameras over invented ground: every tie point is compared with its true place in the second image.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "numbers of a byte"
)]

use nalgebra::{Vector2, Vector3};

use super::*;
use crate::invented_pair::{Invented, LINES, RADIUS_M, Random, SAMPLES};
use areograph_base::{body::Body, ties::Unmatched};

/// Hills that MOLA does not show: height above the sphere at a place, metres.
pub(crate) fn hill_m(place_m: &Vector3<f64>) -> f64 {
    15.0 * (place_m.z / 400.0).sin() + 10.0 * ((place_m.y + 0.3 * place_m.z) / 260.0).cos()
}

/// Shots of a profile along the images.
fn shots_m() -> Vec<Vector3<f64>> {
    let shot_m = |shot: i32| {
        let place_m = Vector3::new(RADIUS_M, 0.0, 300.0 * f64::from(shot));
        RADIUS_M * place_m.normalize()
    };
    (-30..=30).map(shot_m).collect()
}

/// Match of two images with these pixels; the assumed pointing of the second is `off_m` too far north and east.
fn matched(pixels: [&[u8]; 2], off_m: [f64; 2], most_m: f64) -> Matched {
    let folder = tempfile::tempdir().unwrap();
    let pyramids = pixels.map(|pixels| Invented::pyramid(folder.path(), pixels));
    let cameras = [Invented::camera(0, [0.0; 2]), Invented::camera(1, off_m)];
    let view = |number: usize| (number, Invented::view(&cameras[number], &pyramids[number]));
    let (first, second) = (view(0), view(1));
    let heights = Heights::at(Body::Mars, shots_m());
    let margin = Margin::within(2, most_m);
    let never = AtomicBool::new(false);
    let matched = match_pair([&first, &second], &heights, &margin, (&never).into());
    matched.unwrap().unwrap()
}

/// Errors in the second image, pixels and standard deviations.
fn errors_px(matched: &Matched) -> Vec<[[f64; 2]; 2]> {
    let cameras = [Invented::camera(0, [0.0; 2]), Invented::camera(1, [0.0; 2])];
    let folder = tempfile::tempdir().unwrap();
    let blank = Invented::pyramid(folder.path(), &vec![0; (LINES * SAMPLES) as usize]);
    let truth = Invented::view(&cameras[1], &blank);
    let ties = matched.ties.iter();
    ties.map(|[first, second]| {
        let place = Vector2::new(first.line, first.sample);
        let seen = truth
            .place(&Invented::ground_m(&cameras[0], &place, hill_m))
            .unwrap();
        let error = [second.line - seen.x, second.sample - seen.y];
        // Either image has half of the variance, and pixels of nearly the same size.
        let sigmas = second.sigma_px.unwrap().map(|sigma| sigma * 2.0_f64.sqrt());
        [error, [error[0] / sigmas[0], error[1] / sigmas[1]]]
    })
    .collect()
}

fn pair_of_images() -> [Vec<u8>; 2] {
    [0, 1].map(|number| {
        Invented::rendered(
            &Invented::camera(number, [0.0; 2]),
            LINES,
            hill_m,
            &Invented::waves(5),
            number as u64 + 1,
        )
    })
}

#[test]
fn matched_places_are_within_what_they_state_and_other_images_give_none() {
    let [one, two] = pair_of_images();
    let good = matched([&one, &two], [110.0, -70.0], 250.0);
    let errors = errors_px(&good);
    println!("{:?}", good.account);
    // Nearly all cells that both images show whole.
    let edge = good.account.unmatched[&Unmatched::Edge];
    assert!(
        good.account.ties * 5 >= (good.account.cells - edge) * 4,
        "{:?}",
        good.account
    );
    let [parts, with_ties] = good.account.parts;
    assert!(with_ties * 10 >= parts * 9, "{:?}", good.account);
    for axis in 0..2 {
        let square: f64 = errors.iter().map(|[error, _]| error[axis].powi(2)).sum();
        let rms = (square / errors.len() as f64).sqrt();
        let within = errors
            .iter()
            .filter(|[_, normalised]| normalised[axis].abs() <= 3.0);
        let within = within.count();
        println!(
            "axis {axis}: rms {rms:.3}, {within} of {} within",
            errors.len()
        );
        assert!(rms <= 0.3, "{rms}"); // pixels
        assert!(
            within * 100 >= errors.len() * 99,
            "{within} of {}",
            errors.len()
        );
    }
    // The same bytes with any number of threads.
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    let alone = pool.install(|| matched([&one, &two], [110.0, -70.0], 250.0));
    assert_eq!(alone.account, good.account);
    assert_eq!(alone.ties, good.ties);

    let line = |pixels: &[u8], number: u32| {
        let samples = SAMPLES as usize;
        pixels[number as usize * samples..][..samples].to_vec()
    };
    let mirrored: Vec<u8> = (0..LINES)
        .flat_map(|number| line(&two, number).into_iter().rev().collect::<Vec<_>>())
        .collect();
    let mut random = Random(9);
    let noise: Vec<u8> = two
        .iter()
        .map(|_| (100.0 + 20.0 * random.unit()) as u8)
        .collect();
    let elsewhere = Invented::rendered(
        &Invented::camera(1, [0.0; 2]),
        LINES,
        hill_m,
        &Invented::waves(6),
        2,
    );
    // Exchanged pixels are rejected by their labels: nothing else distinguishes them from orientation errors.
    for (what, first, second) in [
        ("mirrored", &one, &mirrored),
        ("of another place", &one, &elsewhere),
        ("noise", &one, &noise),
    ] {
        let found = matched([first, second], [0.0; 2], 250.0);
        println!(
            "{what}: {} of {}: {}",
            found.account.ties,
            found.account.cells,
            found.account.reasons()
        );
        assert!(
            found.account.is_refused && found.ties.is_empty(),
            "{what}: {:?}",
            found.account
        );
    }
    let flat = vec![90; one.len()];
    let found = matched([&flat, &two], [0.0; 2], 250.0);
    assert_eq!(
        found.account.unmatched[&Unmatched::Flat],
        found.account.cells
    );
    // Missing lines are counted, and the rest is matched.
    let lines = LINES * 6 / 10;
    let found = matched([&one, &two[..(lines * SAMPLES) as usize]], [0.0; 2], 250.0);
    assert!(found.account.ties >= 80, "{:?}", found.account);
    assert!(
        found.account.unmatched[&Unmatched::Missing] > 50,
        "{:?}",
        found.account
    );
    let last = found
        .ties
        .iter()
        .map(|[_, second]| second.line)
        .fold(0.0, f64::max);
    assert!(last < f64::from(lines), "{last}");
    // Two seconds of flight: no ground is where it is expected.
    let late = matched([&one, &two], [2_800.0, 0.0], 250.0);
    assert!(late.ties.is_empty(), "{:?}", late.account);
}

#[test]
fn tie_points_lie_at_the_shots_that_both_images_show() {
    let [one, two] = pair_of_images();
    let good = matched([&one, &two], [0.0; 2], 100.0);
    let camera = Invented::camera(0, [0.0; 2]);
    let ties = good.ties.iter().map(|[first, _]| {
        let place = Vector2::new(first.line, first.sample);
        RADIUS_M * Invented::ground_m(&camera, &place, hill_m).normalize()
    });
    let ties_m: Vec<Vector3<f64>> = ties.collect();
    let nearest_m = |shot_m: &Vector3<f64>| {
        let apart_m = ties_m.iter().map(|tie_m| (tie_m - shot_m).norm());
        apart_m.fold(f64::INFINITY, f64::min)
    };
    // Ends of the common ground: no tie point lies beyond, and the last shots may lie outside.
    let north_m = ties_m.iter().map(|tie_m| tie_m.z);
    let ends_m = [
        north_m.clone().fold(f64::INFINITY, f64::min) + 100.0,
        north_m.fold(f64::NEG_INFINITY, f64::max) - 100.0,
    ];
    let inside = shots_m()
        .into_iter()
        .filter(|shot_m| (ends_m[0]..ends_m[1]).contains(&shot_m.z));
    let nearest_m: Vec<f64> = inside.map(|shot_m| nearest_m(&shot_m)).collect();
    // Half the diagonal of a cell of 60 m, and hills of 25 m seen obliquely. Chance leaves a tie point so near to one shot in six.
    let near = nearest_m.iter().filter(|apart_m| **apart_m < 55.0).count();
    assert!(
        nearest_m.len() > 10 && near * 10 >= nearest_m.len() * 8,
        "{nearest_m:.0?}"
    );
}
