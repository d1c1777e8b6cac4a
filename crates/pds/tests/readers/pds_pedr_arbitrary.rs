//! Any bytes are read as a PEDR file: no panic, no shot beyond the globe.

#![allow(clippy::expect_used, reason = "helpers of tests fail as tests do")]

use std::path::Path;

use areograph_base::body::Datum;
use areograph_pds::pedr::{
    FieldGuard, File, FrameValues, LABEL_BYTES, LabelInfo, PedrWriter, RECORD_BYTES, Record,
};
use proptest::prelude::*;

const RECORDS: usize = 5;

/// A complete file: a label and five records with relief, parallax and crossover residuals.
fn file_bytes() -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a folder for the file");
    let path = folder.path().join("AP19019L.B");
    let label = LabelInfo {
        product_id: "AP19019L.B".to_owned(),
        software_version: 7.25,
        datum: Datum::Iau2000,
        note: "synthetic".to_owned(),
    };
    let mut writer = PedrWriter::create(&path, &label).expect("a writable folder");
    for time_s in [0.0, 2.0, 4.0, 6.0, 8.0] {
        let values = FrameValues {
            time_s,
            orbit: 9_019,
            clock_frequency_hz: 1e8,
            spacecraft_radius_m: 3_780_000.0,
            ground_longitude_rad: 6.25,
            ground_longitude_change_rad: 7e-4,
            ground_latitude_rad: 0.17,
            ground_latitude_change_rad: 2e-3,
            parallax_longitude_rad_per_m: -3e-11,
            parallax_latitude_rad_per_m: 9e-11,
            areoid_radius_m: 3_392_000.0,
            crossover_residual_m: 3.0,
            mid_radius_m: 3_390_000.0,
            shot_radius_m: [3_391_000.0; 20],
            range_m: [388_000.25; 20],
            class: [1; 20],
            channel: [2; 20],
            frame_index: 3,
            orbit_quality: 3,
            ..FrameValues::default()
        };
        let record = Record::from_frame(&values).expect("values within their fields");
        writer.write_record(&record).expect("room on the disk");
    }
    writer.finish().expect("room on the disk");
    std::fs::read(&path).expect("the file just written")
}

/// Reads all of a file; returns the number of its records.
fn read_all(bytes: Vec<u8>) -> usize {
    let file = File::from_bytes(bytes, Path::new("AP19019L.B"));
    let records = file.records().len();
    let mut read = 0;
    for (_, frame) in file.frames(0..records, FieldGuard::new(file.label().software_version)) {
        if let Ok(frame) = frame {
            let _ = frame.spoiled_shots();
            assert!(frame.reach_rad() >= 0.0);
            for shot in (1..=20).filter_map(|shot| frame.shot(shot)) {
                assert!((0.0..std::f64::consts::TAU).contains(&shot.longitude_rad));
                assert!(shot.latitude_rad.abs() <= std::f64::consts::FRAC_PI_2);
            }
        }
        read += 1;
    }
    assert_eq!(read, records);
    let _ = file.trailing_complaint();
    read
}

proptest! {
    #![proptest_config(areograph_testing::seeds_kept("pds_pedr"))]

    #[test]
    fn any_bytes_are_read(bytes in proptest::collection::vec(any::<u8>(), 0..12_000)) {
        read_all(bytes);
    }

    #[test]
    fn any_truncation_and_mutation_is_read(
        length in 0..LABEL_BYTES + (RECORDS + 1) * RECORD_BYTES,
        changes in proptest::collection::vec((0..LABEL_BYTES + RECORDS * RECORD_BYTES, any::<u8>()), 0..40),
    ) {
        let mut bytes = file_bytes();
        for (at, byte) in changes {
            bytes[at] = byte;
        }
        bytes.truncate(length);
        let expected = bytes.len().saturating_sub(LABEL_BYTES) / RECORD_BYTES;
        prop_assert_eq!(read_all(bytes), expected);
    }
}
