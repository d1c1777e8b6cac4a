#![allow(clippy::unwrap_used, reason = "helpers of tests may fail loudly")]

use super::*;
use crate::time::{Et, Interval};

const RADIUS_M: f64 = 3.396e6;
/// Angle of 300 m.
const STEP_RAD: f64 = 300.0 / RADIUS_M;

/// Shots of these numbers of a pulse each 0.1 s, 300 m apart along a meridian of a sphere of 3,396 km.
fn shots(pulses: &[u32]) -> (Footprints<BodyFixed>, Profile) {
    let mut footprints = Footprints::new(Vec::new());
    for pulse in pulses.iter().copied().map(f64::from) {
        footprints.et_s.push(0.1 * pulse);
        footprints.longitude_rad.push(1.0);
        footprints.latitude_rad.push(STEP_RAD * pulse);
        footprints.radius_m.push(RADIUS_M);
        footprints.file.push(0);
    }
    let rows = 0..u32::try_from(pulses.len()).unwrap();
    let profile = Profile {
        id: String::new(),
        window: String::new(),
        orbit: 1,
        rows: rows.collect(),
        interval: Interval::new(Et::from_seconds(0.0), Et::from_seconds(0.0)),
        simultaneous: Vec::new(),
    };
    (footprints, profile)
}

fn measured(pulses: &[u32], period_s: Option<f64>, region: Option<&Region>) -> ProfileSpacing {
    let (footprints, profile) = shots(pulses);
    spacing(
        &footprints,
        &profile.rows,
        period_s,
        region.map(std::slice::from_ref),
    )
}

#[test]
fn missing_shots_are_counted_and_the_largest_gap_is_measured() {
    let of = measured(&[0, 1, 2, 3, 7, 8, 10, 11, 12, 13], Some(0.1), None);
    let by_period = of.by_period.unwrap();
    assert_eq!((of.shots, by_period.missing), (10, 4));
    // Rounding of angles of 1e-4 rad times the radius, metres.
    assert!((by_period.spacing_m.unwrap() - 300.0).abs() < 1e-3);
    assert!((of.gap_m.unwrap() - 1_200.0).abs() < 1e-3);
    assert!((of.missing_share() - 4.0 / 14.0).abs() < 1e-12);
}

#[test]
fn a_filter_that_leaves_one_shot_in_three_does_not_change_the_period() {
    let pulses: Vec<u32> = (0..60).step_by(3).collect();
    let of = measured(&pulses, Some(0.1), None);
    let by_period = of.by_period.unwrap();
    assert_eq!((of.shots, by_period.missing), (20, 38));
    assert_eq!(by_period.spacing_m, None);
    assert!((of.gap_m.unwrap() - 900.0).abs() < 1e-3);
}

#[test]
fn pulses_outside_the_window_are_not_missing() {
    // The window ends between the pulses 9 and 10, and begins again between 29 and 30.
    let part = |south: f64, north: f64| WindowShape::Box {
        west_rad: 0.9,
        east_rad: 1.1,
        south_rad: south * STEP_RAD,
        north_rad: north * STEP_RAD,
    };
    let pulses: Vec<u32> = (0..10).chain(30..40).collect();
    let whole = Region::new(&part(-0.5, 45.0));
    assert_eq!(
        measured(&pulses, Some(0.1), Some(&whole))
            .by_period
            .unwrap()
            .missing,
        20
    );
    let first = Region::new(&part(-0.5, 14.5));
    let of = measured(&pulses, Some(0.1), Some(&first));
    assert_eq!(of.by_period.unwrap().missing, 5);
    // Six of the twenty-one intervals of the gap.
    assert!((of.gap_m.unwrap() - 1_800.0).abs() < 1e-3);
}

#[test]
fn the_period_of_a_table_is_estimated_from_enough_intervals() {
    let period_s = |pulses: &[u32]| {
        let (footprints, profile) = shots(pulses);
        periods_s(&footprints, &[profile]).get(&0).copied()
    };
    let dense: Vec<u32> = (0..60).filter(|pulse| pulse % 6 < 4).collect();
    assert!((period_s(&dense).unwrap() - 0.1).abs() < 1e-9);
    assert_eq!(period_s(&dense[..20]), None);
    let unknown = measured(&dense, None, None);
    assert_eq!((unknown.by_period, unknown.missing_share()), (None, 0.0));
    assert!((unknown.gap_m.unwrap() - 900.0).abs() < 1e-3);
}

#[test]
fn spots_of_a_pulse_count_once_and_a_single_shot_has_no_gap() {
    let of = measured(&[0, 0, 0, 1, 1, 2], Some(0.1), None);
    assert_eq!((of.shots, of.by_period.unwrap().missing), (3, 0));
    let single = measured(&[5], Some(0.1), None);
    assert_eq!((single.shots, single.gap_m), (1, None));
    assert_eq!(measured(&[], Some(0.1), None).shots, 0);
}
