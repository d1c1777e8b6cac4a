//! A real image on a map: the pixels of M0100115, placed by its tie points with E0201461 and the cube of that image, against the pixels of
//! E0201461 that ISIS projected.
//!
//! No kernels of M0100115 are public as a small file, and the pixels of E0201461 are available after projection only. The tie points of
//! a control network connect the two: areograph carries their places in E0201461 to the ground with the tables of the cube, and writes
//! M0100115 with these ground control points. GDAL puts it on the map of the cube, where ISIS put E0201461.
//!
//! Heights are those of the MOLA grid, on which the areoid has been taken for the ellipsoid; the error displaces the map in the
//! direction in which E0201461 looks.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::float_cmp,
    clippy::print_stdout,
    clippy::format_push_string,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "helpers of tests work in temporary folders with small maps, and may fail loudly"
)]

use std::{fs, path::Path};

use areograph::{body::Body, geom::ellipsoid::on_ellipsoid_m};
use nalgebra::{Vector2, Vector3};

use crate::{
    common::{
        mission::{areograph, succeed},
        readers::{output, program},
        real_data,
    },
    oriented_cube::{cube, site},
};

/// Map of the cube, by its label: sinusoidal on a sphere, from the outer corner of the first pixel.
const SPHERE_M: f64 = 3_396_190.0;
const CENTRE_DEG: f64 = 141.566_004_633_48;
const CORNER_M: [f64; 2] = [-911.873_930_297_14, 2_032_426.702_335_3];
const PIXEL_M: f64 = 4.676_276_565_626_3;
const EDGE: usize = 500;
/// Edge of a tile of the cube, the first byte of its pixels, and tiles across.
const TILE: usize = 128;
const FIRST_BYTE: usize = 65_536;
/// Pixels around the map in which windows are searched for, along rows and columns.
const SEARCH: [usize; 2] = [6, 26];
/// Edge of a window and distance to the next one, pixels.
const WINDOW: usize = 61;
const STEP: usize = 80;
/// Middle of the map, degrees.
const PLACE_DEG: [f64; 2] = [141.58, 34.27];

/// Height of the MOLA grid above the areoid at the middle of the map: the median of the nearest cells, metres.
fn topography_m(grid: &Path) -> f64 {
    const CELLS_PER_DEGREE: f64 = 4.0;
    let bytes = fs::read(grid).unwrap();
    let nearest = |deg: f64| (deg * CELLS_PER_DEGREE).floor() as usize;
    let [row, column] = [nearest(90.0 - PLACE_DEG[1]), nearest(PLACE_DEG[0])];
    let mut heights: Vec<i16> = (row - 1..=row + 1)
        .flat_map(|row| (column - 1..=column + 1).map(move |column| 2 * (row * 1_440 + column)))
        .map(|at| i16::from_be_bytes([bytes[at], bytes[at + 1]]))
        .collect();
    heights.sort_unstable();
    f64::from(heights[4])
}

/// Line and sample of every tie point in E0201461 and in M0100115, 0 at the outer edge of the first.
fn ties(measures: &Path) -> Vec<[[f64; 2]; 2]> {
    let text = fs::read_to_string(measures).unwrap();
    let rows: Vec<Vec<&str>> = text
        .lines()
        .skip(1)
        .map(|row| row.split(',').collect())
        .collect();
    let place = |row: &[&str]| [4, 3].map(|at| row[at].parse::<f64>().unwrap() - 0.5);
    let of = |clock: &'static str| rows.iter().filter(move |row| row[1].contains(clock));
    of("669329623:36")
        .filter_map(|one| {
            let other = of("610472061:131").find(|other| other[0] == one[0])?;
            Some([place(one), place(other)])
        })
        .collect()
}

/// Longitude and latitude between the control points of an image, degrees, by the four nearest.
fn on_ground(table: &str) -> impl Fn([f64; 2]) -> [f64; 2] {
    let rows: Vec<Vec<f64>> = table
        .lines()
        .skip(1)
        .map(|row| {
            let numbers = row.split(',').skip(2).take(4);
            numbers.map(|number| number.parse().unwrap()).collect()
        })
        .collect();
    let samples = rows.iter().filter(|row| row[0] == rows[0][0]).count();
    let ends = [0, 1].map(|axis| rows.last().unwrap()[axis]);
    let cells = [rows.len() / samples - 1, samples - 1];
    move |place| {
        let at = [0, 1].map(|axis| place[axis] / ends[axis] * cells[axis] as f64);
        let first = [0, 1].map(|axis| (at[axis] as usize).min(cells[axis] - 1));
        let share = [0, 1].map(|axis| at[axis] - first[axis] as f64);
        [2, 3].map(|of| {
            let node = |down: usize, right: usize| {
                rows[(first[0] + down) * samples + first[1] + right][of]
            };
            let row = |down| (1.0 - share[1]) * node(down, 0) + share[1] * node(down, 1);
            (1.0 - share[0]) * row(0) + share[0] * row(1)
        })
    }
}

/// The pixels of the cube, row by row.
fn projected_by_isis(cube: &Path) -> Vec<f32> {
    let bytes = fs::read(cube).unwrap();
    let across = EDGE.div_ceil(TILE);
    let at = |row: usize, column: usize| {
        let tile = row / TILE * across + column / TILE;
        FIRST_BYTE + 4 * (tile * TILE * TILE + row % TILE * TILE + column % TILE)
    };
    (0..EDGE * EDGE)
        .map(|cell| {
            let at = at(cell / EDGE, cell % EDGE);
            f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
        })
        .collect()
}

/// Window of an image with rows of `columns`, mean 0 and norm 1; `None` where it has no pixels.
fn window(pixels: &[f32], columns: usize, [row, column]: [usize; 2]) -> Option<Vec<f32>> {
    let rows = (row..row + WINDOW).map(|row| &pixels[row * columns + column..][..WINDOW]);
    let mut cut: Vec<f32> = rows.flatten().copied().collect();
    if cut.contains(&0.0) {
        return None;
    }
    let mean = cut.iter().sum::<f32>() / cut.len() as f32;
    for pixel in &mut cut {
        *pixel -= mean;
    }
    let norm = cut.iter().map(|pixel| pixel * pixel).sum::<f32>().sqrt();
    for pixel in &mut cut {
        *pixel /= norm;
    }
    Some(cut)
}

/// Best correlation of a window of `theirs` in `ours`, which is larger by [`SEARCH`] on each side, and its offset, rows and columns.
fn best(ours: &[f32], theirs: &[f32], at: [usize; 2]) -> Option<(f32, Vector2<f64>)> {
    let sought = window(theirs, EDGE, at)?;
    let columns = EDGE + 2 * SEARCH[1];
    let mut best = (0.0, Vector2::zeros());
    for down in 0..=2 * SEARCH[0] {
        for right in 0..=2 * SEARCH[1] {
            let Some(found) = window(ours, columns, [at[0] + down, at[1] + right]) else {
                continue;
            };
            let score: f32 = sought
                .iter()
                .zip(&found)
                .map(|(one, other)| one * other)
                .sum();
            if score > best.0 {
                let offset = [down, right].map(|of| of as f64);
                best = (
                    score,
                    Vector2::from(offset) - Vector2::new(SEARCH[0] as f64, SEARCH[1] as f64),
                );
            }
        }
    }
    Some(best)
}

fn median(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers[numbers.len() / 2]
}

#[test]
fn a_real_image_lies_on_the_map_where_isis_has_its_mate() {
    let test = "a_real_image_lies_on_the_map_where_isis_has_its_mate";
    let files = [
        "asp_moc/M0100115.imq",
        "asp_moc/control_net_measures.csv",
        "megdr/megt90n000cb.img",
    ];
    let [Some(image), Some(measures), Some(grid)] = files.map(|file| real_data(file, test)) else {
        return;
    };
    let (Some(cube), Some(mut gdalwarp)) = (cube(), program("gdalwarp", test)) else {
        return;
    };
    let [east_rad, north_rad] = PLACE_DEG.map(f64::to_radians);
    let up = Vector3::new(
        north_rad.cos() * east_rad.cos(),
        north_rad.cos() * east_rad.sin(),
        north_rad.sin(),
    );
    let radius_m = on_ellipsoid_m(Body::Mars.model(), &up).norm() + topography_m(&grid);
    let shots: Vec<[f64; 2]> = (0..200)
        .map(|at| [20.0 + 40.0 * f64::from(at), 512.0])
        .collect();
    let case = site(&cube, &shots, radius_m);
    let outcome = case.outcome(case.run());
    let table = case.path("out/cube/images/E02-01461/control_points.csv");
    assert!(table.exists(), "{outcome}");
    let table = fs::read_to_string(table).unwrap();
    let to_ground = on_ground(&table);
    let mut control = "body,image,line,sample,longitude_deg,latitude_deg,height_m\n".to_owned();
    let ties = ties(&measures);
    assert_eq!(ties.len(), 63);
    for [there, [line, sample]] in &ties {
        let [east_deg, north_deg] = to_ground(*there);
        let height_m = radius_m - SPHERE_M;
        control += &format!("mars,M01-00115,{line},{sample},{east_deg},{north_deg},{height_m}\n");
    }
    case.write("control.csv", control);
    let picture = case.path("m0100115.tif");
    let mut extract = areograph();
    extract.args(["--quiet", "image", "extract"]).arg(image);
    extract.arg("--out").arg(&picture);
    succeed(extract.arg("--control").arg(case.path("control.csv")));
    let map = case.path("map.raw");
    let margins_m = [SEARCH[1], SEARCH[0]].map(|of| of as f64 * PIXEL_M);
    let span_m = EDGE as f64 * PIXEL_M;
    let [west, north] = [CORNER_M[0] - margins_m[0], CORNER_M[1] + margins_m[1]];
    let [east, south] = [
        CORNER_M[0] + span_m + margins_m[0],
        CORNER_M[1] - span_m - margins_m[1],
    ];
    let size = [EDGE + 2 * SEARCH[1], EDGE + 2 * SEARCH[0]];
    output(
        gdalwarp
            .args([
                "-q", "-of", "ENVI", "-ot", "Float32", "-r", "cubic", "-tps", "-t_srs",
            ])
            .arg(format!(
                "+proj=sinu +lon_0={CENTRE_DEG} +R={SPHERE_M} +units=m"
            ))
            .arg("-te")
            .args([west, south, east, north].map(|edge_m| edge_m.to_string()))
            .arg("-ts")
            .args(size.map(|pixels| pixels.to_string()))
            .args([&picture, &map]),
    );
    let ours: Vec<f32> = fs::read(map)
        .unwrap()
        .chunks_exact(4)
        .map(|pixel| f32::from_le_bytes(pixel.try_into().unwrap()))
        .collect();
    let theirs = projected_by_isis(&cube);
    let starts = || (0..EDGE - WINDOW).step_by(STEP);
    let found: Vec<(f32, Vector2<f64>)> = starts()
        .flat_map(|row| starts().map(move |column| [row, column]))
        .filter_map(|at| best(&ours, &theirs, at))
        .collect();
    let good: Vec<Vector2<f64>> = found
        .iter()
        .filter(|of| of.0 > 0.6)
        .map(|of| of.1)
        .collect();
    // The images have different light; more than eight in ten windows correlate.
    assert!(good.len() >= 27, "{found:?}");
    let offset = [0, 1].map(|axis| median(good.iter().map(|of| of[axis]).collect()));
    let scatter = [0, 1].map(|axis| {
        median(
            good.iter()
                .map(|of| (of[axis] - offset[axis]).abs())
                .collect(),
        )
    });
    println!(
        "rows and columns: offset {offset:?}, median deviation {scatter:?} of {} windows",
        good.len()
    );
    // Pixels of 4.7 m. E0201461 looks west by 11.6°: an error of 500 m of the height, more than the areoid departs from the
    // ellipsoid here, is 22 pixels in columns, and 2.3 in rows the other way.
    assert!(offset[1].abs() < 22.0, "{offset:?}");
    assert!((offset[0] + 0.105 * offset[1]).abs() < 2.0, "{offset:?}");
    // Relief of 100 m is 4.4 pixels in columns.
    assert!(scatter[0] <= 2.0 && scatter[1] <= 5.0, "{scatter:?}");
}
