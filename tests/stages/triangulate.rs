//! `areograph triangulate` as its user has it: a synthetic net from tables to products, against its truth, and nets that
//! are refused.

#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::panic,
    clippy::format_push_string,
    clippy::too_many_lines,
    reason = "tests work in temporary folders and may fail loudly; a list of refused nets is read in one go"
)]

use crate::common;

mod sound;

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::Path,
    sync::atomic::AtomicBool,
};

use areograph::{
    config::{Document as _, NetConfig},
    error::Error,
    flow::{RunOutcome, Task},
    geom::plane::{CornerZero, Place},
    scene::write_plane_scene,
    stage::Stage,
    stages::triangulate::{NetFiles, NetKeys, Triangulate, Triangulation},
};
use common::{assert_keeps_schema, flows::run_into, golden::assert_messages, json, number};
use serde_json::Value;

const SEED: u64 = 1;

/// The method of the synthetic net, and what replaces it for bricks.
const ONE_SHOT: &str = "method = \"one_shot\"";
const BRICKS: (&str, &str) = (ONE_SHOT, "method = \"scale\"\nlocal = \"yes\"");

/// A folder with the synthetic net, and `net.toml` with some text replaced.
fn scene(replaced: &[(&str, &str)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_plane_scene(&folder.path().join("net"), SEED).unwrap();
    let toml = folder.path().join("net/net.toml");
    let mut text = fs::read_to_string(&toml).unwrap();
    for (was, is) in replaced {
        assert!(text.contains(was), "{was}");
        text = text.replace(was, is);
    }
    fs::write(toml, text).unwrap();
    folder
}

fn run(folder: &Path, force: bool) -> Result<RunOutcome, Error> {
    let net = NetConfig::load(&folder.join("net/net.toml"))?.config;
    run_into(Task::Net(&net), &folder.join("out"), force)
}

fn triangulated(folder: &Path) -> Result<Triangulation, Error> {
    let net = NetConfig::load(&folder.join("net/net.toml"))?.config;
    let stage = Triangulate {
        net: NetKeys(&net),
        files: NetFiles(&[]),
    };
    stage.run(&AtomicBool::new(false))
}

fn truth(folder: &Path) -> Value {
    json(&folder.join("net/truth.json"))
}

/// Root mean square error of the coordinates of all points, and of the same over their stated standard deviations.
fn errors(net: &Triangulation, truth: &Value) -> (f64, f64) {
    let (mut squares, mut normalised) = (0.0, 0.0);
    for point in &net.points {
        let place = &truth["points_m"][&point.point];
        let error = [0, 1].map(|axis| point.place_m[axis] - number(&place[axis]));
        let square = error[0].powi(2) + error[1].powi(2);
        squares += square;
        normalised += square / point.sigma_m.unwrap().powi(2);
    }
    let count = (2 * net.points.len()) as f64;
    ((squares / count).sqrt(), (normalised / count).sqrt())
}

#[test]
fn blunders_and_gross_controls_are_those_of_the_truth() {
    for method in ["scale", "mortar", "one_shot"] {
        let local = if method == "one_shot" { "no" } else { "yes" };
        let key = format!("local = \"{local}\"\nmethod = \"{method}\"");
        let folder = scene(&[(ONE_SHOT, &key)]);
        let (net, truth) = (triangulated(folder.path()).unwrap(), truth(folder.path()));
        let removed: BTreeSet<(String, String)> = net
            .measurements
            .iter()
            .filter(|of| of.removed)
            .map(|of| (of.picture.clone(), of.point.clone()))
            .collect();
        let text = |value: &Value| value.as_str().unwrap().to_owned();
        let wrong = truth["blunders"].as_array().unwrap();
        for of in wrong {
            let (picture, point) = (text(&of[0]), text(&of[1]));
            // Of a point on two pictures of the brick both go, as nothing tells which of them is wrong.
            let by_point = removed.iter().any(|(_, found)| *found == point);
            assert!(by_point, "{method}: {picture} {point}: {removed:?}");
        }
        let points: BTreeSet<&String> = removed.iter().map(|(_, point)| point).collect();
        assert_eq!(points.len(), wrong.len(), "{method}: {removed:?}");
        let rejected: BTreeSet<&str> = net
            .controls
            .iter()
            .filter(|of| !of.kept)
            .map(|of| &*of.point)
            .collect();
        let gross: BTreeSet<&str> = truth["gross_controls"]
            .as_array()
            .unwrap()
            .iter()
            .map(|of| of.as_str().unwrap())
            .collect();
        assert_eq!(rejected, gross, "{method}");
        // Controls err by 800 m: the figure as a whole does by a third of that, its inside by tens of metres.
        let (rms_m, normalised) = errors(&net, &truth);
        assert!(rms_m < 600.0, "{method}: {rms_m} m");
        // All points share the error of the controls, so that one net gives a rough ratio.
        assert!((0.3..2.0).contains(&normalised), "{method}: {normalised}");
        assert!(
            net.verdict.valid && net.verdict.remarks.len() >= 2,
            "{:?}",
            net.verdict
        );
        // Noise of 30 m, estimated from some hundred equations.
        let sigma_m = net.totals.tie_sigma_m.unwrap();
        assert!((sigma_m / 30.0 - 1.0).abs() < 0.15, "{sigma_m}");
        let totals = &net.totals;
        assert_eq!(totals.unknowns, 100);
        assert_eq!(totals.control_equations, 20);
        assert_eq!(totals.redundancy, totals.tie_equations + 20 - 100);
    }
}

#[test]
fn seams_are_wider_than_bricks_are_within_and_local_evens_them_out() {
    let folder = scene(&[BRICKS]);
    let net = triangulated(folder.path()).unwrap();
    assert_eq!(net.bricks.len(), 3);
    let (seams, within) = (net.seams.unwrap(), &net.bricks);
    let larger = |of: [f64; 2]| of[0].max(of[1]);
    let within_m = within
        .iter()
        .map(|brick| larger(brick.rms_m))
        .fold(0.0, f64::max);
    assert!(larger(seams.rms_m) > within_m, "{seams:?} {within_m}");
    assert!(
        larger(seams.local_rms_m.unwrap()) < larger(seams.rms_m),
        "{seams:?}"
    );
    for shrunk in within
        .iter()
        .filter_map(|brick| brick.shrinkage)
        .chain(seams.shrinkage)
    {
        // The law holds to rounding of the factor.
        assert!(
            shrunk.factor < 1.0 && (shrunk.factor - shrunk.law).abs() < 1e-10,
            "{shrunk:?}"
        );
    }
}

#[test]
fn a_blunder_that_is_alone_in_its_brick_shows_between_the_bricks() {
    let folder = scene(&[BRICKS]);
    let truth = truth(folder.path());
    // A point on two pictures side by side of two bricks.
    let text = fs::read_to_string(folder.path().join("net/measurements.csv")).unwrap();
    let mut views: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for line in text.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        views
            .entry(cells[1].to_owned())
            .or_default()
            .push(cells[0].to_owned());
    }
    let wrong = ["P12".to_owned(), "P13".to_owned()];
    let (point, _) = views
        .iter()
        .find(|(_, pictures)| **pictures == wrong)
        .unwrap();
    let scale = number(&truth["pictures"]["P13"][0]).hypot(number(&truth["pictures"]["P13"][1]));
    change(folder.path(), "measurements.csv", |_, mut cells| {
        if cells[0] == "P13" && cells[1] == *point {
            cells[2] = format!("{}", cells[2].parse::<f64>().unwrap() + 2_000.0 / scale);
        }
        Some(cells)
    });
    let net = triangulated(folder.path()).unwrap();
    let of_point = net.measurements.iter().filter(|of| of.point == *point);
    assert!(
        of_point.filter(|of| of.removed).count() > 0,
        "{point} is in use"
    );
}

#[test]
fn products_are_whole_keep_their_schemas_and_are_not_made_twice() {
    let folder = scene(&[BRICKS]);
    let first = run(folder.path(), false).unwrap();
    assert!(!first.is_unchanged() && first.manifest().unwrap().verdict.valid);
    let out = &first.folder;
    for name in ["triangulation", "columns"] {
        let schema = if name == "columns" {
            "net_columns"
        } else {
            name
        };
        assert_keeps_schema(&json(&out.join(format!("{name}.json"))), schema);
    }
    assert_keeps_schema(&json(&out.join("manifest.json")), "manifest");
    assert_keeps_schema(&json(&out.join("points.geojson")), "net_points");
    let page = fs::read_to_string(out.join("report/index.html")).unwrap();
    for said in [
        "Valid with remarks",
        "brick to brick, after LOCAL",
        "rejected as a blunder",
        "L′/L",
    ] {
        assert!(page.contains(said), "{said}");
    }
    // The largest deviation comes first, and is a blunder.
    let table = fs::read_to_string(out.join("deviations.csv")).unwrap();
    let first_row: Vec<&str> = table.lines().nth(1).unwrap().split(',').collect();
    assert_eq!(first_row[8], "true", "{first_row:?}");
    assert!(run(folder.path(), false).unwrap().is_unchanged());
    let again = run(folder.path(), true).unwrap();
    assert!(!again.is_unchanged());
    assert_eq!(
        again.manifest().unwrap().products,
        first.manifest().unwrap().products
    );
    // A table that changes makes the net run again; one that cannot be used leaves the products alone.
    let controls = folder.path().join("net/controls.csv");
    let text = fs::read_to_string(&controls).unwrap();
    fs::write(
        &controls,
        text.lines().take(2).collect::<Vec<_>>().join("\n"),
    )
    .unwrap();
    let failure = run(folder.path(), false).unwrap_err();
    assert_eq!(failure.kind().exit_code(), 3);
    assert_eq!(
        json(&out.join("manifest.json")),
        serde_json::to_value(again.manifest().unwrap()).unwrap()
    );
    fs::write(
        &controls,
        text.lines().take(8).collect::<Vec<_>>().join("\n"),
    )
    .unwrap();
    assert!(!run(folder.path(), false).unwrap().is_unchanged());
}

#[test]
fn at_once_pictures_have_the_size_that_scale_gives_them() {
    let sizes = ["scale", "one_shot"].map(|method| {
        let key = format!("method = \"{method}\"");
        let folder = scene(&[(ONE_SHOT, &key)]);
        let net = triangulated(folder.path()).unwrap();
        let sizes = net
            .pictures
            .iter()
            .map(|of| of.coefficients[0].hypot(of.coefficients[1]).ln());
        sizes.sum::<f64>() / net.pictures.len() as f64
    });
    // Both stand on the same controls. What ties of 30 m leave would shrink the figure on controls of 800 m by 0.8 %; the bending
    // that their weights allow changes its size by some parts in a hundred thousand.
    let apart = (sizes[1] - sizes[0]).abs();
    assert!(apart < 2e-4, "{apart}");
}

/// A row of the measurements changed by `change`.
fn change(folder: &Path, table: &str, change: impl Fn(usize, Vec<String>) -> Option<Vec<String>>) {
    let path = folder.join("net").join(table);
    let text = fs::read_to_string(&path).unwrap();
    let mut lines = text.lines();
    let mut changed = vec![lines.next().unwrap().to_owned()];
    for (row, line) in lines.enumerate() {
        let cells = line.split(',').map(str::to_owned).collect();
        changed.extend(change(row, cells).map(|cells| cells.join(",")));
    }
    fs::write(path, changed.join("\n") + "\n").unwrap();
}

/// All ticks of the pictures, which are `2 * size` units wide.
fn write_ticks(folder: &Path, size: f64, film: impl Fn(Place) -> Place) {
    let mut ticks = "picture,tick,x,y,known_x,known_y\n".to_owned();
    for picture in 1..=25 {
        for (tick, x, y) in [
            ("lower_left", -1.0, -1.0),
            ("lower_right", 1.0, -1.0),
            ("upper_right", 1.0, 1.0),
            ("upper_left", -1.0, 1.0),
            ("lower", 0.0, -1.0),
            ("upper", 0.0, 1.0),
            ("left", -1.0, 0.0),
            ("right", 1.0, 0.0),
        ] {
            let known = Place::new(x * size, y * size);
            let seen = film(known);
            ticks += &format!(
                "P{picture:02},{tick},{:.12},{:.12},{},{}\n",
                seen.re, seen.im, known.re, known.im
            );
        }
    }
    fs::write(folder.join("net/ticks.csv"), ticks).unwrap();
}

#[test]
fn film_boxes_and_lines_downwards_give_the_same_net() {
    let plain = scene(&[]);
    let expected = triangulated(plain.path()).unwrap();
    let other = scene(&[(
        "files = [\"measurements.csv\"]",
        "files = [\"measurements.csv\"]\ny_axis = \"down\"\n[film]\nfiles = [\"ticks.csv\"]",
    )]);
    // Pictures 8000 units wide, sheared, scaled, and bent by up to 2 units; y counts downwards.
    let size = 8_000.0;
    let bend = CornerZero::new(
        Place::new(-size, -size),
        2.0 * size,
        2.0 * size,
        [[2.0; 2], [-1.5; 2]],
    )
    .unwrap();
    let film = |known: Place| {
        let of = bend.distort(known);
        Place::new(0.013 * of.re + 2e-5 * of.im + 40.0, 0.0131 * of.im - 30.0)
    };
    change(other.path(), "measurements.csv", |_, mut cells| {
        let at = [&cells[2], &cells[3]].map(|cell| cell.parse::<f64>().unwrap());
        let seen = film(Place::new(at[0], -at[1]));
        cells.truncate(2);
        // Boxed by settings on the upper right and the lower left.
        let half = Place::new(0.01, 0.02);
        cells.extend(
            [seen + half, seen - half]
                .iter()
                .flat_map(|of| [of.re, of.im])
                .map(|of| format!("{of:.12}")),
        );
        Some(cells)
    });
    let path = other.path().join("net/measurements.csv");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(
        &path,
        text.replace(
            "picture,point,x,y\n",
            "picture,point,x_upper_right,y_upper_right,x_lower_left,y_lower_left\n",
        ),
    )
    .unwrap();
    write_ticks(other.path(), size, film);
    let found = triangulated(other.path()).unwrap();
    for (point, expected) in found.points.iter().zip(&expected.points) {
        let off = [0, 1].map(|axis| point.place_m[axis] - expected.place_m[axis]);
        // Settings are written to 1e-12 of a film unit of 2 km, coordinates of the plain net to 1e-6 units.
        assert!(off[0].hypot(off[1]) < 1e-3, "{}: {off:?} m", point.point);
    }
}

/// What a net with changed tables or keys is told.
fn refused(replaced: &[(&str, &str)], edit: impl Fn(&Path)) -> String {
    let folder = scene(replaced);
    edit(folder.path());
    let failure = run(folder.path(), false).unwrap_err();
    let path = format!("{}/", folder.path().join("net").display());
    failure.to_string().replace(&path, "")
}

#[test]
fn nets_without_a_solution_are_refused_by_name() {
    let measurements = "measurements.csv";
    let told = [
        (
            "one control",
            refused(&[], |folder| {
                change(folder, "controls.csv", |row, cells| {
                    (row == 0).then_some(cells)
                });
            }),
        ),
        (
            "a picture with one tie",
            refused(&[], |folder| {
                let seen = std::cell::RefCell::new(0);
                change(folder, measurements, |_, cells| {
                    *seen.borrow_mut() += usize::from(cells[0] == "P13");
                    (cells[0] != "P13" || *seen.borrow() == 2).then_some(cells)
                });
            }),
        ),
        (
            "two parts",
            refused(
                &[("[pictures]\nfiles = [\"pictures.csv\"]\n", "")],
                |folder| {
                    // Columns two and three of the grid show no common point any more.
                    change(folder, measurements, |_, mut cells| {
                        let picture: usize = cells[0][1..].parse().unwrap();
                        if (picture - 1) % 5 > 2 {
                            cells[1] = format!("x{}", cells[1]);
                        }
                        Some(cells)
                    });
                },
            ),
        ),
        (
            "equal points",
            refused(&[], |folder| {
                let first = std::cell::RefCell::new(None);
                change(folder, measurements, |_, mut cells| {
                    if cells[0] == "P07" {
                        let mut first = first.borrow_mut();
                        if let Some((x, y)) = &*first {
                            (cells[2], cells[3]) = (String::clone(x), String::clone(y));
                        } else {
                            *first = Some((cells[2].clone(), cells[3].clone()));
                        }
                    }
                    Some(cells)
                });
            }),
        ),
        (
            "equal controls",
            refused(&[], |folder| {
                change(folder, "controls.csv", |_, mut cells| {
                    (cells[1], cells[2]) = ("1.0".to_owned(), "2.0".to_owned());
                    Some(cells)
                });
            }),
        ),
        (
            "a mirrored picture",
            refused(&[], |folder| {
                change(folder, measurements, |_, mut cells| {
                    if cells[0] == "P03" {
                        cells[2] = format!("-{}", cells[2]).replace("--", "");
                    }
                    Some(cells)
                });
            }),
        ),
        (
            "all mirrored",
            refused(
                &[(
                    "files = [\"measurements.csv\"]",
                    "files = [\"measurements.csv\"]\ny_axis = \"down\"",
                )],
                |_| {},
            ),
        ),
        (
            "controls in metres under kilometres",
            refused(&[], |folder| {
                change(folder, "controls.csv", |_, mut cells| {
                    for at in [1, 2] {
                        cells[at] = format!("{}", 1e3 * cells[at].parse::<f64>().unwrap());
                    }
                    Some(cells)
                });
            }),
        ),
        (
            "controls in kilometres under metres",
            refused(&[], |folder| {
                let path = folder.join("net/controls.csv");
                let text = fs::read_to_string(&path).unwrap();
                fs::write(path, text.replace("x_km,y_km", "x_m,y_m")).unwrap();
            }),
        ),
        (
            "controls in miles",
            refused(&[], |folder| {
                let path = folder.join("net/controls.csv");
                let text = fs::read_to_string(&path).unwrap();
                fs::write(path, text.replace("x_km,y_km", "x_miles,y_miles")).unwrap();
            }),
        ),
        (
            "no measurement",
            refused(&[], |folder| change(folder, measurements, |_, _| None)),
        ),
        (
            "no number",
            refused(&[], |folder| {
                change(folder, measurements, |_, mut cells| {
                    cells[2] = "north".to_owned();
                    Some(cells)
                });
            }),
        ),
    ];
    assert_messages("net_refused", &told);
}

#[test]
fn films_without_a_correction_are_refused_by_name() {
    type Row<'a> = &'a dyn Fn(Vec<String>) -> Option<Vec<String>>;
    let told = |of: [&str; 2], edit: Row<'_>| {
        let film = "[film]\nfiles = [\"ticks.csv\"]\n[controls]";
        refused(&[("[controls]", film)], |folder| {
            write_ticks(folder, 8_000.0, |known| known);
            change(folder, "ticks.csv", |_, cells| {
                if [&*cells[0], &*cells[1]] == of || (of[1].is_empty() && cells[0] == of[0]) {
                    edit(cells)
                } else {
                    Some(cells)
                }
            });
        })
    };
    let with = |at: usize, text: &'static str| {
        move |mut cells: Vec<String>| {
            text.clone_into(&mut cells[at]);
            Some(cells)
        }
    };
    let messages = [
        ("a picture without ticks", told(["P07", ""], &|_| None)),
        (
            "a corner tick missing",
            told(["P07", "upper_left"], &|_| None),
        ),
        ("a mid-edge tick missing", told(["P07", "left"], &|_| None)),
        (
            "a tick of another name",
            told(["P07", "upper_left"], &with(1, "top_left")),
        ),
        (
            "a tick in two rows",
            told(["P07", "upper_left"], &with(1, "upper_right")),
        ),
        (
            "a tick without a number",
            told(["P07", "lower_left"], &with(2, "edge")),
        ),
        (
            "two corners at the same place",
            told(["P07", "lower_left"], &|mut cells| {
                (cells[2], cells[3]) = ("8000".to_owned(), "-8000".to_owned());
                Some(cells)
            }),
        ),
        (
            "a mid-edge tick far away",
            told(["P07", "left"], &with(3, "9000")),
        ),
    ];
    assert_messages("net_film_refused", &messages);
}

#[test]
fn every_problem_of_a_net_file_is_told_with_its_place() {
    let bad = "net = \"A Net\"\n[measurements]\nfiles = [\"none.csv\"]\ny_axis = \"left\"\n[map]\nlatitude_deg = 90\n\
               [triangulation]\nmethod = \"one_shot\"\nlocal = \"yes\"\nbrick_pictures = 1\ntie_sigma_m = 0\n\
               [controls]\nlimit = 1.0\n[picture]\n";
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bad.toml");
    let prefix = format!("{}/", folder.path().display());
    let message = |text: &str| {
        NetConfig::parse(text, &path)
            .unwrap_err()
            .to_string()
            .replace(&prefix, "")
    };
    let told = [
        ("everything", message(bad)),
        ("nothing", message("")),
        (
            "advice",
            areograph::error::Error::from(NetConfig::parse("", &path).unwrap_err())
                .to_string()
                .replace(&prefix, ""),
        ),
    ];
    assert_messages("net_bad_keys", &told);
}

#[test]
fn sizes_of_pictures_are_judged_on_the_ground() {
    // 8000 km from the equator Mercator's map is larger than the ground by cosh(8000/3396.19).
    let larger = (8_000.0_f64 / 3_396.19).cosh();
    let folder = scene(&[]);
    change(folder.path(), "controls.csv", |_, mut cells| {
        let y_km: f64 = cells[2].parse().unwrap();
        cells[2] = (y_km + 8_000.0).to_string();
        Some(cells)
    });
    let refused = triangulated(folder.path()).unwrap_err().to_string();
    assert!(refused.contains("m on the ground"), "{refused}");
    change(folder.path(), "pictures.csv", |_, mut cells| {
        let metres: f64 = cells[2].parse().unwrap();
        cells[2] = (metres / larger).to_string();
        Some(cells)
    });
    assert_eq!(triangulated(folder.path()).unwrap().pictures.len(), 25);
}

#[test]
fn rows_that_cannot_be_read_are_told_and_the_others_are_used() {
    let folder = scene(&[]);
    let path = folder.path().join("net/measurements.csv");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, text.clone() + "P01,9999,x,1\nP01,1,2\n").unwrap();
    let net = triangulated(folder.path()).unwrap();
    assert_eq!(net.complaint_count, 2);
    let lines = text.lines().count();
    assert_eq!(
        net.complaints[0],
        format!("measurements.csv line {}: \"x\" is not a number", lines + 1)
    );
    assert!(
        net.verdict
            .remarks
            .contains(&"rows of tables skipped: 2".to_owned())
    );
    let pictures: BTreeMap<&str, u32> = net
        .pictures
        .iter()
        .map(|of| (&*of.picture, of.ties))
        .collect();
    assert_eq!(pictures.len(), 25);
}

#[test]
fn a_file_under_another_key_is_another_net() {
    let folder = scene(&[]);
    let outcome = run(folder.path(), false).unwrap();
    assert!(outcome.manifest().unwrap().counts["controls"] > 0);
    let toml = folder.path().join("net/net.toml");
    let text = fs::read_to_string(&toml).unwrap();
    let net = NetConfig::load(&toml).unwrap().config;
    let moved = net.controls.files[0]
        .file_name()
        .unwrap()
        .to_str()
        .unwrap()
        .to_owned();
    // The same files in the same order, the last table of measurements now one of controls.
    let tables = |text: &str, section: &str| {
        let at = text.find(section).unwrap();
        let start = at + text[at..].find("files = [").unwrap() + "files = [".len();
        (start, start + text[start..].find(']').unwrap())
    };
    let (from, to) = tables(&text, "[controls]");
    let mut changed = format!("{}{}", &text[..from], &text[to..]);
    let (_, end) = tables(&changed, "[measurements]");
    changed.insert_str(end, &format!(", \"{moved}\""));
    fs::write(&toml, changed).unwrap();
    if let Ok(again) = run(folder.path(), false) {
        assert!(!again.is_unchanged());
        assert_ne!(
            again.manifest().unwrap().counts["controls"],
            outcome.manifest().unwrap().counts["controls"]
        );
    }
}

#[test]
fn products_of_something_else_are_left_alone() {
    let folder = scene(&[]);
    let outcome = run(folder.path(), false).unwrap();
    // As if a site of the same name had been published there.
    let path = outcome.folder.join("manifest.json");
    let text = fs::read_to_string(&path).unwrap();
    let other = text.replace("\"triangulate\"", "\"convert_datum\"");
    fs::write(&path, other.replace("\"net\":", "\"site\":")).unwrap();
    let before = fs::read_to_string(&path).unwrap();
    let refused = run(folder.path(), true).unwrap_err().to_string();
    assert!(
        refused.contains("the folder contains other products"),
        "{refused}"
    );
    assert!(refused.contains("created by convert_datum"), "{refused}");
    assert_eq!(fs::read_to_string(&path).unwrap(), before);
    assert!(outcome.folder.join("report/index.html").is_file());
    // Products of a net remain replaceable when its stages have other names.
    fs::write(&path, other).unwrap();
    run(folder.path(), true).unwrap();
}
