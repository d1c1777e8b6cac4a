//! The search of PEDR files against brute force over every shot.

#![allow(clippy::expect_used, reason = "helpers of tests fail as tests do")]

use crate::common::search;
use areograph_testing::brute_force;
use areograph_testing::track;

use std::{
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
};

use areograph::{
    altimetry::{DatumChoice, GroundRadius, ShotFilter},
    body::Datum,
    config::{PedrConfig, WindowConfig},
    files::HashedFile,
    footprints::Footprint,
    geom::window::{Region, WindowShape},
    pds::{archive::Indexes, pedr::Reason},
    stages::search_footprints::{self, SearchResult, ShotRejection},
};
use brute_force::every_shot;
use proptest::prelude::*;
use search::search_footprints;
use track::{DEGREE, FRAMES, write};

/// Nobody stops these searches.
static RUN_ON: AtomicBool = AtomicBool::new(false);

/// Two files, the first in IAU 1991, the second in IAU 2000.
fn archive(folder: &Path) -> PedrConfig {
    let files = [folder.join("ap19019k.b"), folder.join("AP19020L.B")];
    write(&files[0], Datum::Iau1991, 0, |_, _| ());
    write(&files[1], Datum::Iau2000, FRAMES / 2, |_, _| ());
    config(files.to_vec())
}

fn overwrite(path: &Path, bytes: &[u8]) {
    let mut file = std::fs::File::create(path).expect("a writable folder");
    std::io::Write::write_all(&mut file, bytes).expect("room on the disk");
}

fn config(files: Vec<PathBuf>) -> PedrConfig {
    PedrConfig {
        files,
        datum: DatumChoice::Auto,
        crossover: GroundRadius::Corrected,
        filter: ShotFilter {
            classes: vec![1],
            channels: vec![1, 2, 3],
            attitude_flags: vec![0],
            off_nadir_max_rad: 0.02,
            solar_longitude_rad: ShotFilter::ALL_SEASONS,
        },
    }
}

fn windows(shapes: Vec<WindowShape>) -> Vec<WindowConfig> {
    shapes
        .into_iter()
        .enumerate()
        .map(|(index, shape)| WindowConfig {
            id: format!("w{index}"),
            shape,
        })
        .collect()
}

fn box_deg(west: f64, width: f64, south: f64, north: f64) -> WindowShape {
    WindowShape::Box {
        west_rad: west * DEGREE,
        east_rad: (west + width).rem_euclid(360.0) * DEGREE,
        south_rad: south * DEGREE,
        north_rad: north * DEGREE,
    }
}

/// Every shot of every file that the filter keeps, judged by its own position in IAU 2000.
fn brute_force(pedr: &PedrConfig, windows: &[WindowConfig]) -> Vec<(u16, u32, u8, u64)> {
    let regions: Vec<Region> = windows.iter().map(|w| Region::new(&w.shape)).collect();
    let kept = every_shot(&pedr.files).into_iter();
    let kept = kept.filter(|of| keeps(&pedr.filter, &of.shot));
    let rows = kept.map(|of| {
        let [longitude_rad, latitude_rad] = of.place_rad;
        let holds = |region: &Region| region.contains(longitude_rad, latitude_rad);
        let held = regions.iter().enumerate().filter(|(_, of)| holds(of));
        let bits = held.fold(0, |bits, (bit, _)| bits | 1 << bit);
        (of.shot.file, of.shot.record, of.shot.shot, bits)
    });
    rows.filter(|(.., bits)| *bits != 0).collect()
}

fn keeps(filter: &ShotFilter, shot: &Footprint) -> bool {
    filter.classes.contains(&shot.class)
        && filter.channels.contains(&shot.channel)
        && filter.attitude_flags.contains(&shot.attitude_flag)
        && shot.off_nadir_rad <= filter.off_nadir_max_rad
}

fn found(result: &SearchResult) -> Vec<(u16, u32, u8, u64)> {
    (0..result.footprints.len())
        .map(|row| result.footprints.row(row))
        .map(|shot| (shot.file, shot.record, shot.shot, shot.windows))
        .collect()
}

#[test]
fn random_windows_hold_the_shots_that_brute_force_finds() {
    let folder = tempfile::tempdir().unwrap();
    let pedr = archive(folder.path());
    let shape = (
        0.0..360.0_f64,
        1.0..120.0_f64,
        -90.0..88.0_f64,
        0.01..1.0_f64,
        any::<bool>(),
    );
    let shape = shape.prop_map(|(west, width, south, share, as_polygon)| {
        let north = south + share * (90.0 - south);
        if as_polygon {
            let corners = [
                [west, south],
                [west + width, south],
                [west + 0.3 * width, north],
            ];
            let ring = corners
                .map(|corner| corner.map(|angle| angle * DEGREE))
                .to_vec();
            WindowShape::Polygons {
                polygons: vec![vec![ring]],
            }
        } else {
            box_deg(west, width, south, north)
        }
    });
    let mut runner = proptest::test_runner::TestRunner::new(ProptestConfig::with_cases(12));
    let mut shots = 0;
    let shots_found = std::cell::RefCell::new(&mut shots);
    runner
        .run(&proptest::collection::vec(shape, 1..6), |shapes| {
            let windows = windows(shapes);
            let result = search_footprints(&pedr, &windows, 0.0, &RUN_ON).unwrap();
            let expected = brute_force(&pedr, &windows);
            **shots_found.borrow_mut() += expected.len();
            prop_assert_eq!(found(&result), expected);
            prop_assert_eq!(result.frames_read, u64::from(FRAMES));
            Ok(())
        })
        .unwrap();
    assert!(
        shots > 1_000,
        "only {shots} shots in all windows: the test says little"
    );
}

#[test]
fn a_window_across_zero_and_one_over_the_pole_in_one_pass() {
    let folder = tempfile::tempdir().unwrap();
    let pedr = archive(folder.path());
    let all_round = WindowShape::Box {
        west_rad: 0.0,
        east_rad: 2.0 * std::f64::consts::PI,
        south_rad: -90.0 * DEGREE,
        north_rad: -86.5 * DEGREE,
    };
    let windows = windows(vec![box_deg(200.0, 320.0, -10.0, 10.0), all_round]);
    let result = search_footprints(&pedr, &windows, -0.117, &RUN_ON).unwrap();
    assert_eq!(found(&result), brute_force(&pedr, &windows));
    let footprints = &result.footprints;
    for bit in [1, 2] {
        assert!(footprints.windows.iter().any(|windows| windows & bit != 0));
    }
    for (tag_s, et_s) in footprints.et_tag_s.iter().zip(&footprints.et_s) {
        assert!((et_s - tag_s + 0.117).abs() < 1e-8); // rounding of times of 2e7 s
    }
    let datums: Vec<_> = footprints
        .files
        .iter()
        .map(|file| (file.version, file.datum))
        .collect();
    assert_eq!(
        datums,
        [(Some('K'), Datum::Iau1991), (Some('L'), Datum::Iau2000)]
    );
    let rejects: Vec<_> = result.rejected.keys().copied().collect();
    let expected = [
        ShotRejection::NoReturn,
        ShotRejection::Class,
        ShotRejection::Channel,
        ShotRejection::Attitude,
        ShotRejection::OffNadir,
    ];
    assert_eq!(rejects, expected);
    assert_eq!(
        result.notes,
        [
            "1 PEDR file: version letter K, datum iau1991, software version 7.25",
            "1 PEDR file: version letter L, datum iau2000, software version 7.25"
        ]
    );
}

#[test]
fn the_result_is_the_same_on_one_and_four_threads_and_survives_the_cache() {
    let folder = tempfile::tempdir().unwrap();
    let pedr = archive(folder.path());
    let windows = windows(vec![
        box_deg(0.0, 170.0, -60.0, 60.0),
        box_deg(100.0, 100.0, 0.0, 90.0),
    ]);
    let bytes = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let result = pool
            .install(|| search_footprints(&pedr, &windows, 0.0, &RUN_ON))
            .unwrap();
        assert!(!result.footprints.is_empty());
        let bytes = postcard::to_extend(&result, Vec::new()).unwrap();
        assert_eq!(
            postcard::from_bytes::<SearchResult>(&bytes).unwrap(),
            result
        );
        bytes
    };
    assert!(bytes(1) == bytes(4));
}

#[test]
fn damaged_records_are_complained_of_and_the_others_kept() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("AP19019L.B");
    write(&path, Datum::Iau2000, 0, |number, record| match number {
        3 => record.clock_frequency_hz.set(7),
        5 => record.time_s.set(f64::INFINITY),
        8 => {
            record.time_s.set(1e7);
            record.time_whole_s.set(10_000_000);
            record.time_fraction_us.set(0);
        }
        9 => record.shot_radius_cm[4].set(i32::MAX),
        12 => record.channel = [200; 20],
        number if (100..150).contains(&number) && number.is_multiple_of(2) => {
            record.spacecraft_radius_cm.set(1);
        }
        _ => (),
    });
    let mut pedr = config(vec![path.clone()]);
    pedr.filter.channels = vec![1, 2, 3, 4];
    pedr.filter.off_nadir_max_rad = 0.2;
    let globe = windows(vec![WindowShape::Box {
        west_rad: 0.0,
        east_rad: 2.0 * std::f64::consts::PI,
        south_rad: -std::f64::consts::FRAC_PI_2,
        north_rad: std::f64::consts::FRAC_PI_2,
    }]);
    let result = search_footprints(&pedr, &globe, 0.0, &RUN_ON).unwrap();
    let said: Vec<String> = result.complaints[..4]
        .iter()
        .map(|c| c.text.clone())
        .collect();
    assert_eq!(
        said,
        [
            "clock frequency is 7 Hz; expected 1e8 Hz within 1 %",
            "time is inf; expected seconds past J2000",
            "time is 10000000 s, out of order with the neighbouring records",
            "radius of shot 5 is 2147483647 cm; expected 330000000 to 345000000 cm for a return",
        ]
    );
    let records: Vec<_> = result.complaints[..4]
        .iter()
        .filter_map(|c| c.record)
        .collect();
    assert_eq!(records, [14, 16, 19, 20]);
    assert_eq!(result.complaint_counts[&Reason::SpacecraftRadius], 25);
    assert_eq!(result.complaint_counts[&Reason::TimeOrder], 1);
    assert_eq!(
        (
            result.rejected[&ShotRejection::Spoiled],
            result.rejected[&ShotRejection::Channel]
        ),
        (1, 18)
    );
    let has = |number: u32| {
        result
            .footprints
            .record
            .iter()
            .any(|record| record == number)
    };
    assert!(has(20) && !has(14));
}

/// What such a file has left is not what the archive has.
#[test]
fn a_file_that_lost_more_than_some_records_stops_the_search() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("AP19019L.B");
    write(&path, Datum::Iau2000, 0, |number, record| {
        if number.is_multiple_of(50) {
            record.spacecraft_radius_cm.set(1);
        }
    });
    let everywhere = windows(vec![box_deg(0.0, 359.0, -89.0, 89.0)]);
    let error = search_footprints(&config(vec![path]), &everywhere, 0.0, &RUN_ON).unwrap_err();
    let told = error.to_string();
    assert!(
        told.contains("AP19019L.B: 50 of 2500 records are unusable; expected at most 10 plus 1 % of the records"),
        "{told}"
    );
    assert!(error.cause.advice().contains("fetch it again"));
}

#[test]
fn a_file_without_a_datum_stops_the_search() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("renamed.dat");
    write(&path, Datum::Iau2000, 0, |_, _| ());
    let mut bytes = std::fs::read(&path).unwrap();
    let label = String::from_utf8_lossy(&bytes[..7_760]).replace("2000", "XXXX");
    bytes[..7_760].copy_from_slice(label.as_bytes());
    overwrite(&path, &bytes);
    let failure = search_footprints(&config(vec![path]), &[], 0.0, &RUN_ON)
        .unwrap_err()
        .to_string();
    assert!(
        failure.starts_with("search_footprints: ")
            && failure.contains("renamed.dat: the datum is unknown"),
        "{failure}"
    );
}

#[test]
fn a_file_without_a_good_record_stops_the_search_before_its_datum_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("renamed.dat");
    let random: Vec<u8> = (0..50_000_u32)
        .flat_map(|n| n.wrapping_mul(2_654_435_761).to_le_bytes())
        .collect();
    let good = {
        write(&path, Datum::Iau2000, 0, |_, _| ());
        std::fs::read(&path).unwrap()
    };
    for (bytes, why) in [
        (&[][..], "the file has 0 bytes; expected at least the 7760"),
        (&random, "no valid record: "),
        (
            &good[..7_760 + 700],
            "no record of 776 bytes follows the label",
        ),
    ] {
        overwrite(&path, bytes);
        let failure = search_footprints(&config(vec![path.clone()]), &[], 0.0, &RUN_ON);
        let failure = failure.unwrap_err();
        assert_eq!(failure.kind().exit_code(), 3);
        let message = failure.to_string();
        assert!(
            message.contains("renamed.dat: no valid record") && message.contains(why),
            "{message}"
        );
    }
}

#[test]
fn a_copy_is_read_once_and_a_note_names_both_files() {
    let folder = tempfile::tempdir().unwrap();
    let single = archive(folder.path());
    let windows = windows(vec![box_deg(0.0, 170.0, -60.0, 60.0)]);
    let expected = search_footprints(&single, &windows, 0.0, &RUN_ON).unwrap();
    let copy = folder.path().join("copy.b");
    std::fs::copy(&single.files[0], &copy).unwrap();
    let mut files = single.files.clone();
    files.push(copy);
    let result = search_footprints(&config(files), &windows, 0.0, &RUN_ON).unwrap();
    assert!(!result.footprints.is_empty());
    assert_eq!(found(&result), found(&expected));
    assert_eq!(result.frames_read, expected.frames_read);
    assert_eq!(
        result.notes.last().map(String::as_str),
        Some("PEDR file 3 (copy.b) is identical to file 1 (ap19019k.b) and is read once")
    );
}

#[test]
fn two_versions_of_one_orbit_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let files = [
        folder.path().join("ap19019k.b"),
        folder.path().join("ap19019l.b"),
    ];
    write(&files[0], Datum::Iau1991, 0, |_, _| ());
    // The later version moves its time tags by 20 ms.
    write(&files[1], Datum::Iau2000, 0, |_, record| {
        record.time_s.set(record.time_s.get() + 0.02);
        record.time_fraction_us.set(20_000);
    });
    let windows = windows(vec![box_deg(0.0, 170.0, -60.0, 60.0)]);
    for order in [[0, 1], [1, 0]] {
        let pedr = config(order.map(|index: usize| files[index].clone()).to_vec());
        let failure = search_footprints(&pedr, &windows, 0.0, &RUN_ON).unwrap_err();
        assert_eq!(failure.kind().exit_code(), 3);
        let message = failure.to_string();
        for part in [
            "ap19019k.b",
            "ap19019l.b",
            "orbit 9019",
            "only one of the two",
        ] {
            assert!(message.contains(part), "{part}: {message}");
        }
    }
}

#[test]
fn a_search_that_is_stopped_ends_as_interrupted() {
    let folder = tempfile::tempdir().unwrap();
    let pedr = archive(folder.path());
    let windows = windows(vec![box_deg(0.0, 170.0, -60.0, 60.0)]);
    let failure = search_footprints(&pedr, &windows, 0.0, &AtomicBool::new(true)).unwrap_err();
    assert_eq!(failure.kind().exit_code(), 130);
    assert!(
        failure.to_string().starts_with("search_footprints: "),
        "{failure}"
    );
}

#[test]
fn more_files_than_can_be_counted_are_refused() {
    let file = HashedFile {
        path: PathBuf::from("AP19019L.B"),
        bytes: 0,
        blake3: String::new(),
    };
    let (pedr, files) = (config(Vec::new()), vec![file; 65_536]);
    let failure =
        search_footprints::search_footprints(&pedr, &files, &Indexes::default(), &[], 0.0, &RUN_ON);
    let message = failure.unwrap_err().to_string();
    assert!(
        message.contains("65536 PEDR files; expected at most 65535"),
        "{message}"
    );
}
