//! What footprints say of the heights of a pair, held against the true heights of tie points, of which footprints know nothing.

use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;

use super::{Judged, SITES, common::mission::mission, default_run, table, texts};

/// Where the second image shows a footprint is transformed from the tie points around it, to within 3.4 m on the ground (see
/// `misregistration`); across the track that is height, 2.5 times as much at the pairs' base to height.
const TRANSFORMED_M: f64 = 2.5 * 3.4;

#[test]
fn footprints_tell_the_height_error_of_a_pair_before_and_after_the_adjustment() {
    let out = default_run();
    let mut before_m = Vec::new();
    for site in SITES {
        let truth = Judged::of(&mission(), out, site);
        let heights = table(&out.join(site).join("height_check.parquet"));
        let kinds = texts(&heights, "kind");
        let median_m = |column: &str| {
            let column = heights.column_by_name(column).unwrap();
            let column = column.as_primitive::<Float64Type>();
            let rows = (0..kinds.len()).filter(|row| kinds[*row] == "footprint");
            let mut values: Vec<f64> = rows.map(|row| column.value(row)).collect();
            assert!(values.len() > 20, "{site}: {} footprints", values.len());
            values.sort_by(f64::total_cmp);
            values[values.len() / 2]
        };
        let states = [
            ("before", "above_surface_m", truth.before_m),
            ("after", "adjusted_above_surface_m", truth.mean_m().z),
        ];
        for (state, column, true_m) in states {
            let said_m = median_m(column);
            println!(
                "{site} {state}: {said_m:.1} m by footprints, truth of the ties {true_m:.1} m"
            );
            assert!(
                (said_m - true_m).abs() < TRANSFORMED_M,
                "{site} {state}: {said_m} m, truth {true_m} m"
            );
        }
        before_m.push(truth.before_m.abs());
    }
    // The errors told are far larger than what may be wrong in telling them.
    assert!(
        before_m
            .iter()
            .any(|error_m| *error_m > 5.0 * TRANSFORMED_M)
    );
}
