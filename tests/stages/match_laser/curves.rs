//! Elevation curves as published: against the model's file by an interpolation of the test's own, and against the truth.

#![allow(
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    reason = "cells of a small map, and small numbers of a table"
)]

use std::{collections::BTreeMap, fs, path::Path, sync::LazyLock};

use areograph::{
    body::Body,
    flow::Task,
    geom::height_grid::HeightGrid,
    pds::terrain_model::{HeightsAbove, read_terrain_model},
};
use arrow_array::{Array as _, cast::AsArray as _, types};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use tempfile::TempDir;

use super::{request, scene, true_bias_m, true_rms_m, truth};
use crate::common::flows::run_into;

/// A row of `elevation_curves.parquet`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Shot {
    pub(crate) pass: u32,
    pub(crate) distance_m: f64,
    pub(crate) place_deg: [f64; 2],
    pub(crate) unit: u32,
    pub(crate) withheld: bool,
    pub(crate) laser_m: f64,
    pub(crate) model_m: Option<f64>,
    pub(crate) shifted_m: Option<f64>,
    /// Only of calibrations.
    pub(crate) first_m: Option<f64>,
}

/// Columns of a table without empty cells.
pub(crate) fn numbers<const N: usize>(path: &Path, names: [&str; N]) -> [Vec<f64>; N] {
    let file = fs::File::open(path).unwrap();
    let batches = ParquetRecordBatchReaderBuilder::try_new(file).unwrap();
    let mut columns = names.map(|_| Vec::new());
    for batch in batches.build().unwrap() {
        let batch = batch.unwrap();
        for (name, into) in names.iter().zip(&mut columns) {
            let column = batch.column_by_name(name).unwrap();
            if let Some(of) = column.as_primitive_opt::<types::Float64Type>() {
                into.extend(of.values().iter().copied());
            } else {
                let of = column.as_primitive::<types::UInt32Type>();
                into.extend(of.values().iter().copied().map(f64::from));
            }
        }
    }
    columns
}

/// The table in a folder of products.
pub(crate) fn shots(out: &Path) -> Vec<Shot> {
    let file = fs::File::open(out.join("elevation_curves.parquet")).unwrap();
    let batches = ParquetRecordBatchReaderBuilder::try_new(file).unwrap();
    let mut shots = Vec::new();
    for batch in batches.build().unwrap() {
        let batch = batch.unwrap();
        let real = |name: &str| {
            let column = batch.column_by_name(name);
            let values = column.map(|of| of.as_primitive::<types::Float64Type>().clone());
            move |row: usize| {
                let values = values.as_ref().filter(|values| values.is_valid(row));
                values.map(|values| values.value(row))
            }
        };
        let natural = |name: &str| {
            let column = batch.column_by_name(name).unwrap();
            let values = column.as_primitive::<types::UInt32Type>().clone();
            move |row: usize| values.value(row)
        };
        let withheld = batch.column_by_name("withheld").unwrap().as_boolean();
        let (pass, unit) = (natural("laser_pass"), natural("unit"));
        let [
            distance_m,
            longitude,
            latitude,
            laser_m,
            model_m,
            shifted_m,
            first_m,
        ] = [
            "distance_m",
            "longitude_deg",
            "latitude_deg",
            "laser_height_m",
            "model_height_m",
            "shifted_model_height_m",
            "first_round_model_height_m",
        ]
        .map(real);
        shots.extend((0..batch.num_rows()).map(|row| Shot {
            pass: pass(row),
            distance_m: distance_m(row).unwrap(),
            place_deg: [longitude(row).unwrap(), latitude(row).unwrap()],
            unit: unit(row),
            withheld: withheld.value(row),
            laser_m: laser_m(row).unwrap(),
            model_m: model_m(row),
            shifted_m: shifted_m(row),
            first_m: first_m(row),
        }));
    }
    shots
}

/// Compares a height of a model with the test's own interpolation, to a millimetre.
pub(crate) fn assert_height(shot: &Shot, found_m: Option<f64>, expected_m: Option<f64>) {
    match (found_m, expected_m) {
        (None, None) => {}
        (Some(found_m), Some(expected_m)) => assert!(
            (found_m - expected_m).abs() < 1e-3,
            "{shot:?}: {expected_m} m"
        ),
        _ => panic!("{shot:?}: {expected_m:?}"),
    }
}

/// Height between four cells, weighted by the areas opposite to them; `None` where one of them has none.
pub(crate) fn bilinear_m(grid: &HeightGrid, [longitude, latitude]: [f64; 2]) -> Option<f64> {
    let [rows, columns] = grid.size;
    let east = (longitude.to_radians() - grid.first_rad[0]) / grid.cell_rad[0];
    let south = (grid.first_rad[1] - latitude.to_radians()) / grid.cell_rad[1];
    let (left, top) = (east.floor(), south.floor());
    let mut height_m = 0.0;
    for (row, column) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        let [row, column] = [top as i64 + row, left as i64 + column];
        let weight = (1.0 - (south - row as f64).abs()) * (1.0 - (east - column as f64).abs());
        let inside = (0..rows as i64).contains(&row) && (0..columns as i64).contains(&column);
        let cell = inside.then(|| grid.heights_m[row as usize * columns + column as usize])?;
        height_m += weight * f64::from(Some(cell).filter(|cell| cell.is_finite())?);
    }
    Some(height_m)
}

/// A row of `units.csv`.
struct UnitRow {
    shift_deg: [f64; 2],
    sigma_bias_m: f64,
    shots: usize,
    kept: bool,
}

fn units(out: &Path) -> BTreeMap<u32, UnitRow> {
    let mut table = csv::Reader::from_path(out.join("units.csv")).unwrap();
    let header = table.headers().unwrap().clone();
    let at = |name: &str| header.iter().position(|of| of == name).unwrap();
    let names = [
        "unit",
        "shift_longitude_deg",
        "shift_latitude_deg",
        "sigma_bias_m",
        "shots",
    ];
    let columns = names.map(at);
    let kept = at("kept");
    let rows = table.records().map(|row| {
        let row = row.unwrap();
        // Units that were not found have no shift.
        let [unit, east, north, sigma_bias_m, shots] =
            columns.map(|of| row[of].parse::<f64>().unwrap_or(f64::NAN));
        let of = UnitRow {
            shift_deg: [east, north],
            sigma_bias_m,
            shots: shots as usize,
            kept: &row[kept] == "true",
        };
        (unit as u32, of)
    });
    rows.collect()
}

/// Published once.
static OUT: LazyLock<TempDir> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let outcome = run_into(Task::Match(&request(20, None)), folder.path(), false).unwrap();
    assert!(outcome.manifest().unwrap().verdict.valid);
    folder
});

fn model() -> HeightGrid {
    let model = scene().join("model.tif");
    read_terrain_model(&model, Body::Mars, HeightsAbove::default()).unwrap()
}

#[test]
fn both_curves_are_the_heights_of_the_models_file() {
    let (model, units, shots) = (model(), units(OUT.path()), shots(OUT.path()));
    let (mut before, mut after) = (0, 0);
    for shot in &shots {
        let expected_m = bilinear_m(&model, shot.place_deg);
        let unit = units.get(&shot.unit).filter(|unit| unit.kept);
        let shifted_m = unit.and_then(|unit| {
            let [east, north] = unit.shift_deg;
            bilinear_m(
                &model,
                [shot.place_deg[0] + east, shot.place_deg[1] + north],
            )
        });
        // Places of units.csv have 1e-9 degrees, or 0.1 mm.
        assert_height(shot, shot.model_m, expected_m);
        assert_height(shot, shot.shifted_m, shifted_m);
        before += usize::from(shot.model_m.is_some());
        after += usize::from(shot.shifted_m.is_some());
    }
    // The model covers nearly the whole box; shots of kept units are a third of all.
    assert!(
        before > 5_000 && before < shots.len() && after > 1_500,
        "{before} {after} of {}",
        shots.len()
    );
    for (number, unit) in &units {
        let members = shots.iter().filter(|shot| shot.unit == *number);
        assert_eq!(members.count(), unit.shots, "unit {number}");
    }
}

#[test]
fn the_shifted_curve_is_the_lasers_within_its_stated_errors_and_the_other_is_not() {
    let (units, shots, bias_m) = (units(OUT.path()), shots(OUT.path()), true_bias_m());
    let model = model();
    let [east, north] = truth("shift_cells");
    let true_shift_deg = [
        (east * model.cell_rad[0]).to_degrees(),
        (north * model.cell_rad[1]).to_degrees(),
    ];
    let off = |of: &dyn Fn(&Shot) -> Option<f64>| -> Vec<f64> {
        // Shots that took no part in the search for the shift.
        let withheld = shots
            .iter()
            .filter(|shot| shot.withheld && shot.shifted_m.is_some());
        withheld
            .filter_map(|shot| Some(of(shot)? - shot.laser_m - bias_m))
            .collect()
    };
    let rms = |of: &[f64]| (of.iter().map(|of| of * of).sum::<f64>() / of.len() as f64).sqrt();
    let before_m = rms(&off(&|shot| shot.model_m));
    let after_m = rms(&off(&|shot| shot.shifted_m));
    let truth_m = rms(&off(&|shot| {
        let [longitude, latitude] = shot.place_deg;
        bilinear_m(
            &model,
            [longitude + true_shift_deg[0], latitude + true_shift_deg[1]],
        )
    }));
    println!("before {before_m:.1} m, after {after_m:.1} m, true shift {truth_m:.1} m");
    // Shifts are off by a fifth of a cell, which adds little to the noise of 8 m and the ground between cells.
    assert!(
        after_m < 1.25 * truth_m && after_m < 1.25 * true_rms_m(),
        "{after_m} {truth_m}"
    );
    // The drawn shift of several cells moves the model by more than its relief repeats: a clear difference, measured as 14 times.
    assert!(before_m > 4.0 * after_m, "{before_m} {after_m}");
    // The mean of the withheld shots of a unit against the truth, over the standard deviation that the unit states of
    // its bias and the scatter of the withheld shots.
    let mut squares = Vec::new();
    for (number, unit) in units.iter().filter(|(_, unit)| unit.kept) {
        let withheld = shots
            .iter()
            .filter(|shot| shot.unit == *number && shot.withheld);
        let off_m: Vec<f64> = withheld
            .filter_map(|shot| Some(shot.shifted_m? - shot.laser_m - bias_m))
            .collect();
        let mean_m = off_m.iter().sum::<f64>() / off_m.len() as f64;
        let sigma_m = unit
            .sigma_bias_m
            .hypot(truth_m / (off_m.len() as f64).sqrt());
        squares.push((mean_m / sigma_m).powi(2));
    }
    let z = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
    println!("z {z:.2} of {} units", squares.len());
    // Of 80 independent values, chance gives 0.8 to 1.2 in 99 of 100 cases; units of one pass share its errors.
    assert!(squares.len() >= 80 && (0.7..1.4).contains(&z), "{z}");
}

#[test]
fn distances_are_those_of_the_places_along_each_pass() {
    let shots = shots(OUT.path());
    let passes = shots.chunk_by(|a, b| a.pass == b.pass);
    let mut numbers = Vec::new();
    for pass in passes {
        numbers.push(pass[0].pass);
        assert!(pass[0].distance_m == 0.0);
        let mut distance_m = 0.0;
        for pair in pass.windows(2) {
            // Haversines, on the sphere of the model.
            let [[east, south], [west, north]] =
                [0, 1].map(|of| pair[of].place_deg.map(f64::to_radians));
            let half = |of: f64| (0.5 * of).sin().powi(2);
            let haversine = half(north - south) + south.cos() * north.cos() * half(west - east);
            distance_m += 2.0 * 3_396_190.0 * haversine.sqrt().asin();
            assert!((pair[1].distance_m - distance_m).abs() < 1e-3, "{pair:?}");
        }
        // From one end to the other, in steps of the spacing of shots: no pass runs back.
        let steps = pass
            .windows(2)
            .map(|pair| pair[1].distance_m - pair[0].distance_m);
        assert!(steps.into_iter().all(|step_m| step_m > 200.0));
    }
    // Every pass once, in the order of their numbers.
    assert!(
        numbers.windows(2).all(|of| of[0] < of[1]) && numbers.len() >= 20,
        "{numbers:?}"
    );
    assert_eq!(shots.len(), super::MATCHED.shots);
}

#[test]
fn the_page_draws_three_units_and_a_pass_with_named_axes() {
    let page = fs::read_to_string(OUT.path().join("report/index.html")).unwrap();
    let section = page.split("id=\"elevation-curves\"").nth(1).unwrap();
    let section = section.split("<section").next().unwrap();
    let titles = [
        "lowest similarity",
        "median similarity",
        "highest similarity",
    ];
    let figures: Vec<&str> = section.split("<figure").skip(1).collect();
    assert_eq!(figures.len(), 4);
    for (figure, title) in figures.iter().zip(titles) {
        assert!(figure.contains(title), "{title}");
    }
    for figure in figures {
        // Both axes with their units, one vertical reference, three curves.
        for words in [
            "distance along the pass, km",
            "height above the sphere, m",
            "above the sphere of 3396190 m",
        ] {
            assert!(figure.contains(words), "{words}");
        }
        assert_eq!(figure.matches("<li>").count(), 3);
    }
}
