//! Models of invented pairs over known ground, with errors of the covariances that the stage assumes.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "cells and heights of small grids"
)]

use std::collections::BTreeMap;

use super::*;
use crate::map_surface::ShotComparison;
use areograph_geom::random::Random;

/// Cells of the site, and their edge.
const SIZE: [usize; 2] = [240, 40];
const CELL_M: f64 = 15.0;
const RADIUS_M: f64 = 3_396_190.0;
/// Standard deviations of matching, and of the smoothing that all pairs share, metres.
const MATCHING_M: f64 = 2.0;
const SMOOTHING_M: f64 = 0.8;
/// Offset of the altimeter from the site, metres.
const SHOTS_M: f64 = 30.0;

/// The ground above the sphere, metres.
fn ground_m([row, column]: [usize; 2]) -> f64 {
    40.0 * (row as f64 / 31.0).sin() + 15.0 * (column as f64 / 9.0).cos() - 900.0
}

/// A pair: its images with the tangents of their views, rows, and offset, metres.
struct Invented {
    images: [usize; 2],
    views: [f64; 2],
    rows: std::ops::Range<usize>,
    offset_m: f64,
    has_shots: bool,
}

/// Errors of every image and of the smoothing, in standard deviations, cell by cell.
struct Errors {
    images: Vec<Vec<f64>>,
    smoothing: Vec<f64>,
}

impl Errors {
    fn new(seed: u64) -> Self {
        let mut random = Random::new(seed, "terrain models of pairs");
        let mut field = || (0..SIZE[0] * SIZE[1]).map(|_| random.normal()).collect();
        Self {
            images: (0..5).map(|_| field()).collect(),
            smoothing: field(),
        }
    }
}

fn surface(of: &Invented, errors: &Errors) -> Surface {
    let rows = of.rows.len();
    let north_rad = CELL_M / RADIUS_M;
    let cells = of
        .rows
        .clone()
        .flat_map(|row| (0..SIZE[1]).map(move |column| [row, column]));
    let height_m = |[row, column]: [usize; 2]| {
        let at = row * SIZE[1] + column;
        // Each image has half of the variance; its shift raises the ground of the pair or lowers it.
        let sign = (of.views[1] - of.views[0]).signum();
        let [first, second] = of.images.map(|image| errors.images[image][at]);
        let matched = sign * (second - first);
        let error_m = MATCHING_M * matched / 2_f64.sqrt() + SMOOTHING_M * errors.smoothing[at];
        // A column of holes.
        let is_hole = column == 7;
        if is_hole {
            f32::NAN
        } else {
            (ground_m([row, column]) + error_m + of.offset_m) as f32
        }
    };
    let heights_m: Vec<f32> = cells.map(height_m).collect();
    let sigma_m = MATCHING_M.hypot(SMOOTHING_M) as f32;
    let model = SurfaceModel {
        sigmas_m: heights_m.iter().map(|of| of * 0.0 + sigma_m).collect(),
        heights: HeightGrid {
            size: [rows, SIZE[1]],
            first_rad: [1.0, 0.2 - of.rows.start as f64 * north_rad],
            cell_rad: [north_rad / 0.2_f64.cos(), north_rad],
            radius_m: RADIUS_M,
            heights_m,
        },
        parallel_rad: 0.2,
        pairs: Vec::new(),
    };
    let filled = u32::try_from(rows * (SIZE[1] - 1)).unwrap();
    let mut shots = ShotComparison::default();
    if of.has_shots {
        shots.above_m.n = 50;
        shots.above_m.median = SHOTS_M - of.offset_m;
        shots.sigma_m = 1.0;
    }
    Surface {
        account: SurfaceAccount {
            images: of.images,
            directions: of.views.map(|view| [view, 0.0, -1.0]),
            cell_m: CELL_M,
            sample_m: CELL_M,
            compared_m: CELL_M,
            cells: filled,
            filled,
            unfilled: BTreeMap::new(),
            is_refused: false,
            convergence_rad: 0.4,
            height_of_pixel_m: 10.0,
            sigma_m: f64::from(sigma_m),
            jitter_m: 0.0,
            smoothing_m: SMOOTHING_M,
            correlation: 0.9,
            aside_m: 0.1,
            common_sigma_m: Some(20.0),
            shots_take_part: true,
            reference: None,
            shots,
            look: model.look(1),
            joint: None,
        },
        model,
    }
}

/// Two pairs with a common image that overlap, and one apart from them that only shots connect. The common image lies
/// between the two others, or beside them.
fn pairs(is_between: bool) -> [Invented; 3] {
    [
        Invented {
            images: [0, 1],
            views: [-0.2, 0.0],
            rows: 0..100,
            offset_m: 3.0,
            has_shots: true,
        },
        Invented {
            images: [1, 2],
            views: [0.0, if is_between { 0.3 } else { -0.3 }],
            rows: 60..150,
            offset_m: -9.0,
            has_shots: false,
        },
        Invented {
            images: [3, 4],
            views: [0.0, 0.3],
            rows: 170..240,
            offset_m: 5.0,
            has_shots: true,
        },
    ]
}

fn of_pairs(pairs: &[Invented], seed: u64) -> Surface {
    let errors = Errors::new(seed);
    let surfaces: Vec<Surface> = pairs.iter().map(|of| surface(of, &errors)).collect();
    joined(
        &surfaces.iter().collect::<Vec<_>>(),
        &AtomicBool::new(false),
    )
    .expect("the models can be joined")
}

/// Level of the site: the mean of the offsets by numbers of heights, metres.
fn level_m(pairs: &[Invented]) -> f64 {
    let weights = pairs.iter().map(|of| of.rows.len() as f64);
    let weighted = pairs.iter().map(|of| of.rows.len() as f64 * of.offset_m);
    weighted.sum::<f64>() / weights.sum::<f64>()
}

#[test]
fn joined_heights_are_within_what_they_state() {
    let [between_m, beside_m] = [true, false].map(of_two_m);
    // Errors of a common image between the others cancel in the mean.
    assert!(between_m < 0.8 * beside_m, "{between_m} {beside_m}");
}

/// Judges the joined heights; returns the standard deviation of a cell with two of them, metres.
fn of_two_m(is_between: bool) -> f64 {
    let pairs = pairs(is_between);
    let surface = of_pairs(&pairs, 1);
    let joint = surface.account.joint.as_ref().expect("several pairs");
    let model = &surface.model;
    assert_eq!(model.heights.size, SIZE);
    let (mut single, mut double) = (Vec::new(), Vec::new());
    for (at, height_m) in model.heights.heights_m.iter().enumerate() {
        let cell = [at / SIZE[1], at % SIZE[1]];
        let expected: u32 = (0..3)
            .map(|of| u32::from(pairs[of].rows.contains(&cell[0])) << of)
            .sum();
        let is_empty = expected == 0 || cell[1] == 7;
        // No hole of a pair, and no ground between pairs, has a height.
        assert_eq!(height_m.is_nan(), is_empty);
        assert_eq!(model.sigmas_m[at].is_nan(), is_empty);
        assert_eq!(model.pairs[at], if is_empty { 0 } else { expected });
        if is_empty {
            continue;
        }
        let error_m = f64::from(*height_m) - ground_m(cell) - level_m(&pairs);
        let ratio = error_m / f64::from(model.sigmas_m[at]);
        if expected.count_ones() > 1 {
            &mut double
        } else {
            &mut single
        }
        .push(ratio);
    }
    let z = |ratios: &[f64]| {
        (ratios.iter().map(|of| of * of).sum::<f64>() / ratios.len() as f64).sqrt()
    };
    println!(
        "z of cells with one height {:.3}, with two {:.3}",
        z(&single),
        z(&double)
    );
    // 1,600 cells and more: chance gives 1 ± 0.02, and the offsets of the pairs shift many cells together.
    for ratios in [&single, &double] {
        assert!(ratios.len() >= 1_500 && (0.8..1.25).contains(&z(ratios)));
    }
    assert_eq!(joint.several as usize, double.len());
    assert_eq!(joint.filled as usize, single.len() + double.len());
    let of = |row: usize| f64::from(model.sigmas_m[row * SIZE[1]]);
    assert!(of(80) < of(20));
    of(80)
}

#[test]
fn shifted_pairs_are_reported_at_their_seam_and_moved_back() {
    let pairs = pairs(true);
    let surface = of_pairs(&pairs, 2);
    let joint = surface.account.joint.expect("several pairs");
    let [seam] = &joint.seams[..] else {
        panic!("{:?}", joint.seams);
    };
    assert_eq!((seam.pairs, seam.cells), ([0, 1], 40 * 39));
    assert!(
        (seam.before_m - 12.0).abs() <= 3.0 * seam.sigma_m,
        "{seam:?}"
    );
    // 1,560 differences of 3.5 m: 0.09 m, from the scatter of 16 bands.
    assert!((0.045..0.18).contains(&seam.sigma_m), "{seam:?}");
    // The shots of one pair do not move it against the overlap.
    assert!(seam.after_m.abs() <= seam.sigma_m, "{seam:?}");
    assert!((0.9..1.1).contains(&seam.spread_sigmas), "{seam:?}");
    for (pair, invented) in joint.pairs.iter().zip(&pairs) {
        let off_m = pair.offset_m - (invented.offset_m - level_m(&pairs));
        assert!(off_m.abs() <= 3.0 * pair.offset_sigma_m, "{off_m} {pair:?}");
        // The shots of two pairs, 1 m each.
        assert!(pair.offset_sigma_m < 1.1, "{pair:?}");
    }
    assert_eq!(joint.pairs[1].shots_above_m, None);
}

#[test]
fn pairs_without_a_model_take_no_part() {
    let errors = Errors::new(3);
    let invented = pairs(true);
    let mut surfaces: Vec<Surface> = invented.iter().map(|of| surface(of, &errors)).collect();
    surfaces[0].account.is_refused = true;
    let found = joined(
        &surfaces.iter().collect::<Vec<_>>(),
        &AtomicBool::new(false),
    )
    .expect("two pairs are left");
    let joint = found.account.joint.expect("several pairs");
    let bits: Vec<Option<u32>> = joint.pairs.iter().map(|of| of.bit).collect();
    assert_eq!(bits, [None, Some(0), Some(1)]);
    assert!(joint.seams.is_empty());
    assert_eq!(found.model.heights.size[0], 240 - 60);
    for surface in &mut surfaces {
        surface.account.is_refused = true;
    }
    let none = joined(
        &surfaces.iter().collect::<Vec<_>>(),
        &AtomicBool::new(false),
    )
    .expect("a withheld model");
    assert!(none.account.is_refused && none.model.heights.heights_m.is_empty());
    for surface in &mut surfaces {
        surface.account.cells = 0;
    }
    let nothing = joined(
        &surfaces.iter().collect::<Vec<_>>(),
        &AtomicBool::new(false),
    );
    assert!(matches!(nothing, Err(JoinError::Nothing)));
}

#[test]
fn models_of_another_map_are_resampled() {
    let plane = |size: [usize; 2], first_rad: [f64; 2], cell_rad: [f64; 2]| {
        let mut grid = HeightGrid {
            size,
            first_rad,
            cell_rad,
            radius_m: RADIUS_M,
            heights_m: Vec::new(),
        };
        let cells = (0..size[0] * size[1]).map(|at| [(at / size[1]) as f64, (at % size[1]) as f64]);
        grid.heights_m = cells
            .map(|cell| {
                let place_rad = grid.place_rad(cell);
                (1e6 * (place_rad[0] - 1.0) + 5e5 * (place_rad[1] - 0.2)) as f32
            })
            .collect();
        SurfaceModel {
            sigmas_m: vec![2.0; grid.heights_m.len()],
            heights: grid,
            parallel_rad: 0.2,
            pairs: Vec::new(),
        }
    };
    let base = plane([50, 40], [1.0, 0.2], [4.5e-6, 4.4e-6]);
    let other = plane([50, 40], [1.0 + 1.03e-4, 0.2 - 1.07e-4], [4.6e-6, 4.4e-6]);
    let lattice = Lattice::over(&[&base, &other]).expect("both are small");
    let (own, resampled) = (lattice.take(&base), lattice.take(&other));
    let [rows, columns] = lattice.grid.size;
    let mut both = 0;
    for row in 0..rows {
        for column in 0..columns {
            let found = [&own, &resampled].map(|of| of.at([row, column]));
            let place_rad = lattice.grid.place_rad([row as f64, column as f64]);
            let expected_m = 1e6 * (place_rad[0] - 1.0) + 5e5 * (place_rad[1] - 0.2);
            for [height_m, sigma_m] in found.iter().flatten() {
                // Heights of up to 300 m as 32-bit numbers, metres.
                assert!(
                    (height_m - expected_m).abs() < 1e-3,
                    "{height_m} {expected_m}"
                );
                assert!((sigma_m - 2.0).abs() < 1e-9);
            }
            both += usize::from(found.iter().all(Option::is_some));
        }
    }
    // All but 24 rows and 23 columns of 50 and 40.
    assert!((380..460).contains(&both), "{both}");
}
