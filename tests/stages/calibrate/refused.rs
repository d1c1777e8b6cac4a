//! Input that is damaged, exchanged, turned or too coarse: refused or marked, never valid with a wrong answer.

use std::{fs, path::Path};

use areograph::{
    config::{CalibrationConfig, Document as _},
    error::Error,
    stages::calibrate::PointKind,
};

use super::{
    SAMPLES, all_errors_m, calibrated, common::golden::assert_messages, edited, errors_m, replace,
    rms, run, scene, truth,
};

const TIES: &str = "i864_ties.csv";
const CONTROL: &str = "i864_control.csv";
const TABLES: [&str; 2] = [TIES, CONTROL];
const LINES: f64 = 20_000.0;

/// What input that was changed is told.
fn refused(replaced: &[(&str, &str)], edit: impl Fn(&Path)) -> String {
    let folder = scene(replaced);
    edit(folder.path());
    match run(folder.path(), false) {
        Err(failure) => {
            let path = format!("{}/", folder.path().join("lines").display());
            failure.to_string().replace(&path, "")
        }
        Ok(outcome) => {
            let verdict = &outcome.manifest().unwrap().verdict;
            assert!(!verdict.valid, "{verdict:?}");
            format!("{}: {}", verdict.word(), verdict.reasons.join("; "))
        }
    }
}

/// The same with a change of every row of some tables.
fn refused_rows(files: &[&str], change: impl Fn(&mut Vec<String>)) -> String {
    refused(&[], |folder| {
        for file in files {
            edited(folder, file, |_, cells| change(cells));
        }
    })
}

/// A cell of a row as another number.
fn number(cells: &mut [String], column: usize, of: impl Fn(f64) -> f64) {
    cells[column] = format!("{:.9}", of(cells[column].parse().unwrap()));
}

/// The names of the lines of the camera exchanged.
fn exchange(cells: &mut [String]) {
    let other = if cells[1] == "s1" { "s2" } else { "s1" };
    other.clone_into(&mut cells[1]);
}

#[test]
fn cameras_that_are_exchanged_or_turned_are_refused() {
    let told = [
        (
            "exchanged support data",
            refused(
                &[
                    ("isd/i864_s1.json", "isd/other.json"),
                    ("isd/i864_s2.json", "isd/i864_s1.json"),
                    ("isd/other.json", "isd/i864_s2.json"),
                ],
                |_| {},
            ),
        ),
        (
            "lines exchanged in the ties",
            refused_rows(&[TIES], |cells| exchange(cells)),
        ),
        (
            "lines exchanged in the control",
            refused_rows(&[CONTROL], |cells| exchange(cells)),
        ),
        (
            "samples of one line from the other edge",
            refused_rows(&TABLES, |cells| {
                if cells[1] == "s1" {
                    number(cells, 3, |sample| SAMPLES - sample);
                }
            }),
        ),
        (
            "samples of both from the other edge",
            refused_rows(&TABLES, |cells| number(cells, 3, |sample| SAMPLES - sample)),
        ),
        (
            "rows of both from the other end",
            refused_rows(&TABLES, |cells| number(cells, 2, |line| LINES - line)),
        ),
        (
            "row and sample exchanged",
            refused_rows(&TABLES, |cells| cells.swap(2, 3)),
        ),
        (
            "a camera that there is none of",
            refused(&[], |folder| {
                replace(folder, TIES, &[("T001,s1", "T001,nd")]);
            }),
        ),
        (
            "one image twice",
            refused(
                &[("isd = \"isd/i864_s2.json\"", "isd = \"isd/i864_s1.json\"")],
                |_| {},
            ),
        ),
        (
            "another mounting in another orbit",
            refused(&[], |folder| {
                replace(
                    folder,
                    "isd/i818_s1.json",
                    &[("\"focal_length\":175.0", "\"focal_length\":174.0")],
                );
            }),
        ),
        (
            "another orbit without one of the lines",
            refused(&[("isd/i818_*.json", "isd/i818_s1.json")], |_| {}),
        ),
    ];
    assert_messages("calibration_exchanged", &told);
}

#[test]
fn damaged_support_data_are_refused() {
    let isd = |was: &'static str, is: &'static str| {
        refused(&[], |folder| {
            replace(folder, "isd/i864_s2.json", &[(was, is)]);
        })
    };
    let told = [
        (
            "cut off",
            refused(&[], |folder| {
                let path = folder.join("lines/isd/i864_s2.json");
                let text = fs::read_to_string(&path).unwrap();
                let some = text.find(',').unwrap();
                fs::write(&path, &text[..some]).unwrap();
            }),
        ),
        ("of the Moon", isd("\"BODY_CODE\":499", "\"BODY_CODE\":301")),
        (
            "at the Moon",
            refused(&[("[ties]", "[solution]\norder = 2\n\n[ties]")], |folder| {
                let path = folder.join("lines/calibration.toml");
                let text = fs::read_to_string(&path).unwrap();
                fs::write(&path, format!("body = \"moon\"\n{text}")).unwrap();
            }),
        ),
        (
            "looking backwards",
            isd("\"focal_length\":175.0", "\"focal_length\":-175.0"),
        ),
        (
            "samples the other way",
            isd(
                "\"focal2pixel_samples\":[0.0,0.0,71",
                "\"focal2pixel_samples\":[0.0,0.0,-71",
            ),
        ),
        (
            "no positions",
            isd("\"instrument_position\"", "\"instrument_positions\""),
        ),
        (
            "a position that is no number",
            isd("\"positions\":[[", "\"positions\":[[null,0.0,0.0],["),
        ),
    ];
    assert_messages("calibration_damaged_isd", &told);
}

#[test]
fn control_and_ties_that_cannot_tell_are_refused_or_marked() {
    let emptied = |file: &'static str| {
        refused(&[], |folder| {
            let path = folder.join("lines").join(file);
            let text = fs::read_to_string(&path).unwrap();
            fs::write(&path, text.lines().next().unwrap().to_owned() + "\n").unwrap();
        })
    };
    let told = [
        ("no ties", emptied(TIES)),
        ("no control in the table", emptied(CONTROL)),
        (
            "no table",
            refused(&[("i864_control.csv", "nowhere.csv")], |_| {}),
        ),
        (
            "an empty file",
            refused(&[], |folder| {
                fs::write(folder.join("lines").join(CONTROL), "").unwrap();
            }),
        ),
        (
            "a column missing",
            refused(&[], |folder| {
                replace(folder, CONTROL, &[("radius_m", "height_m")]);
            }),
        ),
        (
            "no numbers",
            refused_rows(&[TIES], |cells| "nan".clone_into(&mut cells[2])),
        ),
        (
            "heights for radii",
            refused_rows(&[CONTROL], |cells| {
                number(cells, 6, |radius| radius - 3.396e6);
            }),
        ),
        (
            "radii in kilometres",
            refused_rows(&[CONTROL], |cells| number(cells, 6, |radius| radius / 1e3)),
        ),
        (
            "latitudes with the other sign",
            refused_rows(&[CONTROL], |cells| number(cells, 5, |latitude| -latitude)),
        ),
        (
            "longitudes west",
            refused_rows(&[CONTROL], |cells| number(cells, 4, |longitude| -longitude)),
        ),
        (
            "control of another orbit",
            refused(
                &[("[\"i864_control.csv\"]", "[\"i818_control.csv\"]")],
                |_| {},
            ),
        ),
        (
            "ties of another orbit",
            refused(&[("[\"i864_ties.csv\"]", "[\"i818_ties.csv\"]")], |_| {}),
        ),
        (
            "control six kilometres off",
            refused(
                &[("sigma_px = 1.0", "sigma_px = 1.0\nlimit_px = 1000.0")],
                |folder| {
                    edited(folder, CONTROL, |_, cells| {
                        number(cells, 4, |longitude| longitude + 0.12);
                    });
                },
            ),
        ),
        (
            "control that is known to 10 km",
            refused(
                &[("sigma_horizontal_m = 100.0", "sigma_horizontal_m = 1e4")],
                |_| {},
            ),
        ),
        (
            "control that is coarser than what was known",
            refused(
                &[
                    ("sigma_horizontal_m = 100.0", "sigma_horizontal_m = 3e3"),
                    ("[control]", "[a_priori]\norbit_bias_m = 100\n\n[control]"),
                ],
                |folder| keep(folder, |point, _| point < 24),
            ),
        ),
        (
            "control that is worse than is said",
            refused(&[], |folder| scatter(folder, 2_000.0)),
        ),
        (
            "a second camera without ties",
            refused_rows(&[TIES], |cells| {
                if cells[1] == "s2" && !cells[0].ends_with("00") {
                    "x".clone_into(&mut cells[2]);
                }
            }),
        ),
        (
            "control in the first line alone",
            refused_rows(&[CONTROL], |cells| {
                if cells[1] == "s2" {
                    "x".clone_into(&mut cells[2]);
                }
            }),
        ),
        (
            "six points of control",
            refused(&[], |folder| keep(folder, |point, _| point < 6)),
        ),
    ];
    assert_messages("calibration_refused", &told);
}

/// What is wrong in all laser points alike, another orbit tells.
#[test]
fn control_that_is_shifted_is_told_by_another_orbit() {
    let told = refused(&[], |folder| {
        edited(folder, CONTROL, |_, cells| {
            number(cells, 4, |longitude| longitude + 0.05);
        });
    });
    println!("{told}");
    assert!(
        told.contains("orbit i818: control in plan (camera s1)")
            && told.contains("a deterioration of more"),
        "{told}"
    );
}

/// What a calibration was made from cannot judge it, nor can an orbit without points.
#[test]
fn another_orbit_must_be_another_and_have_points() {
    let same = refused(&[("[\"i818_ties.csv\"]", "[\"i864_ties.csv\"]")], |_| {});
    assert!(same.contains("i864_ties.csv is identical"), "{same}");
    for (file, expected) in [
        ("i818_control.csv", "control points are usable"),
        ("i818_ties.csv", "usable tie points link camera s1"),
    ] {
        let told = refused(&[], |folder| {
            let path = folder.join("lines").join(file);
            let text = fs::read_to_string(&path).unwrap();
            fs::write(&path, text.lines().next().unwrap().to_owned() + "\n").unwrap();
        });
        assert!(told.contains("i818") && told.contains(expected), "{told}");
    }
}

/// Under two names a shot would make the calibration and judge it.
#[test]
fn shots_under_another_name_count_once() {
    let folder = scene(&[]);
    let once = calibrated(folder.path()).unwrap();
    let path = folder.path().join("lines").join(CONTROL);
    let text = fs::read_to_string(&path).unwrap();
    let again = text.lines().skip(1).map(|row| format!("again_{row}\n"));
    fs::write(&path, text.clone() + &again.collect::<String>()).unwrap();
    let twice = calibrated(folder.path()).unwrap();
    assert_eq!(twice.held_back, once.held_back);
    let names = twice.points.iter().filter(|of| of.kind != PointKind::Tie);
    assert_eq!(
        twice.complaint_count,
        once.complaint_count + names.count() as u64
    );
    let told = &twice.complaints[once.complaints.len()];
    assert!(told.contains("duplicates it"), "{told}");
}

/// Control scattered by so many metres, the same on every machine.
fn scatter(folder: &Path, by_m: f64) {
    let noise = |row: usize, axis: usize| {
        // Uniform with a standard deviation of 1: both rows of a point have the same.
        let turned = (row as f64 / 2.0)
            .floor()
            .mul_add([0.754_877_67, 0.569_840_29][axis], 0.3);
        3_f64.sqrt() * (2.0 * turned.fract() - 1.0)
    };
    edited(folder, CONTROL, |row, cells| {
        let metre_deg = (1.0 / 3.396e6_f64).to_degrees();
        number(cells, 4, |longitude| {
            // At 33 degrees south.
            longitude + by_m * noise(row, 0) * metre_deg / 33_f64.to_radians().cos()
        });
        number(cells, 5, |latitude| {
            latitude + by_m * noise(row, 1) * metre_deg
        });
    });
}

/// Keeps rows of control by the number of the point and the row in its image.
fn keep(folder: &Path, kept: impl Fn(usize, f64) -> bool) {
    let path = folder.join("lines").join(CONTROL);
    let text = fs::read_to_string(&path).unwrap();
    let rows = text.lines().enumerate().filter(|(row, text)| {
        let line = text.split(',').nth(2).unwrap().parse().unwrap_or(0.0);
        *row == 0 || kept((row - 1) / 2, line)
    });
    let rows: Vec<&str> = rows.map(|(_, text)| text).collect();
    fs::write(&path, rows.join("\n") + "\n").unwrap();
}

/// Little control, coarse control, control in one place: whatever is called valid is as good as it says at points of the truth.
#[test]
fn what_is_valid_is_as_good_as_it_says() {
    let coarse = |sigma_m: f64| {
        let folder = scene(&[(
            "sigma_horizontal_m = 100.0",
            &format!("limit_px = 2000.0\nsigma_horizontal_m = {sigma_m:?}"),
        )]);
        scatter(folder.path(), sigma_m);
        folder
    };
    let kept = |kept: fn(usize, f64) -> bool| {
        let folder = scene(&[]);
        keep(folder.path(), kept);
        folder
    };
    let cases = [
        ("control to 500 m", coarse(500.0)),
        ("control to 2 km", coarse(2_000.0)),
        ("control to 3 km", coarse(3_000.0)),
        ("control in the first fifth", kept(|_, line| line < 4_000.0)),
        (
            "control in both ends",
            kept(|_, line| !(2_000.0..18_000.0).contains(&line)),
        ),
        ("24 points of control", kept(|point, _| point < 24)),
    ];
    let mut valid = 0;
    for (what, folder) in cases {
        let found = calibrated(folder.path()).unwrap();
        // Standard deviations of single points may be withheld.
        let errors = all_errors_m(&found, &truth(folder.path()), PointKind::Tie);
        let of = found.held_back.as_ref().unwrap();
        let [plane_m, height_m] = [of.accuracy_plane_m, of.accuracy_height_m].map(Option::unwrap);
        let ratio = [
            rms(errors.iter().map(|(error_m, _)| error_m.xy().norm())) / plane_m,
            rms(errors.iter().map(|(error_m, _)| error_m.z)) / height_m,
        ];
        println!(
            "{what}: valid {}, {plane_m:.0} m and {height_m:.0} m stated, errors over that {ratio:.2?} {:?}",
            found.verdict.valid, found.verdict.reasons
        );
        if found.verdict.valid {
            valid += 1;
            // One draw of some parameters that all points share: of a normal number one in a hundred is beyond 2.6.
            assert!(ratio.iter().all(|ratio| *ratio < 2.6), "{what}: {ratio:?}");
        }
    }
    // Those that say how coarse they are can be used.
    assert!(valid >= 3, "{valid}");
}

/// Files that lost or changed some bytes: an error or a verdict, and numbers only.
#[test]
fn files_that_lost_some_bytes_are_told_or_harmless() {
    let files = [TIES, CONTROL, "isd/i864_s1.json", "isd/i864_s2.json"];
    let (mut told, mut marked, mut valid) = (0, 0, 0);
    for turn in 0..24_usize {
        let folder = scene(&[]);
        let path = folder.path().join("lines").join(files[turn % files.len()]);
        let mut bytes = fs::read(&path).unwrap();
        // Multiples of the golden section: everywhere in the file.
        let share = (turn as f64 * 0.618_033_988_7).fract();
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a place in a file"
        )]
        let at = (share * (bytes.len() - 40) as f64) as usize;
        match turn / files.len() % 3 {
            0 => drop(bytes.drain(at..at + 30)),
            1 => bytes[at..at + 8].fill(0xff),
            _ => bytes.truncate(at),
        }
        fs::write(&path, bytes).unwrap();
        let Ok(outcome) = run(folder.path(), false) else {
            told += 1;
            continue;
        };
        let result = fs::read_to_string(outcome.folder.join("calibration.json")).unwrap();
        // JSON has no NaN: serde writes null.
        assert!(
            !result.contains("null") && !result.contains("NaN"),
            "turn {turn}"
        );
        if !outcome.manifest().unwrap().verdict.valid {
            marked += 1;
            continue;
        }
        valid += 1;
        let found = calibrated(folder.path()).unwrap();
        let height_m = rms(errors_m(&found, &truth(folder.path()), PointKind::Tie)
            .iter()
            .map(|of| of[0].z));
        // The size of a result from whole files, and some more for points that are gone.
        assert!(height_m < 100.0, "turn {turn}: {height_m} m");
    }
    println!("{told} told, {marked} marked, {valid} valid");
    // Half of the turns damage tables, whose other rows are good; the others support data, which are refused.
    assert!(
        told >= 8 && valid >= 4,
        "{told} told, {marked} marked, {valid} valid"
    );
}

#[test]
fn keys_that_are_wrong_are_told_at_once() {
    let text = "calibration = \"Lines 1\"\nbody = \"venus\"\n[[cameras]]\nid = \"s1\"\nisd = \"nowhere.json\"\n[[cameras]]\n\
                id = \"s1\"\n[solution]\norder = 7\nmode = \"free\"\n[control]\nheld_back_every = 1\n";
    let problems = CalibrationConfig::parse(text, Path::new("calibration.toml")).unwrap_err();
    let told = Error::new(problems).to_string();
    let folder = std::env::current_dir().unwrap();
    let told = told.replace(&format!("{}/", folder.display()), "");
    assert_messages("calibration_bad_keys", &[("wrong keys", told)]);
}
