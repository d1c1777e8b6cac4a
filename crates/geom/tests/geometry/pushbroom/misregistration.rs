//! Two images of one site, one of them with a wrong clock.

use areograph_geom::{
    misregistration::{ImageToImage, Pair},
    pushbroom::Projector,
    random::Random,
};
use nalgebra::Vector3;

use super::scene::{GUSEV, Held, Scene};

/// A second look at Gusev from a neighbouring orbit.
const OBLIQUE: Scene = Scene {
    longitude_deg: 175.55,
    held: Held::Inertial { roll_deg: 2.2 },
    ..GUSEV
};

/// Image coordinates of a point in both images, lines and pixels from their middles.
fn seen(point_m: &Vector3<f64>) -> Pair {
    let place = |scene: &Scene| {
        let model = scene.rotation_vector();
        let projector = Projector::new(&model, f64::from(scene.lines)).unwrap();
        let solution = projector.project(point_m).unwrap();
        let across = solution.camera_m.y / solution.camera_m.z;
        [solution.x, -scene.focal_length_px() * across]
    };
    Pair {
        first: place(&GUSEV),
        second: place(&OBLIQUE),
    }
}

/// A grid of tie points along the first image, `across` of them in each of `along` rows, within 1.4 km.
fn ties(along: u32, across: u32) -> Vec<Pair> {
    let mut found = Vec::new();
    for row in 0..along {
        let share = f64::from(row) / f64::from(along - 1) - 0.5;
        let at_s = 0.9 * share * GUSEV.duration_s;
        let ground = GUSEV.boresight_ground_m(at_s);
        let sideways = GUSEV.pose(at_s).mars_to_camera.row(1).transpose();
        for column in 0..across {
            let offset = f64::from(column) / f64::from(across - 1) - 0.5;
            found.push(seen(&(ground + sideways * (2_800.0 * offset))));
        }
    }
    found
}

/// Footprints whose line in the second image is `late` lines too large, as by a wrong clock.
fn footprints(late: f64) -> Vec<Pair> {
    let mut found: Vec<Pair> = GUSEV.profile_m(120, 305.0).iter().map(seen).collect();
    for pair in &mut found {
        pair.second[0] += late;
    }
    found
}

#[test]
fn a_late_clock_is_seen_in_lines() {
    for (along, across, order, tolerance) in [(20, 5, 2, 0.05), (8, 4, 1, 3.0)] {
        let ties = ties(along, across);
        let fit = ImageToImage::through(&ties).unwrap();
        let found = fit.misregistration(&footprints(72.0));
        assert_eq!((fit.order(), fit.ties_rejected), (order, 0));
        // Lines and samples: what a plane transformation of this order leaves of two orbits over a sphere.
        assert!((found.lines.mean + 72.0).abs() < tolerance, "{found:?}");
        assert!(found.samples.mean.abs() < tolerance, "{found:?}");
        assert!(found.lines.standard_deviation < tolerance, "{found:?}");
        assert!(fit.tie_lines.standard_deviation < tolerance, "{fit:?}");
        assert_eq!(found.lines.n as usize + found.beyond_ties, 120);
    }
}

#[test]
fn blunders_among_the_ties_are_left_out() {
    let mut ties = ties(20, 5);
    for (index, tie) in ties.iter_mut().enumerate() {
        // A wave of a fifth of a pixel represents the noise of measuring.
        let noise = 0.2 * (7.3 * index as f64).sin();
        tie.second[0] += noise;
        tie.second[1] -= noise;
        if index % 20 == 7 {
            tie.second[0] += 40.0; // 5 % of the ties
        }
    }
    let fit = ImageToImage::through(&ties).unwrap();
    let found = fit.misregistration(&footprints(-23.5));
    assert_eq!((fit.ties, fit.ties_rejected), (95, 5));
    // Lines: the mean of a hundred waves of 0.2, and 0.05 of the transformation.
    assert!((found.lines.mean - 23.5).abs() < 0.1, "{found:?}");
}

#[test]
fn ties_that_determine_nothing_give_nothing() {
    let all = ties(8, 4);
    assert!(ImageToImage::through(&all[..3]).is_none());
    assert!(ImageToImage::through(&[]).is_none());
    let mut one_line = all.clone();
    for tie in &mut one_line {
        tie.first[1] = 0.1 * tie.first[0];
    }
    assert!(ImageToImage::through(&one_line).is_none());
    let mut lost = all.clone();
    lost[3].second[0] = f64::NAN;
    assert!(ImageToImage::through(&lost).is_none());
    let found = ImageToImage::through(&all).unwrap().misregistration(&[]);
    assert_eq!((found.lines.n, found.beyond_ties), (0, 0));
}

#[test]
fn the_stated_uncertainty_is_that_of_noise_in_the_ties() {
    const TRIALS: u32 = 300;
    const NOISE_LINES: f64 = 0.4;
    for (along, across) in [(20, 5), (8, 4)] {
        let ties = ties(along, across);
        let footprints = footprints(0.0);
        let without = ImageToImage::through(&ties).unwrap();
        let truth = without.misregistration(&footprints).lines.mean;
        let mut random = Random::new(u64::from(along), "misregistration");
        let mut squares = 0.0;
        for _ in 0..TRIALS {
            let mut noisy = ties.clone();
            for tie in &mut noisy {
                tie.second[0] += NOISE_LINES * random.normal();
            }
            let fit = ImageToImage::through(&noisy).unwrap();
            let found = fit.misregistration(&footprints);
            squares += ((found.lines.mean - truth) / found.lines_sigma).powi(2);
        }
        // Of 300 trials an rms is known to 4 %; 32 tie points with outliers removed determine their noise to 15 %.
        let rms = (squares / f64::from(TRIALS)).sqrt();
        assert!((0.85..1.25).contains(&rms), "{along} × {across}: {rms}");
    }
}
