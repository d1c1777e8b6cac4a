//! Line times by pieces: the table itself, and an image whose exposure changes inside it, on its way to the ground and
//! back and into a camera model.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

use crate::common;
use crate::common::adjusted as images;
use crate::common::camera_files as pushbroom;
use crate::common::products_site as fixture;

use std::{fs, sync::atomic::AtomicBool};

use areograph::{
    body::Body,
    capabilities::write_products,
    frames::{BodyFixed, Position},
    geom::{
        ellipsoid::{Spherical, ray_meets_ellipsoid},
        pushbroom::CameraModel,
    },
    line_times::{LinePiece, LineTimes, LineTimesError},
    spice::Session,
    stages::{
        fit_sensor_model::fit_sensor_model, oriented::OrientedImage, register::register,
        tag_times::ImageTimes,
    },
    time::Et,
    units::METRES_PER_KM,
};
use areograph_testing::replace;
use images::{Image, kernel_camera};
use nalgebra::Vector3;
use proptest::prelude::*;
use pushbroom::{Pushbroom, rows};
use serde_json::Value;

const START_S: f64 = 38_593_127.0;

fn start() -> Et {
    Et::from_seconds(START_S)
}

/// Pieces of some lines, with a period and a gap before them, seconds.
fn tables() -> impl Strategy<Value = LineTimes> {
    let piece = (
        1_u32..2_000,
        3e-4..1e-2_f64,
        prop_oneof![Just(0.0), 1e-3..0.5_f64],
    );
    prop::collection::vec(piece, 1..6).prop_map(|table| {
        let (mut first_line, mut after_s) = (0, 0.0);
        let mut pieces = Vec::new();
        for (lines, period_s, gap_s) in table {
            pieces.push(LinePiece {
                first_line,
                start: start().plus(after_s),
                period_s,
            });
            first_line += lines;
            after_s += f64::from(lines) * period_s + gap_s;
        }
        LineTimes::of_pieces(first_line, &pieces).unwrap()
    })
}

proptest! {
    #[test]
    fn lines_and_times_are_each_others_inverse(times in tables(), share in -0.2..1.2_f64) {
        let line = share * f64::from(times.lines());
        let back = times.line_at(times.seconds(line));
        prop_assert!((back - line).abs() < 1e-9, "{line} {back}"); // lines
        let back = times.line_of_offset(times.offset_of_line(line));
        prop_assert!((back - line).abs() < 1e-9, "{line} {back}"); // lines
        // ET of 4e7 s is rounded to 7.5e-9 s, and a line takes 3e-4 s or more.
        let back = times.line(times.et(line));
        prop_assert!((back - line).abs() < 1e-4, "{line} {back}");
        let apart = times.offset(times.et(line)) - times.offset_of_line(line);
        prop_assert!(apart.abs() < 1e-4, "{apart}"); // likewise
    }

    #[test]
    fn later_lines_are_exposed_later(times in tables(), a in -0.2..1.2_f64, b in -0.2..1.2_f64) {
        let (a, b) = (a.min(b) * f64::from(times.lines()), a.max(b) * f64::from(times.lines()));
        prop_assert!(times.seconds(a) <= times.seconds(b));
        prop_assert!(times.offset_of_line(a) <= times.offset_of_line(b));
        let duration_s = times.duration_s();
        let (a_s, b_s) = (duration_s * a / f64::from(times.lines()), duration_s * b / f64::from(times.lines()));
        prop_assert!(times.line_at(a_s) <= times.line_at(b_s));
    }

    /// Not only near: images of one piece give the numbers that they always gave, bit by bit.
    #[test]
    fn one_piece_is_a_line_period(lines in 1_u32..100_000, period_s in 1e-4..1e-1_f64, line in -1e3..1e5_f64) {
        let times = LineTimes::even(start(), lines, period_s).unwrap();
        let half = 0.5 * f64::from(lines);
        let equal = |a: f64, b: f64| a.to_bits() == b.to_bits();
        prop_assert!(equal(times.mean_period_s(), period_s));
        prop_assert!(equal(times.duration_s(), f64::from(lines) * period_s));
        prop_assert_eq!(times.middle(), start().plus(0.5 * f64::from(lines) * period_s));
        prop_assert_eq!(times.et(line), start().plus(line * period_s));
        prop_assert!(equal(times.offset_of_line(line), line - half));
        prop_assert!(equal(times.line_of_offset(line), line + half));
        prop_assert!(!times.in_gap(line) && equal(times.offsets_per_line(line), 1.0));
    }
}

fn piece(first_line: u32, after_s: f64, period_s: f64) -> LinePiece {
    LinePiece {
        first_line,
        start: start().plus(after_s),
        period_s,
    }
}

#[test]
fn a_gap_has_no_line() {
    // 100 lines of 10 ms, a gap of half a second, 100 lines of 10 ms.
    let times = LineTimes::of_pieces(200, &[piece(0, 0.0, 0.01), piece(100, 1.5, 0.01)]).unwrap();
    let near = |a: f64, b: f64| (a - b).abs() < 1e-9; // lines, seconds: rounding of small numbers
    assert!(near(times.duration_s(), 2.5) && near(times.mean_period_s(), 0.0125));
    assert!(near(times.line_at(1.25), 100.0) && near(times.line_at(1.75), 125.0));
    let offset = |after_s: f64| times.offset(start().plus(after_s));
    assert!(times.in_gap(offset(1.25)) && near(times.line_of_offset(offset(1.25)), 100.0));
    for after_s in [-0.1, 0.5, 0.999, 1.501, 2.0, 2.6] {
        assert!(!times.in_gap(offset(after_s)), "{after_s} s");
    }
    assert!(near(times.seconds(99.999), 0.999_99) && near(times.seconds(100.0), 1.5));
    let told: Vec<LinePiece> = times.pieces().collect();
    assert_eq!(told, [piece(0, 0.0, 0.01), piece(100, 1.5, 0.01)]);
}

#[test]
fn tables_that_are_none_are_refused() {
    let refused = |lines, pieces: &[LinePiece]| LineTimes::of_pieces(lines, pieces).unwrap_err();
    assert_eq!(refused(10, &[]), LineTimesError::NoPieces);
    assert_eq!(
        LineTimes::continuous(start(), &[]).unwrap_err(),
        LineTimesError::NoPieces
    );
    assert_eq!(
        refused(10, &[piece(1, 0.0, 0.01)]),
        LineTimesError::FirstLine { first_line: 1 }
    );
    assert_eq!(
        refused(10, &[piece(0, 0.0, 0.01), piece(10, 0.1, 0.01)]).to_string(),
        "piece 2 of the line times begins with line 10 and ends before line 10; expected one line or more"
    );
    assert_eq!(
        LineTimes::even(start(), 0, 0.01).unwrap_err().to_string(),
        "piece 1 of the line times begins with line 0 and ends before line 0; expected one line or more"
    );
    for period_s in [0.0, -0.01, f64::NAN, f64::INFINITY] {
        let failure = LineTimes::even(start(), 10, period_s)
            .unwrap_err()
            .to_string();
        assert!(
            failure.ends_with(&format!("of {period_s} s; expected a number above 0")),
            "{failure}"
        );
    }
    let early = refused(20, &[piece(0, 0.0, 0.01), piece(10, 0.05, 0.01)]).to_string();
    assert!(
        early.contains("piece 2")
            && early.contains("before the last line of the preceding piece ends"),
        "{early}"
    );
    let nowhere = refused(20, &[piece(0, 0.0, 0.01), piece(10, f64::NAN, 0.01)]);
    assert!(matches!(nowhere, LineTimesError::Overlap { piece: 2, .. }));
}

/// ET is rounded: what begins within a microsecond of the end of the piece before follows at once, however many do.
#[test]
fn pieces_that_overlap_by_rounding_follow_each_other() {
    let early_s = [0.0, 4e-7, -4e-7];
    for early_s in early_s {
        let pieces = (0..300_u32).map(|index| {
            let after_s = f64::from(index) * (0.1 - early_s);
            piece(10 * index, after_s, 0.01)
        });
        let pieces: Vec<LinePiece> = pieces.collect();
        let times = LineTimes::of_pieces(3000, &pieces).unwrap();
        for piece in pieces {
            let first = f64::from(piece.first_line);
            let expected_s = piece.start.since(start());
            // Seconds: the rounding of ET, which does not add up.
            assert!((times.seconds(first) - expected_s).abs() < 2e-8);
            assert!((times.seconds(first - 1e-6) - expected_s).abs() < 2e-8);
        }
    }
    let overlap = [piece(0, 0.0, 0.01), piece(10, 0.1 - 2e-6, 0.01)];
    assert!(LineTimes::of_pieces(20, &overlap).is_err());
}

/// An image of the scene as a camera would have taken it that changes its exposure: fine lines first, coarse ones
/// behind, the fine ones over a part that the first lines of an upper half would show.
fn changed() -> Image {
    let mut image = Image::of_scene("E02-02016");
    let of_one = &image.times.line_times;
    let (lines, period_s) = (of_one.lines(), of_one.mean_period_s());
    image.times.line_times = LineTimes::continuous(
        of_one.start(),
        &[
            (lines / 3, 0.6 * period_s),
            (lines / 2, 1.3 * period_s),
            (lines / 4, 0.8 * period_s),
        ],
    )
    .unwrap();
    image.times.lines_delivered = image.times.line_times.lines();
    image.orientation = image.sampled_with(&image.set);
    image
}

/// Line coordinates all over the image, on both sides of the ends of its pieces, with a sample each.
fn places(times: &ImageTimes) -> Vec<(f64, f64)> {
    let lines = f64::from(times.line_times.lines());
    let mut all: Vec<f64> = (0..=30).map(|k| lines * f64::from(k) / 30.0).collect();
    for piece in times.line_times.pieces().skip(1) {
        let first = f64::from(piece.first_line);
        all.extend([-1.0, -0.5, -0.1, 0.0, 0.1, 0.4, 0.5, 0.9].map(|beside| first + beside));
    }
    let samples = f64::from(times.samples);
    let across = [0.5, 0.3 * samples, samples - 0.5];
    all.iter()
        .zip(across.iter().cycle())
        .map(|(line, sample)| (*line, *sample))
        .collect()
}

#[test]
fn image_to_ground_to_image_closes_where_the_exposure_changes() {
    let image = changed();
    let sampling = areograph::config::OrientationConfig::default();
    let required = Some(CameraModel::Samples);
    let model = fit_sensor_model(&image.orientation, &sampling, required).unwrap();
    // Time is what orientation is smooth over: the polynomials fit as they do without a change.
    assert!(
        model.invalid_because.is_empty(),
        "{:?}",
        model.invalid_because
    );
    let oriented = OrientedImage::of(&image.times, &image.orientation, &model).unwrap();
    let camera = oriented.oriented_camera();
    let projector = oriented.projector().unwrap();
    let session = Session::open(&image.set).unwrap();
    let (mut site, mut expected) = (fixture::Site::small(), Vec::new());
    let (mut worst_px, mut worst_of_kernels_px) = (0.0_f64, 0.0_f64);
    for (line, sample) in places(&image.times) {
        let (x, _) = camera.focal_plane_coordinates(line, sample);
        let pose = camera.orientation.pose(x);
        let look = oriented.detector.look(sample);
        let ground = |position_m: Vector3<f64>, direction: Vector3<f64>| {
            let position = Position::<BodyFixed>::new(position_m);
            ray_meets_ellipsoid(Body::Mars.model(), &position, &direction)
                .unwrap()
                .xyz_m
        };
        let seen = |ground_m: &Vector3<f64>| {
            let seen = projector.project(ground_m).unwrap();
            let focal_px = oriented.detector.focal_px(&seen.camera_m).unwrap();
            [
                image.times.line_times.line_of_offset(seen.x) - line,
                oriented.detector.sample(focal_px.y) - sample,
            ]
        };
        let ground_m = ground(pose.position_m, pose.mars_to_camera.transpose() * look);
        let [lines, samples] = seen(&ground_m);
        worst_px = worst_px.max(lines.hypot(samples));
        // Where the kernels have the camera when the line is exposed, whatever is made of lines in between.
        let (position_m, to_mars) =
            kernel_camera(&session, &image, image.times.line_times.et(line));
        let [lines, samples] = seen(&ground(position_m, to_mars * look));
        worst_of_kernels_px = worst_of_kernels_px.max(lines.hypot(samples));
        let row = expected.len();
        if row < site.footprints.len() {
            let place = Spherical::from_xyz_m(&ground_m);
            replace(&mut site.footprints.longitude_rad, row, place.longitude_rad);
            replace(&mut site.footprints.latitude_rad, row, place.latitude.0);
            replace(&mut site.footprints.radius_crossover_m, row, place.radius_m);
            expected.push((line, sample));
        }
    }
    println!("closes within {worst_px:e} px, {worst_of_kernels_px:e} px from the kernels");
    assert!(worst_px < 1e-6, "{worst_px} px");
    // Between 31 samples of a motion without jitter; ET is rounded to 7.5e-9 s, 1e-5 lines.
    assert!(worst_of_kernels_px < 0.01, "{worst_of_kernels_px} px");
    let mut profile = site.profiles[0].clone();
    profile.rows = (0_u32..).take(expected.len()).collect();
    let registered = register(
        &image.times,
        &image.orientation,
        &model,
        &site.footprints,
        &[profile],
        &site.config.registration,
        &AtomicBool::new(false),
    )
    .unwrap();
    assert_eq!(registered.points.len(), expected.len());
    for (index, (line, sample)) in expected.iter().enumerate() {
        let lines = registered.points.line.at(index) - line;
        let samples = registered.points.sample.at(index) - sample;
        // Positions from angles are rounded to 1e-9 m of lines of metres.
        assert!(
            lines.hypot(samples) < 1e-6,
            "{line}: {lines} lines, {samples} samples"
        );
    }
}

#[test]
fn camera_models_see_every_line_when_it_is_exposed() {
    let image = changed();
    let sampling = areograph::config::OrientationConfig::default();
    let mut site = fixture::Site::small();
    site.model = fit_sensor_model(&image.orientation, &sampling, None).unwrap();
    site.orientation = image.orientation.clone();
    site.times = image.times.clone();
    let folder = tempfile::tempdir().unwrap();
    site.with(true, |site| write_products(folder.path(), site, ""))
        .unwrap();
    let read = |name: &str| -> Value {
        let path = folder
            .path()
            .join(format!("images/{}/{name}", image.times.id));
        serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
    };
    let isd = read("isd.json");
    common::assert_keeps_schema(&isd, "isd");
    let line_times = &image.times.line_times;
    assert_eq!(
        rows(&isd["line_scan_rate"]).len(),
        line_times.pieces().len()
    );
    let camera = Pushbroom::new(isd);
    let session = Session::open(&image.set).unwrap();
    let (mut worst_s, mut worst_px) = (0.0_f64, 0.0_f64);
    for (line, sample) in places(&image.times) {
        let et = line_times.et(line);
        worst_s = worst_s.max((camera.time(line) - et.seconds()).abs());
        let (position_m, camera_to_mars) = kernel_camera(&session, &image, et);
        let look = camera_to_mars * image.times.detector().look(sample);
        let position = Position::<BodyFixed>::new(position_m);
        let ground_m = ray_meets_ellipsoid(Body::Mars.model(), &position, &look)
            .unwrap()
            .xyz_m;
        let (found_line, found_sample) = camera.image(&(ground_m / METRES_PER_KM));
        worst_px = worst_px.max((found_line - line).hypot(found_sample - sample));
    }
    println!("times within {worst_s:e} s, places within {worst_px:e} px");
    assert!(worst_s < 3e-8, "{worst_s} s"); // four roundings of ET
    assert!(worst_px < 0.01, "{worst_px} px");
    let orientation = read("orientation.json");
    common::assert_keeps_schema(&orientation, "orientation");
    let pieces = orientation["times"]["line_pieces"].as_array().unwrap();
    for (written, piece) in pieces.iter().zip(line_times.pieces()) {
        assert_eq!(written["first_line"], piece.first_line);
        assert_eq!(written["start_et_s"], piece.start.seconds());
        assert_eq!(written["line_period_s"], piece.period_s);
    }
}
