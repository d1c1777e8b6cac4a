//! From kernels and level-2 files of HRSC to a calibration and back: `run`, `calibrate`, and a site with what it wrote. Kernels and
//! attitudes are those of orbit 5270; the rows of the two stereo lines are made over them, since no whole file of the archive is at hand.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::panic,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::format_push_string,
    reason = "helpers of tests work in temporary folders, may fail loudly, make samples of small numbers, and write short tables"
)]

use crate::common;
use crate::usgscsm;

use std::{fs, path::Path, process::Command};

use areograph::{
    body::Body,
    files::{HashedFile, hash_file},
    geom::ellipsoid::Spherical,
    stages::{camera_lines::LinePixels, line_camera::LineCamera},
};
use areograph_testing::level_2::Level2;
use common::{case::Case, json, mission::succeed, real_data};
use nalgebra::Vector3;

const FOLDER: &str = "ale_mex/h5270_0000_ir2";
const KERNELS: [&str; 7] = [
    "naif0012.tls",
    "pck00009.tpc",
    "MEX_190911_STEP.TSC",
    "MEX_V14.TF",
    "h5270_0000_ir2_0.bsp",
    "h5270_0000_ir2_1.bsp",
    "ATNM_MEASURED_080101_090101_V03_1_sliced_-41001.bc",
];
/// Sums of eight detector pixels and lines: 110 m on the ground, as fine as the test needs.
const SIZE: [u32; 2] = [1200, 648];
/// The stereo lines: the second sees the ground of the first 55 s later.
const LINES: [Level2<'_>; 2] = [
    stereo(
        ["S1", "MEX_HRSC_S1"],
        "2008-02-08T12:08:54.816",
        255_744_600.0,
    ),
    stereo(
        ["S2", "MEX_HRSC_S2"],
        "2008-02-08T12:09:49.816",
        255_744_655.0,
    ),
];
/// Sphere near the ground, and the relief of points over it, metres.
const GROUND_M: [f64; 2] = [3_393_000.0, 800.0];

const fn stereo<'a>(line: [&'a str; 2], utc_start: &'a str, start_et_s: f64) -> Level2<'a> {
    Level2 {
        orbit: "H5270_0000",
        line,
        utc_start,
        start_et_s,
        period_ms: 25.6,
        macro_pixel: 8,
        size: SIZE,
    }
}

fn name(line: &Level2<'_>) -> String {
    format!("{}_{}2", line.orbit, line.line[0]).to_lowercase()
}

/// Kernels, the two images, and a site of them, which was run.
fn oriented(folder: &Path) -> Case {
    let case = Case::empty();
    for name in KERNELS {
        case.write(name, fs::read(folder.join(name)).unwrap());
    }
    let kernels = KERNELS.map(|name| format!("'{name}'")).join(", ");
    let mut site = format!("site = 'hrsc'\nkernels.files = [{kernels}]\n");
    for line in &LINES {
        let name = name(line);
        let file = line.file(|line, sample| (line * 7 + sample * 3) as u8);
        case.write(&format!("{name}.img"), file);
        site += &format!(
            "[[images]]\nid = '{name}'\ninstrument = 'hrsc_{}'\nlabel = '{name}.img'\npixels = '{name}.img'\n",
            line.line[0].to_lowercase()
        );
    }
    case.write("site.toml", site);
    succeed(&mut case.run());
    case
}

/// Where a line sees a place.
fn seen(line: &LineCamera, place_m: &Vector3<f64>) -> Option<[f64; 2]> {
    let camera = &line.camera;
    let seen = line.projector().unwrap().project(place_m).ok()?;
    let focal_px = camera.detector.focal_px(&seen.camera_m).ok()?;
    let at = [
        camera.line_times.line_of_offset(seen.x),
        camera.detector.sample(focal_px.y),
    ];
    camera.shows(at[0], at[1]).then_some(at)
}

/// A place and where both lines measure it.
struct Point {
    index: u32,
    place: Spherical,
    measured: [[f64; 2]; 2],
}

/// Points of the ground that the lines measure `off_px` samples from where the support data have them, as by another mounting.
fn points(lines: &[LineCamera; 2], off_px: [f64; 2]) -> Vec<Point> {
    let point = |index: u32| {
        let [row, column] = [index / 20, index % 20].map(f64::from);
        let ray = lines[0]
            .camera
            .ray((row + 0.5) * 60.0, (column + 0.5) * 32.4);
        // The nearer point of the ray on a sphere whose radius varies from point to point.
        let radius_m = GROUND_M[0] + GROUND_M[1] * (f64::from(index) * 0.7).sin();
        let (from_m, direction) = (ray.position_m, ray.direction());
        let along_m = -from_m.dot(&direction);
        let square_m2 = radius_m.powi(2) - (from_m.norm_squared() - along_m.powi(2));
        let place_m = from_m + (along_m - square_m2.sqrt()) * direction;
        let seen = [seen(&lines[0], &place_m)?, seen(&lines[1], &place_m)?];
        let measured = [0, 1].map(|camera| {
            // As ties are measured: within 0.2 pixels, in no order.
            let noise_px = 0.2 * (f64::from(index * 2) + camera as f64).powi(2).sin();
            let [line, sample] = seen[camera];
            [line - noise_px, sample + off_px[camera] + noise_px]
        });
        Some(Point {
            index,
            place: Spherical::from_xyz_m(&place_m),
            measured,
        })
    };
    (0..400).filter_map(point).collect()
}

/// Tables of tie points and laser points of a calibration.
fn tables(points: &[Point]) -> [String; 2] {
    let mut ties = "point,camera,line,sample\n".to_owned();
    let mut control = "point,camera,line,sample,longitude_deg,latitude_deg,radius_m\n".to_owned();
    for point in points {
        let Point { index, place, .. } = point;
        let at = format!(
            "{},{},{:.4}",
            place.longitude_rad.to_degrees(),
            place.latitude.0.to_degrees(),
            place.radius_m
        );
        for (camera, [line, sample]) in ["s1", "s2"].into_iter().zip(point.measured) {
            match index % 2 {
                0 => ties += &format!("T{index},{camera},{line:.4},{sample:.4}\n"),
                _ => control += &format!("L{index},{camera},{line:.4},{sample:.4},{at}\n"),
            }
        }
    }
    [ties, control]
}

/// The two lines by the support data that a run wrote.
fn lines(case: &Case) -> [LineCamera; 2] {
    LINES.map(|line| {
        let path = case.path(&isd(&line));
        LineCamera::read(&path, line.line[0], Body::Mars).unwrap()
    })
}

fn isd(line: &Level2<'_>) -> String {
    format!("out/hrsc/images/{}/isd.json", name(line))
}

/// Displacement of the samples, which a calibration finds.
const OFF_PX: [f64; 2] = [3.0, -2.0];

/// Calibrates the two lines from simulated points, with laser points or without.
fn calibrate(case: &Case, name: &str, control: &str) -> Command {
    let isd = LINES.each_ref().map(isd);
    let file = format!("{name}.toml");
    case.write(
        &file,
        format!(
            "calibration = '{name}'\n[[cameras]]\nid = 's1'\nisd = '{}'\n[[cameras]]\nid = 's2'\nisd = '{}'\n\
             [ties]\nfiles = ['ties.csv']\n{control}",
            isd[0], isd[1]
        ),
    );
    let mut calibrate = case.areograph();
    calibrate.args(["calibrate", &file, "--out", "out"]);
    calibrate
}

#[test]
fn support_data_of_a_run_are_calibrated_and_used_without_an_edit() {
    let Some(folder) = real_data(FOLDER, "HRSC from kernels to a calibration") else {
        return;
    };
    let case = oriented(&folder);
    let isd = LINES.each_ref().map(isd);
    for (path, line) in isd.iter().zip(&LINES) {
        assert_eq!(json(&case.path(path))["name_sensor"], line.line[1]);
    }
    let (lines, off_px) = (lines(&case), OFF_PX);
    let [ties, control] = tables(&points(&lines, off_px));
    case.write("ties.csv", ties);
    case.write("control.csv", control);
    let control = "[control]\nfiles = ['control.csv']\n";
    succeed(&mut calibrate(&case, "h5270", control));
    assert_eq!(
        json(&case.path("out/h5270/manifest.json"))["verdict"]["valid"],
        true
    );
    // A site by the calibrated support data: their camera differs from the built-in one, as calibrated cameras do.
    let calibrated = ["s1", "s2"].map(|camera| format!("out/h5270/cameras/{camera}/isd.json"));
    case.write(
        "calibrated.toml",
        format!(
            "site = 'calibrated'\nkernels.files = ['naif0012.tls']\n[[images]]\nid = 's1'\nisd = '{}'\n\
             [[images]]\nid = 's2'\nisd = '{}'\n",
            calibrated[0], calibrated[1]
        ),
    );
    let mut run = case.areograph();
    run.args(["run", "calibrated.toml", "--out", "out"]);
    succeed(&mut run);
    for ((path, before), off_px) in calibrated.iter().zip(&lines).zip(off_px) {
        assert!(
            LINES
                .iter()
                .any(|line| json(&case.path(path))["name_sensor"] == line.line[1])
        );
        let after = LineCamera::read(&case.path(path), "line", Body::Mars).unwrap();
        for share in [0.2, 0.5, 0.8] {
            let [line, sample] = [share * f64::from(SIZE[0]), share * f64::from(SIZE[1])];
            let ray = before.camera.ray(line, sample);
            let place_m = ray.position_m + ray.direction() * 370_000.0;
            let [_, now] = seen(&after, &place_m).unwrap();
            // Pixels: control of 100 m, one pixel, in 50 points.
            assert!(
                (now - sample - off_px).abs() < 0.5,
                "{path}: {}",
                now - sample
            );
        }
    }
    applied(&case, &isd);
    used_by_a_site(&case);
    refused(&case, &isd);
}

/// Where support data see points near those that the uncalibrated line sees.
fn seen_by(path: &Path, uncalibrated: &LineCamera) -> Vec<([f64; 2], Vector3<f64>)> {
    let camera = LineCamera::read(path, "line", Body::Mars).unwrap();
    let shares = [0.1, 0.3, 0.5, 0.7, 0.9];
    let places = shares.iter().flat_map(|of_line| {
        shares.map(|share| [of_line * f64::from(SIZE[0]), share * f64::from(SIZE[1])])
    });
    let seen = places.map(|[line, sample]| {
        let ray = uncalibrated.camera.ray(line, sample);
        let place_m = ray.position_m + ray.direction() * 370_000.0;
        (seen(&camera, &place_m).unwrap(), place_m)
    });
    seen.collect()
}

/// The calibration in the support data that a run wrote: orbit and attitude of these, camera of the calibration. Another program
/// reads them as areograph does.
fn applied(case: &Case, isd: &[String; 2]) {
    let mut apply = case.areograph();
    apply.args([
        "calibrate",
        "apply",
        "out/h5270",
        &isd[0],
        &isd[1],
        "--to",
        "applied",
    ]);
    let told = case.outcome(apply);
    assert!(told.starts_with("exit 0"), "{told}");
    for (index, line) in LINES.iter().enumerate() {
        let path = case.path(&format!("applied/{}.json", name(line)));
        let camera = ["s1", "s2"][index];
        let expected = format!(
            "{}.json: camera {camera} of h5270, look directions moved by up to ",
            name(line)
        );
        assert!(told.contains(&expected), "{told}");
        let [before, now, calibrated] = [
            case.path(&isd[index]),
            path.clone(),
            case.path(&format!("out/h5270/cameras/{camera}/isd.json")),
        ];
        let documents = [&before, &now, &calibrated].map(|path| json(path));
        for key in ["instrument_position", "line_scan_rate", "body_rotation"] {
            assert_eq!(documents[0][key], documents[1][key], "{key}");
        }
        for key in ["optical_distortion", "detector_center"] {
            assert_eq!(documents[2][key], documents[1][key], "{key}");
        }
        // The calibration is of another orbit; its own support data are not.
        let [own, applied] = [2, 1].map(|at| documents[at]["areograph_calibration"].clone());
        for key in ["calibration", "camera", "verdict"] {
            assert_eq!(own[key], applied[key], "{key}");
        }
        assert_eq!(
            [&own["is_of_other_orbit"], &applied["is_of_other_orbit"]],
            [&serde_json::Value::Null, &serde_json::Value::Bool(true)]
        );
        let uncalibrated = LineCamera::read(&before, "line", Body::Mars).unwrap();
        let places = seen_by(&now, &uncalibrated);
        let ground_m: Vec<_> = places.iter().map(|(_, place_m)| *place_m).collect();
        let Some(others) = usgscsm::seen(&now, &ground_m, "calibrated support data in usgscsm")
        else {
            continue;
        };
        for (([line, sample], _), other) in places.iter().zip(others) {
            // As for uncalibrated support data: interpolation, and the iterations of both programs.
            let off_px = (line - other[0]).hypot(sample - other[1]);
            assert!(
                off_px < usgscsm::LIMIT_PX,
                "{off_px} px at {line}, {sample}"
            );
        }
    }
}

/// Labels and kernels with the calibrated cameras see as the support data to which the calibration was applied.
fn used_by_a_site(case: &Case) {
    let site = String::from_utf8(case.read("site.toml")).unwrap();
    let site = site.replace("site = 'hrsc'", "site = 'with'");
    case.write("with.toml", site + "[calibration]\nfrom = 'out/h5270'\n");
    let mut run = case.areograph();
    run.args(["run", "with.toml", "--out", "out"]);
    succeed(&mut run);
    // Mounting and orbit of the calibrated images are not separated: positions in other orbits are less accurate than stated.
    let verdict = &json(&case.path("out/with/manifest.json"))["verdict"];
    let expected = "contain the mean error of the calibrated orbit, which the stated standard deviations do not include";
    assert!(
        verdict["remarks"].to_string().contains(expected),
        "{verdict}"
    );
    for line in &LINES {
        let own = case.path(&format!("out/with/images/{}/isd.json", name(line)));
        assert_eq!(json(&own)["areograph_calibration"]["calibration"], "h5270");
        let applied = case.path(&format!("applied/{}.json", name(line)));
        let uncalibrated = LineCamera::read(&case.path(&isd(line)), "line", Body::Mars).unwrap();
        let both = seen_by(&own, &uncalibrated)
            .into_iter()
            .zip(seen_by(&applied, &uncalibrated));
        for ((own, _), (applied, _)) in both {
            // Both tables of the orientation are interpolated.
            let off_px = (own[0] - applied[0]).hypot(own[1] - applied[1]);
            assert!(
                off_px < usgscsm::LIMIT_PX,
                "{off_px} px: {own:?} {applied:?}"
            );
        }
    }
}

/// Calibrations of another line, damaged ones and invalid ones, each by its name.
fn refused(case: &Case, isd: &[String; 2]) {
    let applied = |folder: &str, isd: &str| {
        let mut apply = case.areograph();
        apply.args(["calibrate", "apply", folder, isd, "--to", "refused"]);
        let told = case.outcome(apply);
        assert!(!case.path("refused").exists(), "{told}");
        told
    };
    let told = applied("out/hrsc", &isd[0]);
    assert!(
        told.contains("out/hrsc holds no calibrated cameras"),
        "{told}"
    );
    let told = applied("out/absent", &isd[0]);
    assert!(told.contains("out/absent"), "{told}");
    // A line that the calibration does not contain.
    let text = String::from_utf8(case.read(&isd[0])).unwrap();
    case.write("other.json", text.replace("MEX_HRSC_S1", "MEX_HRSC_IR"));
    let told = applied("out/h5270", "other.json");
    let expected = "other.json: the calibration has no camera MEX_HRSC_IR, only MEX_HRSC_S1, MEX_HRSC_S2; expected a calibration of the line";
    assert!(told.contains(expected), "{told}");
    // Products of a run and files of other programs are not replaced.
    let to = |folder: &str| {
        let mut apply = case.areograph();
        apply.args(["calibrate", "apply", "out/h5270", &isd[0], "--to", folder]);
        case.outcome(apply)
    };
    let printed = to("out/h5270/cameras/s1");
    assert!(printed.contains("in the products of a run"), "{printed}");
    fs::create_dir(case.path("own")).unwrap();
    case.write(&format!("own/{}.json", name(&LINES[0])), "{}");
    let printed = to("own");
    let expected = "exists, and is not calibrated support data";
    assert!(printed.contains(expected), "{printed}");
    // Support data have their own camera: a calibration would change nothing.
    let site = String::from_utf8(case.read("calibrated.toml")).unwrap();
    case.write(
        "unused.toml",
        site.replace("site = 'calibrated'", "site = 'unused'")
            + "[calibration]\nfrom = 'out/h5270'\n",
    );
    let mut run = case.areograph();
    run.args(["run", "unused.toml", "--out", "out"]);
    let printed = case.outcome(run);
    let expected = "calibration.from applies to no image of the site";
    assert!(printed.contains(expected), "{printed}");
    // Without laser points the pointing is not determined.
    let told = case.outcome(calibrate(case, "ties_only", ""));
    assert!(told.contains("ties_only: INVALID"), "{told}");
    let told = applied("out/ties_only", &isd[0]);
    let expected = "the calibration ties_only is invalid; expected a valid calibration";
    assert!(
        told.contains("isd.json") && told.contains(expected),
        "{told}"
    );
    // One digit of a calibrated camera.
    let path = "out/h5270/cameras/s1/isd.json";
    let text = String::from_utf8(case.read(path)).unwrap();
    let at = text.find("\"sample\": ").unwrap() + 10;
    let digit = text[at..]
        .find(|letter: char| letter.is_ascii_digit())
        .unwrap()
        + at;
    let changed = if &text[digit..=digit] == "9" {
        "8"
    } else {
        "9"
    };
    case.write(
        path,
        format!("{}{changed}{}", &text[..digit], &text[digit + 1..]),
    );
    let told = applied("out/h5270", &isd[0]);
    assert!(told.contains("cameras/s1/isd.json"), "{told}");
    let mut run = case.areograph();
    run.args(["run", "with.toml", "--out", "out"]);
    let told = case.outcome(run);
    assert!(
        told.contains("with/tag_times") && told.contains("cameras/s1/isd.json"),
        "{told}"
    );
}

fn hashed(case: &Case, line: &Level2<'_>) -> HashedFile {
    let path = case.path(&format!("{}.img", name(line)));
    let (blake3, bytes) = hash_file(&path).unwrap();
    HashedFile {
        path,
        bytes,
        blake3,
    }
}

/// The pixels of the lines in files of the archive, which state the line and the time of their image.
#[test]
fn level_2_files_are_the_pixels_of_their_own_line_only() {
    let Some(folder) = real_data(FOLDER, "level-2 files as pixels of a calibration") else {
        return;
    };
    let case = oriented(&folder);
    let lines = lines(&case);
    let files = LINES.each_ref().map(|line| hashed(&case, line));
    let own = LinePixels::of(files.to_vec());
    assert_eq!(own.decoded(&lines).unwrap().len(), 2);
    let [first, second] = files;
    let exchanged = LinePixels::of(vec![second, first]);
    let told = exchanged.decoded(&lines).unwrap_err().to_string();
    assert!(
        told.contains(
            "camera S1: its pixels belong to MEX_HRSC_S2; expected MEX_HRSC_S1, the sensor of its support data"
        ),
        "{told}"
    );
    let refused = |file: Vec<u8>| {
        let path = case.path(&format!("{}.img", name(&LINES[0])));
        fs::write(path, file).unwrap();
        let files = LINES.each_ref().map(|line| hashed(&case, line));
        LinePixels::of(files.to_vec())
            .decoded(&lines)
            .unwrap_err()
            .to_string()
    };
    let later = Level2 {
        start_et_s: LINES[0].start_et_s + 2.0,
        ..LINES[0]
    };
    let told = refused(later.file(|line, sample| (line + sample) as u8));
    let expected = "camera S1: the exposure of its pixels begins at ET 255744602.000 s; expected 255744600.000 s, as in \
                    its support data";
    assert!(told.contains(expected), "{told}");
    // A line that no camera has.
    let unknown = Level2 {
        line: ["S1", "MEX_HRSC_S9"],
        ..LINES[0]
    };
    let told = refused(unknown.file(|line, sample| (line + sample) as u8));
    let expected = "instrument is \"HRSC MEX_HRSC_S9\"; expected MOC-NA, ";
    assert!(told.contains(expected), "{told}");
}

/// The orbits of Mars Express are less accurate than those of the spacecraft with the laser, which its file states.
#[test]
fn a_site_has_the_accuracy_of_its_spacecraft() {
    let Some(folder) = real_data(FOLDER, "accuracy of Mars Express") else {
        return;
    };
    let case = oriented(&folder);
    let mut ties = "point_id,serial_number,sample,line\n".to_owned();
    for point in points(&lines(&case), [0.0; 2]).iter().step_by(9) {
        for (line, [at_line, sample]) in LINES.iter().zip(point.measured) {
            ties += &format!("T{},{},{sample:.4},{at_line:.4}\n", point.index, name(line));
        }
    }
    case.write("site_ties.csv", ties);
    case.replace(
        "site.toml",
        "[[images]]\nid = 'h5270_0000_s12'",
        "[ties]\nfiles = ['site_ties.csv']\n[[images]]\nid = 'h5270_0000_s12'",
    );
    let stated = |keys: &str| {
        if !keys.is_empty() {
            case.replace(
                "site.toml",
                "[ties]",
                &format!("[adjustment]\n{keys}\n[ties]"),
            );
        }
        let told = case.outcome(case.run());
        assert!(!told.contains("withheld"), "{told}");
        let document = json(&case.path("out/hrsc/adjustment.json"));
        let configured = document["configured"]["adjustment"].clone();
        let page = fs::read_to_string(case.path("out/hrsc/report/index.html")).unwrap();
        let axis = page.split("largest semi-axis ").nth(1).unwrap();
        let axis_m: f64 = axis.split(' ').next().unwrap().parse().unwrap();
        (configured, axis_m)
    };
    let (configured, axis_m) = stated("");
    assert_eq!(
        configured["position_sigma_m"],
        serde_json::json!([1000.0, 100.0, 0.0])
    );
    let own_arcsec = configured["rotation_sigma_rad"][0]
        .as_f64()
        .unwrap()
        .to_degrees()
        * 3600.0;
    assert!((own_arcsec - 90.0).abs() < 1e-9); // arc seconds, 25 mdeg
    // Metres: two images of 1000 m each have a common error of 700 m at least.
    assert!((700.0..3_000.0).contains(&axis_m), "{axis_m}");
    // What a site states precedes.
    let (configured, axis_m) =
        stated("position_sigma_m = [25.0, 0.2, 0.0]\nrotation_sigma_arcsec = [82.5, 2.0, 2.0]");
    assert_eq!(configured["position_sigma_m"][0], 25.0);
    assert!(axis_m < 300.0, "{axis_m}");
}
