//! Times, states and attitudes compared with an independent CSPICE run on real kernels.

#![allow(
    clippy::unwrap_used,
    reason = "helpers of tests outside a test function"
)]

use areograph_testing as common;

use std::path::Path;

use areograph_base::{
    body::{Body, BodyModel, Datum, MARS_IAU1991, MARS_IAU1994, MARS_IAU2000, MOON_ME},
    error::Kind,
    time::{Et, Interval, Intervals, PointingBias},
    units::{RADIANS_PER_DEGREE, wrap_pi},
    utc::Utc,
};
use areograph_config::usual_instrument;
use areograph_geom::{
    body_rotation::{body_matrix, body_rotation, convert_datum},
    ellipsoid::{AreocentricLatitude, Spherical, spherical_to_xyz_m},
};
use areograph_spice::{KernelSet, Session, UtcClock};
use common::{json, m0402852_files, number, real_data};
use nalgebra::{Matrix3, Vector3};
use serde_json::Value;

fn kernels(folder: &Path) -> KernelSet {
    KernelSet::from_files(&m0402852_files(folder)).unwrap()
}

/// The kernels of the image, and the reference values.
fn image(test: &str) -> Option<(KernelSet, Value)> {
    let folder = real_data("ale_mgs/m0402852", test)?;
    let truth = real_data("derived/cspice_truth.json", test)?;
    Some((kernels(&folder), json(&truth)))
}

fn rows(value: &Value) -> &[Value] {
    value.as_array().unwrap()
}

fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_iterator(rows(value).iter().map(number))
}

fn matrix(value: &Value) -> Matrix3<f64> {
    Matrix3::from_row_iterator(rows(value).iter().map(number))
}

/// Largest distance of components, for tolerances that are stated per element.
fn worst<const R: usize, const C: usize>(
    a: &nalgebra::SMatrix<f64, R, C>,
    b: &nalgebra::SMatrix<f64, R, C>,
) -> f64 {
    (a - b).abs().max()
}

#[test]
fn clock_strings_and_utc_become_the_same_instants() {
    let Some((set, truth)) = image("clock strings") else {
        return;
    };
    let session = Session::open(&set).unwrap();
    for case in rows(&truth["sclk_to_et"]) {
        let et = session.sclk_to_et(case["sclk"].as_str().unwrap()).unwrap();
        let difference_s = et.seconds() - number(&case["et"]);
        assert!(difference_s.abs() <= 1e-9, "{case}: {et}"); // nanosecond: below one ulp of 2^24 s
    }
    for case in rows(&truth["utc_to_et"]) {
        let utc = case["utc"].as_str().unwrap();
        let et = session.utc_to_et(utc).unwrap();
        let difference_s = et.seconds() - number(&case["et"]);
        assert!(difference_s.abs() <= 1e-9, "{case}: {et}");
        assert_eq!(session.utc_to_et(&format!("{utc}Z")).unwrap(), et);
    }
    let moc = session.sclk_to_et("610472061:131").unwrap();
    assert!((moc.seconds() - -20_723_097.688_171).abs() < 5e-7); // printed to a microsecond
    let node = session.sclk_to_et("1/0844996544.086").unwrap();
    assert_eq!(session.et_to_sclk(node).unwrap(), "1/0844996544.086");
    let start = session.sclk_to_et("619971158:28").unwrap();
    assert_eq!(session.et_to_utc(start).unwrap(), "1999-08-24T14:12:13.635");
}

#[test]
fn utc_by_the_hour_is_that_of_cspice() {
    let Some((set, _)) = image("UTC of many instants") else {
        return;
    };
    let session = Session::open(&set).unwrap();
    let mut clock = UtcClock::new(&session);
    let mut differ = 0;
    let mut compared = 0;
    // Dates where TDB − TT is steepest and where it bends most, the leap second of 1998 and its neighbours, full hours, and instants in no order.
    for day in [
        "1998-12-31T23:59:50",
        "1999-04-02T13:59:59",
        "2000-12-31T00:00:00",
        "1999-07-04T11:59:58",
        "1999-10-05T23:00:00",
    ] {
        let from = session.utc_to_et(day).unwrap();
        for k in 0..5_000_i32 {
            let et = from.plus(f64::from(k) * 1.700_000_3 - f64::from(k % 7) * 900.0);
            for et in [et, from.plus(f64::from(k) * 0.009)] {
                let ours = clock.utc(et).unwrap();
                let expected = session.et_to_utc_with(et, 6).unwrap();
                let expected = Utc::parse(&expected).unwrap();
                compared += 1;
                if ours != expected {
                    differ += 1;
                    let by_us = ours.microseconds() - expected.microseconds();
                    // The last digit, where CSPICE and the hour round to both sides.
                    assert!(by_us.abs() <= 1, "{ours}, not {expected}");
                }
            }
        }
    }
    let far = clock.utc(Et::from_seconds(-1e13)).unwrap_err().to_string();
    assert!(far.contains("YEAROUTOFRANGE"), "{far}");
    println!("{differ} of {compared} differ in the last digit");
    assert!(differ * 1_000 < compared, "{differ} of {compared}");
}

#[test]
fn orientation_samples_of_a_real_image_are_met() {
    let Some((set, truth)) = image("orientation samples") else {
        return;
    };
    let session = Session::open(&set).unwrap();
    let samples = rows(&truth["eo_m0402852"]["samples"]);
    assert_eq!(samples.len(), 31);
    let (mut worst_km, mut worst_element) = (0.0_f64, 0.0_f64);
    for sample in samples {
        let et = Et::from_seconds(number(&sample["et"]));
        let position = session.state(et).unwrap().position;
        let apparent = session.apparent_state(et).unwrap().position;
        let to_mars = body_rotation(Body::Mars, et);
        let mars = to_mars.apply(&position);
        for (ours, key) in [
            (position.xyz_m, "mgs_j2000_pos_geometric"),
            (apparent.xyz_m, "mgs_j2000_pos_lt_s"),
            (mars.xyz_m, "mgs_iau_mars_pos"),
            (
                body_matrix(&MARS_IAU1991, et) * position.xyz_m,
                "mgs_pos_iau1991_w176.868",
            ),
            (
                body_matrix(&MARS_IAU1994, et) * position.xyz_m,
                "mgs_pos_pck00006_w176.901",
            ),
        ] {
            worst_km = worst_km.max(worst(&(ours / 1_000.0), &vector(&sample[key])));
        }
        let attitude = session
            .attitude(usual_instrument().pointing_bias().lookup(et), et, 0.0)
            .unwrap();
        assert!(attitude.distance_s < 1e-9 && attitude.inertial_to_bus.at() == et);
        let to_camera =
            session.mounting(usual_instrument(), et).unwrap() * attitude.inertial_to_bus;
        let camera_to_mars = to_mars * to_camera.inverse();
        for (ours, key) in [
            (to_mars.matrix(), "r_j2000_to_iau_mars"),
            (
                attitude.inertial_to_bus.matrix(),
                "r_j2000_to_spacecraft_at_et_minus_1.15",
            ),
            (camera_to_mars.matrix(), "r_camera_to_iau_mars"),
        ] {
            worst_element = worst_element.max(worst(ours, &matrix(&sample[key])));
        }
    }
    println!("worst position {worst_km:.1e} km, worst matrix element {worst_element:.1e}");
    assert!(worst_km < 1e-6); // a millimetre
    assert!(worst_element < 1e-11); // 0.04 mm seen from 3700 km
}

#[test]
fn apparent_positions_and_the_sun_are_those_of_the_support_data() {
    let (Some((set, _)), Some(isd)) = (
        image("support data"),
        real_data("ale_mgs/isds/mgsmocna_isd.json", "support data"),
    ) else {
        return;
    };
    let session = Session::open(&set).unwrap();
    let isd = json(&isd);
    for (body, count) in [("instrument_position", 154), ("sun_position", 2)] {
        let table = &isd[body];
        let epochs = rows(&table["ephemeris_times"]);
        assert_eq!(epochs.len(), count);
        for (index, epoch) in epochs.iter().enumerate() {
            let et = Et::from_seconds(number(epoch));
            let state = if body == "sun_position" {
                session.sun_state(et).unwrap()
            } else {
                session.apparent_state(et).unwrap()
            };
            let km = state.position.xyz_m / 1_000.0;
            let km_s = state.velocity_m_s / 1_000.0;
            assert!(worst(&km, &vector(&table["positions"][index])) < 1e-6); // a millimetre
            assert!(worst(&km_s, &vector(&table["velocities"][index])) < 1e-9); // 1 µm/s
        }
    }
}

#[test]
fn tabulated_states_of_real_kernels_are_those_that_cspice_reads() {
    let (Some((set, _)), Some(isd)) = (
        image("tabulated states"),
        real_data("ale_mgs/isds/mgsmocna_isd.json", "tabulated states"),
    ) else {
        return;
    };
    let session = Session::open(&set).unwrap();
    let epochs = &json(&isd)["instrument_position"]["ephemeris_times"];
    let epochs: Vec<f64> = rows(epochs).iter().map(number).collect();
    let [first, last] = [epochs[0], epochs[epochs.len() - 1]].map(Et::from_seconds);
    let over = Interval::new(first, last);
    let tabulated = session.of(session.spacecraft()).tabulated(over);
    let (mut worst_m, mut worst_m_s, mut differ) = (0.0_f64, 0.0_f64, 0);
    for k in 0..1_000 {
        let et = first.plus(over.duration_s() * f64::from(k) / 1_000.0);
        for (found, read) in [
            (tabulated.state(et), session.state(et)),
            (tabulated.apparent_state(et), session.apparent_state(et)),
        ] {
            let [found, read] = [found.unwrap(), read.unwrap()];
            worst_m = worst_m.max((found.position.xyz_m - read.position.xyz_m).norm());
            worst_m_s = worst_m_s.max((found.velocity_m_s - read.velocity_m_s).norm());
            differ += i32::from(found != read);
        }
    }
    println!("{worst_m:.1e} m, {worst_m_s:.1e} m/s, {differ} of 2000 differ in the last bits");
    // As `Session::tabulated` states; states that never differ were not tabulated.
    assert!(worst_m < 3e-4 && worst_m_s < 1e-5 && differ > 0);
    let before = first.plus(-1.0);
    assert_eq!(
        tabulated.state(before).unwrap(),
        session.state(before).unwrap()
    );
}

#[test]
fn a_mounting_is_read_once_only_where_it_is_constant() {
    let (Some(folder), Some((_, truth))) = (
        real_data("ale_mgs/m0402852", "mountings"),
        image("mountings"),
    ) else {
        return;
    };
    let samples = rows(&truth["eo_m0402852"]["samples"]);
    let [first, last] = [&samples[0], &samples[30]].map(|s| Et::from_seconds(number(&s["et"])));
    let mounted_on = |relative: &str| {
        let written = tempfile::tempdir().unwrap();
        let file = written.path().join("camera.tf");
        // Through a frame that is constant relative to the other one.
        let text = format!(
            "KPL/FK\n\\begindata\nFRAME_HOLDER = 1494031\nFRAME_1494031_NAME = 'HOLDER'\n\
             FRAME_1494031_CLASS = 4\nFRAME_1494031_CLASS_ID = 1494031\nFRAME_1494031_CENTER = -94\n\
             TKFRAME_1494031_RELATIVE = '{relative}'\nTKFRAME_1494031_SPEC = 'ANGLES'\n\
             TKFRAME_1494031_UNITS = 'DEGREES'\nTKFRAME_1494031_AXES = ( 1 2 3 )\n\
             TKFRAME_1494031_ANGLES = ( 10 20 30 )\nTKFRAME_-94031_RELATIVE = 'HOLDER'\n\\begintext\n"
        );
        #[allow(clippy::disallowed_methods, reason = "input of a test, not a product")]
        std::fs::write(&file, text).unwrap();
        let mut files = m0402852_files(&folder);
        files.push(file);
        let session = Session::open(&KernelSet::from_files(&files).unwrap()).unwrap();
        let mounting = |et| session.mounting(usual_instrument(), et).unwrap();
        // Asked for again, an instant has the mounting of that instant.
        let asked = [first, last, first].map(mounting);
        assert_eq!(asked.map(|of| of.at()), [first, last, first]);
        asked.map(|of| *of.matrix())
    };
    let [before, after, again] = mounted_on("MGS_SPACECRAFT");
    assert!(before == after && before == again);
    let [before, after, again] = mounted_on("J2000");
    assert_eq!(before, again);
    // The bus turns by 0.05° a second.
    assert!(worst(&before, &after) > 1e-4);
}

#[test]
fn closed_rotations_equal_the_kernels() {
    let cases: [(&str, Body, &BodyModel); 8] = [
        (
            "derived/mars_iau1991_w176868.tpc",
            Body::Mars,
            &MARS_IAU1991,
        ),
        (
            "derived/mars_iau1994_pck00006.tpc",
            Body::Mars,
            &MARS_IAU1994,
        ),
        ("mgs_text/mars_iau2000_v0.tpc", Body::Mars, &MARS_IAU2000),
        ("mgs_text/pck00008.tpc", Body::Mars, &MARS_IAU2000),
        ("mgs_text/pck00009.tpc", Body::Mars, &MARS_IAU2000),
        ("mgs_text/pck00010.tpc", Body::Mars, &MARS_IAU2000),
        ("ale_mgs/m0402852/pck00009.tpc", Body::Mars, &MARS_IAU2000),
        // The Moon with its periodic terms.
        ("mgs_text/pck00010.tpc", Body::Moon, &MOON_ME),
    ];
    for (file, body, model) in cases {
        let Some(path) = real_data(file, "rotation of bodies") else {
            continue;
        };
        let session = Session::open(&KernelSet::from_files(&[path]).unwrap()).unwrap();
        // CSPICE computes the meridian in degrees, then in radians, before it removes whole turns: with 3e5 degrees in
        // MOLA's years its rounding is 1e-12 rad (4 µm on the ground), with 9e5 degrees at the mission's end three
        // times as much.
        for (days, tolerance) in [(-900..=600, 1e-12), (601..=2_600, 3e-12)] {
            let largest = days
                .map(|day| Et::from_seconds(f64::from(day) * 86_400.0 + 12_345.678))
                .map(|et| {
                    worst(
                        &session.body_matrix(body, et).unwrap(),
                        &body_matrix(model, et),
                    )
                })
                .fold(0.0, f64::max);
            println!("{file}: {largest:.1e}");
            assert!(largest < tolerance, "{file}: {largest:.1e}");
        }
    }
}

#[test]
fn datum_vectors_are_met() {
    let Some(path) = real_data("derived/cspice_truth.json", "datum vectors") else {
        return;
    };
    for case in rows(&json(&path)["datum_conversion"]) {
        let datum = match case["from"].as_str().unwrap() {
            "iau1991_w176.868" => Datum::Iau1991,
            _ => Datum::Iau1994,
        };
        let et = Et::from_seconds(number(&case["et"]));
        let old_m = spherical_to_xyz_m(
            number(&case["lon_east"]) * RADIANS_PER_DEGREE,
            number(&case["lat_centric"]) * RADIANS_PER_DEGREE,
            number(&case["radius"]) * 1_000.0,
        );
        let new = convert_datum(Body::Mars, old_m, datum, et, et);
        let spherical = Spherical::from_xyz_m(&new.xyz_m);
        let longitude_rad = number(&case["iau2000_lon_east"]) * RADIANS_PER_DEGREE;
        let latitude_rad = number(&case["iau2000_lat_centric"]) * RADIANS_PER_DEGREE;
        // 1e-9 rad is 3 mm on the ground.
        assert!(
            wrap_pi(spherical.longitude_rad - longitude_rad).abs() < 1e-9,
            "{case}"
        );
        assert!((spherical.latitude.0 - latitude_rad).abs() < 1e-9, "{case}");
        assert!((spherical.radius_m / 1_000.0 - number(&case["iau2000_radius"])).abs() < 1e-9);
    }
}

#[test]
fn areographic_latitudes_are_met() {
    let Some(path) = real_data("derived/cspice_truth.json", "areographic latitudes") else {
        return;
    };
    for case in rows(&json(&path)["areographic_to_areocentric"]) {
        let model: &BodyModel = match case["ellipsoid"].as_str().unwrap() {
            "iau1991" => &MARS_IAU1991,
            _ => &MARS_IAU2000,
        };
        // Above the ellipsoid the areocentric latitude is not that of the foot of the normal.
        if number(&case["alt"]).abs() > 1e-12 {
            continue;
        }
        let [graphic_rad, centric_rad] =
            ["lat_graphic", "lat_centric"].map(|key| number(&case[key]) * RADIANS_PER_DEGREE);
        let graphic = AreocentricLatitude(centric_rad).to_areographic(model);
        assert!((graphic.0 - graphic_rad).abs() < 1e-12, "{case}"); // rounding
    }
}

#[test]
fn a_gap_between_attitude_files_is_named_with_its_kernels() {
    let Some((set, _)) = image("attitude gap") else {
        return;
    };
    let session = Session::open(&set).unwrap();
    let coverage = session.coverage().unwrap();
    assert_eq!(coverage.ck.as_slice().len(), 2);
    assert_eq!(coverage.spk.as_slice().len(), 2);
    let at = |utc: &str| session.utc_to_et(utc).unwrap();
    let gap = Interval::new(at("1999-08-24T14:00:00"), at("1999-08-24T14:11:00"));
    let failure = session
        .require_attitude(gap, usual_instrument().pointing_bias(), 1.0, 0.0)
        .unwrap_err();
    assert_eq!(failure.kind(), Kind::Coverage);
    let text = failure.to_string();
    println!("{text}");
    for part in [
        "no attitude of MGS for ET -11224",
        "1999-08-24T14:02:21.9",
        "1999-08-24T14:10:13.6",
        "mgs_sc_map2_0_sliced_-94000.bc ends at",
        "mgs_sc_map2_1_sliced_-94000.bc begins at",
    ] {
        assert!(text.contains(part), "{part} in {text}");
    }
    let failure = session.require_position(gap).unwrap_err().to_string();
    assert!(failure.contains("m0402852.ale_0.bsp ends at"), "{failure}");
    // The bias matters: these exposures lie inside the second slice, their look-ups before it.
    let edge = coverage.ck.as_slice()[1].start;
    let exposures = Interval::new(edge.plus(1.0), edge.plus(10.0));
    assert!(
        session
            .require_attitude(exposures, PointingBias::from_seconds(0.0), 0.5, 0.0)
            .is_ok()
    );
    assert!(
        session
            .require_attitude(exposures, usual_instrument().pointing_bias(), 0.0, 0.0)
            .is_err()
    );
    let inside = usual_instrument()
        .pointing_bias()
        .lookup(at("1999-08-24T14:05:00"));
    let failure = session
        .attitude(inside, at("1999-08-24T14:05:00"), 1.0)
        .unwrap_err();
    assert_eq!(failure.kind(), Kind::Coverage);
    let failure = session.state(at("1999-08-24T14:05:00")).unwrap_err();
    assert_eq!(failure.kind(), Kind::Coverage);
    assert!(failure.to_string().contains("SPICE(SPKINSUFFDATA)"));
}

#[test]
fn a_trajectory_keeps_within_a_millimetre_of_the_kernels() {
    let Some((set, _)) = image("trajectory") else {
        return;
    };
    let session = Session::open(&set).unwrap();
    let held = session.coverage().unwrap().spk.clone();
    let trajectory = session.trajectory(&held, 1e-3).unwrap();
    assert!(trajectory.max_error_m() < 1e-3);
    let (mut worst_m, mut worst_m_s) = (0.0_f64, 0.0_f64);
    for interval in held.as_slice() {
        for step in 0..=5_000 {
            let share = f64::from(step) / 5_000.0;
            let et = interval.start.plus(share * interval.duration_s());
            if !interval.contains(et) {
                continue;
            }
            let state = session.state(et).unwrap();
            let position = trajectory.position(et).unwrap();
            worst_m = worst_m.max(position.distance_m(&state.position));
            let velocity_m_s = trajectory.velocity_m_s(et).unwrap();
            worst_m_s = worst_m_s.max((velocity_m_s - state.velocity_m_s).norm());
        }
        assert!(trajectory.position(interval.stop.plus(0.001)).is_none());
        assert!(trajectory.position(interval.start.plus(-0.001)).is_none());
    }
    println!("trajectory: {worst_m:.2e} m, {worst_m_s:.2e} m/s off at 5001 instants per interval");
    assert!(worst_m < 1e-3);
    assert!(worst_m_s < 1e-3);
    let start = held.as_slice()[1].start;
    let clock = std::time::Instant::now();
    let mut sum_m = 0.0;
    for step in 0..100_000 {
        let position = trajectory.position(start.plus(f64::from(step) * 2e-3));
        sum_m += position.unwrap().xyz_m.x;
    }
    let nanoseconds = clock.elapsed().as_secs_f64() * 1e4;
    println!("trajectory: {nanoseconds:.0} ns a call (checksum {sum_m:.3e})");
    let outside = Intervals::union_of([held.as_slice()[0].padded(1.0)]);
    assert_eq!(
        session.trajectory(&outside, 1e-3).unwrap_err().kind(),
        Kind::Coverage
    );
}
