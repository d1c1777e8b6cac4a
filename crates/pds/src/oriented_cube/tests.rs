//! Cubes made by the tests: which part they show, kinds of tables, and damage.

#![allow(
    clippy::disallowed_methods,
    reason = "tests write into temporary folders"
)]

use super::*;
use areograph_config::built_in_instruments;
use areograph_testing::cube::{CubeTable, cube};
use nalgebra::Vector3;

const LINES: u32 = 1_000;
const PERIOD_S: f64 = 0.9642e-3;
const START_S: f64 = 38_134_456.448_224_77;
const POSITION: [&str; 7] = [
    "J2000X", "J2000Y", "J2000Z", "J2000XV", "J2000YV", "J2000ZV", "ET",
];
const ROTATION: [&str; 8] = [
    "J2000Q0", "J2000Q1", "J2000Q2", "J2000Q3", "AV1", "AV2", "AV3", "ET",
];
const TO_BUS: &str = "  TimeDependentFrames = (-94000, 1)\n";
const TO_MARS: &str = "  TimeDependentFrames = (10014, 1)\n";

/// Groups of the label of an image of 1,000 lines and 1,024 samples.
fn groups(more: &str) -> String {
    format!(
        "  Group = Instrument\n    SpacecraftName = \"MARS GLOBAL SURVEYOR\"\n    InstrumentId = MOC-NA\n    TargetName = Mars\n    \
         StartTime = 2001-03-17T20:53:12.26\n    CrosstrackSumming = 2\n    DowntrackSumming = 2\n    \
         LineExposureDuration = 0.482100 <milliseconds>\n    SpacecraftClockCount = 669329623:36\n    FirstLineSample = 1\n  End_Group\n  \
         Group = Archive\n    ProductId = E02/01461\n  End_Group\n  Group = BandBin\n    FilterName = BROAD_BAND\n  End_Group\n{more}"
    )
}

/// Where the spacecraft is, kilometres: a straight flight.
fn place_km(after_s: f64) -> Vector3<f64> {
    Vector3::new(3_800.0, 3.4 * after_s, -0.1 * after_s)
}

/// The state at an instant after the start, and ET.
fn state(after_s: f64) -> Vec<f64> {
    let [place, flight] = [place_km(after_s), place_km(1.0) - place_km(0.0)];
    place
        .iter()
        .chain(flight.iter())
        .copied()
        .chain([START_S + after_s])
        .collect()
}

/// A frame that turns about z by −1 mrad a second.
fn turned(after_s: f64) -> Vec<f64> {
    let half_rad = 0.5e-3 * after_s;
    vec![
        half_rad.cos(),
        0.0,
        0.0,
        half_rad.sin(),
        0.0,
        0.0,
        -1e-3,
        START_S + after_s,
    ]
}

/// Tables over the time of `[first, end]` lines.
fn tables([first, end]: [f64; 2]) -> Vec<CubeTable> {
    let [from, to] = [first, end].map(|line| line * PERIOD_S);
    let middle = 0.5 * (from + to);
    let states = || [from, middle, to].map(state).to_vec();
    let rotations = || [from - 0.3, to + 0.3].map(turned).to_vec();
    vec![
        CubeTable::new(
            "InstrumentPosition",
            "  CacheType = HermiteSpline\n",
            &POSITION,
            states(),
        ),
        CubeTable::new("InstrumentPointing", TO_BUS, &ROTATION, rotations()),
        CubeTable::new("BodyRotation", TO_MARS, &ROTATION, rotations()),
        CubeTable::new("SunPosition", "", &POSITION, states()),
    ]
}

fn read_bytes(bytes: &[u8]) -> Result<OrientedCube> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("e0201461.cub");
    std::fs::write(&path, bytes).unwrap();
    read_oriented_cube(&path, built_in_instruments())
}

/// Group `AlphaCube` with edges `[first, last]` of lines and of samples, and the size of the cube.
fn alpha([first, last]: [f64; 2], [left, right]: [f64; 2], [lines, samples]: [u32; 2]) -> String {
    format!(
        "  Group = AlphaCube\n    AlphaSamples = 1024\n    AlphaLines = {LINES}\n    AlphaStartingSample = {left}\n    \
         AlphaStartingLine = {first}\n    AlphaEndingSample = {right}\n    AlphaEndingLine = {last}\n    BetaSamples = {samples}\n    \
         BetaLines = {lines}\n  End_Group\n"
    )
}

#[test]
fn a_whole_cube_begins_with_its_tables_in_either_order_of_bytes() {
    for is_msb in [false, true] {
        let bytes = cube(&groups(""), [LINES, 1_024], &tables([0.0, 1_000.0]), is_msb);
        let cube = read_bytes(&bytes).unwrap();
        let times = &cube.support.line_times;
        assert_eq!((times.lines(), cube.support.samples), (LINES, 1_024));
        // Seconds: the rounding of an ET.
        assert!((times.start().seconds() - START_S).abs() < 1e-8);
        assert!((times.mean_period_s() - PERIOD_S).abs() < 1e-12);
        let (position_m, _) = cube.support.tables.position.at(START_S + 0.3);
        // Metres: the rounding of an ET times 3.4 km/s.
        assert!((position_m - place_km(0.3) * 1e3).norm() < 1e-3);
        assert!(cube.part.lines.is_whole() && cube.part.samples.is_whole());
        assert_eq!(cube.notes(), Vec::<String>::new());
    }
}

#[test]
fn a_cropped_and_a_reduced_cube_have_the_times_of_their_own_lines() {
    // Lines 201 to 700 and samples 101 to 612, whether spiceinit ran before the crop or after it.
    let cropped = groups(&alpha([200.5, 700.5], [100.5, 612.5], [500, 512]));
    for lines in [[0.0, 1_000.0], [200.0, 700.0]] {
        let bytes = cube(&cropped, [500, 512], &tables(lines), false);
        let cube = read_bytes(&bytes).unwrap();
        let times = &cube.support.line_times;
        // Seconds: the rounding of an ET.
        assert!((times.start().seconds() - START_S - 200.0 * PERIOD_S).abs() < 1e-8);
        assert!((times.mean_period_s() - PERIOD_S).abs() < 1e-12);
        let support = &cube.support;
        assert_eq!(
            (times.lines(), support.samples, support.first_detector),
            (500, 512, 200)
        );
        assert_eq!(
            cube.notes(),
            [
                "the cube contains a part of the camera image: lines 201 to 700 of 1000; samples 101 to 612 of 1024"
            ]
        );
    }
    let reduced = groups(&alpha([0.5, 1_000.5], [0.5, 1_024.5], [250, 256]));
    let cube = read_bytes(&cube(&reduced, [250, 256], &tables([0.0, 1_000.0]), false)).unwrap();
    let support = &cube.support;
    assert!((support.line_times.mean_period_s() - 4.0 * PERIOD_S).abs() < 1e-12);
    assert!((support.line_times.start().seconds() - START_S).abs() < 1e-8);
    assert_eq!(
        [support.crosstrack_summing, support.downtrack_summing],
        [8, 8]
    );
}

#[test]
fn the_clock_that_isis_converted_gives_the_start_of_padded_tables() {
    let padded = tables([-50.0, 1_050.0]);
    let refused = read_bytes(&cube(&groups(""), [LINES, 1_024], &padded, false)).unwrap_err();
    assert!(
        refused
            .to_string()
            .contains("the first line of the table is unknown"),
        "{refused}"
    );
    let digits: String = START_S
        .to_le_bytes()
        .iter()
        .fold(String::new(), |digits, byte| {
            digits + &format!("{byte:02x}")
        });
    let computed = format!(
        "  Object = NaifKeywords\n    BODY_CODE = 499\n    CLOCK_ET_-94_669329623:36_COMPUTED = {digits}\n  End_Object\n"
    );
    let cube = read_bytes(&cube(&groups(&computed), [LINES, 1_024], &padded, false)).unwrap();
    assert!((cube.support.line_times.start().seconds() - START_S).abs() < 1e-12);
}

#[test]
fn polynomials_give_what_rows_give() {
    let rows = read_bytes(&cube(
        &groups(""),
        [LINES, 1_024],
        &tables([0.0, 1_000.0]),
        false,
    ))
    .unwrap();
    let end_s = START_S + 1_000.0 * PERIOD_S;
    let times = |prefix: &str| {
        format!("  {prefix}TableStartTime = {START_S:.12}\n  {prefix}TableEndTime = {end_s:.12}\n")
    };
    let mut tables = tables([0.0, 1_000.0]);
    // Time in tens of seconds from the start.
    let flight = place_km(10.0) - place_km(0.0);
    tables[0] = CubeTable::new(
        "InstrumentPosition",
        &format!("  CacheType = PolyFunction\n{}", times("Spk")),
        &["J2000SVX", "J2000SVY", "J2000SVZ"],
        vec![
            place_km(0.0).iter().copied().collect(),
            flight.iter().copied().collect(),
            vec![START_S, 10.0, 1.0],
        ],
    );
    // A turn about z is the first angle of the axes 3, 1, 3.
    tables[1] = CubeTable::new(
        "InstrumentPointing",
        &format!("{TO_BUS}{}", times("Ck")),
        &["J2000Ang1", "J2000Ang2", "J2000Ang3"],
        vec![
            vec![0.0; 3],
            vec![-1e-2, 0.0, 0.0],
            vec![START_S, 10.0, 1.0],
        ],
    );
    let polynomials = read_bytes(&cube(&groups(""), [LINES, 1_024], &tables, false)).unwrap();
    for after_s in [0.0, 0.31, 0.9] {
        let at = |cube: &OrientedCube| {
            let tables = &cube.support.tables;
            let (position_m, velocity_m_s) = tables.position.at(START_S + after_s);
            let (turning, rate_rad_s) = tables.pointing.at(START_S + after_s);
            (position_m, velocity_m_s, turning, rate_rad_s)
        };
        let (one, other) = (at(&rows), at(&polynomials));
        // Metres, metres per second, radians, radians per second: the rounding of an ET, and its change over a node.
        assert!((one.0 - other.0).norm() < 1e-3 && (one.1 - other.1).norm() < 1e-3);
        assert!((one.2 - other.2).norm() < 1e-9 && (one.3 - other.3).norm() < 1e-6);
    }
}

/// A change of a table.
type Change = fn(&mut CubeTable);

/// Asserts that these bytes are refused with `expected` and advice.
fn refused(bytes: &[u8], expected: &str) {
    let refused = read_bytes(bytes).unwrap_err();
    assert!(
        refused.to_string().contains(expected),
        "{refused}; expected {expected}"
    );
    assert!(!refused.cause.advice().is_empty());
}

#[test]
fn what_is_no_oriented_cube_is_refused_with_the_reason() {
    refused(b"PDS_VERSION_ID = PDS3\nEND\n", "not an ISIS cube");
    refused(b"\xFF\xD8\xFF", "not an ISIS cube");
    let whole = tables([0.0, 1_000.0]);
    let size = [LINES, 1_024];
    for name in ["InstrumentPointing", "SunPosition"] {
        let others = whole.iter().filter(|table| table.name != name);
        let others: Vec<CubeTable> = others.cloned().collect();
        let expected = format!("the cube has no table {name}");
        refused(&cube(&groups(""), size, &others, false), &expected);
    }
    for (part, expected) in [
        (
            alpha([0.5, 1_000.5], [0.5, 1_024.5], [300, 256]),
            "enlarged and unevenly reduced cubes contain no camera lines",
        ),
        (
            alpha([0.5, 1_200.5], [0.5, 1_024.5], [1_200, 1_024]),
            "expected an edge within the image",
        ),
    ] {
        refused(&cube(&groups(&part), size, &whole, false), expected);
    }
}

#[test]
fn invalid_tables_are_refused_with_the_reason() {
    let changes: [(usize, Change, &str); 6] = [
        (0, |table| table.rows[1][6] = 0.0, "ET is ["),
        (
            1,
            |table| table.rows[0][0] = 0.7,
            "expected unit quaternions; the quaternion of record 0 has length 0.70",
        ),
        (
            1,
            |table| table.rows[1][3] = f64::NAN,
            "finite numbers; the invalid number is in record 1",
        ),
        (
            1,
            |table| "  TimeDependentFrames = (-94000, 2)\n".clone_into(&mut table.keywords),
            "TimeDependentFrames is [-94000, 2]; expected a list of frames that ends with 1, J2000",
        ),
        (
            0,
            |table| table.rows.iter_mut().for_each(|row| row[0] = 1.0),
            "expected positions at least 3376.2 km from the centre of the target",
        ),
        (
            2,
            |table| table.rows[1][7] -= 0.9,
            "table BodyRotation of the cube has epochs from",
        ),
    ];
    for (at, change, expected) in changes {
        let mut tables = tables([0.0, 1_000.0]);
        change(&mut tables[at]);
        refused(&cube(&groups(""), [LINES, 1_024], &tables, false), expected);
    }
}

#[test]
fn damage_is_refused_or_changes_nothing_silently_to_no_number() {
    let bytes = cube(&groups(""), [LINES, 64], &tables([0.0, 1_000.0]), false);
    let label_end = bytes.iter().position(|byte| *byte == 0).unwrap();
    let content = bytes.len() - 4 * 200;
    for at in (0..label_end)
        .step_by(7)
        .chain((content..bytes.len()).step_by(11))
    {
        for flip in [0x01, 0x20, 0x80] {
            let mut damaged = bytes.clone();
            damaged[at] ^= flip;
            if let Ok(cube) = read_bytes(&damaged) {
                assert!(cube.support.line_times.start().seconds().is_finite());
                assert!(cube.support.line_times.mean_period_s() > 0.0);
            }
        }
    }
    for length in (0..bytes.len()).step_by(bytes.len() / 50) {
        assert!(read_bytes(&bytes[..length]).is_err(), "{length}");
    }
}
