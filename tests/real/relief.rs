//! The ground of maps of sites against the topography of Mars from which it is derived.
#![allow(
    clippy::unwrap_used,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "helpers of tests may fail loudly; rows and columns are small numbers"
)]

use std::fs;

use areograph::body::Body;
use nalgebra::{DMatrix, DVector};

use crate::common;

/// Cells along a degree of the MEGDR, and its columns and rows.
const PER_DEGREE: f64 = 4.0;
const COLUMNS: i64 = 1440;
const ROWS: i64 = 720;
/// Places that are compared, evenly distributed; those closer to a pole are left out: columns converge there.
const PLACES: u32 = 6_000;
const LATITUDE_MAX_DEG: f64 = 70.0;

/// Heights of the MEGDR by place. Its label: `SAMPLE_PROJECTION_OFFSET` 720.5 at 180° E, `LINE_PROJECTION_OFFSET` 360.5 at the
/// equator, counted from 1; 16-bit numbers, most significant byte first.
struct Megdr(Vec<u8>);

impl Megdr {
    fn height_m(&self, longitude_deg: f64, latitude_deg: f64) -> f64 {
        let sample = 720.5 + PER_DEGREE * (longitude_deg - 180.0);
        let line = 360.5 - PER_DEGREE * latitude_deg;
        let column = (sample.round() as i64 - 1).rem_euclid(COLUMNS);
        let row = (line.round() as i64 - 1).clamp(0, ROWS - 1);
        let at = usize::try_from(2 * (row * COLUMNS + column)).unwrap();
        f64::from(i16::from_be_bytes([self.0[at], self.0[at + 1]]))
    }

    /// Mean height and rises towards east and north, per two degrees of the great circle, over a cell and its neighbours.
    fn ground(&self, longitude_deg: f64, latitude_deg: f64) -> [f64; 3] {
        let step_deg = 1.0;
        let at = |east: f64, north: f64| self.height_m(longitude_deg + east, latitude_deg + north);
        let [west, east, south, north] = [[-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, 1.0]]
            .map(|[x, y]| at(x * step_deg, y * step_deg));
        let parallel = latitude_deg.to_radians().cos();
        [
            (west + east + south + north) / 4.0,
            (east - west) / parallel,
            north - south,
        ]
    }
}

/// Share of the variance of greys that height and slopes explain, with the greys taken from other places.
fn explained(megdr: &Megdr, grey: impl Fn(f64, f64) -> f64) -> f64 {
    let mut rows: Vec<[f64; 4]> = Vec::new();
    let mut greys: Vec<f64> = Vec::new();
    for place in 0..PLACES {
        // Places of a spiral by the golden angle.
        let longitude_deg = (f64::from(place) * 137.507_764).rem_euclid(360.0);
        let sine = 1.0 - 2.0 * (f64::from(place) + 0.5) / f64::from(PLACES);
        let latitude_deg = sine.asin().to_degrees();
        if latitude_deg.abs() < LATITUDE_MAX_DEG {
            let [height_m, east, north] = megdr.ground(longitude_deg, latitude_deg);
            rows.push([1.0, height_m / 1e4, east / 1e4, north / 1e4]);
            greys.push(grey(longitude_deg, latitude_deg));
        }
    }
    let design = DMatrix::from_fn(rows.len(), 4, |row, column| rows[row][column]);
    let greys = DVector::from_vec(greys);
    let fitted = &design * design.clone().svd(true, true).solve(&greys, 1e-12).unwrap();
    let spread = greys.add_scalar(-greys.mean()).norm_squared();
    1.0 - (greys - fitted).norm_squared() / spread
}

/// The picture agrees with the topography where it is, and worse by a degree or more, mirrored, upside down or turned.
#[test]
fn the_ground_of_maps_lies_where_the_topography_of_mars_states() {
    let Some(path) = common::real_data("megdr/megt90n000cb.img", "topography of Mars") else {
        return;
    };
    let megdr = Megdr(fs::read(path).unwrap());
    // The summit and the floor by the IAU gazetteer.
    assert!(megdr.height_m(226.2, 18.65) > 15_000.0);
    assert!(megdr.height_m(70.5, -42.4) < -5_000.0);
    let picture = std::io::Cursor::new(Body::Mars.relief().unwrap());
    let mut reader = png::Decoder::new(picture).read_info().unwrap();
    let mut greys = vec![0; reader.output_buffer_size().unwrap()];
    let size = reader.next_frame(&mut greys).unwrap();
    let [columns, rows] = [size.width, size.height].map(f64::from);
    let grey = |longitude_deg: f64, latitude_deg: f64| {
        let column = longitude_deg.rem_euclid(360.0) / 360.0 * columns;
        let row = ((90.0 - latitude_deg) / 180.0 * rows).clamp(0.0, rows - 1.0);
        f64::from(greys[row as usize * size.width as usize + column as usize])
    };
    let in_place = explained(&megdr, grey);
    println!("explained in place: {in_place:.3}");
    // 0.83 of the variance: shading and height are linear in these, except on the steepest slopes.
    assert!(in_place > 0.78, "{in_place}");
    for (name, moved) in [
        ("a degree east", explained(&megdr, |x, y| grey(x + 1.0, y))),
        ("a degree west", explained(&megdr, |x, y| grey(x - 1.0, y))),
        ("a degree north", explained(&megdr, |x, y| grey(x, y + 1.0))),
        ("a degree south", explained(&megdr, |x, y| grey(x, y - 1.0))),
        ("mirrored", explained(&megdr, |x, y| grey(-x, y))),
        ("upside down", explained(&megdr, |x, y| grey(x, -y))),
        ("turned", explained(&megdr, |x, y| grey(x + 180.0, y))),
    ] {
        println!("{name}: {moved:.3}");
        assert!(moved < in_place - 0.05, "{name}: {moved}");
    }
}
