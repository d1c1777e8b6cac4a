//! The synthetic mission, read back by CSPICE and by a decoding of its own.

#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    reason = "helpers of tests may panic, and files in a temporary folder need no atomic writer"
)]

use crate::common;

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    sync::LazyLock,
};

use areograph::{
    body::Body,
    body::{Datum, MARS_IAU2000},
    config::{Document as _, SiteConfig, built_in_instruments, usual_altimeter, usual_instrument},
    frames::{BodyFixed, Position},
    geom::{
        attitude::matrix_of_spice_quaternion,
        body_rotation::{body_matrix, convert_datum},
        ellipsoid::{ray_meets_ellipsoid, spherical_to_xyz_m},
        image_outline::{Sight, convergence_rad},
    },
    pds::pedr::{LABEL_BYTES, LABEL_RECORDS, RECORD_BYTES, Record},
    scene::{SceneErrors, SceneOptions, write_scene, write_scene_along},
    spice::{KernelSet, Session},
    time::Et,
    units::{RADIANS_PER_DEGREE, RADIANS_PER_MICRODEGREE},
};
use nalgebra::Vector3;
use serde_json::Value;

/// Days of half an hour: slews, images and windows are all inside.
const SHORT: SceneOptions = SceneOptions {
    seed: 3,
    day_s: 1_800.0,
    pairs: 1,
    passes: 2,
    ties: 154,
    ties_at_shots: false,
    errors: SceneErrors::demo(),
};

struct Mission {
    folder: tempfile::TempDir,
    truth: Value,
}

static MISSION: LazyLock<Mission> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    write_scene(&folder.path().join("mission"), &SHORT).unwrap();
    let truth = truth_of(&folder.path().join("mission"));
    Mission { folder, truth }
});

impl Mission {
    fn path(&self, relative: &str) -> PathBuf {
        self.folder.path().join("mission").join(relative)
    }

    fn session(&self, metakernel: &str) -> Session {
        let path = self.path("kernels").join(metakernel);
        Session::open(&KernelSet::from_metakernel(&path).unwrap()).unwrap()
    }
}

fn truth_of(mission: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(mission.join("truth.json")).unwrap()).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|x| x.as_f64().unwrap())
        .collect()
}

fn vectors(value: &Value) -> Vec<Vector3<f64>> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|row| Vector3::from_vec(numbers(row)))
        .collect()
}

/// A shot by the rules of the PEDR, decoded here a second time; angles in radians, lengths in metres. Ground and spacecraft
/// are corrected by the crossover residual of the mid-point, which changes by 3 mm from frame to frame.
struct Decoded {
    tag_s: f64,
    ground_file_m: Vector3<f64>,
    spacecraft_file_m: Vector3<f64>,
    range_m: f64,
    class: i16,
}

fn decode(record: &Record, shot: u8) -> Decoded {
    let k = usize::from(shot - 1);
    let from_middle = f64::from(shot) - 10.5;
    let x = from_middle / 20.0;
    let micro =
        |mid: i32, change: i32| (f64::from(mid) + x * f64::from(change)) * RADIANS_PER_MICRODEGREE;
    let radius_m = f64::from(record.shot_radius_cm[k].get()) / 100.0;
    let higher_m = radius_m - f64::from(record.mid_radius_cm.get()) / 100.0;
    let parallax = |nanodegrees: i32| f64::from(nanodegrees) * 1e-9 * RADIANS_PER_DEGREE * higher_m;
    let latitude = micro(
        record.ground_latitude_microdegrees.get(),
        record.ground_latitude_change_microdegrees.get(),
    ) + parallax(record.parallax_latitude_nanodegrees_per_m.get());
    let longitude = micro(
        record.ground_longitude_microdegrees.get(),
        record.ground_longitude_change_microdegrees.get(),
    ) + parallax(record.parallax_longitude_nanodegrees_per_m.get());
    let craft_radius_m = (f64::from(record.spacecraft_radius_cm.get())
        + x * f64::from(record.spacecraft_radius_change_cm.get()))
        / 100.0;
    let craft_longitude = micro(
        record.spacecraft_longitude_microdegrees.get(),
        record.spacecraft_longitude_change_microdegrees.get(),
    );
    let craft_latitude = micro(
        record.spacecraft_latitude_microdegrees.get(),
        record.spacecraft_latitude_change_microdegrees.get(),
    );
    let residual_m = f64::from(record.crossover_residual_cm.get()) / 100.0;
    let [radius_m, craft_radius_m] = [radius_m, craft_radius_m].map(|of_m| of_m - residual_m);
    Decoded {
        tag_s: record.time_s.get() + from_middle * 1e7 / f64::from(record.clock_frequency_hz.get()),
        ground_file_m: spherical_to_xyz_m(longitude, latitude, radius_m),
        spacecraft_file_m: spherical_to_xyz_m(craft_longitude, craft_latitude, craft_radius_m),
        range_m: f64::from(record.range_cm[k].get()) / 100.0,
        class: record.class[k].get(),
    }
}

fn records(path: &Path) -> Vec<Record> {
    let bytes = fs::read(path).unwrap();
    assert_eq!(bytes.len() % RECORD_BYTES, 0);
    bytes[LABEL_BYTES..]
        .chunks_exact(RECORD_BYTES)
        .map(|chunk| Record::from_bytes(chunk.try_into().unwrap()))
        .collect()
}

fn datum(file: &str) -> Datum {
    if file.ends_with("l.b") {
        Datum::Iau2000
    } else {
        Datum::Iau1991
    }
}

fn shots(profile: &Value) -> Vec<(usize, u8)> {
    let whole = |value: &Value| usize::try_from(value.as_u64().unwrap()).unwrap();
    let records = profile["record"].as_array().unwrap();
    let shots = profile["shot"].as_array().unwrap();
    records
        .iter()
        .zip(shots)
        .map(|(record, shot)| {
            (
                whole(record) - LABEL_RECORDS - 1,
                u8::try_from(whole(shot)).unwrap(),
            )
        })
        .collect()
}

#[test]
fn the_gsfc_orbit_and_the_biased_attitude_are_the_truth() {
    let session = MISSION.session("gsfc.tm");
    for image in MISSION.truth["images"].as_array().unwrap() {
        let epochs = numbers(&image["epochs_et_s"]);
        let positions = vectors(&image["position_iau2000_m"]);
        assert_eq!(epochs.len(), 31);
        for (index, seconds) in epochs.iter().enumerate() {
            let et = Et::from_seconds(*seconds);
            let mars = body_matrix(&MARS_IAU2000, et);
            let position = mars * session.state(et).unwrap().position.xyz_m;
            let off_m = (position - positions[index]).norm();
            assert!(off_m < 1e-4, "{} {off_m} m", image["id"]); // 0.1 mm; kernels round to 1e-9 km
            let attitude = session
                .attitude(usual_instrument().pointing_bias().lookup(et), et, 0.0)
                .unwrap();
            let camera =
                session.mounting(usual_instrument(), et).unwrap() * attitude.inertial_to_bus;
            let camera_to_mars = mars * camera.matrix().transpose();
            let quaternion: [f64; 4] = numbers(&image["camera_to_mars_quaternion_wxyz"][index])
                .try_into()
                .unwrap();
            let off_rad = (camera_to_mars - matrix_of_spice_quaternion(quaternion))
                .abs()
                .max();
            assert!(off_rad < 1e-10, "{} {off_rad} rad", image["id"]); // clock ticks round to 1e-11 rad
            // Without the bias the camera looks elsewhere: 1.15 s at 0.05 deg/s, unless it is held.
            let unbiased = session.attitude(
                areograph::time::PointingBias::from_seconds(0.0).lookup(et),
                et,
                0.0,
            );
            let turned = unbiased.unwrap().inertial_to_bus.matrix()
                * attitude.inertial_to_bus.matrix().transpose();
            let turned_deg = turned[(0, 2)].abs().asin() / RADIANS_PER_DEGREE;
            let expected_deg = if image["look"] == "nadir" {
                0.0585
            } else {
                0.0
            };
            assert!(
                (turned_deg - expected_deg).abs() < 0.001,
                "{} {turned_deg}",
                image["id"]
            );
        }
    }
}

#[test]
fn image_starts_are_the_published_times_to_the_clock_tick() {
    let session = MISSION.session("nav.tm");
    for image in MISSION.truth["images"].as_array().unwrap() {
        let id = image["id"].as_str().unwrap();
        let label = areograph::pds::read_label(
            &MISSION.path(&format!("labels/{id}.lbl")),
            built_in_instruments(),
        )
        .unwrap();
        let clock = session
            .sclk_to_et(&label.fields.sclk_start.unwrap())
            .unwrap();
        let utc = session.utc_to_et(&label.fields.utc_start.unwrap()).unwrap();
        assert!((clock.seconds() - image["start_et_s"].as_f64().unwrap()).abs() < 1e-9);
        assert!((0.0..0.004).contains(&utc.since(clock)), "{id}"); // a tick is 1/256 s
    }
}

#[test]
fn the_images_are_flown_as_table_2_prints_them() {
    // Emission angle in degrees, sum factor, lines of the header and of the file, samples.
    let table = [
        ("E02-02855", 0.16, 3, 9_856, 9_856, 672),
        ("E04-01275", 17.97, 2, 8_064, 7_424, 1_024), // 7424 are printed of the header too; Table 4 takes 8064
        ("E02-00665", 0.2, 2, 10_496, 10_112, 1_024),
        ("E02-01453", 22.1, 2, 8_960, 8_960, 1_024),
        ("E02-01301", 13.0, 2, 8_064, 7_680, 1_024),
        ("E02-02016", 0.2, 2, 8_064, 7_680, 1_024),
    ];
    let images = MISSION.truth["images"].as_array().unwrap();
    assert_eq!(images.len(), table.len());
    for (id, emission_deg, sum, header_lines, file_lines, samples) in table {
        let truth = images.iter().find(|image| image["id"] == id).unwrap();
        let middle = numbers(&truth["camera_to_mars_quaternion_wxyz"][15]);
        let boresight = matrix_of_spice_quaternion(middle.try_into().unwrap())
            .column(2)
            .into_owned();
        let camera = Position::<BodyFixed>::new(vectors(&truth["position_iau2000_m"])[15]);
        let ground_m = ray_meets_ellipsoid(Body::Mars.model(), &camera, &boresight)
            .unwrap()
            .xyz_m;
        let flown_deg = ground_m.angle(&-boresight) / RADIANS_PER_DEGREE;
        // Degrees: two of the nadir images are printed to a tenth, and one mounting serves all.
        assert!((flown_deg - emission_deg).abs() < 0.06, "{id}: {flown_deg}");
        let path = MISSION.path(&format!("labels/{id}.lbl"));
        let label = areograph::pds::read_label(&path, built_in_instruments()).unwrap();
        let fields = &label.fields;
        assert_eq!(fields.downtrack_summing, Some(sum), "{id}");
        assert_eq!(fields.lines_header, Some(header_lines), "{id}");
        assert_eq!(fields.samples, Some(samples), "{id}");
        let delivered = site_files()
            .flat_map(|site| site.images)
            .find(|image| image.id == id)
            .unwrap()
            .fields
            .lines_delivered;
        assert_eq!(delivered.unwrap_or(header_lines), file_lines, "{id}");
    }
}

#[test]
fn convergence_by_centres_is_that_of_the_rays_to_common_ground() {
    const RADIUS_M: f64 = 3_389_500.0;
    let images = MISSION.truth["images"].as_array().unwrap();
    // Where the spacecraft was and what it looked at, in the middle of the swath.
    let seen = |id: &str| -> Vec<[Vector3<f64>; 2]> {
        let truth = images.iter().find(|image| image["id"] == id).unwrap();
        let cameras = vectors(&truth["position_iau2000_m"]);
        let quaternions = truth["camera_to_mars_quaternion_wxyz"].as_array().unwrap();
        let rays = cameras.into_iter().zip(quaternions);
        rays.map(|(camera_m, quaternion)| {
            let to_mars = matrix_of_spice_quaternion(numbers(quaternion).try_into().unwrap());
            let camera = Position::<BodyFixed>::new(camera_m);
            let ground =
                ray_meets_ellipsoid(Body::Mars.model(), &camera, &to_mars.column(2).into_owned());
            [camera_m, ground.unwrap().xyz_m]
        })
        .collect()
    };
    // As an index has it: hundredths of a degree.
    let place = |towards: &Vector3<f64>| {
        let angles = [
            towards.y.atan2(towards.x),
            (towards.z / towards.norm()).asin(),
        ];
        angles
            .map(|angle| (angle / RADIANS_PER_DEGREE * 100.0).round() / 100.0 * RADIANS_PER_DEGREE)
    };
    let sight = |seen: &[[Vector3<f64>; 2]]| {
        let [camera_m, ground_m] = seen[seen.len() / 2];
        Sight {
            centre_rad: place(&ground_m),
            below_rad: place(&camera_m),
            altitude_m: camera_m.norm() - RADIUS_M,
        }
    };
    for (one, other, least_deg) in [
        ("E02-02855", "E04-01275", 15.0),
        ("E02-00665", "E02-01453", 19.0),
        ("E02-01301", "E02-02016", 10.0),
    ] {
        let (one, other) = (seen(one), seen(other));
        let all = one
            .iter()
            .flat_map(|one| other.iter().map(move |other| (one, other)));
        let apart_m =
            |pair: &(&[Vector3<f64>; 2], &[Vector3<f64>; 2])| (pair.0[1] - pair.1[1]).norm();
        let nearest = all
            .min_by(|a, b| apart_m(a).total_cmp(&apart_m(b)))
            .unwrap();
        let ground_m = (nearest.0[1] + nearest.1[1]) / 2.0;
        let flown_rad = (nearest.0[0] - ground_m).angle(&(nearest.1[0] - ground_m));
        let found_rad = convergence_rad(&sight(&one), &sight(&other), RADIUS_M);
        let [flown, found] = [flown_rad, found_rad].map(|angle| angle / RADIANS_PER_DEGREE);
        // Degrees: places to 0.6 km of 380, Mars a sphere, and images held inertially turn by 0.4 from end to end.
        assert!(
            flown > least_deg && (flown - found).abs() < 0.6,
            "{found} {flown}"
        );
    }
}

/// The configurations of the three pairs.
fn site_files() -> impl Iterator<Item = SiteConfig> {
    ["eos_chasma", "gusev_crater", "isidis"]
        .into_iter()
        .map(|site| {
            let path = MISSION.path(&format!("sites/{site}.toml"));
            SiteConfig::load(&path).unwrap().config
        })
}

#[test]
fn footprints_come_back_within_0_2_m_and_times_within_2_us() {
    let mut worst: BTreeMap<String, f64> = BTreeMap::new();
    for profile in MISSION.truth["profiles"].as_array().unwrap() {
        let file = profile["file"].as_str().unwrap();
        let records = records(&MISSION.path(&format!("pedr/{file}")));
        let times = numbers(&profile["et_s"]);
        let grounds = vectors(&profile["ground_iau2000_m"]);
        // A further pass may leave the window through its side.
        assert!(times.len() > 100, "{file}: {} shots", times.len());
        for (((record, shot), time_s), truth_m) in
            shots(profile).into_iter().zip(times).zip(grounds)
        {
            let decoded = decode(&records[record], shot);
            assert_eq!(decoded.class, 1);
            let et = Et::from_seconds(decoded.tag_s - usual_altimeter().clock_bias_s);
            assert!((et.seconds() - time_s).abs() < 2e-6);
            let ground = convert_datum(
                areograph::body::Body::Mars,
                decoded.ground_file_m,
                datum(file),
                et,
                et,
            );
            let off_m = (ground.xyz_m - truth_m).norm();
            let held = worst.entry(file.to_owned()).or_default();
            *held = held.max(off_m);
        }
    }
    // Six files of images, the lost image has no window; two further passes over each of three sites.
    let further = worst.keys().filter(|file| file.starts_with("ap200"));
    assert_eq!((worst.len(), further.count()), (12, 6), "{worst:?}");
    println!("largest distance from the true footprint, m: {worst:.3?}");
    assert!(worst.values().all(|off_m| *off_m < 0.2), "{worst:?}");
}

#[test]
fn range_minus_distance_has_the_expected_mean_for_every_orbit() {
    for family in ["nav", "gsfc", "ipng"] {
        let session = MISSION.session(&format!("{family}.tm"));
        for profile in MISSION.truth["profiles"].as_array().unwrap() {
            let file = profile["file"].as_str().unwrap();
            let records = records(&MISSION.path(&format!("pedr/{file}")));
            let residuals: Vec<f64> = shots(profile)
                .into_iter()
                .map(|(record, shot)| {
                    let decoded = decode(&records[record], shot);
                    let et = Et::from_seconds(decoded.tag_s - usual_altimeter().clock_bias_s);
                    let ground = convert_datum(
                        areograph::body::Body::Mars,
                        decoded.ground_file_m,
                        datum(file),
                        et,
                        et,
                    );
                    let spacecraft =
                        body_matrix(&MARS_IAU2000, et) * session.state(et).unwrap().position.xyz_m;
                    let own_m = (decoded.spacecraft_file_m - decoded.ground_file_m).norm();
                    // The frame's own spacecraft track is linear: a metre would be a field read wrongly.
                    assert!(
                        (decoded.range_m - own_m).abs() < 0.3,
                        "{file} {}",
                        decoded.range_m - own_m
                    );
                    decoded.range_m - (spacecraft - ground.xyz_m).norm()
                })
                .collect();
            let mean_m = residuals.iter().sum::<f64>() / residuals.len() as f64;
            let difference = &profile["orbit_differences"][family];
            let expected_m = difference["expected_range_minus_distance_mean_m"]
                .as_f64()
                .unwrap();
            println!("{file} {family}: {mean_m:.4} m, expected {expected_m:.4} m");
            // A footprint is rounded by 0.06 m on the ground, ten frames make a profile, looks lean by up to 18 deg.
            assert!(
                (mean_m - expected_m).abs() < 0.03,
                "{file} {family} {mean_m} {expected_m}"
            );
            assert!(expected_m.abs() < 50.0 && (family != "gsfc" || expected_m.abs() < 1e-9));
        }
    }
}

#[test]
fn site_files_pass_their_own_checks() {
    for site in ["eos_chasma", "gusev_crater", "isidis"] {
        let loaded = SiteConfig::load(&MISSION.path(&format!("sites/{site}.toml"))).unwrap();
        assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
        assert_eq!(loaded.config.site, site);
        assert_eq!(loaded.config.images.len(), 2);
        assert!(loaded.config.ties.files[0].ends_with(format!("ties/{site}.csv")));
        assert!((loaded.config.altimeter_clock.correction_s() + 0.117).abs() < 1e-12);
    }
}

#[test]
fn images_are_taken_by_day_and_the_records_say_so() {
    let profiles = MISSION.truth["profiles"].as_array().unwrap().iter();
    for profile in profiles.filter(|profile| !profile["image"].is_null()) {
        let file = profile["file"].as_str().unwrap();
        let records = records(&MISSION.path(&format!("pedr/{file}")));
        let record = &records[shots(profile)[0].0];
        let hour = 12.0 + f64::from(record.local_time.get()) * 1e-4 * 12.0 / std::f64::consts::PI;
        // The mission's orbit passed the dayside equator at about two in the afternoon.
        assert!((13.0..15.5).contains(&hour), "{file}: {hour} h");
        let incidence_deg = f64::from(record.solar_incidence.get()) * 1e-4 / RADIANS_PER_DEGREE;
        assert!(incidence_deg < 70.0, "{file}: {incidence_deg}");
    }
}

#[test]
fn the_same_seed_gives_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let again = folder.path().join("again");
    write_scene(&again, &SHORT).unwrap();
    write_scene(&again, &SHORT).unwrap(); // replaces the first
    let mut compared = 0;
    for part in ["kernels", "pedr", "labels", "sites", "ties", "."] {
        for entry in fs::read_dir(MISSION.path(part)).unwrap() {
            let path = entry.unwrap().path();
            if path.is_file() {
                let other = again.join(part).join(path.file_name().unwrap());
                assert!(
                    fs::read(&path).unwrap() == fs::read(&other).unwrap(),
                    "{}",
                    path.display()
                );
                compared += 1;
            }
        }
    }
    // The second 6: two further passes over each site.
    assert_eq!(compared, 7 + 6 + 5 + 7 + 6 + 9 + 4 + 4 + 3);
    assert_eq!(
        fs::read_dir(folder.path()).unwrap().count(),
        1,
        "no draft is left"
    );
}

#[test]
fn days_that_miss_their_image_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let options = SceneOptions {
        day_s: f64::NAN,
        ..SHORT
    };
    let failure = write_scene(&folder.path().join("mission"), &options).unwrap_err();
    assert!(
        failure
            .to_string()
            .contains("day_s is NaN; expected 600 to 90000"),
        "{failure}"
    );
}

#[test]
fn a_flight_along_real_kernels_gives_shots_that_fit_them() {
    let test = "a_flight_along_real_kernels_gives_shots_that_fit_them";
    let Some(data) = common::real_data("ale_mgs/m0402852", test) else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let data = data.canonicalize().unwrap();
    let list: Vec<String> = common::M0402852_KERNELS
        .iter()
        .map(|name| format!("'$D/{name}'"))
        .collect();
    let metakernel = folder.path().join("real.tm");
    let text = format!(
        "KPL/MK\n\\begindata\nPATH_SYMBOLS = ( 'D' )\nPATH_VALUES = ( '{}' )\nKERNELS_TO_LOAD = ( {} )\n",
        data.display(),
        list.join("\n")
    );
    fs::write(&metakernel, text).unwrap();
    let mission = folder.path().join("along");
    let summary = write_scene_along(
        &mission,
        &metakernel,
        &[data.join("m0402852_isis.lbl")],
        SHORT.seed,
    )
    .unwrap();
    println!("{summary}");
    assert_eq!((summary.images, summary.pedr_files), (1, 1));
    let loaded = SiteConfig::load(&mission.join("sites/m04-02852.toml")).unwrap();
    assert_eq!(loaded.config.windows.len(), 2);

    let truth = truth_of(&mission);
    let records = records(&mission.join("pedr/ap10001l.b"));
    let session = Session::open(&KernelSet::from_metakernel(&metakernel).unwrap()).unwrap();
    for profile in truth["profiles"].as_array().unwrap() {
        let times = numbers(&profile["et_s"]);
        assert!(times.len() > 2_000);
        let mut sum_m = 0.0;
        for (record, shot) in shots(profile) {
            let decoded = decode(&records[record], shot);
            let et = Et::from_seconds(decoded.tag_s - usual_altimeter().clock_bias_s);
            let spacecraft =
                body_matrix(&MARS_IAU2000, et) * session.state(et).unwrap().position.xyz_m;
            let residual_m = decoded.range_m - (spacecraft - decoded.ground_file_m).norm();
            assert!(residual_m.abs() < 0.5, "{residual_m}");
            sum_m += residual_m;
        }
        let mean_m = sum_m / times.len() as f64;
        println!(
            "{}: mean {mean_m:.4} m, frame error {}",
            profile["window"], profile["frame_error_max_m"]
        );
        assert!(mean_m.abs() < 0.02, "{mean_m}");
    }
}
