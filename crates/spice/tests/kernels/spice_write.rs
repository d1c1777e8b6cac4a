//! Round trip of kernels written for a synthetic mission.

#![allow(
    clippy::unwrap_used,
    reason = "helpers of tests outside a test function"
)]

use areograph_testing as common;

use std::path::PathBuf;

use areograph_base::{
    error::Kind,
    frames::Position,
    time::{Et, Interval, PointingBias},
};
use areograph_geom::attitude::matrix_of_spice_quaternion;
use areograph_spice::{CkSegment, KernelSet, Session, SpkSegment, State, write_ck, write_spk};
use common::real_data;
use nalgebra::Vector3;
use tempfile::tempdir;

const RATE_RAD_S: f64 = 9e-4;
const RADIUS_M: f64 = 3.77e6;
/// The kernel of the test has no time bias.
const NO_BIAS: PointingBias = PointingBias::from_seconds(0.0);

/// A circle, seconds after its start.
fn circle(t: f64) -> State {
    let (sin, cos) = (RATE_RAD_S * t).sin_cos();
    State {
        position: Position::new(RADIUS_M * Vector3::new(cos, sin, 0.1)),
        velocity_m_s: RADIUS_M * RATE_RAD_S * Vector3::new(-sin, cos, 0.0),
    }
}

/// An attitude that rotates about Z.
fn turn(t: f64) -> [f64; 4] {
    let (sin, cos) = (RATE_RAD_S * t / 2.0).sin_cos();
    [cos, 0.0, 0.0, -sin]
}

/// Leap seconds and clock.
fn times(test: &str) -> Option<Vec<PathBuf>> {
    ["naif0012.tls", "MGS_SCLKSCET.00061.tsc"]
        .iter()
        .map(|name| real_data(&format!("mgs_text/{name}"), test))
        .collect()
}

#[test]
fn a_circle_is_read_back_and_tabulated() {
    let Some(mut files) = times("ephemeris writer") else {
        return;
    };
    let temporary = tempdir().unwrap();
    let path = temporary.path().join("circle.bsp");
    let begin = Et::from_seconds(3.7e7);
    let seconds: Vec<f64> = (0..200).map(|step| f64::from(step) * 10.0).collect();
    let epochs: Vec<Et> = seconds.iter().map(|t| begin.plus(*t)).collect();
    let states: Vec<State> = seconds.iter().map(|t| circle(*t)).collect();
    let segment = SpkSegment {
        target: -94,
        centre: 499,
        name: "circle",
        degree: 7,
        epochs: &epochs,
        states: &states,
    };
    write_spk(&path, &[segment], "A circle.\n\nSecond paragraph.").unwrap();
    files.push(path.clone());
    let session = Session::open(&KernelSet::from_files(&files).unwrap()).unwrap();
    let held = &session.coverage().unwrap().spk;
    assert_eq!(held.as_slice(), [Interval::new(begin, begin.plus(1_990.0))]);
    let trajectory = session.trajectory(held, 1e-3).unwrap();
    for t in [0.0, 3.3, 399.0, 801.0, 1_990.0] {
        let truth = circle(t);
        let state = session.state(begin.plus(t)).unwrap();
        // ET is rounded to 7e-9 s here, 2.5e-5 m at this speed.
        assert!(state.position.distance_m(&truth.position) < 1e-4);
        assert!((state.velocity_m_s - truth.velocity_m_s).norm() < 1e-6);
        let tabulated = trajectory.position(begin.plus(t)).unwrap();
        assert!(tabulated.distance_m(&truth.position) < 1e-3 + 1e-4);
    }
    // Ten days without data are a gap, not an extrapolation.
    let beyond = Interval::new(begin, begin.plus(864_000.0));
    assert_eq!(
        session.require_position(beyond).unwrap_err().kind(),
        Kind::Coverage
    );
}

/// A summary record has room for 25 segments; where the last one is full, an empty record of names ends the file.
#[test]
fn kernels_of_full_summary_records_are_complete() {
    let temporary = tempdir().unwrap();
    let begin = Et::from_seconds(3.7e7);
    let passes: Vec<(Vec<Et>, Vec<State>)> = (0..50)
        .map(|pass| {
            let seconds = (0..8).map(|step| 3_600.0 * f64::from(pass) + 10.0 * f64::from(step));
            seconds.map(|t| (begin.plus(t), circle(t))).unzip()
        })
        .collect();
    for count in [24, 25, 26, 50] {
        let segments = passes[..count].iter().map(|(epochs, states)| SpkSegment {
            target: -94,
            centre: 499,
            name: "pass",
            degree: 7,
            epochs,
            states,
        });
        let path = temporary.path().join(format!("{count}.bsp"));
        write_spk(&path, &segments.collect::<Vec<_>>(), "Passes.").unwrap();
        assert_eq!(
            std::fs::metadata(&path).unwrap().len() % 1_024,
            0,
            "{count}"
        );
        let session = Session::open(&KernelSet::from_files(&[path]).unwrap()).unwrap();
        assert_eq!(session.coverage().unwrap().spk.as_slice().len(), count);
        let t = 3_600.0 * (count - 1) as f64 + 35.0;
        let off_m =
            (session.state(begin.plus(t)).unwrap().position).distance_m(&circle(t).position);
        assert!(off_m < 1e-4, "{count} {off_m}");
    }
}

#[test]
fn an_attitude_with_a_gap_is_read_back() {
    let Some(mut files) = times("attitude writer") else {
        return;
    };
    let temporary = tempdir().unwrap();
    let path = temporary.path().join("turning.bc");
    let begin = Et::from_seconds(3.7e7);
    let seconds: Vec<f64> = (0..=100)
        .chain(200..=300)
        .map(|step| f64::from(step) * 4.0)
        .collect();
    let instants: Vec<Et> = seconds.iter().map(|t| begin.plus(*t)).collect();
    let quaternions: Vec<[f64; 4]> = seconds.iter().map(|t| turn(*t)).collect();
    let rates = vec![[0.0, 0.0, RATE_RAD_S]; instants.len()];
    let segment = CkSegment {
        name: "turning",
        instants: &instants,
        quaternions: &quaternions,
        angular_velocities_rad_s: &rates,
        interval_starts: &[begin, begin.plus(800.0)],
    };
    let session = Session::open(&KernelSet::from_files(&files).unwrap()).unwrap();
    write_ck(&path, &session, &[segment], "").unwrap();
    let existing = write_ck(&path, &session, &[segment], "").unwrap_err();
    assert!(
        existing.to_string().contains("ckopn_c: SPICE("),
        "{existing}"
    );
    drop(session);
    files.push(path);
    let session = Session::open(&KernelSet::from_files(&files).unwrap()).unwrap();
    for t in [0.0, 3.3, 399.0, 801.0, 1_199.9] {
        let at = begin.plus(t);
        let attitude = session.attitude(NO_BIAS.lookup(at), at, 0.0).unwrap();
        let expected = matrix_of_spice_quaternion(turn(t));
        let difference = (attitude.inertial_to_bus.matrix() - expected).abs().max();
        // A double holds ticks to 4e-6 (1.5e-8 s) and ET to 7e-9 s; at 9e-4 rad/s that is 2e-11 rad.
        assert!(difference < 2e-11, "{difference:.1e} at {t} s");
        assert!((attitude.angular_velocity_rad_s.z - RATE_RAD_S).abs() < 1e-12);
    }
    let held = session.coverage().unwrap().ck.as_slice();
    let ends: Vec<f64> = held
        .iter()
        .flat_map(|interval| [interval.start.since(begin), interval.stop.since(begin)])
        .collect();
    assert_eq!(ends.len(), 4);
    for (end, expected) in ends.iter().zip([0.0, 400.0, 800.0, 1_200.0]) {
        assert!((end - expected).abs() < 1e-6, "{end}"); // rounding of ticks and ET
    }
    let at = begin.plus(403.0);
    let near = session.attitude(NO_BIAS.lookup(at), at, 5.0).unwrap();
    assert!((near.distance_s - 3.0).abs() < 1e-3); // the sample at 400 s
    assert!(session.attitude(NO_BIAS.lookup(at), at, 2.0).is_err());
}

#[test]
fn columns_that_do_not_fit_are_refused() {
    let Some(files) = times("refused columns") else {
        return;
    };
    let temporary = tempdir().unwrap();
    let at = temporary.path();
    let instants = [0.0, 4.0, 8.0].map(Et::from_seconds);
    let states = [0.0, 4.0, 8.0].map(circle);
    let spk = SpkSegment {
        target: -94,
        centre: 499,
        name: "circle",
        degree: 1,
        epochs: &instants,
        states: &states,
    };
    let text = |name: &str, segment: SpkSegment| {
        write_spk(&at.join(name), &[segment], "")
            .unwrap_err()
            .cause
            .to_string()
    };
    let long = SpkSegment {
        name: "a name that is longer than the forty characters",
        ..spk
    };
    assert!(text("long.bsp", long).ends_with("its name must have 1 to 40 characters"));
    let none = SpkSegment {
        epochs: &[],
        states: &[],
        ..spk
    };
    assert_eq!(
        text("none.bsp", none),
        "segment circle: it contains no instants"
    );
    let even = SpkSegment { degree: 4, ..spk };
    assert!(text("even.bsp", even).starts_with("spkw13_c: SPICE(INVALIDDEGREE)"));
    let session = Session::open(&KernelSet::from_files(&files).unwrap()).unwrap();
    assert!(text("session.bsp", spk).contains("session is already open on this thread"));
    let ck = CkSegment {
        name: "turning",
        instants: &instants,
        quaternions: &[turn(0.0); 2],
        angular_velocities_rad_s: &[[0.0; 3]; 3],
        interval_starts: &instants[..1],
    };
    let failure = write_ck(&at.join("uneven.bc"), &session, &[ck], "").unwrap_err();
    assert_eq!(
        failure.cause.to_string(),
        "segment turning: column of 2 values for 3 instants"
    );
}
