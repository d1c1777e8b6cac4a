//! Offsets of invented orthoimages with a known shift.

use std::f64::consts::TAU;

use super::*;
use crate::invented_orthoimage::{CELL_M, orthoimage};
use areograph_geom::random::Random;

/// Ground without repetition: waves of all directions and lengths from 6 to 60 cells, about 120.
fn waves() -> Vec<[f64; 4]> {
    waves_to(60.0)
}

/// The same with waves up to this length, cells.
fn waves_to(longest: f64) -> Vec<[f64; 4]> {
    let mut random = Random::new(7, "ground");
    let mut wave = || {
        let length = random.between_log(6.0, longest);
        let (direction, phase) = (random.between(0.0, TAU), random.between(0.0, TAU));
        let [down, across] = [direction.sin(), direction.cos()].map(|of| of * TAU / length);
        [down, across, phase, length.sqrt().min(8.0)]
    };
    (0..60).map(|_| wave()).collect()
}

fn ground(waves: &[[f64; 4]], [row, column]: [f64; 2]) -> f64 {
    let waves = waves
        .iter()
        .map(|[down, across, phase, size]| size * (down * row + across * column + phase).sin());
    (120.0 + 1.8 * waves.sum::<f64>()).clamp(1.0, 255.0)
}

/// The ground, shifted southwards and eastwards by some cells; without the cells of an eastern strip.
fn shifted(image: usize, first: [i64; 2], by: [f64; 2]) -> Orthoimage {
    let waves = waves();
    let east = first[1] + 300;
    orthoimage(image, first, [400, 330], move |cell| {
        if cell[1] >= east {
            return 0.0;
        }
        ground(&waves, [0, 1].map(|axis| cell[axis] as f64 - by[axis]))
    })
}

#[test]
fn known_shifts_are_found_between_cells() {
    let one = shifted(3, [-90, 1_000], [0.0; 2]);
    // Less than a cell, and farther than the room around a place without the shift of the complete orthoimages.
    for by in [[0.3, -0.4], [-70.25, 95.6]] {
        let other = shifted(5, [-160, 1_020], by);
        let found = offsets(&one, &other).unwrap();
        let medians_m = found.summaries_m().map(|of| of.median);
        println!(
            "{} of {} places: {medians_m:?} m",
            found.places.len(),
            found.squares
        );
        assert_eq!(found.images, [3, 5]);
        assert!(found.places.len() >= 12 && found.places.len() * 10 >= found.squares as usize * 9);
        for place in &found.places {
            for (axis, expected) in [by[1], -by[0]].into_iter().enumerate() {
                let error_m = place.offset_m[axis] - expected * CELL_M;
                // A tenth of a cell: brightness is rounded to whole numbers.
                assert!(error_m.abs() < 0.1 * CELL_M, "{place:?}");
            }
            assert!(place.sigma_m.iter().all(|of| *of < 0.1 * CELL_M) && place.correlation > 0.9);
        }
    }
}

/// Offsets that drift along the image, between small cells: coarse cells lead to the same offsets as one window.
#[test]
fn coarse_cells_lead_to_the_offsets_of_one_window() {
    // The reduced orthoimages show the longest ones alone.
    let waves = waves_to(600.0);
    let size = [620, 520];
    let drift = |row: f64| [0.012 * row - 60.3, 40.6 - 0.008 * row];
    let mut one = orthoimage(0, [0, 0], size, |cell| {
        ground(&waves, cell.map(|at| at as f64))
    });
    let other = orthoimage(1, [0, 0], size, |cell| {
        let [row, column] = cell.map(|at| at as f64);
        let [down, across] = drift(row);
        ground(&waves, [row - down, column - across])
    });
    // Cells of half a metre: errors of a kilometre are 63 reduced cells of 32.
    one.account.cell_m = 0.5;
    let cells = [&one, &other].map(|of| of.brightness.bytes());
    let [first, second] = [(&one, &cells[0]), (&other, &cells[1])]
        .map(|(of, cells)| Raster::of(&of.account.map, cells));
    let shift = shift(&first, &second, 0.5).unwrap();
    let reach = ROOM + shift.factor;
    assert_eq!(reach, 75);
    let levels = Levels::of([&first, &second], reach);
    let pair = Pair {
        account: &one.account,
        one: first,
        other: second,
    };
    let (mut led, mut matching) = (0, 0);
    for middle in middles(&pair.one) {
        let Some(found) = pair.found(middle, &shift, &levels) else {
            continue;
        };
        let template = pair.one.square(middle.map(|at| at - i64::from(HALF)), EDGE);
        let of_window = pair.matched(&template.unwrap(), middle, shift.by, reach);
        led += i32::from(levels.near(middle, shift.by, reach).is_some());
        matching += i32::from(of_window.is_some());
        // Both begin at the same whole cell.
        assert_eq!(found, of_window);
    }
    println!("{led} of {matching} places led by coarse cells");
    // Squares of coarse cells reach farther, and are not complete near the edges.
    assert!(matching >= 100 && led * 3 >= matching);
}

/// A window that is searched in cells of 16, then of 4, then of 1.
#[test]
fn several_levels_lead_to_a_shift_that_no_level_searches_at_once() {
    const REACH: u32 = 200;
    let waves = &waves_to(1_500.0)[..24];
    let (size, by) = ([1_100, 1_100], [151, -87]);
    let one = orthoimage(0, [0, 0], size, |cell| {
        ground(waves, cell.map(|at| at as f64))
    });
    let other = orthoimage(1, [0, 0], size, |cell| {
        ground(waves, [0, 1].map(|axis| (cell[axis] - by[axis]) as f64))
    });
    let cells = [&one, &other].map(|of| of.brightness.bytes());
    let [first, second] = [(&one, &cells[0]), (&other, &cells[1])]
        .map(|(of, cells)| Raster::of(&of.account.map, cells));
    let levels = Levels::of([&first, &second], REACH);
    assert_eq!(levels.edges(), [4, 16]);
    let pair = Pair {
        account: &one.account,
        one: first,
        other: second,
    };
    for middle in [[550, 550], [530, 570], [565, 541]] {
        let near = levels.near(middle, [0, 0], REACH).unwrap();
        let is_near = (0..2).all(|axis| near[axis].abs_diff(by[axis]) < u64::from(NEAR));
        assert!(is_near, "{middle:?}: {near:?}");
        let template = pair.one.square(middle.map(|at| at - i64::from(HALF)), EDGE);
        let found = pair
            .matched(&template.unwrap(), middle, near, NEAR)
            .unwrap();
        for (axis, expected) in [by[1], -by[0]].into_iter().enumerate() {
            let error_m = found.offset_m[axis] - expected as f64 * CELL_M;
            assert!(error_m.abs() < 0.1 * CELL_M, "{found:?}");
        }
    }
}

#[test]
fn other_ground_does_not_match() {
    let waves: Vec<[f64; 4]> = waves()
        .into_iter()
        .map(|[down, across, phase, size]| [across, -down, phase, size])
        .collect();
    let one = shifted(0, [0, 0], [0.0; 2]);
    let other = orthoimage(1, [0, 0], [400, 330], move |cell| {
        ground(&waves, cell.map(|at| at as f64))
    });
    // A few squares match by chance, and are not trusted.
    let found = offsets(&one, &other).unwrap();
    assert!(found.squares > 10 && found.places.is_empty(), "{found:?}");
    assert_eq!(found.rms_m(), None);
    let apart = shifted(1, [0, 5_000], [0.0; 2]);
    assert_eq!(offsets(&one, &apart), None);
}

#[test]
fn a_mismatch_does_not_count() {
    let place = |east_m: f64| PlaceOffset {
        cell: [0; 2],
        place_rad: [0.0; 2],
        offset_m: [east_m, 0.0],
        sigma_m: [0.1; 2],
        correlation: 0.9,
    };
    // A drift of 100 m along the image, and a place 400 m beside it.
    let drift_m = (0..=10).map(|at| 10.0 * f64::from(at));
    let mut pair = OrthoimageOffsets {
        images: [0, 1],
        cell_m: CELL_M,
        squares: 20,
        places: drift_m.chain([450.0]).map(place).collect(),
    };
    pair.leave_out_mismatches();
    assert_eq!(pair.places.len(), 11);
    pair.squares = 60;
    pair.leave_out_mismatches();
    assert!(pair.places.is_empty());
}
