//! Mosaics of invented orthoimages.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "numbers of a small grid"
)]

use super::*;
use crate::invented_orthoimage::{CELL_M, RADIUS_M, orthoimage};

/// Number of columns of an orthoimage, and of those between the first columns of two.
const COLUMNS: usize = 120;
const APART: i64 = 60;

/// Brightness of the ground: hills of unequal lengths, between 40 and 160.
fn ground([row, column]: [i64; 2]) -> f64 {
    let [row, column] = [row as f64, column as f64];
    100.0 + 35.0 * (0.31 * row + 0.5 * (0.17 * column).sin()).sin() + 25.0 * (0.23 * column).cos()
}

/// Two strips side by side: the second with another tone, both with a hole in the middle of the overlap.
fn strips() -> [Orthoimage; 2] {
    let is_hole = |[row, column]: [i64; 2]| (40..50).contains(&row) && (80..90).contains(&column);
    let strip = |image: usize, gain: f64, offset: f64| {
        orthoimage(
            image,
            [-20, APART * image as i64],
            [200, COLUMNS],
            move |cell| {
                if is_hole(cell) {
                    0.0
                } else {
                    gain * ground(cell) + offset
                }
            },
        )
    };
    [strip(0, 1.0, 0.0), strip(1, 0.8, 40.0)]
}

/// Distance of a place from the western or eastern edge of a strip, metres.
fn inside_m(of: usize, [longitude_rad, _]: [f64; 2]) -> f64 {
    let west_m = longitude_rad * RADIUS_M - (APART * of as i64) as f64 * CELL_M;
    west_m.min(COLUMNS as f64 * CELL_M - west_m).max(0.0)
}

fn made(orthoimages: &[Orthoimage], offsets: &[OrthoimageOffsets], is_balanced: bool) -> Mosaic {
    let never = AtomicBool::new(false);
    let made = mosaic(orthoimages, offsets, is_balanced, inside_m, (&never).into());
    made.unwrap().unwrap()
}

#[test]
fn every_cell_is_that_of_the_orthoimage_that_the_sources_identify() {
    let strips = strips();
    let mosaic = made(&strips, &[], false);
    let [rows, columns] = mosaic.account.map.size;
    assert_eq!([rows, columns], [200, 180]);
    let cells = strips.each_ref().map(|of| of.brightness.bytes());
    let rasters = [0, 1].map(|of: usize| Raster::of(&strips[of].account.map, &cells[of]));
    let first = first_cell(&mosaic.account.map);
    let mut cells = [0_u32; 3];
    let [brightnesses, sources] = [&mosaic.brightness, &mosaic.sources].map(Tiles::bytes);
    for (at, (brightness, source)) in brightnesses.iter().zip(&sources).enumerate() {
        let cell = [
            first[0] + (at / columns) as i64,
            first[1] + (at % columns) as i64,
        ];
        cells[usize::from(*source)] += 1;
        match source {
            0 => {
                assert_eq!(*brightness, 0);
                assert!(rasters.iter().all(|of| of.at(cell) == 0));
            }
            _ => assert_eq!(*brightness, rasters[usize::from(*source) - 1].at(cell)),
        }
    }
    // The hole.
    assert_eq!(cells[0], 100);
    let counted = mosaic.account.images.iter().map(|of| of.cells);
    assert!(counted.eq(cells[1..].iter().copied()));
    // Each strip keeps its own side, and the seam is between three quarters inside either.
    for row in 0..rows {
        let sources = &sources[row * columns..][..columns];
        assert!(sources[..APART as usize].iter().all(|of| *of == 1));
        assert!(sources[COLUMNS..].iter().all(|of| *of == 2));
    }
    let detail = mosaic.account.detail.unwrap();
    assert!(detail.sources.contains(&1) && detail.sources.contains(&2));
}

#[test]
fn balanced_tones_leave_no_step_at_the_seam() {
    let step = |mosaic: &Mosaic| {
        let columns = mosaic.account.map.size[1];
        let (mut sum, mut count) = (0.0, 0.0_f64);
        let [brightness, sources] = [&mosaic.brightness, &mosaic.sources].map(Tiles::bytes);
        for (at, pair) in sources.windows(2).enumerate() {
            if pair == [1, 2] && at % columns + 1 < columns {
                let first = first_cell(&mosaic.account.map);
                let cell = |at: usize| {
                    [
                        first[0] + (at / columns) as i64,
                        first[1] + (at % columns) as i64,
                    ]
                };
                let [one, other] = [at, at + 1].map(|at| f64::from(brightness[at]));
                sum += (other - one - (ground(cell(at + 1)) - ground(cell(at)))).abs();
                count += 1.0;
            }
        }
        assert!(count > 100.0);
        sum / count
    };
    let strips = strips();
    let [balanced, unbalanced] = [true, false].map(|of| step(&made(&strips, &[], of)));
    println!("steps of {balanced:.2} and {unbalanced:.2} grey values");
    // Rounding to whole grey values, and slopes of the ground times the difference of gains. The tones meet where the ground has
    // a brightness of 200, which it does not reach.
    assert!(
        balanced < 2.0 && unbalanced > 5.0,
        "{balanced} {unbalanced}"
    );
}

#[test]
fn places_count_where_the_seam_crosses_their_squares() {
    let strips = strips();
    let mosaic = made(&strips, &[], false);
    let columns = mosaic.account.map.size[1];
    let row = 100;
    let sources = mosaic.sources.window(&(row..row + 1), &(0..columns));
    let seam = sources.iter().position(|of| *of == 2).unwrap();
    let first = first_cell(&mosaic.account.map);
    let place = |column: usize, east_m: f64| PlaceOffset {
        cell: [first[0] + row as i64, first[1] + column as i64],
        place_rad: [0.0; 2],
        offset_m: [east_m, 0.0],
        sigma_m: [0.1; 2],
        correlation: 0.9,
    };
    let pair = OrthoimageOffsets {
        images: [0, 1],
        cell_m: CELL_M,
        squares: 3,
        places: vec![place(seam, 3.0), place(seam - 1, -4.0), place(2, 100.0)],
    };
    let crossed = pair
        .cells()
        .into_iter()
        .filter(|cell| cell[1] > first[1] + 2);
    let crossed: Vec<[i64; 2]> = crossed.rev().collect();
    let found = made(&strips, &[pair], false).account.seams;
    assert_eq!(found.len(), 1);
    assert_eq!((found[0].images, &found[0].cells), ([0, 1], &crossed));
}

#[test]
fn too_many_and_no_orthoimages_are_not_joined() {
    let never = AtomicBool::new(false);
    let join = |of: &[Orthoimage]| mosaic(of, &[], false, inside_m, (&never).into());
    assert_eq!(join(&[]).unwrap(), None);
    let small = |image: usize| orthoimage(image, [0, 0], [2, 2], |_| 9.0);
    let many: Vec<Orthoimage> = (0..=Set::MOST).map(small).collect();
    let message = join(&many).unwrap_err().to_string();
    assert!(
        message.contains("65 orthoimages") && message.contains("at most 64"),
        "{message}"
    );
    let far = [small(0), orthoimage(1, [20_000, 9_000], [2, 2], |_| 9.0)];
    let message = join(&far).unwrap_err().to_string();
    assert!(message.contains("cells of 5 m"), "{message}");
}
