//! Parts of the error of the mean against the dense equations of all unknowns.

use nalgebra::{DMatrix, Matrix3, Matrix3xX};

use super::{
    AttitudeClock, HeightControl, Network,
    bus_tests::with_spots,
    factor::Factor,
    groups::PointGroups,
    height_tests::{CONTROLLED, dense, surface_with},
    heights::Heights,
    prior_tests::prior_row,
    quality::judge,
    solve::{Stop, settle},
    tests::{dense_rows, layout, network},
    unknowns::Unknown,
};
use crate::{pushbroom::EulerPolynomial, surface::SurfaceOptions};
use nalgebra::Vector3;

/// The parts of the adjusted network equal those of the gain of each observation, and all observations together cause the
/// whole.
fn are_those_of_the_gains(mut network: Network<EulerPolynomial>, uses_relief: bool) {
    let options = SurfaceOptions {
        uses_relief,
        ..SurfaceOptions::default()
    };
    let surface = surface_with(&network, 35.0, &options);
    network.heights = Some(HeightControl {
        surface: surface.clone(),
        jitter: None,
        common_noise: None,
        compared: Vec::new(),
        observed: CONTROLLED.collect(),
    });
    let (mut layout, start, active) = layout(&network);
    let bus = network.common_bus.as_ref();
    let shifts = bus.map_or_else(Vec::new, |bus| layout.columns.shifts_on_surface(bus));
    layout.heights = Some(Heights::at(&surface, CONTROLLED.collect(), shifts, &start));
    let start = layout.linearise(start);
    let groups = PointGroups::of(&layout, active.clone());
    let stop = Stop {
        steps_max: 100,
        change: 1e-10,
    };
    let settled = settle(&layout, start, &groups, stop, &mut Vec::new()).unwrap();
    let factor = Factor::new(&settled.reduced.matrix, settled.reduced.heights.as_ref()).unwrap();
    let fitness = vec![Ok(()); active.len()];
    let adjustment = judge(&layout, &settled, &groups, &fitness, &factor);
    let (found, whole_m2) = (
        adjustment.mean_parts.unwrap(),
        adjustment.mean_cofactor_m2.unwrap(),
    );

    let heights = layout.heights.as_ref().unwrap();
    let dense = dense(&layout, &settled.at, heights, active.len());
    let (shared, unknowns) = (layout.columns.len(), dense.cofactors.ncols());
    // Change of the mean with the right-hand side of each normal equation.
    let mut mean = DMatrix::zeros(3, unknowns);
    for point in CONTROLLED {
        for axis in 0..3 {
            mean[(axis, shared + 3 * point + axis)] = 1.0 / CONTROLLED.len() as f64;
        }
    }
    let pull = mean * &dense.cofactors;
    let square = |moved: Matrix3xX<f64>| -> Matrix3<f64> { &moved * moved.transpose() };
    let mut expected = super::MeanParts::default();
    let mut rest_m2 = Matrix3::zeros();
    for (column, sigma) in layout.columns.sigmas.iter().enumerate() {
        let row = prior_row(&layout, column, unknowns);
        let part_m2 = square(Matrix3xX::from_columns(&[(&pull * row / *sigma)
            .fixed_rows::<3>(0)
            .into_owned()]));
        *match layout.columns.unknowns[column] {
            Unknown::Boresight { .. } => &mut expected.boresight_m2,
            Unknown::ProfileShift { .. } => &mut expected.profiles_m2,
            Unknown::RangeBias { .. } => &mut rest_m2,
            _ => &mut expected.orientations_m2,
        } += part_m2;
    }
    for point in &active {
        // Weighted rows have the variance 1.
        let (rows, _) = dense_rows(&layout, &settled.at, *point);
        rest_m2 += square(Matrix3xX::from_fn(rows.nrows(), |axis, row| {
            pull.row(axis).dot(&rows.row(row))
        }));
    }
    let close = |one: &Matrix3<f64>, other: &Matrix3<f64>, what: &str| {
        let off_m2 = (one - other).abs().max();
        // Shares of the whole: rounding of positions of 4e6 m.
        assert!(off_m2 < 1e-6 * whole_m2.trace(), "{what}: {off_m2} m²");
    };
    close(&found.boresight_m2, &expected.boresight_m2, "boresight");
    close(
        &found.orientations_m2,
        &expected.orientations_m2,
        "orientations",
    );
    // All that is not stated by a priori values or the rest comes from heights.
    let of_heights_m2 = found.profiles_m2 - expected.profiles_m2
        + found.frame_m2
        + found.slopes_m2
        + found.ground_m2;
    let before_m2 =
        expected.boresight_m2 + expected.orientations_m2 + expected.profiles_m2 + rest_m2;
    close(&of_heights_m2, &(whole_m2 - before_m2), "heights");
    for part_m2 in [
        found.profiles_m2,
        found.frame_m2,
        found.slopes_m2,
        found.ground_m2,
    ] {
        let least = part_m2.symmetric_eigenvalues().min();
        assert!(least > -1e-9 * whole_m2.trace(), "{least} m²"); // rounding
    }
    assert!(found.ground_m2.trace() > 0.0 && found.profiles_m2.trace() > 0.0);
    assert_eq!(found.slopes_m2.trace() > 0.0, !uses_relief);
}

#[test]
fn parts_equal_the_gains_of_the_dense_equations() {
    for uses_relief in [false, true] {
        are_those_of_the_gains(network(), uses_relief);
        let mut network = with_spots();
        network.attitude_clock = Some(AttitudeClock {
            sigma_s: 1.0,
            turns_rad_s: vec![Vector3::new(1e-5, -8.7e-4, 2e-5); 3],
        });
        are_those_of_the_gains(network, uses_relief);
    }
}
