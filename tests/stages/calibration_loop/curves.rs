//! Elevation curves of a calibration: against its published terrain models, and the laser.

use std::{collections::BTreeMap, fs};

use areograph::{
    body::Body,
    geom::statistics::median,
    pds::{
        calibration_tables::{ImageRow, read_control, read_ties},
        terrain_model::{HeightsAbove, read_terrain_model},
    },
};

use super::{RUN, long, rms};
use crate::match_laser::curves::{Shot, assert_height, bilinear_m, numbers, shots};

#[test]
fn curves_of_the_first_and_the_last_round_are_published() {
    let shots = shots(&RUN.folder);
    let model = RUN.folder.join("surface_above_sphere.tif");
    let model = read_terrain_model(&model, Body::Mars, HeightsAbove::default()).unwrap();
    let (mut before, mut after) = (0, 0);
    for shot in &shots {
        // Heights of the file and of the run are the same numbers; places have 1e-14 of a degree.
        let expected_m = bilinear_m(&model, shot.place_deg);
        assert_height(shot, shot.model_m, expected_m);
        before += usize::from(shot.model_m.is_some());
        after += usize::from(shot.shifted_m.is_some());
        // In the short run the first round is the last.
        assert!(long() || shot.first_m == shot.model_m, "{shot:?}");
    }
    assert!(
        before > 1_000 && after > 300 && before < shots.len(),
        "{before} {after}"
    );
    // Shots that took no part in a search, in units that are kept.
    let withheld = shots
        .iter()
        .filter(|shot| shot.withheld && shot.shifted_m.is_some());
    let withheld: Vec<&Shot> = withheld.collect();
    let off_m = |of: fn(&Shot) -> Option<f64>| -> f64 {
        let off_m = withheld
            .iter()
            .filter_map(|shot| Some(of(shot)? - shot.laser_m));
        let off_m: Vec<f64> = off_m.collect();
        let bias_m = median(&mut off_m.clone());
        rms(off_m.iter().map(|off_m| off_m - bias_m))
    };
    let [first_m, last_m, shifted_m] = [
        off_m(|shot| shot.first_m),
        off_m(|shot| shot.model_m),
        off_m(|shot| shot.shifted_m),
    ];
    println!(
        "{} withheld shots: first {first_m:.1} m, last {last_m:.1} m, shifted {shifted_m:.1} m",
        withheld.len()
    );
    assert!(withheld.len() >= 100);
    // The orbit and the mounting displace the first model by many cells, which the shift removes; the model of the last
    // round of the long run is made with calibrated cameras.
    assert!(shifted_m < 0.5 * first_m, "{shifted_m} {first_m}");
    assert!(!long() || last_m < 0.5 * first_m, "{last_m} {first_m}");
}

/// Every measured image position is in a table that other calibrations read, and as often in the table of residuals.
#[test]
fn measured_points_are_tables_for_other_calibrations() {
    let [ties, control] = ["ties.csv", "control.csv"].map(|name| RUN.folder.join(name));
    let (ties, control) = (read_ties(&ties).unwrap(), read_control(&control).unwrap());
    assert!(ties.complaints.is_empty() && control.complaints.is_empty());
    let place = |of: &ImageRow| format!("{},{},{},{}", of.point, of.camera, of.line, of.sample);
    let images = control.rows.iter().map(|row| &row.image);
    let mut measured: Vec<String> = ties.rows.iter().chain(images).map(place).collect();
    let residuals = fs::read_to_string(RUN.folder.join("residuals.csv")).unwrap();
    let used = residuals.lines().skip(1).map(|row| {
        let cells: Vec<&str> = row.split(',').collect();
        [cells[0], cells[2], cells[3], cells[4]].join(",")
    });
    let mut used: Vec<String> = used.collect();
    measured.sort();
    used.sort();
    assert!(used.len() > 100);
    assert_eq!(measured, used);
    assert!(
        ties.rows
            .iter()
            .all(|row| row.sigma_px.iter().all(Option::is_some))
    );
    assert!(
        control
            .rows
            .iter()
            .all(|row| row.matching_m.iter().all(Option::is_some))
    );
}

/// The peak of every map is at the shift of its unit, to a cell, with its similarity, to a level.
#[test]
fn score_maps_of_the_last_round_have_their_peaks_at_the_shifts() {
    let names = [
        "unit",
        "shift_east_cells",
        "shift_north_cells",
        "similarity",
    ];
    let path = RUN.folder.join("score_maps.parquet");
    let [unit, east, north, similarity] = numbers(&path, names);
    let mut peaks: BTreeMap<u64, [f64; 3]> = BTreeMap::new();
    for at in 0..unit.len() {
        let peak = peaks.entry(unit[at].to_bits()).or_insert([0.0, 0.0, -1.0]);
        if similarity[at] > peak[2] {
            *peak = [east[at], north[at], similarity[at]];
        }
    }
    let units = fs::read_to_string(RUN.folder.join("units.csv")).unwrap();
    let mut rows = units.lines().map(|row| row.split(',').collect::<Vec<_>>());
    let header = rows.next().unwrap();
    let at = |name: &str| header.iter().position(|of| *of == name).unwrap();
    let number = |row: &[&str], name: &str| row[at(name)].parse::<f64>();
    let mut compared = 0;
    for row in rows {
        let Ok(score) = number(&row, "score") else {
            continue;
        };
        let [x, y] = ["shift_east_cells", "shift_north_cells"].map(|of| number(&row, of).unwrap());
        let peak = peaks[&number(&row, "unit").unwrap().to_bits()];
        // Equal levels near the peak, and shifts between cells.
        let off = (peak[0] - x).hypot(peak[1] - y);
        assert!(
            off < 3.0 && (peak[2] - score).abs() < 0.02,
            "{row:?} {peak:?}"
        );
        compared += 1;
    }
    assert_eq!(compared, peaks.len());
    assert!(compared >= 10, "{compared}");
}

#[test]
fn the_page_draws_curves_of_a_few_units_and_similarities_of_all() {
    let page = fs::read_to_string(RUN.folder.join("report/index.html")).unwrap();
    let curves = page.split("<h3>Elevation curves").nth(1).unwrap();
    let curves = curves.split("</section>").next().unwrap();
    // Four plots of curves; similarities of the units of these, of other kept units, and of rejected ones.
    assert_eq!(curves.matches("<figcaption").count(), 4 + 3);
    let [mut units] = numbers(&RUN.folder.join("score_maps.parquet"), ["unit"]);
    units.dedup();
    assert_eq!(curves.matches("data:image/png").count(), units.len());
    for words in [
        "lowest similarity",
        "before and after the calibration",
        "model of the first round",
        "model of the last round",
        "height above the sphere, m",
    ] {
        assert!(curves.contains(words), "{words}");
    }
}
