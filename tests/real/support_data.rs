//! Images by support data of the Community Sensor Model: those of areograph itself come back, those of ALE are seen as
//! usgscsm sees them, damaged ones are refused with their key.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

use crate::common;
use crate::common::readers;
use areograph_testing::lunar_pair;

use std::{
    fs::{self, File},
    io::Write as _,
    path::{Path, PathBuf},
    process::Stdio,
};

use areograph::{
    geom::{attitude::matrix_of_spice_quaternion, pushbroom::Detector},
    pds::isd::read_isd,
};
use arrow_array::RecordBatch;
use arrow_array::cast::AsArray as _;
use arrow_array::types::{Float64Type, UInt32Type};
use common::{
    case::Case,
    json,
    mission::{areograph, succeed},
    number,
};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use serde_json::{Value, json};

fn table(path: &Path) -> RecordBatch {
    let builder = ParquetRecordBatchReaderBuilder::try_new(File::open(path).unwrap()).unwrap();
    let mut reader = builder.with_batch_size(1 << 20).build().unwrap();
    reader.next().unwrap().unwrap()
}

/// Footprint, line and sample of every row of a registration.
pub(crate) fn places(path: &Path) -> Vec<(u32, [f64; 2])> {
    let table = table(path);
    let rows = table.column_by_name("footprint_row").unwrap();
    let rows = rows.as_primitive::<UInt32Type>();
    let [lines, samples] = ["line", "sample"].map(|name| {
        let column = table.column_by_name(name).unwrap();
        column.as_primitive::<Float64Type>().values().to_vec()
    });
    let places = rows.values().iter().zip(lines).zip(samples);
    places
        .map(|((row, line), sample)| (*row, [line, sample]))
        .collect()
}

/// The pair over Isidis, run by labels and kernels, and its site file with its own support data instead.
pub(crate) fn pair_with_support_data() -> Case {
    let case = Case::pair();
    succeed(&mut case.run());
    fs::rename(case.path("out"), case.path("by_kernels")).unwrap();
    fs::create_dir(case.path("isd")).unwrap();
    for image in ["E02-01301", "E02-02016"] {
        let own = format!("by_kernels/isidis/images/{image}/isd.json");
        fs::copy(case.path(&own), case.path(&format!("isd/{image}.json"))).unwrap();
        case.replace(
            "site.toml",
            &format!("label = \"labels/{image}.lbl\""),
            &format!("isd = \"isd/{image}.json\""),
        );
    }
    case
}

#[test]
fn a_site_of_its_own_support_data_comes_out_as_by_kernels() {
    let case = pair_with_support_data();
    let told = case.outcome(case.run());
    assert!(told.starts_with("exit 0"), "{told}");
    let [by_kernels, by_support] = ["by_kernels", "out"].map(|out| case.path(out).join("isidis"));
    let name = "registration.parquet";
    let [expected, found] = [&by_kernels, &by_support].map(|folder| places(&folder.join(name)));
    assert!(expected.len() > 100);
    assert_eq!(expected.len(), found.len());
    for ((row, expected), (same, found)) in expected.iter().zip(&found) {
        assert_eq!(row, same);
        let apart = [0, 1].map(|axis| (expected[axis] - found[axis]).abs());
        // Pixels: the tables are made to be interpolated within 0.01.
        assert!(apart[0] < 0.01 && apart[1] < 0.01, "{row}: {apart:?}");
    }
    let [expected, found] =
        [&by_kernels, &by_support].map(|folder| json(&folder.join("manifest.json")));
    let figure = |manifest: &Value, name: &str| number(&manifest["figures"][name]);
    // Ranges are not used with such images, heights above MOLA's surface are: metres, a tenth of what is known of them.
    let name = "adjusted_height_off_surface_m";
    assert!(figure(&found, name) < figure(&expected, name) + 1.0);
    assert!(figure(&found, name) < 0.1 * figure(&found, "height_off_surface_m"));
    // What is said of it: nothing is applied, and no kernels are written that would follow none.
    let biases = found["biases"].as_array().unwrap();
    assert!(
        biases.iter().all(|bias| bias["name"] != "ck_bias"),
        "{biases:?}"
    );
    let page = fs::read_to_string(by_support.join("report/index.html")).unwrap();
    assert!(page.contains("Nothing is applied to them"));
    assert!(page.contains("E02-01301.json"), "by name, with its hash");
    assert!(
        by_support
            .join("images/E02-01301/adjusted_isd.json")
            .is_file()
    );
    assert!(by_kernels.join("adjusted/E02-01301.bsp").is_file());
    assert!(!by_support.join("adjusted").join("E02-01301.bsp").exists());
    // A second run keeps everything; one with a changed file reads it again.
    assert_eq!(case.stages_run(), [""; 0]);
    let mut changed = json(&case.path("isd/E02-01301.json"));
    changed["focal_length_model"]["focal_length"] = json!(3500.1);
    case.write("isd/E02-01301.json", changed.to_string());
    let ran = case.stages_run();
    assert_eq!(ran[0], "tag_times/E02-01301");
    assert!(!ran.contains(&"tag_times/E02-02016".to_owned()), "{ran:?}");
}

/// Support data that are not those of their image, and what the message must state.
type Mistake = (&'static str, fn(&mut Value), i32, &'static str);

const MISTAKES: [Mistake; 4] = [
    (
        "rotated by 10 mrad",
        |isd| {
            let turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 0.010);
            for row in isd["instrument_pointing"]["quaternions"]
                .as_array_mut()
                .unwrap()
            {
                let [w, x, y, z] = [0, 1, 2, 3].map(|part| number(&row[part]));
                let turned = turn.into_inner() * Quaternion::new(w, x, y, z);
                *row = json!([turned.w, turned.i, turned.j, turned.k]);
            }
        },
        5,
        "support data and kernels contradict each other in the middle of the image: boresights differ by 10.0",
    ),
    (
        "a kilometre away along each axis",
        |isd| {
            let rows = isd["instrument_position"]["positions"]
                .as_array_mut()
                .unwrap();
            for coordinate in rows.iter_mut().flat_map(|row| row.as_array_mut().unwrap()) {
                // Kilometres.
                *coordinate = json!(number(coordinate) + 1.0);
            }
        },
        5,
        "the spacecraft position in its support data differs by 17",
    ),
    (
        "another detector",
        |isd| {
            let centre = &mut isd["detector_center"]["sample"];
            *centre = json!(number(centre) + 500.0);
        },
        5,
        "its camera differs in detector.boresight_px from the built-in file of MOC narrow angle, although both name \
         the same frame, 7",
    ),
    (
        "those of another image",
        |isd| isd["image_identifier"] = json!("E02-02016"),
        3,
        "the support data belong to product E02-02016; expected E0201301",
    ),
];

#[test]
fn support_data_are_compared_with_the_kernels_shots_and_cameras_beside_them() {
    let case = pair_with_support_data();
    let good = json(&case.path("isd/E02-01301.json"));
    for (mistake, change, code, part) in MISTAKES {
        let mut isd = good.clone();
        change(&mut isd);
        case.write("isd/E02-01301.json", isd.to_string());
        let found = case.outcome(case.run());
        assert!(
            found.starts_with(&format!("exit {code}\n")),
            "{mistake}: {found}"
        );
        assert!(found.contains(part), "{mistake}: {found}");
    }
}

/// Kernels of the spacecraft that do not reach the image contradict nothing: a remark states why they are not compared.
#[test]
fn kernels_that_do_not_cover_an_image_of_support_data_are_a_remark() {
    let case = pair_with_support_data();
    let site = "site = 'alone'\n[kernels]\nmetakernel = 'kernels/nav.tm'\n\
                [[images]]\nid = 'E02-01301'\nisd = 'isd/E02-01301.json'\n";
    case.write("site.toml", site);
    let remark = "its support data are not compared with the kernels";
    let covered = case.outcome(case.run());
    assert!(covered.starts_with("exit 0"), "{covered}");
    assert!(!covered.contains(remark), "{covered}");
    // A year later than the kernels of the mission end.
    let mut isd = json(&case.path("isd/E02-01301.json"));
    let late_s = 365.0 * 86_400.0;
    for key in ["starting_ephemeris_time", "center_ephemeris_time"] {
        isd[key] = json!(number(&isd[key]) + late_s);
    }
    for table in [
        "instrument_position",
        "instrument_pointing",
        "body_rotation",
        "sun_position",
    ] {
        for key in [
            "ck_table_start_time",
            "ck_table_end_time",
            "spk_table_start_time",
            "spk_table_end_time",
        ] {
            if isd[table][key].is_number() {
                isd[table][key] = json!(number(&isd[table][key]) + late_s);
            }
        }
        let times = isd[table]["ephemeris_times"].as_array_mut();
        for time in times.into_iter().flatten() {
            *time = json!(number(time) + late_s);
        }
    }
    case.write("isd/E02-01301.json", isd.to_string());
    let late = case.outcome(case.run());
    assert!(late.starts_with("exit 0"), "{late}");
    assert!(late.contains(remark), "{late}");
}

#[test]
fn images_of_support_data_need_leap_seconds_alone() {
    let case = pair_with_support_data();
    let site = "site = 'alone'\n[kernels]\nfiles = ['kernels/leapseconds.tls']\n\
                [[images]]\nid = 'E02-01301'\nisd = 'isd/E02-01301.json'\n";
    case.write("site.toml", site);
    let checked = case.outcome(case.check());
    assert!(checked.starts_with("exit 0"), "{checked}");
    let told = case.outcome(case.run());
    assert!(told.starts_with("exit 0"), "{told}");
    let [own, again] = ["by_kernels/isidis", "out/alone"]
        .map(|folder| json(&case.path(&format!("{folder}/images/E02-01301/isd.json"))));
    for key in [
        "line_scan_rate",
        "starting_ephemeris_time",
        "focal2pixel_samples",
    ] {
        assert_eq!(own[key], again[key], "{key}");
    }
    assert_eq!(again["name_platform"], own["name_platform"]);
    assert_eq!(again["areograph"]["light_time"]["convention"], "support");
    common::assert_keeps_schema(&again, "isd");
    // Without leap seconds there is no UTC, and that is said.
    case.replace("site.toml", "leapseconds.tls", "mars_iau2000.tpc");
    let told = case.outcome(case.run());
    assert!(told.starts_with("exit ") && told.contains("leap"), "{told}");
}

/// A change of good support data, and what the message must hold.
type Damage = (&'static str, fn(&mut Value), &'static str);

const DAMAGES: [Damage; 17] = [
    (
        "another kind of camera",
        |isd| isd["name_model"] = json!("USGS_ASTRO_FRAME_SENSOR_MODEL"),
        "name_model is \"USGS_ASTRO_FRAME_SENSOR_MODEL\"; expected USGS_ASTRO_LINE_SCANNER_SENSOR_MODEL",
    ),
    (
        "no radii",
        |isd| isd["radii"] = Value::Null,
        "radii is missing; expected an object",
    ),
    (
        "metres for kilometres",
        |isd| isd["radii"]["unit"] = json!("m"),
        "radii are 3.40 and 3.38 km; expected 3396.19",
    ),
    (
        "an unknown unit",
        |isd| isd["radii"]["unit"] = json!("mi"),
        "radii.unit is \"mi\"; expected km or m",
    ),
    (
        "the Moon",
        |isd| isd["radii"] = json!({"semimajor": 1737.4, "semiminor": 1737.4, "unit": "km"}),
        "radii are 1737.40 and 1737.40 km; expected 3396.19 and 3376.20 km, the radii of Mars",
    ),
    (
        "another body",
        |isd| isd["naif_keywords"]["BODY_CODE"] = json!(301),
        "naif_keywords.BODY_CODE is 301; expected 499, Mars",
    ),
    (
        "times that go back",
        |isd| {
            let times = isd["instrument_position"]["ephemeris_times"].as_array_mut();
            times.unwrap().swap(3, 4);
        },
        "instrument_position.ephemeris_times[4] is ",
    ),
    (
        "a row less",
        |isd| {
            let rows = isd["instrument_pointing"]["quaternions"].as_array_mut();
            rows.unwrap().pop();
        },
        "rows, one per entry of ephemeris_times, not ",
    ),
    (
        "a quaternion that is none",
        |isd| isd["body_rotation"]["quaternions"][1] = json!([1.0, 1.0, 0.0, 0.0]),
        "expected unit quaternions (w, x, y, z); the quaternion of row 1 has length 1.414",
    ),
    (
        "a number in words",
        |isd| isd["instrument_position"]["positions"][2][1] = json!("far"),
        "instrument_position.positions[2][1] is \"far\"; expected a finite number",
    ),
    (
        "positions in metres below the ground",
        |isd| isd["instrument_position"]["positions"][2] = json!([1.0, 2.0, 3.0]),
        "expected positions at least 3376.2 km from the centre of the target",
    ),
    (
        "another inertial frame",
        |isd| isd["sun_position"]["reference_frame"] = json!(17),
        "sun_position.reference_frame is 17; expected 1, J2000",
    ),
    (
        "a distortion that nobody here knows",
        |isd| isd["optical_distortion"] = json!({"kaguyalism": {"x": [0.0], "y": [0.0]}}),
        "expected one of the supported distortions radial, transverse and lrolrocnac",
    ),
    (
        "a distortion that lacks a coefficient",
        |isd| {
            let nine = vec![0.0; 9];
            isd["optical_distortion"] = json!({"transverse": {"x": nine, "y": nine}});
        },
        "optical_distortion.transverse.x is [0.0,0.0,0.0,0.0,0.0,0.0,0.0,0.0,0.0]; expected 10 finite numbers",
    ),
    (
        "no lines between pixels",
        |isd| isd["focal2pixel_samples"] = isd["focal2pixel_lines"].clone(),
        "focal2pixel_samples is [",
    ),
    (
        "a clock of another image",
        |isd| {
            let start = isd["starting_ephemeris_time"].as_f64().unwrap();
            isd["starting_ephemeris_time"] = json!(start + 1.0);
        },
        "expected the time of the first line according to line_scan_rate",
    ),
    (
        "more lines than tables",
        |isd| isd["image_lines"] = json!(60_000),
        "expected epochs that cover the whole image, which was exposed from ET ",
    ),
];

#[test]
fn damaged_support_data_are_refused_with_file_key_and_value() {
    let case = pair_with_support_data();
    let site = "site = 'alone'\n[kernels]\nfiles = ['kernels/leapseconds.tls']\n\
                [[images]]\nid = 'E02-01301'\nisd = 'isd/E02-01301.json'\n";
    case.write("site.toml", site);
    let good = json(&case.path("isd/E02-01301.json"));
    let refused = |what: &str, bytes: &[u8], expected: &str| {
        case.write("isd/E02-01301.json", bytes);
        for command in [case.run(), case.check()] {
            let told = case.outcome(command);
            assert!(told.starts_with("exit 3"), "{what}: {told}");
            let place = "alone/tag_times/E02-01301: isd/E02-01301.json: ";
            assert!(told.contains(place), "{what}: {told}");
            assert!(told.contains(expected), "{what}: {told}");
            assert!(told.contains("what to do: "), "{what}: {told}");
        }
    };
    for (what, damage, expected) in DAMAGES {
        let mut isd = good.clone();
        damage(&mut isd);
        assert_ne!(isd, good, "{what}");
        refused(what, isd.to_string().as_bytes(), expected);
    }
    let text = good.to_string();
    refused(
        "cut off",
        &text.as_bytes()[..text.len() / 2],
        "not image support data: EOF",
    );
    refused("a list", b"[1, 2]", "it holds no object");
    refused("no text", &[0xff, 0xfe, 0x00], "not image support data: ");
    let infinite = text.replacen("\"image_lines\":", "\"image_lines\":1e999,\"other\":", 1);
    refused(
        "no number",
        infinite.as_bytes(),
        "not image support data: number out of range",
    );
}

/// Every key of good support data, left out or made a text, is refused or does no harm; nothing panics.
#[test]
fn support_data_without_any_one_key_never_end_in_a_panic() {
    let case = pair_with_support_data();
    let path = case.path("isd/E02-01301.json");
    let good = json(&path);
    let mut pointers = Vec::new();
    for (key, value) in good.as_object().unwrap() {
        pointers.push(vec![key.clone()]);
        for inner in value
            .as_object()
            .into_iter()
            .flat_map(|object| object.keys())
        {
            pointers.push(vec![key.clone(), inner.clone()]);
        }
    }
    let mut refused = 0;
    for pointer in &pointers {
        for left_out in [true, false] {
            let mut isd = good.clone();
            let (last, tables) = pointer.split_last().unwrap();
            let table = tables.iter().fold(&mut isd, |at, key| &mut at[key]);
            let table = table.as_object_mut().unwrap();
            if left_out {
                table.remove(last);
            } else {
                table.insert(last.clone(), json!("text"));
            }
            fs::write(&path, isd.to_string()).unwrap();
            refused += usize::from(read_isd(&path).is_err());
        }
    }
    // Single bits: most hit a digit of some number, which no check can tell.
    let bytes = good.to_string().into_bytes();
    for flip in 0..80_usize {
        let mut damaged = bytes.clone();
        damaged[(flip * 7919 * 31) % bytes.len()] ^= 1 << (flip % 8);
        fs::write(&path, damaged).unwrap();
        let _either = read_isd(&path);
    }
    // Names may be any text, and much of the file is for other readers.
    assert!(refused > 40, "{refused} of {}", 2 * pointers.len());
}

/// The ISD of ALE for HRSC's infrared line `h5270_0000_ir2`, by labels of ISIS.
const HRSC: &str = "ale_mex/isds/mexhrsc_isis_isd.json";

/// Where usgscsm, with the support data, sees what another camera sees at these lines and samples, metres.
fn usgscsm(isd: &Path, question: &[&str], rows: &[Vec<f64>], test: &str) -> Option<Vec<Vec<f64>>> {
    let mut camera = readers::camera(isd, question[0], test)?;
    camera.args(&question[1..]);
    camera.stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut camera = camera.spawn().unwrap();
    let asked: Vec<String> = rows
        .iter()
        .map(|row| {
            let numbers: Vec<String> = row.iter().map(ToString::to_string).collect();
            numbers.join(" ") + "\n"
        })
        .collect();
    let mut to = camera.stdin.take().unwrap();
    let writer = std::thread::spawn(move || to.write_all(asked.concat().as_bytes()).unwrap());
    let answered = camera.wait_with_output().unwrap();
    writer.join().unwrap();
    assert!(answered.status.success(), "{}", isd.display());
    let text = String::from_utf8(answered.stdout).unwrap();
    let numbers = |line: &str| line.split(' ').map(|n| n.parse().unwrap()).collect();
    Some(text.lines().map(numbers).collect())
}

/// A site of one image by support data, run; its folder of products.
fn run_alone(folder: &Path, isd: &Path, leap_seconds: &Path) -> PathBuf {
    let site = format!(
        "site = 'alone'\n[kernels]\nfiles = ['{}']\n[[images]]\nid = 'image'\nisd = '{}'\n\
         [orientation]\nposition_rmse_max_m = 1e5\npointing_rmse_max_arcsec = 3600\n",
        leap_seconds.display(),
        isd.display()
    );
    fs::write(folder.join("site.toml"), site).unwrap();
    let mut run = areograph();
    run.args(["--quiet", "run", "site.toml", "--out", "out"]);
    succeed(run.current_dir(folder));
    folder.join("out/alone")
}

#[test]
fn hrsc_is_seen_as_usgscsm_sees_it() {
    let test = "HRSC by ALE's support data";
    let (Some(isd), Some(leap_seconds)) = (
        common::real_data(HRSC, test),
        common::real_data("mgs_text/naif0012.tls", test),
    ) else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let out = run_alone(folder.path(), &isd, &leap_seconds);
    let own = out.join("images/image/isd.json");
    let written = json(&own);
    // usgscsm wants an identifier, which ALE leaves to its callers.
    let mut named = json(&isd);
    named["image_identifier"] = json!("h5270_0000_ir2");
    let isd = folder.path().join("named.json");
    fs::write(&isd, named.to_string()).unwrap();
    let rows = written["line_scan_rate"].as_array().unwrap();
    assert_eq!(rows.len(), 3, "exposure changes twice: {rows:?}");
    // Lines over all pieces, samples over the line.
    let mut places = Vec::new();
    for line in [
        0.5, 900.0, 5000.0, 6663.2, 6664.9, 6700.0, 11_000.0, 15_087.5,
    ] {
        for sample in [0.5, 300.0, 644.0, 1287.5] {
            places.push(vec![line, sample]);
        }
    }
    for height_m in ["0", "3000"] {
        let Some(ground_m) = usgscsm(&isd, &["image-to-ground", height_m], &places, test) else {
            return;
        };
        for camera in [&isd, &own] {
            let seen = usgscsm(camera, &["ground-to-image"], &ground_m, test).unwrap();
            for (place, seen) in places.iter().zip(&seen) {
                let apart = [0, 1].map(|axis: usize| (place[axis] - seen[axis]).abs());
                // Pixels, as demanded. Between two pieces a line has two times, a thousandth of a line apart.
                let limit = if (6663.0..6666.0).contains(&place[0]) {
                    0.01
                } else {
                    1e-3
                };
                assert!(
                    apart[0] < limit && apart[1] < limit,
                    "{camera:?} {place:?}: {apart:?}"
                );
            }
        }
    }
}

#[test]
fn what_is_wrong_with_real_support_data_is_said() {
    let test = "support data of ALE that contradict themselves";
    for (name, expected) in [
        // The second row of line times lies 98 s behind the middle of the image, not before it.
        (
            "ale_mex/isds/mexhrsc_isd.json",
            "expected epochs that cover the whole image",
        ),
        // The pixel pitch stands where coefficients should; ALE would write the same again.
        (
            "ale_mgs/isds/mgsmocna_isd.json",
            "what to do: configure the image by label and kernels. For MOC, ALE repeats",
        ),
        (
            "ale_mex/isds/mexsrc_isd.json",
            "name_model is \"USGS_ASTRO_FRAME_SENSOR_MODEL\"",
        ),
    ] {
        let Some(path) = common::real_data(name, test) else {
            return;
        };
        let told = read_isd(&path).unwrap_err().to_string();
        assert!(told.contains(expected), "{told}");
    }
}

#[test]
fn the_lunar_pair_is_read_as_its_numbers_stand() {
    let test = "support data of LROC";
    let Some(folder) = common::real_data(lunar_pair::FOLDER, test) else {
        return;
    };
    let path = folder.join("lidarObservationImage1.isd");
    let (support, raw) = (read_isd(&path).unwrap(), lunar_pair::read_json(&path));
    let root = folder.ancestors().nth(2).unwrap();
    let [image, _] = lunar_pair::images(root);
    assert!(
        support
            .radii_m
            .iter()
            .all(|m| (m - 1_737_400.0).abs() < 1e-6)
    ); // metres: rounding
    assert_eq!(
        (support.line_times.lines(), support.samples),
        (52_224, 5064)
    );
    for step in 0..=40 {
        let et_s = image.start_s + f64::from(step) / 40.0 * image.lines * image.period_s;
        let tables = &support.tables;
        let (position_m, velocity_m_s) = tables.position.at(et_s);
        let expected_m = lunar_pair::inertial_position(&raw["instrument_position"], et_s);
        assert!((position_m - expected_m).norm() < 1e-6); // metres: rounding of 1.8e6 m
        let ahead_m = tables.position.at(et_s + 0.5).0 - tables.position.at(et_s - 0.5).0;
        assert!((velocity_m_s - ahead_m).norm() < 0.01); // metres per second: bend of a second
    }
    for (key, table) in [
        ("instrument_pointing", &support.tables.pointing),
        ("body_rotation", &support.tables.body_rotation),
    ] {
        let rows = lunar_pair::vectors(&raw[key]["quaternions"]);
        let times = lunar_pair::times(&raw[key]);
        let row = |row: usize| matrix_of_spice_quaternion(rows[row].clone().try_into().unwrap());
        for after in 1..rows.len() {
            let (before, next) = (row(after - 1), row(after));
            assert!(
                (table.at(times[after]).0 - next).abs().max() < 1e-12,
                "{key} {after}"
            );
            // Half way, half of the turn: elements, to the rounding of times to 6e-8 s.
            let middle = table.at(0.5 * (times[after - 1] + times[after])).0;
            let half = middle * before.transpose();
            let whole = next * before.transpose();
            assert!((half * half - whole).abs().max() < 1e-8, "{key} {after}");
        }
        let constant = raw[key]["constant_rotation"].as_array().unwrap();
        let constant: Vec<f64> = constant.iter().map(number).collect();
        let apart = table.constant - Matrix3::from_row_slice(&constant);
        assert!(apart.abs().max() < 1e-12, "{key}"); // no turn: samples lie along y there
    }
    let detector = Detector::new(&support.instrument, 1, 0, support.samples);
    let focal_length_px = detector.focal_length_px;
    for sample in [0.0, 0.5, 1200.0, 2547.5, 4000.0, 5064.0] {
        // The place of a camera without distortion: samples are counted against its y.
        let y_px = detector.place_px(sample).y;
        let ideal = image
            .detector
            .sample(y_px / focal_length_px * image.detector.focal_length_px);
        assert!((ideal - image.ideal_sample(sample)).abs() < 1e-9); // pixels: rounding
        assert!((detector.sample(y_px) - sample).abs() < 1e-9);
    }
}
