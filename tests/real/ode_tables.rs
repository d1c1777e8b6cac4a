//! Real MOLA shots in the tables of the Orbital Data Explorer's PEDR query, from the file to the verdict.

#![allow(
    clippy::unwrap_used,
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::format_push_string,
    clippy::needless_range_loop,
    reason = "helpers of tests read their own folders and may fail loudly"
)]

use crate::common;

use std::{collections::BTreeSet, fs::File, path::Path};

use areograph::geom::ellipsoid::spherical_to_xyz_m;
use arrow_array::{Array as _, RecordBatch, cast::AsArray as _, types::Float64Type};
use common::{case::Case, json, number};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use serde_json::Value;

/// The tables with the windows of their queries, and profiles of fewer than 20 shots.
const WINDOWS: [(&str, [f64; 2], [f64; 2], u64); 6] = [
    ("spirit_topography", [174.97, 175.98], [-15.07, -14.06], 1),
    (
        "opportunity_topography",
        [353.97, 354.98],
        [-2.45, -1.44],
        1,
    ),
    ("insight_topography", [135.12, 136.13], [4.0, 5.01], 2),
    ("perseverance_topography", [76.95, 77.95], [17.93, 18.94], 1),
    ("weak_negative_1", [169.99, 171.01], [-81.01, -79.99], 17),
    ("weak_negative_2", [359.0, 1.0], [0.0, 1.0], 27),
];

/// The other heading of the service.
const CAPITALS: &str =
    "LONG_EAST,LAT_NORTH,TOPOGRAPHY,MOLA_RANGE,PLANET_RAD,C,A,EMPHEMERIS_TIME,UTC,ORBIT";

/// A site file over `table.csv`.
fn site(longitude_deg: [f64; 2], latitude_deg: [f64; 2]) -> String {
    format!(
        "site = \"ode\"\nkernels.files = [\"naif0012.tls\"]\n[[shots]]\nfiles = [\"*.csv\"]\nlayout = \"ode_pedr\"\n\
         [[windows]]\nid = \"window\"\nlongitude_deg = {longitude_deg:?}\nlatitude_deg = {latitude_deg:?}\n"
    )
}

/// The site of a table, with copies of its files; none without the real data.
fn case(table: &str) -> Option<Case> {
    let path = common::real_data(&format!("mola_ode/{table}.csv"), "tables of the ODE")?;
    let kernel = path.ancestors().nth(2)?.join("mgs_text/naif0012.tls");
    let (_, longitude_deg, latitude_deg, _) = WINDOWS.into_iter().find(|of| of.0 == table)?;
    let case = Case::empty();
    case.write("table.csv", std::fs::read(path).unwrap());
    case.write("naif0012.tls", std::fs::read(kernel).unwrap());
    case.write("site.toml", site(longitude_deg, latitude_deg));
    Some(case)
}

fn parquet(path: &Path) -> RecordBatch {
    let builder = ParquetRecordBatchReaderBuilder::try_new(File::open(path).unwrap()).unwrap();
    let mut reader = builder.with_batch_size(1 << 20).build().unwrap();
    reader.next().unwrap().unwrap()
}

fn numbers(table: &RecordBatch, name: &str) -> Vec<f64> {
    let column = table.column_by_name(name).unwrap();
    column.as_primitive::<Float64Type>().values().to_vec()
}

/// The rows of a table as text, without the heading.
fn rows(text: &str) -> Vec<Vec<String>> {
    let lines = text.lines().skip(1).filter(|line| !line.trim().is_empty());
    lines
        .map(|line| {
            line.split(',')
                .map(|field| field.trim().to_owned())
                .collect()
        })
        .collect()
}

/// A table from the file to the verdict: every distinct row is a shot, with the values of the file.
fn goes_through(name: &str) {
    let Some(case) = case(name) else {
        return;
    };
    let told = case.outcome(case.run());
    assert!(told.starts_with("exit 0"), "{name}: {told}");
    let rows = rows(&String::from_utf8(case.read("table.csv")).unwrap());
    let distinct: BTreeSet<&Vec<String>> = rows.iter().collect();
    let shots = parquet(&case.path("out/ode/footprints.parquet"));
    assert_eq!(shots.num_rows(), distinct.len(), "{name}");
    let column = |at: usize| rows.iter().map(move |row| row[at].parse::<f64>().unwrap());
    let expected: Vec<[f64; 5]> = column(0)
        .zip(column(1))
        .zip(column(2).zip(column(3)).zip(column(4)))
        .map(|((east, north), ((topography, range), radius))| {
            [east, north, topography, range, radius]
        })
        .collect();
    let found = ["topography_m", "range_m", "radius_m", "radius_crossover_m"]
        .map(|name| numbers(&shots, name));
    let place = ["x_m", "y_m", "z_m"].map(|name| numbers(&shots, name));
    for (row, [east, north, topography, range, radius]) in expected.iter().enumerate() {
        let values = [topography, range, radius, radius];
        for (found, value) in found.iter().zip(values) {
            // Metres: the numbers of the file, through a difference of radii.
            assert!((found[row] - value).abs() < 1e-6, "{name} row {row}");
        }
        let xyz_m = spherical_to_xyz_m(east.to_radians(), north.to_radians(), *radius);
        for axis in 0..3 {
            // Metres: degrees to radians and back.
            assert!(
                (place[axis][row] - xyz_m[axis]).abs() < 1e-6,
                "{name} row {row}"
            );
        }
    }
    let by_range = shots.column_by_name("nadir_by_range").unwrap().as_boolean();
    assert_eq!(by_range.true_count(), shots.num_rows(), "{name}");
    verdict_is_honest(name, &case);
}

/// The slanted passes of a table, as the study of these tables names them, and no other.
fn passes_off_nadir_are_named(name: &str, notes: &str) {
    let expected: &[&str] = match name {
        "spirit_topography" => &["orbit 19053 (21°)", "orbit 20033 (11°)"],
        "weak_negative_1" => &["orbit 11735", "orbit 13974", "orbit 17156"],
        "weak_negative_2" => &["orbit 19926", "orbit 20240"],
        _ => &[],
    };
    let (_, passes) = notes.split_once("off-nadir passes").unwrap_or_default();
    assert_eq!(
        passes.matches("orbit 1").count() + passes.matches("orbit 2").count(),
        expected.len(),
        "{name}: {notes}"
    );
    for pass in expected {
        assert!(passes.contains(pass), "{name}: {notes}");
    }
}

/// The verdict: valid, with what is not tested and not judged.
fn verdict_is_honest(name: &str, case: &Case) {
    let manifest = json(&case.path("out/ode/manifest.json"));
    assert_eq!(manifest["verdict"]["valid"], true, "{name}");
    assert_eq!(manifest["complaints"]["count"], 0, "{name}");
    let remarks = manifest["verdict"]["remarks"].to_string();
    assert!(remarks.contains("No range is tested"), "{name}: {remarks}");
    let notes = manifest["notes"].to_string();
    assert!(notes.contains("nadir by range"));
    passes_off_nadir_are_named(name, &notes);
    let ranges = json(&case.path("out/ode/ranges.json"));
    let profiles = ranges["profiles"].as_array().unwrap();
    let short = profiles.iter().filter(|of| of["judged"] == false).count() as u64;
    let (.., expected) = WINDOWS.into_iter().find(|of| of.0 == name).unwrap();
    assert_eq!(short, expected, "{name}");
    assert!(
        remarks.contains(&format!("which are not judged: {short} with")),
        "{name}: {remarks}"
    );
    assert_eq!(parquet_rows(&case.path("out/ode/ranges.parquet")), 0);
    let page = String::from_utf8(case.read("out/ode/report/index.html")).unwrap();
    assert!(page.contains("No range is tested"), "{name}");
    surface_is_tested(name, case);
}

/// The surface between shots, tested on the window's own profiles.
fn surface_is_tested(name: &str, case: &Case) {
    let checked = json(&case.path("out/ode/profiles.json"));
    common::assert_keeps_schema(&checked, "profiles");
    let score = &checked["withheld"]["score"];
    assert_eq!(score["stretches"], 60, "{name}");
    // Three standard deviations of 60 stretches below the stated 95 %.
    let inside = number(&score["inside"][1]);
    assert!(
        inside > 0.95 - 3.0 * f64::sqrt(0.95 * 0.05 / 60.0),
        "{name}: {score}"
    );
    let manifest = json(&case.path("out/ode/manifest.json"));
    let checks = manifest["verdict"]["checks"].as_array().unwrap();
    let withheld = checks
        .iter()
        .find(|check| check["kind"] == "withheld_stretches")
        .unwrap();
    assert_eq!(withheld["outcome"], "pass", "{name}: {withheld}");
    let page = String::from_utf8(case.read("out/ode/report/index.html")).unwrap();
    assert!(page.contains("surface-tested"), "{name}");
    let left_out = checked["left_out"].as_array().unwrap();
    let remarks = manifest["verdict"]["remarks"].to_string();
    for profile in left_out {
        let id = profile["profile"].as_str().unwrap();
        assert!(remarks.contains(id), "{name}: {remarks}");
    }
    if name == "spirit_topography" {
        // An off-nadir pass, 43 m below five others; orbit 18563 is one of these.
        assert_eq!(left_out.len(), 1);
        assert!(left_out[0].to_string().contains("20033"), "{left_out:?}");
        assert!(left_out[0]["others"].to_string().contains("18563"));
    }
}

fn parquet_rows(path: &Path) -> i64 {
    let builder = ParquetRecordBatchReaderBuilder::try_new(File::open(path).unwrap()).unwrap();
    builder.metadata().file_metadata().num_rows()
}

#[test]
fn gusev_is_valid_as_served() {
    goes_through("spirit_topography");
}

#[test]
fn meridiani_is_valid_as_served() {
    goes_through("opportunity_topography");
}

#[test]
fn elysium_is_valid_as_served() {
    goes_through("insight_topography");
}

#[test]
fn jezero_is_valid_as_served() {
    goes_through("perseverance_topography");
}

#[test]
fn the_polar_window_is_valid_as_served() {
    goes_through("weak_negative_1");
}

#[test]
fn the_window_across_0_degrees_is_valid_as_served() {
    goes_through("weak_negative_2");
}

/// Two tables of windows that overlap, the second below the other heading: every shot counts once.
#[test]
fn tables_that_overlap_count_every_shot_once_below_either_heading() {
    let Some(case) = case("spirit_topography") else {
        return;
    };
    let text = String::from_utf8(case.read("table.csv")).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let (heading, rows) = lines.split_first().unwrap();
    let part = |heading: &str, rows: &[&str]| format!("{heading}\r\n{}\r\n", rows.join("\r\n"));
    case.write("table.csv", part(heading, &rows[..6_000]));
    case.write("later.csv", part(CAPITALS, &rows[4_000..]));
    // Both at once, below the first heading, without blanks and carriage returns.
    let bare = format!("{heading}\n{}\n", rows[..500].join("\n")).replace(' ', "");
    case.write("bare.csv", bare);
    let told = case.outcome(case.run());
    assert!(told.starts_with("exit 0"), "{told}");
    assert_eq!(
        parquet_rows(&case.path("out/ode/footprints.parquet")),
        rows.len() as i64
    );
    let manifest = json(&case.path("out/ode/manifest.json"));
    assert_eq!(manifest["complaints"]["count"], 0);
    let notes = manifest["notes"].to_string();
    assert!(
        notes.contains("2500 rows in the windows duplicate other rows"),
        "{notes}"
    );
    // `pedr search` gives the same shots, in order of time.
    let mut search = case.areograph();
    search.args(["pedr", "search", "bare.csv", "later.csv", "table.csv"]);
    search.args(["--box", "174,176,-16,-14", "--out", "found.parquet"]);
    let told = case.outcome(search);
    assert!(told.starts_with("exit 0"), "{told}");
    let found = parquet(&case.path("found.parquet"));
    assert_eq!(found.num_rows(), rows.len());
    assert!(numbers(&found, "et_tag_s").is_sorted());
}

/// A row (counted from 0 without the heading), its damage, and what the complaint holds.
type Damage = (usize, fn(&str) -> String, &'static str);

const DAMAGED: [Damage; 8] = [
    (
        1,
        |row| row[..30].to_owned(),
        "line 3: the row has 3 columns; expected 10, as in the heading",
    ),
    (
        2,
        |row| row.replacen("-1928.96", "-19Z8.96", 1),
        "line 4: topography (column 3) is \"-19Z8.96\"; expected a number",
    ),
    (
        3,
        |row| format!("{row},1"),
        "line 5: the row has 11 columns; expected 10",
    ),
    (
        4,
        |row| row.replacen(",1,0,", ",1,9,", 1),
        "line 6: A (column 7) is \"9\"; expected a whole number from 0 to 7",
    ),
    (
        5,
        |row| row.replacen(" 10094", "-10094", 1),
        "line 7: Orbit (column 10) is \"-10094\"; expected a whole number from 0 to 99999",
    ),
    (
        6,
        |row| row.replacen("-25125471", "-25125441", 1),
        "line 8: Ephermis Time (column 8) is \"-25125441",
    ),
    (
        7,
        |row| row.replacen("  339", "  393", 1),
        "line 9: planet_rad (column 5) is \"393",
    ),
    (
        8,
        |row| row.replacen("175.", "975.", 1),
        "line 10: long_East (column 1) is \"975.",
    ),
];

#[test]
fn rows_that_are_no_shots_are_reported_with_line_column_and_value() {
    let Some(case) = case("spirit_topography") else {
        return;
    };
    let text = String::from_utf8(case.read("table.csv")).unwrap();
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    for (row, damage, _) in DAMAGED {
        let damaged = damage(&lines[row + 1]);
        assert_ne!(damaged, lines[row + 1], "row {row}");
        lines[row + 1] = damaged;
    }
    // The file ends within its last row, whose orbit is then another number.
    let all = lines.join("\r\n");
    case.write("table.csv", &all[..all.len() - 2]);
    let told = case.outcome(case.run());
    assert!(told.starts_with("exit 0"), "{told}");
    let manifest = json(&case.path("out/ode/manifest.json"));
    let texts = manifest["complaints"]["texts"].as_array().unwrap();
    assert_eq!(
        manifest["complaints"]["count"],
        DAMAGED.len() + 1,
        "{texts:?}"
    );
    for (text, (.., expected)) in texts.iter().zip(DAMAGED) {
        let text = text.as_str().unwrap().replace('−', "-");
        assert!(text.starts_with("table.csv line"), "{text}");
        assert!(text.contains(expected), "{text}, not {expected}");
    }
    let last = texts.last().unwrap().to_string();
    assert!(last.contains("the file ends within this row"), "{last}");
    let kept = lines.len() - 1 - DAMAGED.len() - 1;
    assert_eq!(
        parquet_rows(&case.path("out/ode/footprints.parquet")),
        kept as i64
    );
    let mut info = case.areograph();
    info.args([
        "pedr",
        "info",
        "--json",
        "table.csv",
        "--leap-seconds",
        "naif0012.tls",
    ]);
    let told = case.outcome(info);
    let told: Value = serde_json::from_str(told.split_once('\n').unwrap().1).unwrap();
    assert_eq!(told[0]["shots"], kept);
    assert_eq!(told[0]["complaints"].as_array().unwrap().len(), texts.len());
    assert_eq!(told[0]["nadir_by_range"], true);
    assert!(told[0]["range_minus_distance_m"].is_null());
}

#[test]
fn another_heading_is_refused_with_its_column() {
    let Some(case) = case("insight_topography") else {
        return;
    };
    let text = String::from_utf8(case.read("table.csv")).unwrap();
    for (from, to, expected) in [
        (
            "MOLArange",
            "range",
            "line 1: column 4 is \"range\"; expected MOLArange or MOLA_RANGE",
        ),
        (
            ",          Orbit",
            "",
            "line 1: column 10 is \"\"; expected Orbit or ORBIT",
        ),
        (
            "Orbit",
            "Orbit,shot",
            "line 1: the heading has 11 columns; expected 10",
        ),
        (
            "long_East",
            "",
            "line 1: column 1 is \"\"; expected long_East or LONG_EAST",
        ),
    ] {
        case.write("table.csv", text.replacen(from, to, 1));
        let told = case.outcome(case.run());
        assert!(told.starts_with("exit 3"), "{told}");
        assert!(
            told.contains("table.csv") && told.contains(expected),
            "{told}"
        );
    }
    // No heading at all.
    case.write("table.csv", text.split_once('\n').unwrap().1);
    let told = case.outcome(case.run());
    assert!(told.contains("line 1: column 1 is \"136.10379\""), "{told}");
    case.replace(
        "site.toml",
        "site = ",
        "body = \"moon\"\naltimeter = \"lola\"\nsite = ",
    );
    let told = case.outcome(case.run());
    assert!(
        told.contains("this layout is for MOLA shots at Mars"),
        "{told}"
    );
}

/// A row of the service, `tenths` of a second after J2000.
fn row(tenths: u32, [east_deg, north_deg]: [f64; 2], radius_m: f64) -> String {
    let et_s = 0.1 * f64::from(tenths);
    format!(
        "{east_deg:09.5},{north_deg:9.5},{:11.2},{:10.2},{radius_m:12.2},1,0,{et_s:17.5},{},{:6}",
        radius_m - 3_376_200.0,
        4e5,
        utc_of(et_s),
        7
    )
}

#[test]
fn longitude_0_and_the_pole_are_kept_and_a_pulse_has_one_place() {
    let Some(case) = case("weak_negative_1") else {
        return;
    };
    let places = [
        [0.0, -90.0],
        [360.0, -89.9],
        [359.999_99, -89.9],
        [180.0, -89.99],
    ];
    let shots = (0..)
        .zip(places)
        .map(|(tenths, place)| row(tenths, place, 3_376_000.0));
    let mut shots: Vec<String> = shots.collect();
    // The pulse of the second row elsewhere.
    shots.push(row(1, [90.0, -89.9], 3_376_000.0));
    case.write(
        "table.csv",
        format!("{CAPITALS}\r\n{}\r\n", shots.join("\r\n")),
    );
    case.write("site.toml", site([0.0, 360.0], [-90.0, -80.0]));
    let told = case.outcome(case.run());
    assert!(told.starts_with("exit 0"), "{told}");
    let found = parquet(&case.path("out/ode/footprints.parquet"));
    assert_eq!(found.num_rows(), places.len());
    let [east, north, z] =
        ["longitude_deg", "latitude_deg", "z_m"].map(|name| numbers(&found, name));
    for (row, place) in places.into_iter().enumerate() {
        // Degrees: through radians and back.
        assert!(
            (east[row] - place[0] % 360.0).abs() < 1e-12,
            "{}",
            east[row]
        );
        assert!((north[row] - place[1]).abs() < 1e-12, "{}", north[row]);
    }
    assert!((z[0] + 3_376_000.0).abs() < 1e-6); // metres, at the pole
    let manifest = json(&case.path("out/ode/manifest.json"));
    assert_eq!(manifest["complaints"]["count"], 1);
    let texts = manifest["complaints"]["texts"].to_string();
    assert!(
        texts.contains("table.csv line 6: same shot as in table.csv line 3, but different values"),
        "{texts}"
    );
}

/// Shots of the synthetic mission as the service would write them, and its kernels: ranges are compared with these.
#[test]
fn kernels_give_the_spacecraft_that_a_table_lacks() {
    let case = Case::pair();
    let told = case.outcome(case.run());
    assert!(told.starts_with("exit 0"), "{told}");
    let by_pedr = json(&case.path("out/isidis/ranges.json"));
    let shots = parquet(&case.path("out/isidis/footprints.parquet"));
    case.write("shots.csv", as_served(&shots));
    let site = String::from_utf8(case.read("site.toml")).unwrap();
    let start = site.find("[pedr]").unwrap();
    let end = start + 1 + site[start + 1..].find("\n[").unwrap();
    let tables = "[[shots]]\nfiles = [\"shots.csv\"]\nlayout = \"ode_pedr\"\n";
    case.write(
        "site.toml",
        format!("{}{tables}{}", &site[..start], &site[end..]),
    );
    let told = case.outcome(case.run());
    assert!(told.starts_with("exit 0"), "{told}");
    let by_table = json(&case.path("out/isidis/ranges.json"));
    let profiles = |of: &Value| of["profiles"].as_array().unwrap().clone();
    let (expected, found) = (profiles(&by_pedr), profiles(&by_table));
    assert_eq!(expected.len(), found.len());
    for (expected, found) in expected.iter().zip(&found) {
        let mean_m = |of: &Value, name: &str| number(&of[name]["mean"]);
        assert_eq!(
            found["range_minus_distance_m"]["n"],
            expected["range_minus_distance_m"]["n"]
        );
        // The table has the corrected radius. Metres: half a digit of its radius and range, averaged.
        let apart_m = mean_m(found, "range_minus_distance_m")
            - mean_m(expected, "range_minus_distance_crossover_m");
        assert!(apart_m.abs() < 0.01, "{apart_m}");
        assert_eq!(found["decoding_m"]["n"], 0);
        assert_eq!(found["spacecraft_along_m"]["n"], 0);
    }
    let residuals = parquet(&case.path("out/isidis/ranges.parquet"));
    let own = residuals.column_by_name("decoding_m").unwrap();
    assert_eq!(own.null_count(), residuals.num_rows());
    // Profiles that are too short for the limit: nothing is left to judge.
    let site = String::from_utf8(case.read("site.toml")).unwrap();
    case.write(
        "site.toml",
        format!("{site}\n[range_check]\nshots_min = 100000\n"),
    );
    let told = case.outcome(case.run());
    assert!(told.starts_with("exit 5"), "{told}");
    assert!(
        told.contains("no profile is long enough to be judged"),
        "{told}"
    );
}

/// Footprints in the form of the service.
fn as_served(shots: &RecordBatch) -> String {
    let columns = [
        "longitude_deg",
        "latitude_deg",
        "topography_m",
        "range_m",
        "radius_crossover_m",
        "et_tag_s",
    ]
    .map(|name| numbers(shots, name));
    let orbits = shots.column_by_name("orbit").unwrap();
    let orbits = orbits.as_primitive::<arrow_array::types::UInt32Type>();
    let mut text = format!("{CAPITALS}\r\n");
    for row in 0..shots.num_rows() {
        let [east, north, topography, range, radius, et] =
            [0, 1, 2, 3, 4, 5].map(|at| columns[at][row]);
        text += &format!(
            "{east:09.5},{north:9.5},{topography:11.2},{range:10.2},{radius:12.2},1,0,{et:17.5},{},{:6}\r\n",
            utc_of(et),
            orbits.value(row)
        );
    }
    text
}

/// UTC of an instant of 1999 to 2005: 32 leap seconds.
fn utc_of(et_s: f64) -> String {
    let milliseconds = ((et_s - 64.184) * 1e3).round();
    let at =
        chrono::DateTime::from_timestamp_millis(946_728_000_000 + milliseconds as i64).unwrap();
    at.format("%Y-%m-%dT%H:%M:%S%.3f").to_string()
}

/// What `pedr crossovers` prints of a table.
fn crossovers(table: &str) -> Option<Value> {
    let case = case(table)?;
    let (_, [west, east], [south, north], _) = WINDOWS.into_iter().find(|of| of.0 == table)?;
    let mut command = case.areograph();
    let edges = format!("--box={west},{east},{south},{north}");
    command.args(["--quiet", "pedr", "crossovers", "table.csv", &edges]);
    let output = command.output().unwrap();
    assert!(output.status.success(), "{output:?}");
    serde_json::from_slice(&output.stdout).ok()
}

#[test]
fn crossovers_of_a_table_scatter_as_published_and_the_wrong_profile_is_named() {
    // Table, robust spread of its crossovers in metres by another program, and profiles that it names as wrong.
    for (table, expected_m, wrong) in [
        ("spirit_topography", 1.27, Some("20033")),
        ("opportunity_topography", 0.97, None),
        ("insight_topography", 0.85, None),
    ] {
        let Some(answer) = crossovers(table) else {
            return;
        };
        // Of the profiles that belong to the others.
        let nmad_m = answer["differences_m"]["nmad"].as_f64().unwrap();
        println!(
            "{table}: {} crossovers, {nmad_m:.2} m",
            answer["differences_m"]["n"]
        );
        // A tenth: shots of nearly equal place are joined differently.
        assert!(
            (nmad_m / expected_m - 1.0).abs() < 0.1,
            "{table}: {nmad_m} m"
        );
        let left_out = answer["left_out"].as_array().unwrap();
        let names: Vec<&str> = left_out
            .iter()
            .map(|of| of["profile"].as_str().unwrap())
            .collect();
        match wrong {
            Some(orbit) => assert!(names.iter().any(|name| name.ends_with(orbit)), "{names:?}"),
            None => assert!(names.len() <= 1, "{table}: {names:?}"),
        }
        let shifts = answer["shifts"].as_array().unwrap();
        assert!(shifts.len() > 10, "{table}: {}", shifts.len());
        for shift in shifts {
            let sigma_m = shift["covariance_m2"][2][2].as_f64().unwrap().sqrt();
            // A profile is known to the metre of its prior, and better by its crossovers; not below the noise of a shot.
            assert!((0.05..2.0).contains(&sigma_m), "{table}: {shift}");
        }
    }
}

#[test]
fn a_window_is_required_for_crossovers() {
    let Some(case) = case("insight_topography") else {
        return;
    };
    let mut command = case.areograph();
    command.args(["--quiet", "pedr", "crossovers", "table.csv"]);
    let said = case.outcome(command);
    assert!(
        said.starts_with("exit 2") && said.contains("--box"),
        "{said}"
    );
}
