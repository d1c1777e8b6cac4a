//! PEDR files written and read back: shot rules computed by hand, damaged files.

#![allow(clippy::expect_used, reason = "helpers of tests fail as tests do")]

use std::path::Path;

use areograph_base::{body::Datum, footprints::Footprint};
use areograph_pds::pedr::{
    FieldGuard, File, Frame, FrameValues, LABEL_BYTES, LabelInfo, PedrWriter, Reason, Record,
};

const DEGREE: f64 = std::f64::consts::PI / 180.0;
const METRE_OF_ANGLE: f64 = 1.0 / 3.39e6;

/// A frame with round numbers, for mental arithmetic.
fn values() -> FrameValues {
    FrameValues {
        time_s: -20_000_000.5,
        orbit: 9_019,
        clock_frequency_hz: 1e8,
        spacecraft_longitude_rad: 0.05 * DEGREE,
        spacecraft_longitude_change_rad: -0.2 * DEGREE,
        spacecraft_latitude_rad: 10.0 * DEGREE,
        spacecraft_latitude_change_rad: 0.1 * DEGREE,
        spacecraft_radius_m: 3_780_000.0,
        spacecraft_radius_change_m: 20.0,
        ground_longitude_rad: 359.99 * DEGREE,
        ground_longitude_change_rad: 0.04 * DEGREE,
        ground_latitude_rad: 10.0 * DEGREE,
        ground_latitude_change_rad: 0.1 * DEGREE,
        parallax_longitude_rad_per_m: -2e-9 * DEGREE,
        parallax_latitude_rad_per_m: 5e-9 * DEGREE,
        areoid_radius_m: 3_392_000.0,
        areoid_radius_change_m: -4.0,
        crossover_residual_m: 3.0,
        mid_radius_m: 3_390_000.0,
        shot_radius_m: [3_391_000.0; 20],
        range_m: [388_000.25; 20],
        class: [1; 20],
        channel: [2; 20],
        frame_index: 3,
        orbit_quality: 3,
        off_nadir_rad: 0.25 * DEGREE,
        ..FrameValues::default()
    }
}

fn record(change: impl Fn(&mut FrameValues)) -> Record {
    let mut values = values();
    change(&mut values);
    Record::from_frame(&values).expect("values within their fields")
}

fn new_software() -> FieldGuard {
    FieldGuard::new(Some(7.25))
}

fn label() -> LabelInfo {
    LabelInfo {
        product_id: "AP19019L.B".to_owned(),
        software_version: 7.25,
        datum: Datum::Iau2000,
        note: "synthetic".to_owned(),
    }
}

/// Bytes of a file with these records.
fn file_bytes(records: &[Record]) -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a folder for the file");
    let path = folder.path().join("AP19019L.B");
    let mut writer = PedrWriter::create(&path, &label()).expect("a writable folder");
    for record in records {
        writer.write_record(record).expect("room on the disk");
    }
    assert_eq!(
        writer.finish().expect("room on the disk") as usize,
        records.len()
    );
    std::fs::read(&path).expect("the file just written")
}

fn file(bytes: Vec<u8>) -> File {
    File::from_bytes(bytes, Path::new("AP19019L.B"))
}

fn shots(frame: &Frame<'_>) -> Vec<Footprint> {
    (1..=20).filter_map(|shot| frame.shot(shot)).collect()
}

/// Tolerance of half a microdegree, the resolution of the encoding, and rounding.
fn assert_angle(found_rad: f64, expected_deg: f64) {
    let difference_deg = found_rad / DEGREE - expected_deg;
    assert!(
        difference_deg.abs() < 0.51e-6,
        "{} instead of {expected_deg}",
        found_rad / DEGREE
    );
}

/// Tolerance of a micrometre: these lengths are whole centimetres, with rounding differences only.
fn assert_metres(found_m: f64, expected_m: f64) {
    assert!(
        (found_m - expected_m).abs() < 1e-6,
        "{found_m} instead of {expected_m}"
    );
}

#[test]
fn shots_follow_the_rules_of_the_format() {
    let record = record(|_| ());
    let frame = Frame::new(&record, new_software(), Some(1.0));
    let shots = shots(&frame);
    assert_eq!(
        (shots.len(), frame.shot(0), frame.shot(21)),
        (20, None, None)
    );
    let (first, last) = (&shots[0], &shots[19]);
    // 9.5 shots of 0.1 s from the middle; 30 ns is the rounding of a time of 2e7 s.
    assert!((first.et_tag_s - -20_000_001.45).abs() < 3e-8);
    assert!((last.et_tag_s - -19_999_999.55).abs() < 3e-8);
    // x = ∓0.475; parallax for 1000 m of relief: −2e-6° and +5e-6°; the longitude passes 360°.
    assert_angle(first.longitude_rad, 359.99 - 0.019 - 2e-6);
    assert_angle(last.longitude_rad, 0.009 - 2e-6);
    assert_angle(first.latitude_rad, 10.0 - 0.0475 + 5e-6);
    assert_angle(last.latitude_rad, 10.0 + 0.0475 + 5e-6);
    assert_angle(first.spacecraft_longitude_rad, 0.05 + 0.095);
    assert_angle(last.spacecraft_longitude_rad, 359.955);
    assert_angle(last.spacecraft_latitude_rad, 10.0475);
    assert_metres(last.spacecraft_radius_m, 3_780_009.5);
    assert_metres(last.areoid_radius_m, 3_391_998.1);
    assert_metres(last.range_m, 388_000.25);
    assert_metres(last.radius_m, 3_391_000.0);
    // Residual 3 m, 2 m more than in the preceding frame.
    assert_metres(first.radius_crossover_m, 3_391_000.0 - (3.0 - 0.475 * 2.0));
    assert_metres(last.radius_crossover_m, 3_391_000.0 - (3.0 + 0.475 * 2.0));
    assert_angle(last.off_nadir_rad, 0.25);
    assert_eq!(
        (last.orbit, last.channel, last.class, last.shot),
        (9_019, 2, 1, 20)
    );
}

#[test]
fn the_clock_frequency_sets_the_spacing() {
    let record = record(|values| values.clock_frequency_hz = 99_950_000.0);
    let shots = shots(&Frame::new(&record, new_software(), None));
    let expected_s = -20_000_000.5 + 9.5 * 1e7 / 99_950_000.0;
    assert!((shots[19].et_tag_s - expected_s).abs() < 3e-8); // rounding of the time
}

#[test]
fn older_software_and_orbits_have_no_parallax_or_crossover() {
    // version, orbit quality, parallax used, crossover used; the table is pedr2tab's guard
    let cases = [
        (Some(6.5), 2, false, false),
        (Some(7.0), 2, false, false),
        (Some(7.0), 3, true, false),
        (Some(7.1), 2, true, false),
        (Some(7.125), 2, true, true),
        (Some(7.25), 1, false, false),
        (Some(7.25), 0, false, false),
        (None, 2, true, true),
    ];
    for (version, orbit_quality, parallax, crossover) in cases {
        let record = record(|values| values.orbit_quality = orbit_quality);
        let frame = Frame::new(&record, FieldGuard::new(version), None);
        let shot = frame.shot(1).expect("shot 1");
        let moved = if parallax { 5e-6 } else { 0.0 };
        assert_angle(shot.latitude_rad, 10.0 - 0.0475 + moved);
        let lowered_m = if crossover { 3.0 } else { 0.0 };
        assert_metres(shot.radius_m - shot.radius_crossover_m, lowered_m);
    }
}

#[test]
fn without_a_return_there_is_no_parallax() {
    let mut record = record(|values| values.parallax_latitude_rad_per_m = 5e-8 * DEGREE);
    record.range_cm[0].set(0);
    record.shot_radius_cm[0].set(0);
    let shot = Frame::new(&record, new_software(), None)
        .shot(1)
        .expect("shot 1");
    assert_angle(shot.latitude_rad, 10.0 - 0.0475);
}

#[test]
fn a_track_over_the_pole_comes_down_the_other_side() {
    let record = record(|values| {
        values.ground_latitude_rad = 89.99 * DEGREE;
        values.ground_longitude_change_rad = 0.0;
        values.parallax_latitude_rad_per_m = 0.0;
        values.parallax_longitude_rad_per_m = 0.0;
    });
    let shot = Frame::new(&record, new_software(), None)
        .shot(20)
        .expect("shot 20");
    assert_angle(shot.latitude_rad, 180.0 - (89.99 + 0.0475));
    assert_angle(shot.longitude_rad, 179.99);
}

/// Slope of the crossover residual over each frame, metres, from the shots.
fn slopes_m(file: &File) -> Vec<f64> {
    let slope_m = |frame: &Frame<'_>| {
        let shots = shots(frame);
        (shots[0].radius_crossover_m - shots[19].radius_crossover_m) / 0.95
    };
    file.frames(0..file.records().len(), new_software())
        .filter_map(|(_, frame)| frame.ok().map(|frame| slope_m(&frame)))
        .collect()
}

#[test]
fn the_crossover_slope_differs_from_pedr2tab_only_where_a_track_enters_the_window_again() {
    let residuals_m = [1.0, 1.5, 2.5, 2.0, 0.0, 4.0];
    let records: Vec<Record> = (0..6_u32)
        .zip(residuals_m)
        .map(|(row, residual_m)| {
            record(|values| {
                values.time_s += 2.0 * f64::from(row);
                values.crossover_residual_m = residual_m;
            })
        })
        .collect();
    let ours = slopes_m(&file(file_bytes(&records)));
    // pedr2tab: the previous frame *inside the window*; before the first frame x1 − (x2 − x1).
    let inside = [true, true, false, false, true, true];
    let mut previous_m = residuals_m[0] - (residuals_m[1] - residuals_m[0]);
    for row in (0..6).filter(|row| inside[*row]) {
        let theirs = residuals_m[row] - previous_m;
        previous_m = residuals_m[row];
        let same = (theirs - ours[row]).abs() < 1e-6; // metres; residuals are whole centimetres
        assert_eq!(
            same,
            row != 4,
            "row {row}: pedr2tab {theirs} m, ours {} m",
            ours[row]
        );
    }
    assert_metres(ours[4], -2.0);
}

#[test]
fn a_broken_neighbour_leaves_the_crossover_residual_constant() {
    let mut records: Vec<Record> = (0..3)
        .map(|row| {
            record(|values| {
                values.time_s += 2.0 * f64::from(row);
                values.crossover_residual_m = f64::from(row);
            })
        })
        .collect();
    records[1].clock_frequency_hz.set(0);
    let slopes = slopes_m(&file(file_bytes(&records)));
    assert_eq!(slopes.len(), 2);
    for slope_m in slopes {
        assert_metres(slope_m, 0.0);
    }
}

#[test]
fn no_shot_lies_beyond_the_reach_of_its_frame() {
    let record = record(|values| {
        values.shot_radius_m[7] = 3_420_000.0;
        values.parallax_latitude_rad_per_m = 0.3 * METRE_OF_ANGLE;
    });
    let frame = Frame::new(&record, new_software(), None);
    let (longitude_rad, latitude_rad) = frame.mid_point();
    for shot in shots(&frame) {
        let cosine = latitude_rad.sin() * shot.latitude_rad.sin()
            + latitude_rad.cos()
                * shot.latitude_rad.cos()
                * (shot.longitude_rad - longitude_rad).cos();
        assert!(cosine.clamp(-1.0, 1.0).acos() <= frame.reach_rad());
    }
    // 30 km × 0.3/R of parallax, and half of 0.04° + 0.1°.
    let expected_rad = 30_000.0 * 0.3 * METRE_OF_ANGLE + 0.07 * DEGREE;
    assert!((frame.reach_rad() - expected_rad).abs() < 0.01 * expected_rad); // 2e-9°/m and rounding of fields
}

fn label_reasons(file: &File) -> Vec<Reason> {
    file.label_complaints()
        .iter()
        .map(|complaint| complaint.reason)
        .collect()
}

#[test]
fn a_healthy_file_is_read_without_complaint() {
    let records = [record(|_| ()), record(|values| values.time_s += 2.0)];
    let file = file(file_bytes(&records));
    assert_eq!(file.records(), records);
    assert_eq!(
        (label_reasons(&file), file.trailing_complaint()),
        (vec![], None)
    );
    assert_eq!(file.label().product_id.as_deref(), Some("AP19019L.B"));
    assert_eq!(file.label().datum, Some(Datum::Iau2000));
    assert_eq!(
        file.label().data_set_id.as_deref(),
        Some("MGS-M-MOLA-3-PEDR-L1A-V1.0")
    );
    assert!(
        file.frames(0..10, new_software())
            .all(|(_, frame)| frame.is_ok())
    );
    assert_eq!(file.frames(0..10, new_software()).count(), 2);
    assert_eq!(file.frames(5..10, new_software()).count(), 0);
}

#[test]
fn damaged_files_are_complained_of_and_read_as_far_as_they_go() {
    let bytes = file_bytes(&[record(|_| ()), record(|values| values.time_s += 2.0)]);

    let truncated = file(bytes[..bytes.len() - 76].to_vec());
    assert_eq!(truncated.records().len(), 1);
    let complaint = truncated.trailing_complaint().expect("a complaint");
    assert_eq!(
        complaint.to_string(),
        "AP19019L.B record 12: 700 bytes after the last whole record of 776 bytes are ignored"
    );

    let stub = file(bytes[..1000].to_vec());
    assert_eq!(
        (stub.records().len(), label_reasons(&stub)),
        (0, vec![Reason::TruncatedLabel])
    );
    let empty = file(Vec::new());
    assert_eq!(
        label_reasons(&empty),
        [Reason::TruncatedLabel, Reason::UnreadableLabel]
    );

    let mut no_label = bytes.clone();
    no_label[..LABEL_BYTES].fill(0xFF);
    let no_label = file(no_label);
    assert_eq!(
        (no_label.records().len(), label_reasons(&no_label)),
        (2, vec![Reason::UnreadableLabel])
    );

    let text = String::from_utf8(bytes[..LABEL_BYTES].to_vec()).expect("ASCII");
    let mut miscounted = text.replace("RECORDS = UNK", "RECORDS = 99 ").into_bytes();
    miscounted.extend(&bytes[LABEL_BYTES..]);
    let miscounted = file(miscounted);
    assert_eq!(
        miscounted.label_complaints()[0].to_string(),
        "AP19019L.B: the label states 99 records; the file contains 12"
    );
}

#[test]
fn files_that_cannot_be_opened_say_why() {
    let folder = tempfile::tempdir().expect("a folder");
    let message = File::open(folder.path())
        .expect_err("a folder is no file")
        .to_string();
    assert!(message.contains("not a regular file"), "{message}");
    let missing = folder.path().join("AP19019L.B");
    let message = File::open(&missing).expect_err("no such file").to_string();
    assert!(message.contains("AP19019L.B: cannot open"), "{message}");
    // An empty file can be mapped.
    std::fs::File::create(&missing).expect("a writable folder");
    assert_eq!(
        File::open(&missing).expect("an empty file").records().len(),
        0
    );
}
