//! Orthoimages of two synthetic cameras against the brightness of their synthetic ground, and against each other.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    reason = "numbers of a small grid"
)]

use nalgebra::{Matrix2, Vector2, Vector3};

use super::*;
use crate::{
    invented_pair::{Invented, LINES, RADIUS_M},
    look::LOOK,
};
use areograph_geom::{
    ellipsoid::spherical_to_xyz_m,
    imaging::{Affine, Patch, match_least_squares, search},
};

/// Cells of the terrain model and of orthoimages, metres.
const TERRAIN_CELL_M: f64 = 20.0;
const CELL_M: f64 = 4.0;

/// Slow hills: between cells of the terrain model their heights are linear to decimetres.
fn hill_m(place_m: &Vector3<f64>) -> f64 {
    25.0 * (place_m.z / 300.0).sin() + 20.0 * ((place_m.y + 0.3 * place_m.z) / 220.0).cos()
}

/// A terrace 250 m above the western ground. The second camera flies 120 km east.
fn terrace_m(place_m: &Vector3<f64>) -> f64 {
    if place_m.y > 0.0 { 250.0 } else { 0.0 }
}

/// The true terrain about the middle of the ground, with standard deviations of a metre.
fn model(ground_m: impl Fn(&Vector3<f64>) -> f64) -> SurfaceModel {
    let cell_rad = TERRAIN_CELL_M / RADIUS_M;
    let size = [120, 80];
    let mut heights = HeightGrid {
        size,
        first_rad: [-40.0 * cell_rad, 60.0 * cell_rad],
        cell_rad: [cell_rad; 2],
        radius_m: RADIUS_M,
        heights_m: Vec::new(),
    };
    let cells = (0..size[0]).flat_map(|row| (0..size[1]).map(move |column| [row, column]));
    heights.heights_m = cells
        .map(|cell| {
            let [longitude_rad, latitude_rad] = heights.place_rad(cell.map(|of| of as f64));
            ground_m(&spherical_to_xyz_m(longitude_rad, latitude_rad, RADIUS_M)) as f32
        })
        .collect();
    SurfaceModel {
        sigmas_m: vec![1.0; size[0] * size[1]],
        heights,
        parallel_rad: 0.0,
        pairs: Vec::new(),
    }
}

/// The image of a camera over this ground, rectified on `model`; its assumed pointing is `off_m` too far north and east.
fn orthoimage(
    number: usize,
    off_m: [f64; 2],
    ground_m: fn(&Vector3<f64>) -> f64,
    model: &SurfaceModel,
) -> Orthoimage {
    in_cells(CELL_M, number, off_m, ground_m, model).unwrap()
}

/// The same in cells of this edge; `None` if all are empty.
fn in_cells(
    cell_m: f64,
    number: usize,
    off_m: [f64; 2],
    ground_m: fn(&Vector3<f64>) -> f64,
    model: &SurfaceModel,
) -> Option<Orthoimage> {
    let waves = Invented::waves(5);
    let camera = Invented::camera(number, [0.0; 2]);
    let pixels = Invented::rendered(&camera, LINES, ground_m, &waves, number as u64 + 1);
    let folder = tempfile::tempdir().unwrap();
    let pyramid = Invented::pyramid(folder.path(), &pixels);
    let assumed = Invented::camera(number, off_m);
    let view = Invented::view(&assumed, &pyramid);
    let never = AtomicBool::new(false);
    rectified(&view, model, cell_m, None, (&never).into()).unwrap()
}

/// Row and column of the first whose middle is at this cell of the second.
fn aligned(one: &HeightGrid, other: &HeightGrid) -> [i64; 2] {
    let [longitude_rad, latitude_rad] = other.place_rad([0.0; 2]);
    one.cell_of(longitude_rad, latitude_rad).map(|at| {
        // Edges lie at whole cells.
        assert!((at - at.round()).abs() < 1e-3, "{at}");
        at.round() as i64
    })
}

/// A square of an orthoimage; `None` where a cell has no brightness.
fn square(of: &Orthoimage, first: [i64; 2], edge: usize) -> Option<Patch> {
    let [rows, columns] = of.account.map.size;
    let [row, column] = first.map(|at| usize::try_from(at).ok());
    let (row, column) = (row?, column?);
    if row + edge > rows || column + edge > columns {
        return None;
    }
    let (rows, columns) = (row..row + edge, column..column + edge);
    let pixels = of.brightness.window(&rows, &columns);
    let values: Vec<f32> = pixels.into_iter().map(f32::from).collect();
    let size = [edge; 2];
    values.iter().all(|of| *of > 0.0).then_some(Patch {
        first,
        size,
        values,
    })
}

/// Shifts of the second orthoimage against the first on a grid, cells southwards and eastwards.
fn shifts(one: &Orthoimage, other: &Orthoimage) -> Vec<[f64; 2]> {
    const HALF: i64 = 10;
    const REACH: i64 = 14;
    let offset = aligned(&one.account.map, &other.account.map);
    let rows = one.account.map.size.map(|size| size as i64);
    let middles = (0..rows[0])
        .step_by(25)
        .flat_map(|row| (0..rows[1]).step_by(25).map(move |column| [row, column]));
    let shift = |middle: [i64; 2]| {
        let template = square(one, middle.map(|at| at - HALF), 2 * HALF as usize + 1)?;
        let there = [0, 1].map(|axis| middle[axis] - offset[axis] - HALF - REACH);
        let area = square(other, there, 2 * (HALF + REACH) as usize + 1)?;
        let peak = search(&template, &area)?;
        let expected = template.middle() - Vector2::from(offset.map(|of| of as f64));
        let start = Affine {
            from: template.middle(),
            to: [0, 1]
                .map(|axis| peak.at[axis] as f64 - REACH as f64)
                .into(),
            matrix: Matrix2::identity(),
        };
        let start = Affine {
            to: start.to + expected,
            ..start
        };
        let found = match_least_squares(&template, &area, &start).ok()?;
        Some((found.affine.to - expected).into())
    };
    middles.filter_map(shift).collect()
}

/// Root mean square of both components together.
fn rms(shifts: &[[f64; 2]]) -> f64 {
    let squares = shifts.iter().map(|of| of[0] * of[0] + of[1] * of[1]);
    (squares.sum::<f64>() / shifts.len() as f64).sqrt()
}

#[test]
fn orthoimages_show_the_ground_where_it_is() {
    let model = model(hill_m);
    let of = orthoimage(1, [0.0; 2], hill_m, &model);
    let waves = Invented::waves(5);
    let columns = of.account.map.size[1];
    let mut differences = Vec::new();
    for (at, pixel) in of.brightness.bytes().iter().enumerate() {
        // White is clipped.
        if [0, 1, 255].contains(pixel) {
            continue;
        }
        let cell = [(at / columns) as f64, (at % columns) as f64];
        let [longitude_rad, latitude_rad] = of.account.map.place_rad(cell);
        let place_m = spherical_to_xyz_m(longitude_rad, latitude_rad, RADIUS_M);
        let height_m = hill_m(&place_m);
        let place_m = spherical_to_xyz_m(longitude_rad, latitude_rad, RADIUS_M + height_m);
        differences.push(f64::from(*pixel) - 120.0 - Invented::brightness(&place_m, &waves));
    }
    let square = differences.iter().map(|of| of * of).sum::<f64>();
    let rms = (square / differences.len() as f64).sqrt();
    println!("{} cells, rms {rms:.2} DN", differences.len());
    assert!(differences.len() > 80_000);
    // Noise of a DN, and detail between pixels; a displacement of half a pixel has more than twice as much.
    assert!(rms < 2.5, "{rms}");
    // 17.5 degrees off nadir, and 1 m of height.
    assert!((of.account.sigma_m - 0.316).abs() < 0.005);
    assert_eq!(of.account.hidden, 0);
}

#[test]
fn orthoimages_of_a_pair_agree_as_far_as_their_orientations_do() {
    let model = model(hill_m);
    let one = orthoimage(0, [0.0; 2], hill_m, &model);
    let agreeing = shifts(&one, &orthoimage(1, [0.0; 2], hill_m, &model));
    let apart = shifts(&one, &orthoimage(1, [24.0, -16.0], hill_m, &model));
    println!(
        "{} places: {:.3}; {:.3}",
        agreeing.len(),
        rms(&agreeing),
        rms(&apart)
    );
    assert!(agreeing.len() > 30 && apart.len() > 30);
    // Cells of about a pixel.
    assert!(rms(&agreeing) <= 0.3);
    // 24 m north and 16 m west, in cells.
    let expected = f64::hypot(6.0, 4.0);
    assert!((rms(&apart) - expected).abs() < 0.3);
}

#[test]
fn ground_that_relief_hides_stays_empty() {
    let model = model(terrace_m);
    let of = orthoimage(1, [0.0; 2], terrace_m, &model);
    let columns = of.account.map.size[1];
    let brightness = of.brightness.bytes();
    let shown = brightness.iter().enumerate();
    let shown = shown.filter(|(_, pixel)| **pixel > 0);
    let east_m = shown.map(|(at, _)| {
        let [longitude_rad, _] = of.account.map.place_rad([0.0, (at % columns) as f64]);
        longitude_rad * RADIUS_M
    });
    let east_m: Vec<f64> = east_m.collect();
    // The terrace hides 250 m times the tangent of 17.5 degrees of the ground to its west; its edge is a cell wide.
    let inside = |west_m: f64, east: f64| {
        east_m
            .iter()
            .filter(|at| **at > west_m && **at < east)
            .count()
    };
    assert_eq!(inside(-250.0 * 0.316 + TERRAIN_CELL_M, -TERRAIN_CELL_M), 0);
    assert!(inside(-200.0, -120.0) > 1_000);
    assert!(inside(20.0, 100.0) > 1_000);
    assert!(of.account.hidden > 100, "{}", of.account.hidden);
}

#[test]
fn ground_without_heights_stays_empty() {
    let mut holes = model(hill_m);
    for at in 0..holes.heights.heights_m.len() {
        if at % 80 > 38 {
            holes.heights.heights_m[at] = f32::NAN;
        }
    }
    let of = orthoimage(0, [0.0; 2], hill_m, &holes);
    let east_rad = of.account.map.edges_rad()[2];
    assert!(east_rad * RADIUS_M < 0.0, "the eastern half has no heights");
    let brightest = of.account.look.brightness.iter().max();
    assert!(of.account.look.size.iter().max() <= Some(&LOOK) && brightest > Some(&0));
}

#[test]
fn large_cells_are_means_of_small_ones_and_cells_larger_than_the_image_are_empty() {
    const FACTOR: usize = 4;
    let model = model(hill_m);
    let fine = orthoimage(1, [0.0; 2], hill_m, &model);
    let coarse = in_cells(FACTOR as f64 * CELL_M, 1, [0.0; 2], hill_m, &model).unwrap();
    let [_, columns] = coarse.account.map.size;
    // Differences from the means of small cells, `aside` of these too far east.
    let rms = |aside: i64| {
        let mut squares = Vec::new();
        for (at, pixel) in coarse.brightness.bytes().iter().enumerate() {
            let [longitude_rad, latitude_rad] =
                (coarse.account.map).place_rad([(at / columns) as f64, (at % columns) as f64]);
            let middle = fine.account.map.cell_of(longitude_rad, latitude_rad);
            let [row, column] = middle.map(|of| (of - 0.5 * (FACTOR as f64 - 1.0)).round() as i64);
            let cells = square(&fine, [row, column + aside], FACTOR);
            if let (true, Some(cells)) = (*pixel > 0, cells) {
                let mean = cells.values.iter().sum::<f32>() / (FACTOR * FACTOR) as f32;
                squares.push((f64::from(*pixel) - f64::from(mean)).powi(2));
            }
        }
        assert!(squares.len() > 4_000);
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    };
    let [here, beside] = [0, 1].map(rms);
    println!("large cells: {here:.2} DN, and {beside:.2} DN a small cell aside");
    // Large cells average over pixels of the image, which are not those of the map.
    assert!(here < 4.0 && beside > 1.5 * here, "{here} {beside}");
    assert!(in_cells(1e5, 1, [0.0; 2], hill_m, &model).is_none());
}
