//! Searches of an index: every image of a made one, held against the definition point by point.

use std::{collections::BTreeSet, fmt::Write as _, fs, path::Path};

use super::{areograph, stdout, text};
use areograph::config::{Document as _, SiteConfig};
use serde_json::Value;

/// A row of the archive, as a public page quotes it, with what it does not quote left empty.
const CYDONIA: &str = r#""MGSC_1066","M19008/M1900850.IMQ","M19/00850   ","2000-09-13T07:54:02.34","MOC-NA","N/A ",512,12160,4,4,6.19,0.94,0.23,32.21,32.05,10.15,41.88,10.01,41.28,10.08,41.27,10.21,42.47,10.29,42.47,"MAPPING","MARS","653298871:2",245.0,0.4821,"6A","30",0,"MOC-PRED-X-5",3.17,71.32,,,,"",,,,,,,,,,,"Cydonia, ""Face""","OK",6690"#;

/// An image of a made index: west longitudes, as the index has them.
struct Row {
    product: String,
    centre: [f64; 2],
    /// First line: first and last sample; last line: first and last sample.
    corners: [[f64; 2]; 4],
}

fn table(rows: &[Row]) -> String {
    let mut table = String::new();
    for Row {
        product,
        centre,
        corners,
    } in rows
    {
        let [ul, ur, ll, lr] = corners;
        writeln!(
            table,
            "\"MGSC_1001\",\"X/X.IMQ\",\"{product}\",\"1999-0{}-06T15:33:58.13\",\"MOC-NA\",\"N/A \",512,4096,4,4,6.0,1.0,10.0,40.0,\
             45.0,{:.2},{:.2},{:.2},{:.2},{:.2},{:.2},{:.2},{:.2},{:.2},{:.2},\"MAPPING\",\"MARS\",\"610472061:131\",245.0,0.4821,\
             \"6A\",\"30\",0,\"MOC-PRED-X-5\",3.0,24.0,380.0,3770.0,380.0,\"\",90.0,40.0,100.0,5.0,{:.2},{:.2},2e8,150.0,14.0,90.0,\"\",\"OK\",{}",
            1 + product.len() % 9,
            centre[0], centre[1], ul[0], ul[1], ur[0], ur[1], ll[0], ll[1], lr[0], lr[1], centre[0], centre[1],
            700 + product.len()
        )
        .unwrap();
    }
    table
}

struct Random(u64);

impl Random {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Images all over Mars, some across 0° and 180°, up to 87° of latitude; each a slanting quadrangle.
fn images(random: &mut Random) -> Vec<Row> {
    let longitudes = [0.01, 179.99, 359.99, 90.0];
    (0..300)
        .map(|number| {
            let latitude = random.between(-86.0, 86.0);
            let west = if number % 3 == 0 {
                longitudes[number % 4]
            } else {
                random.between(0.0, 360.0)
            };
            let half_height = random.between(0.1, 1.0);
            let half_width = random.between(0.03, 0.3) / latitude.to_radians().cos();
            let slant = random.between(-0.2, 0.2) / latitude.to_radians().cos();
            let corner = |across: f64, along: f64| {
                let longitude = west + across * half_width + along * slant;
                [longitude.rem_euclid(360.0), latitude + along * half_height]
            };
            Row {
                product: format!("M01/{number:05}"),
                centre: [west, latitude],
                corners: [
                    corner(-1.0, -1.0),
                    corner(1.0, -1.0),
                    corner(-1.0, 1.0),
                    corner(1.0, 1.0),
                ],
            }
        })
        .collect()
}

/// Whether a box of east longitudes holds a place that some point of the outline may be, by the margins: many points one by one.
/// `slack_deg` makes the box larger or smaller.
fn meets(row: &Row, [west, east, south, north]: [f64; 4], slack_deg: f64) -> bool {
    const STEPS: i32 = 60;
    let away = |a: f64, b: f64| (a - b + 180.0).rem_euclid(360.0) - 180.0;
    let farthest = row
        .corners
        .iter()
        .map(|corner| (corner[1] * 100.0).round() / 100.0)
        .fold(0.0, |most: f64, l| most.max(l.abs()));
    let longitude_margin = 0.3 / farthest.to_radians().cos();
    let (middle, half) = (0.5 * (west + east), 0.5 * (east - west));
    let rounded = |value: f64| (value * 100.0).round() / 100.0;
    for across in 0..=STEPS {
        for along in 0..=STEPS {
            let [u, v] = [across, along].map(|step| f64::from(step) / f64::from(STEPS));
            let weights = [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v];
            let mix = |axis: usize| {
                let values = row.corners.iter().map(|corner| match axis {
                    0 => away(rounded(corner[0]), rounded(row.centre[0])),
                    _ => rounded(corner[1]),
                });
                weights
                    .iter()
                    .zip(values)
                    .map(|(weight, value)| weight * value)
                    .sum::<f64>()
            };
            let longitude = -(rounded(row.centre[0]) + mix(0));
            let latitude = mix(1);
            let in_longitude = away(longitude, middle).abs() <= half + longitude_margin + slack_deg;
            let in_latitude =
                south - 0.35 - slack_deg <= latitude && latitude <= north + 0.35 + slack_deg;
            if in_longitude && in_latitude {
                return true;
            }
        }
    }
    false
}

fn found(index: &Path, edges: &str, format: &str) -> String {
    stdout(&areograph(&[
        "search",
        text(index),
        &format!("--box={edges}"),
        "--format",
        format,
    ]))
}

#[test]
fn every_image_of_a_window_is_found_and_no_other() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cumindex.tab");
    let mut random = Random(11);
    let rows = images(&mut random);
    fs::write(&path, table(&rows)).unwrap();
    let mut windows = vec![
        [-20.0, 20.0, -30.0, 30.0],
        [175.0, 185.0, -80.0, 80.0],
        [359.0, 361.0, -70.0, 70.0],
        [0.0, 360.0, 80.0, 90.0],
        [0.0, 360.0, -90.0, -80.0],
    ];
    for _ in 0..20 {
        let (west, south) = (random.between(-180.0, 180.0), random.between(-88.0, 85.0));
        windows.push([
            west,
            west + random.between(1.0, 120.0),
            south,
            south + random.between(0.5, 5.0),
        ]);
    }
    let mut met = 0;
    for edges in windows {
        let [west, east, south, north] = edges;
        let turned = |longitude: f64| {
            if longitude > 360.0 {
                longitude - 360.0
            } else {
                longitude
            }
        };
        let box_text = format!("{west},{},{south},{north}", turned(east));
        let csv = found(&path, &box_text, "csv");
        let found: BTreeSet<&str> = csv
            .lines()
            .skip(1)
            .filter_map(|line| line.split(',').next())
            .collect();
        met += found.len();
        // Points of a grid miss slivers of an outline, 0.1° wide at most times 1/cos of latitude.
        for row in &rows {
            let is_found = found.contains(&*row.product);
            assert!(
                is_found || !meets(row, edges, -0.001),
                "{} lost of {edges:?}",
                row.product
            );
            let cosine = row.centre[1].to_radians().cos();
            assert!(
                !is_found || meets(row, edges, 0.1 / cosine),
                "{} found in {edges:?}",
                row.product
            );
        }
    }
    assert!(met > 100, "{met}");
}

#[test]
fn the_quoted_row_is_found_where_it_lies_and_makes_an_image_of_a_site() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cumindex.tab");
    fs::write(&path, format!("{CYDONIA}\r\n")).unwrap();
    assert!(found(&path, "349,351,41,43", "table").contains("M19/00850"));
    // Quotes within a text are doubled in the index, and again in the answer.
    let answer = found(&path, "349,351,41,43", "csv");
    assert!(answer.contains(r#","Cydonia, ""Face"""#), "{answer}");
    // 10° west is 350° east.
    assert!(!found(&path, "9,11,41,43", "table").contains("M19/00850"));
    let geojson: Value = serde_json::from_str(&found(&path, "349,351,41,43", "geojson")).unwrap();
    let feature = &geojson["features"][0];
    let ring = feature["geometry"]["coordinates"][0].as_array().unwrap();
    // Four corners, the first one again at the end, 10.01° west as a longitude within ±180°.
    assert_eq!(ring.len(), 5);
    assert!(
        ring.contains(&serde_json::json!([-10.01, 41.28])),
        "{ring:?}"
    );
    assert_eq!(feature["properties"]["emission_deg"], 0.23);
    let site = folder.path().join("site.toml");
    let images = found(&path, "349,351,41,43", "toml");
    let head = "[site]\nid = \"cydonia\"\n\n[[windows]]\nid = \"face\"\nlongitude_deg = [349.0, 351.0]\nlatitude_deg = [41.0, 43.0]\n\n";
    fs::write(&site, format!("{head}{images}")).unwrap();
    let kernels = folder.path().join("kernels");
    fs::create_dir(&kernels).unwrap();
    let problems =
        SiteConfig::load(&site).map_or_else(|failure| failure.to_string(), |_| String::new());
    assert!(!problems.contains("images"), "{problems}");
    // The windows of a site are searched as a box is.
    if problems.is_empty() {
        assert!(
            stdout(&areograph(&["search", text(&path), "--site", text(&site)]))
                .contains("M19/00850")
        );
    }
}

#[test]
fn pairs_are_told_best_first() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cumindex.tab");
    let row = |product: &str, west: f64| upright(product, [west, 10.0]);
    // Times and orbits differ by the lengths of the names.
    let rows = [
        row("M01/00001", 50.0),
        row("M01/000002", 50.3),
        row("M01/0000003", 50.5),
    ];
    fs::write(&path, table(&rows)).unwrap();
    let pairs = found(&path, "308,312,9,11", "pairs");
    let told: Vec<Vec<&str>> = pairs
        .lines()
        .skip(1)
        .map(|line| line.split(',').collect())
        .collect();
    let names: Vec<[&str; 2]> = told.iter().map(|pair| [pair[0], pair[1]]).collect();
    assert_eq!(names.len(), 3, "{pairs}");
    let overlap = |one: &str, other: &str| {
        let pair = told
            .iter()
            .find(|pair| pair[..2].contains(&one) && pair[..2].contains(&other))
            .unwrap();
        pair[2].parse::<f64>().unwrap()
    };
    // 0.6° wide; printed to 0.01.
    for (one, other, share) in [
        ("M01/00001", "M01/000002", 0.5),
        ("M01/000002", "M01/0000003", 2.0 / 3.0),
        ("M01/00001", "M01/0000003", 1.0 / 6.0),
    ] {
        assert!(
            (overlap(one, other) - share).abs() <= 0.005 + 1e-9,
            "{pairs}"
        );
    }
    let scores: Vec<f64> = told.iter().map(|pair| pair[6].parse().unwrap()).collect();
    assert!(scores.is_sorted_by(|a, b| a >= b), "{pairs}");
}

/// An upright image one degree high.
fn upright(product: &str, [west, latitude]: [f64; 2]) -> Row {
    let corner = |across: f64, along: f64| [west + 0.3 * across, latitude + 0.5 * along];
    Row {
        product: product.to_owned(),
        centre: [west, latitude],
        corners: [
            corner(-1.0, -1.0),
            corner(1.0, -1.0),
            corner(-1.0, 1.0),
            corner(1.0, 1.0),
        ],
    }
}

#[test]
fn nadir_images_shifted_along_the_track_do_not_converge() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cumindex.tab");
    let rows = [
        upright("M01/00001", [50.0, 10.0]),
        upright("M01/000002", [50.1, 10.6]),
    ];
    fs::write(&path, table(&rows)).unwrap();
    let pairs = found(&path, "308,312,9,12", "pairs");
    let convergence: f64 = pairs
        .lines()
        .nth(1)
        .unwrap()
        .split(',')
        .nth(3)
        .unwrap()
        .parse()
        .unwrap();
    // Seen from above the middle between them they would be 6° apart.
    assert!(convergence < 0.5, "{pairs}");
}

#[test]
fn pairs_are_of_different_orbits() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cumindex.tab");
    let rows =
        ["M01/00001", "M01/00002", "M01/00003"].map(|product| upright(product, [50.0, 10.0]));
    // All in one minute; the second on another orbit, the third without any.
    let lines = table(&rows);
    let lines: Vec<&str> = lines.lines().collect();
    let write = |second: &str, third: &str| {
        let rows = [lines[0], second, third].join("\n");
        fs::write(&path, rows).unwrap();
    };
    let orbit = |row: &str, number: &str| row.replace(",709", &format!(",{number}"));
    let start = |row: &str, time: &str| row.replace("15:33:58.13", time);
    let pairs = |second: &str, third: &str| {
        write(second, third);
        let told = found(&path, "308,312,9,12", "pairs");
        let pairs = told.lines().skip(1).map(|line| {
            let names: Vec<&str> = line.split(',').take(2).map(|name| &name[8..]).collect();
            names.concat()
        });
        pairs.collect::<BTreeSet<String>>()
    };
    let set = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    let (second, third) = (orbit(lines[1], "710"), orbit(lines[2], ""));
    assert_eq!(pairs(&second, &third), set(&["12"]));
    // The minute changes between two images of one orbit; half an hour without an orbit is another one.
    let second = start(lines[1], "15:34:01.00");
    assert_eq!(pairs(&second, &start(&third, "16:04:00.00")), set(&["13"]));
    // Of what has neither, nothing is known.
    assert_eq!(pairs(&second, &start(&third, "UNK")), set(&["13", "23"]));
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_areograph"))
        .args(["image", "search", text(&path), "--box=308,312,9,12"])
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(told.contains("2 pairs may be from one orbit"), "{told}");
}

#[test]
fn what_the_index_does_not_say_loses_no_image() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cumindex.tab");
    let whole = table(&[upright("M01/00001", [50.0, 10.0])]);
    let changes: [(&str, &str); 8] = [
        ("\"MARS\"", "\"    \""),
        ("\"MARS\"", "\"UNK\""),
        ("\"MOC-NA\"", "\"UNK\""),
        ("\"MOC-NA\",\"N/A \"", "\"MOC-WA\",\"    \""),
        (",4096,4,4,", ",4096,,4,"),
        (",4096,4,4,", ",4096,4,N/A,"),
        // No corners, and no size but that of the pixels: 4096 of 6 m reach 0.2° to either side.
        (",49.70,9.50,", ",,,"),
        (",3.0,24.0,380.0", ",,,380.0"),
    ];
    for (number, (from, to)) in changes.iter().enumerate() {
        assert!(whole.contains(from), "{from}");
        let mut row = whole.replace(from, to);
        if number >= 6 {
            row = row
                .replace(",49.70,9.50,", ",,,")
                .replace(",3.0,24.0,380.0", ",,,380.0");
        }
        fs::write(&path, &row).unwrap();
        // A window 0.15° north of the centre and beyond the margin of the index.
        let told = found(&path, "309,311,10.45,10.54", "csv");
        assert!(told.contains("M01/00001"), "{to}: {told}");
        stdout(&areograph(&[
            "search",
            text(&path),
            "--box=309,311,9,11",
            "--format=toml",
        ]));
    }
    let warning = |row: &str, expected: &str| {
        fs::write(&path, row).unwrap();
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_areograph"))
            .args(["image", "search", text(&path), "--box=309,311,9,11"])
            .output()
            .unwrap();
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(told.contains(expected), "{told}");
    };
    warning(
        &whole.replace("\"MARS\"", "\"\""),
        "1 images have no TARGET_NAME",
    );
    warning(
        &whole.replace("MOC-NA", "CTX"),
        "1 image (first: M01/00001) omitted, because the camera is unknown",
    );
    let nowhere = whole
        .replace(",49.70,9.50,", ",,,")
        .replace(",3.0,24.0,380.0", ",,,380.0");
    let nowhere = nowhere.replace(",6.0,1.0,10.0,", ",,,10.0,");
    warning(&nowhere, "1 image (first: M01/00001) not tested");
}

#[test]
fn outlines_as_geojson_stay_on_the_map_and_are_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cumindex.tab");
    let pole = Row {
        product: "M01/00003".to_owned(),
        centre: [10.0, 89.0],
        corners: [[0.0, 83.0], [80.0, 84.0], [280.0, 82.0], [170.0, 84.0]],
    };
    let rows = [
        upright("M01/00001", [180.1, 10.0]),
        upright("M01/00002", [200.0, 30.0]),
        pole,
    ];
    fs::write(&path, table(&rows)).unwrap();
    let geojson = found(&path, "0,360,-90,90", "geojson");
    let value: Value = serde_json::from_str(&geojson).unwrap();
    let kinds = value["features"].as_array().unwrap().iter();
    let kinds: Vec<&str> = kinds
        .map(|feature| feature["geometry"]["type"].as_str().unwrap())
        .collect();
    assert_eq!(kinds, ["MultiPolygon", "Polygon", "MultiPolygon"]);
    let polygons = folder.path().join("found.geojson");
    fs::write(&polygons, &geojson).unwrap();
    let again = stdout(&areograph(&[
        "search",
        text(&path),
        "--polygon",
        text(&polygons),
        "--format=geojson",
    ]));
    let again: Value = serde_json::from_str(&again).unwrap();
    assert_eq!(again["features"].as_array().unwrap().len(), 3);
    // The pole is found by its image alone, wherever it is looked for.
    for edges in ["100,110,88,90", "250,260,86,87", "0,360,89.5,90"] {
        let csv = found(&path, edges, "csv");
        assert!(csv.contains("M01/00003"), "{edges}: {csv}");
    }
}

#[test]
fn what_is_no_index_is_refused_with_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("wrong.tab");
    for (content, code, message) in [
        ("", 3, "the table is empty"),
        (
            "a,b,c\r\n",
            3,
            "no row describes an image; line 1: 3 fields; expected 53",
        ),
        (
            &CYDONIA.replace("12160", "many"),
            3,
            "line 1: LINES is \"many\"; expected a count from 1",
        ),
    ] {
        fs::write(&path, content).unwrap();
        let output = areograph(&["search", text(&path), "--box=0,1,0,1"]);
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code));
        assert!(told.contains(message), "{told}");
    }
    for (limit, value) in [
        ("--emission-max-deg", "nan"),
        ("--incidence-max-deg", "-1"),
        ("--pixel-max-m", "inf"),
    ] {
        let output = areograph(&["search", text(&path), "--box=0,1,0,1", limit, value]);
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{told}");
        assert!(told.contains("expected a number above 0, up to"), "{told}");
    }
    let output = areograph(&["search", text(&path), "--box=0,1,0,1", "--camera", "hrsc"]);
    assert_eq!(output.status.code(), Some(2));
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(
        told.contains("unknown camera \"hrsc\"; expected moc_na, moc_wa_red, moc_wa_blue"),
        "{told}"
    );
}
