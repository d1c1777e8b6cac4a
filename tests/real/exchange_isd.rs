//! `isd.json` of image M04/02852: field by field beside ALE's, and read by a line scanner of the test's own.
#![allow(clippy::unwrap_used, reason = "helpers of tests may fail loudly")]

use crate::common;
use crate::common::camera_files as pushbroom;
use crate::common::products_site as fixture;

use std::fs;

use areograph::{
    capabilities::write_products,
    config::{ImageConfig, KernelsConfig, OrientationConfig, PointingConfig, usual_instrument},
    geom::light_time::LightTime,
    kernel_source::{KernelList, KernelSource},
    spice::{KernelSet, Session},
    stages::{
        fit_sensor_model::fit_sensor_model, sample_orientation::sample_orientation,
        tag_times::tag_times,
    },
    time::Et,
    units::METRES_PER_KM,
};
use nalgebra::Vector3;
use pushbroom::{Nodes, Pushbroom, matrix, numbers, rows};
use serde_json::Value;

const fn sampling(light_time: LightTime) -> OrientationConfig {
    OrientationConfig {
        intervals: 30,
        light_time,
        position_rmse_max_m: 1.0,
        pointing_rmse_max_rad: 1e-3,
    }
}

/// The site with the real image, its kernels open, and the image support data that was written for it.
struct Real {
    site: fixture::Site,
    session: Session,
    isd: Value,
    /// The file for ISIS and ALE.
    isis: Value,
    _folder: tempfile::TempDir,
}

/// With the positions of ALE.
fn real(test: &str) -> Option<Real> {
    real_with(test, 8, LightTime::Centre)
}

/// The image with another number of summed detectors, and so with other pixels, in the same time.
fn real_with(test: &str, summing: u32, light_time: LightTime) -> Option<Real> {
    let folder = common::real_data("ale_mgs/m0402852", test)?;
    let files = common::m0402852_files(&folder);
    let session = Session::open(&KernelSet::from_files(&files).unwrap()).unwrap();
    let image = ImageConfig {
        id: "m04-02852".to_owned(),
        label: Some(folder.join("m0402852_isis.lbl")),
        ..ImageConfig::default()
    };
    let kernels = KernelsConfig {
        source: KernelSource::Listed(KernelList::Files(files)),
        ..KernelsConfig::default()
    };
    let pointing = PointingConfig {
        ck_bias: Some(usual_instrument().pointing_bias()),
        source: None,
    };
    let mut site = fixture::Site::small();
    site.times = tag_times(&[image], &session).unwrap().remove(0);
    site.times.downtrack_summing = summing;
    site.times.crosstrack_summing = summing;
    site.orientation = sample_orientation(
        &session,
        &site.times,
        &kernels,
        &pointing,
        &sampling(light_time),
    )
    .unwrap();
    site.model = fit_sensor_model(&site.orientation, &sampling(light_time), None).unwrap();
    assert!(site.model.invalid_because.is_empty());
    let folder = tempfile::tempdir().unwrap();
    site.with(true, |site| write_products(folder.path(), site, ""))
        .unwrap();
    let read = |name: &str| common::json(&folder.path().join(name));
    Some(Real {
        site,
        session,
        isd: read("images/m04-02852/isd.json"),
        isis: read("exchange/centre/m04-02852_isd.json"),
        _folder: folder,
    })
}

/// ALE's members that ours differ from on purpose, and why.
const DIFFERENT: [(&str, &str); 16] = [
    (
        "/line_scan_rate/0/2",
        "seconds per image line, 8 detector lines summed: usgscsm multiplies by no summing",
    ),
    (
        "/detector_sample_summing",
        "8, as the label says; ALE's file says 1",
    ),
    (
        "/detector_line_summing",
        "8, as the label says; ALE's file says 1",
    ),
    (
        "/detector_center/line",
        "usgscsm takes the detector's line at 0",
    ),
    (
        "/detector_center/sample",
        "counted from the detector's edge, as usgscsm counts samples",
    ),
    (
        "/starting_detector_sample",
        "counted from 0, as usgscsm counts samples",
    ),
    (
        "/optical_distortion/radial/coefficients/1",
        "no distortion: ALE repeats the pixel pitch here",
    ),
    (
        "/optical_distortion/radial/coefficients/2",
        "no distortion: ALE repeats the pixel pitch here",
    ),
    (
        "/body_rotation",
        "more epochs, beyond both ends; compared as functions of time",
    ),
    (
        "/instrument_pointing/ephemeris_times",
        "from before the first line on: ALE's begin 1.15 s late",
    ),
    (
        "/instrument_pointing/quaternions",
        "compared as functions of time",
    ),
    (
        "/instrument_pointing/angular_velocities",
        "compared as functions of time",
    ),
    (
        "/instrument_pointing/ck_table",
        "names the epochs of this file",
    ),
    (
        "/instrument_position",
        "more epochs, beyond both ends; compared as functions of time",
    ),
    (
        "/sun_position",
        "the epochs of the other tables; compared as functions of time",
    ),
    (
        "/naif_keywords/",
        "only the keywords that the file's numbers come from",
    ),
];

/// Members of `truth` at which `ours` has something else, numbers within rounding.
fn differing(truth: &Value, ours: Option<&Value>, at: &str, found: &mut Vec<String>) {
    match (truth, ours) {
        (Value::Object(members), Some(ours)) => {
            for (key, member) in members {
                differing(member, ours.get(key), &format!("{at}/{key}"), found);
            }
        }
        (Value::Array(items), Some(Value::Array(ours))) if items.len() == ours.len() => {
            for (index, item) in items.iter().enumerate() {
                differing(item, ours.get(index), &format!("{at}/{index}"), found);
            }
        }
        (Value::Number(truth), Some(Value::Number(ours))) => {
            let (truth, ours) = (truth.as_f64().unwrap(), ours.as_f64().unwrap());
            let rounding = match at {
                // ISIS rounds the camera's mounting to 1e-7 rad.
                at if at.contains("constant_rotation") => 1e-7,
                // Seconds, two units in the last place of ET: ALE subtracts epochs.
                "/line_scan_rate/0/1" | "/starting_ephemeris_time" | "/center_ephemeris_time" => {
                    4e-9
                }
                _ => 0.0,
            };
            // Relative: 15 digits.
            if (truth - ours).abs() > rounding + 1e-15 * truth.abs() {
                found.push(at.to_owned());
            }
        }
        (truth, ours) => {
            if ours != Some(truth) {
                found.push(at.to_owned());
            }
        }
    }
}

#[test]
fn two_kernels_of_one_name_keep_their_hashes() {
    let mut site = fixture::Site::small();
    let mut rival = site.kernels[1].clone();
    rival.blake3 = "5".repeat(64);
    site.kernels.push(rival);
    let folder = tempfile::tempdir().unwrap();
    site.with(true, |site| write_products(folder.path(), site, ""))
        .unwrap();
    let text = fs::read(folder.path().join("images/m04-02852/isd.json")).unwrap();
    let isd: Value = serde_json::from_slice(&text).unwrap();
    common::assert_keeps_schema(&isd, "isd");
    let expected: Vec<Value> = site
        .kernels
        .iter()
        .map(|kernel| serde_json::json!({"name": kernel.name, "blake3": kernel.blake3}))
        .collect();
    assert_eq!(isd["areograph"]["kernels"], Value::Array(expected));
}

#[test]
fn camera_keys_are_those_of_ale_but_for_a_list() {
    let test = "image support data beside ALE's";
    let (Some(real), Some(path)) = (
        real_with(test, 8, LightTime::Surface),
        common::real_data("ale_mgs/isds/mgsmocna_isd.json", test),
    ) else {
        return;
    };
    let truth: Value = serde_json::from_slice(&fs::read(path).unwrap()).unwrap();
    let mut found = Vec::new();
    differing(&truth, Some(&real.isis), "", &mut found);
    for at in &found {
        assert!(
            DIFFERENT.iter().any(|(key, _)| at.starts_with(key)),
            "{at} differs"
        );
    }
    for (key, why) in DIFFERENT {
        assert!(
            found.iter().any(|at| at.starts_with(key)),
            "{key} does not differ: {why}"
        );
    }
}

#[test]
fn positions_and_rotations_are_those_of_ale() {
    let test = "tables beside ALE's";
    let (Some(real), Some(path)) = (
        real_with(test, 8, LightTime::Surface),
        common::real_data("ale_mgs/isds/mgsmocna_isd.json", test),
    ) else {
        return;
    };
    let truth: Value = serde_json::from_slice(&fs::read(path).unwrap()).unwrap();
    let worst = |block: &str, key: &str| {
        let ours = Nodes::new(&real.isis[block], key);
        let end_s = ours.et_s[ours.et_s.len() - 1];
        let mut worst = 0.0_f64;
        let theirs = Nodes::new(&truth[block], key);
        for (et_s, theirs) in theirs.et_s.iter().zip(&theirs.values) {
            // ALE's pointing goes on for 1.15 s after the last line.
            if *et_s <= end_s {
                let mine = ours.at(*et_s);
                let apart = if key == "quaternions" {
                    (matrix(&mine) - matrix(theirs)).abs().max()
                } else {
                    (Vector3::from_vec(mine) - Vector3::from_row_slice(theirs)).norm()
                };
                worst = worst.max(apart);
            }
        }
        println!("{block} {key}: {worst:e}");
        worst
    };
    assert!(worst("instrument_position", "positions") < 1e-6); // km
    assert!(worst("instrument_position", "velocities") < 1e-9); // km/s
    assert!(worst("sun_position", "positions") < 1e-1); // km of 2.2e8
    assert!(worst("body_rotation", "quaternions") < 1e-9); // matrix elements
    assert!(worst("body_rotation", "angular_velocities") < 1e-9);
    // Interpolated at ALE's epochs: 0.01 pixels of 8 summed detectors of 3.75e-6 rad.
    assert!(worst("instrument_pointing", "quaternions") < 3e-7);
    // At its own epochs, each file holds what the kernels say.
    for isd in [&real.isis, &truth] {
        let nodes = Nodes::new(&isd["instrument_pointing"], "quaternions");
        let rates = Nodes::new(&isd["instrument_pointing"], "angular_velocities");
        for (index, et_s) in nodes.et_s.iter().enumerate() {
            let exposure = Et::from_seconds(*et_s);
            let lookup = usual_instrument().pointing_bias().lookup(exposure);
            let kernels = real.session.attitude(lookup, exposure, 0.0).unwrap();
            let apart = matrix(&nodes.values[index]) - kernels.inertial_to_bus.matrix();
            assert!(apart.abs().max() < 1e-9, "{et_s}: {apart}"); // matrix elements
            let rate = Vector3::from_row_slice(&rates.values[index]);
            let apart = (rate - kernels.angular_velocity_rad_s).norm();
            assert!(apart < 1e-9, "{et_s}: {apart} rad/s");
        }
    }
}

#[test]
fn image_to_ground_to_image_closes() {
    let Some(real) = real("a line scanner made of isd.json") else {
        return;
    };
    let camera = Pushbroom::new(real.isd);
    let mut worst_px = 0.0_f64;
    for k in 0..=40 {
        let line = camera.lines() * f64::from(k) / 40.0;
        for sample in [0.5, 100.0, camera.samples() - 0.5] {
            let (found_line, found_sample) = camera.image(&camera.ground(line, sample));
            worst_px = worst_px.max((found_line - line).hypot(found_sample - sample));
        }
    }
    println!("closes within {worst_px:e} px");
    assert!(worst_px < 0.01, "{worst_px} px");
}

#[test]
fn the_line_scanner_agrees_with_spice() {
    for (_, light_time) in LightTime::WORDS {
        let Some(real) = real_with("a line scanner beside SPICE", 8, light_time) else {
            return;
        };
        let (stated, rotation, position_m) = beside_spice(&real);
        println!("stated {stated:e} px; rotation {rotation:e}, position {position_m:e} m");
        // 0.01 pixel of 8 summed detectors of 3.75e-6 rad; 0.01 pixel of 11 m on the ground.
        assert!(rotation < 3e-7, "{rotation}");
        assert!(position_m < 0.1, "{position_m} m");
    }
}

/// The stated error, and the largest distances of rotations (elements) and positions from those of the samples.
fn beside_spice(real: &Real) -> (f64, f64, f64) {
    let camera = Pushbroom::new(real.isd.clone());
    let stated = real.isd["areograph"]["interpolation"]["error_max_px"]
        .as_f64()
        .unwrap();
    assert!(stated < 0.01 && real.isd["areograph"]["interpolation"]["within_limit"] == true);
    let (mut rotation, mut position_m) = (0.0_f64, 0.0_f64);
    for sample in &real.site.orientation.samples {
        let (position_km, camera_to_mars) = camera.camera(sample.et.seconds());
        let spice = sample.camera_to_mars.matrix();
        rotation = rotation.max((camera_to_mars - spice).abs().max());
        let apart = METRES_PER_KM * position_km - sample.position.xyz_m;
        position_m = position_m.max(apart.norm());
    }
    // Nothing of the image lies outside the tables: `Nodes::at` would refuse.
    let times = rows(&real.isd["line_scan_rate"]);
    assert_eq!(times.len(), 1);
    let nodes = numbers(&real.isd["instrument_pointing"]["ephemeris_times"]);
    assert!(nodes[0] < camera.time(0.0) && camera.time(camera.lines()) < nodes[nodes.len() - 1]);
    (stated, rotation, position_m)
}

/// Pixels eight times finer want the same attitude eight times better.
#[test]
fn tables_get_the_nodes_that_the_limit_needs() {
    let measured = |summing| {
        let real = real_with("nodes of tables", summing, LightTime::Surface)?;
        let epochs = numbers(&real.isd["instrument_pointing"]["ephemeris_times"]);
        Some((epochs.len(), real.site.orientation.tables.interpolation))
    };
    let (Some((coarse, _)), Some((fine, interpolation))) = (measured(8), measured(1)) else {
        return;
    };
    // Ten lines from node to node, and eight nodes beyond either end.
    assert_eq!(coarse, 1 + 1536_usize.div_ceil(10) + 2 * 8);
    assert_eq!(fine, 1 + 2 * 154 + 2 * 8);
    assert!(interpolation.keeps_limit());
}

#[test]
fn tables_that_cannot_keep_the_limit_make_the_image_invalid() {
    let mut site = fixture::Site::small();
    site.orientation.tables.interpolation.error_max_px = 0.25;
    let model = fit_sensor_model(&site.orientation, &site.config.orientation, None).unwrap();
    let told = "interpolation errors of camera tables reach 0.2500 pixels even with one node per line; \
                limit 0.01 pixels";
    assert!(
        model.invalid_because.contains(&told.to_owned()),
        "{:?}",
        model.invalid_because
    );
    site.model = model;
    let folder = tempfile::tempdir().unwrap();
    site.with(true, |site| write_products(folder.path(), site, ""))
        .unwrap();
    let isd = fs::read(folder.path().join("images/m04-02852/isd.json")).unwrap();
    let isd: Value = serde_json::from_slice(&isd).unwrap();
    let stated = &isd["areograph"]["interpolation"];
    assert_eq!(stated["error_max_px"], 0.25);
    assert_eq!(stated["within_limit"], false);
}
