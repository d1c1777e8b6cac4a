//! Decisions against a known camera: false alarms, detection, and what errors of orbits imitate.

use nalgebra::{DMatrix, DVector, Vector2};

use super::*;
use crate::{
    calibration::{LineCamera, Offset, looks::orbit_in_looks},
    random::Random,
};

const PIXEL: f64 = 8e-5;
const HALF: f64 = 0.103;
const DEPTH_M: f64 = 350_000.0;
const QUARTER_S: f64 = 7.9e6;
const NUMBERS: usize = 12;
/// Roll, yaw and scale of the second line in [`parameters`].
const RELATIVE: [usize; 3] = [6, 8, 9];

/// Standard deviations of orbits, as in Li et al. 2023, Table 2.
fn orbit_errors() -> DMatrix<f64> {
    let mut columns = DMatrix::zeros(NUMBERS, 6);
    for (line, along) in [0.342, -0.342].into_iter().enumerate() {
        let looks = [-HALF, 0.0, HALF].map(|across| Vector2::new(across, along));
        let errors = orbit_in_looks(looks, [DEPTH_M; 3]);
        for (column, error) in errors.into_iter().enumerate() {
            let sigma = if column < 3 {
                1_000.0
            } else {
                0.025_f64.to_radians()
            };
            for (row, value) in error.into_iter().enumerate() {
                columns[(6 * line + row, column)] = value * sigma;
            }
        }
    }
    columns
}

/// Standard deviations of measurement: a tenth of a pixel for every parameter.
fn measured() -> DMatrix<f64> {
    DMatrix::identity(NUMBERS, NUMBERS) * (0.1 * PIXEL).powi(2)
}

fn drawn(count: usize, random: &mut Random) -> DVector<f64> {
    DVector::from_fn(count, |_, _| random.normal())
}

/// Calibrations of a camera, whose change after a number of orbits is given, line by line; measurement errors are `times` as
/// large as stated.
fn orbits(
    count: usize,
    times: f64,
    seed: u64,
    change: impl Fn(usize) -> DVector<f64>,
) -> Vec<OrbitLooks> {
    let mut random = Random::new(seed, "calibrations of a series");
    let orbit = orbit_errors();
    let one = |at: usize| OrbitLooks {
        et_s: at as f64 * QUARTER_S,
        changes: change(at)
            + &orbit * drawn(6, &mut random)
            + drawn(NUMBERS, &mut random) * (0.1 * PIXEL * times),
        covariance: measured(),
        orbit: orbit.clone(),
    };
    (0..count).map(one).collect()
}

fn none(_: usize) -> DVector<f64> {
    DVector::zeros(NUMBERS)
}

/// A change of the scale of the second line, pixels.
fn scale(px: f64) -> DVector<f64> {
    let mut change = DVector::zeros(NUMBERS);
    change[9] = px * PIXEL;
    change
}

fn count(series: &Series, agreement: Agreement) -> usize {
    let others = series.orbits.iter().skip(1);
    others.filter(|of| of.agreement == agreement).count()
}

#[test]
fn an_unchanged_camera_agrees_whatever_its_orbits() {
    let mut alarms = 0;
    let mut squares = 0.0;
    for seed in 0..200 {
        let series = compare_orbits(&orbits(8, 1.0, seed, none), 0, PIXEL).unwrap();
        alarms += 7 - count(&series, Agreement::Agrees);
        alarms += series
            .drifts
            .iter()
            .filter(|of| of.relevant_after_s.is_some())
            .count();
        squares += series.orbits[1..]
            .iter()
            .map(|of| of.together_sigmas * of.together_sigmas)
            .sum::<f64>();
        let scatter = series.scatter.unwrap();
        assert!((1.0..2.0).contains(&scatter), "{seed}: {scatter}");
    }
    // 1,400 orbits with a nominal rate of 2e-4, and 2,400 drifts with 7e-6.
    assert!(alarms <= 2, "{alarms}");
    let rms = (squares / 1_400.0).sqrt();
    assert!((0.8..1.1).contains(&rms), "{rms}");
}

/// Attitudes and radial orbit errors change lines by tens of pixels, also relative to each other.
#[test]
fn errors_of_orbits_alone_are_no_change() {
    let of = orbits(4, 1.0, 1, none);
    let moved = (0..6).map(|column| {
        let mut of = of.clone();
        of[3].changes += orbit_errors().column(column) * 2.0;
        compare_orbits(&of, 0, PIXEL).unwrap().orbits[3].agreement
    });
    let moved: Vec<Agreement> = moved.collect();
    assert_eq!(moved, [Agreement::Agrees; 6]);
}

#[test]
fn a_change_that_no_orbit_imitates_is_found_and_sized() {
    for seed in 0..50 {
        // A sudden change of 6 pixels after the fifth orbit.
        let step = |at: usize| scale(if at > 4 { 6.0 } else { 0.0 });
        let series = compare_orbits(&orbits(8, 1.0, seed, step), 0, PIXEL).unwrap();
        for (at, orbit) in series.orbits.iter().enumerate().skip(1) {
            let expected = if at > 4 {
                Agreement::Recalibrate
            } else {
                Agreement::Agrees
            };
            assert_eq!(orbit.agreement, expected, "seed {seed}, orbit {at}");
            let change = orbit.changes[RELATIVE[2]];
            let truth = if at > 4 { 6.0 * PIXEL } else { 0.0 };
            let sigmas = (change.value - truth) / change.sigma;
            assert!(sigmas.abs() < 4.5, "{sigmas}");
        }
    }
}

/// Bends of both lines: no error of an orbit bends a line by as much.
#[test]
fn a_significant_change_below_the_limit_requires_no_calibration() {
    let small = |at: usize| {
        let mut change = DVector::zeros(NUMBERS);
        if at > 0 {
            change[4] = 0.1 * PIXEL;
            change[10] = 0.1 * PIXEL;
        }
        change
    };
    for seed in 0..20 {
        let mut of = orbits(2, 0.1, seed, small);
        for orbit in &mut of {
            orbit.covariance *= 0.01;
        }
        let series = compare_orbits(&of, 0, PIXEL).unwrap();
        let agreement = series.orbits[1].agreement;
        assert_eq!(agreement, Agreement::Changed, "seed {seed}");
        assert!(series.scatter.is_none() && series.drifts.is_empty());
    }
}

#[test]
fn an_ageing_camera_has_a_drift_with_a_date() {
    let mut sigmas = Vec::new();
    for seed in 0..30 {
        // Two pixels per quarter.
        let series = compare_orbits(&orbits(8, 1.0, seed, |at| scale(2.0 * at as f64)), 0, PIXEL);
        let series = series.unwrap();
        let drift = series.drifts[RELATIVE[2]];
        sigmas.push((drift.rate.value - 2.0 * PIXEL / QUARTER_S) / drift.rate.sigma);
        let after_s = drift.relevant_after_s.unwrap();
        let expected_s = RELEVANT_PX / 2.0 * QUARTER_S;
        assert!((0.5..2.0).contains(&(after_s / expected_s)), "{after_s}");
        // A drift is not scatter.
        assert!(series.scatter.unwrap() < 1.5);
    }
    let rms = (sigmas.iter().map(|of| of * of).sum::<f64>() / 30.0).sqrt();
    assert!((0.6..1.4).contains(&rms), "{rms}");
}

#[test]
fn scatter_beyond_the_stated_widens_the_standard_deviations() {
    let mut alarms = 0;
    let mut mean = 0.0;
    for seed in 0..50 {
        let series = compare_orbits(&orbits(8, 3.0, seed, none), 0, PIXEL).unwrap();
        mean += series.scatter.unwrap() / 50.0;
        alarms += 7 - count(&series, Agreement::Agrees);
    }
    assert!((2.5..3.5).contains(&mean), "{mean}");
    assert!(alarms <= 4, "{alarms} of 350");
}

/// Columns are what a wrong position or attitude makes of a line.
#[test]
fn errors_of_an_orbit_are_those_of_the_look_directions() {
    let line = LineCamera {
        offset: Offset::default(),
        m: vec![0.0, HALF, 0.0],
        n: vec![0.342, 0.0, 0.0],
    };
    let looks = [-1.0, 0.0, 1.0].map(|s| line.turned(s));
    let columns = orbit_in_looks(looks, [DEPTH_M; 3]);
    let angle = 1e-6;
    let offsets = [
        // About the axes across, along and down: pitch and roll have signs of their own.
        Offset {
            omega_rad: angle,
            ..Offset::default()
        },
        Offset {
            phi_rad: angle,
            ..Offset::default()
        },
        Offset {
            kappa_rad: angle,
            ..Offset::default()
        },
    ];
    for (column, offset) in columns[3..].iter().zip(offsets) {
        let turned = LineCamera {
            offset,
            ..line.clone()
        };
        let [before, after] = [&line, &turned].map(LineCamera::look_parameters);
        for at in 0..6 {
            let change = (after[at] - before[at]) / angle;
            assert!(
                (change.abs() - column[at].abs()).abs() < 1e-5,
                "{change} {column:?}"
            );
        }
    }
}
