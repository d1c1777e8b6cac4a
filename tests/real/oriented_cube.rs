//! A real MOC cube after `spiceinit` as the only source of times and orientation, held against its own tables as text, and in a
//! closed loop; cubes with the states of the mission's pair.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests work in temporary folders and may fail loudly"
)]

use crate::{
    common,
    support_data::{pair_with_support_data, places},
};

use std::{
    fmt::Write as _,
    fs,
    fs::File,
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
};

use areograph::{
    body::Body,
    config::{
        ImageConfig, KernelsConfig, OrientationConfig, PointingConfig, all_instruments,
        built_in_instruments, usual_instrument,
    },
    frames::{BodyFixed, Position},
    geom::{
        attitude::{matrix_of_rotation_vector, matrix_of_spice_quaternion, rotation_vector},
        ellipsoid::{Spherical, ray_meets_ellipsoid},
        pushbroom::{CameraModel, Detector},
    },
    pds::{oriented_cube::read_oriented_cube, read_label},
    spice::{KernelSet, KernelView},
    stage::{Output, Provenance, Stage as _},
    stages::{
        fit_sensor_model::fit_sensor_model,
        oriented::OrientedImage,
        sample_orientation::{Orientation, SampleOrientation},
        tag_times::{ImageTimes, tag_times},
    },
};
use areograph_testing::{
    csm_state::{state_of_isd, state_text},
    cube::{CubeString, cube_with},
};
use arrow_array::{RecordBatch, cast::AsArray as _, types::Float64Type};
use common::{case::Case, json};
use nalgebra::{Matrix3, Vector3};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

const START_S: f64 = 38_134_456.448_224_77;
const PERIOD_S: f64 = 2.0 * 0.4821e-3;
/// `ConstantRotation` of the label.
const TO_CAMERA: [f64; 9] = [
    0.999_994_283_955_81,
    0.003_139_080_428_038_8,
    0.001_256_276_150_102_4,
    -0.003_141_585_031_924_9,
    0.999_993_071_811_37,
    0.001_996_690_447_655,
    -0.001_249_999_674_479_2,
    -0.002_000_625_732_833_3,
    0.999_997_217_494_87,
];

pub(crate) fn cube() -> Option<PathBuf> {
    common::real_data("moc_cubes/E0201461.tiny.cub", "a real oriented cube")
}

/// Rows of a table of the cube, from its copy as text.
fn rows(cube: &Path, table: &str) -> Vec<Vec<f64>> {
    let text = cube.with_file_name(format!("E0201461.tiny.{table}.csv"));
    let text = fs::read_to_string(text).unwrap();
    let lines = text.lines().skip(1).filter(|line| !line.is_empty());
    lines
        .map(|line| {
            line.split(',')
                .map(|number| number.parse().unwrap())
                .collect()
        })
        .collect()
}

/// The rows around an instant, and the share of the way between them.
fn around(rows: &[Vec<f64>], et_s: f64) -> ([&[f64]; 2], f64) {
    let et = |row: &[f64]| *row.last().unwrap();
    let after = rows
        .partition_point(|row| et(row) <= et_s)
        .clamp(1, rows.len() - 1);
    let pair = [&*rows[after - 1], &*rows[after]];
    (pair, (et_s - et(pair[0])) / (et(pair[1]) - et(pair[0])))
}

/// Rotation from J2000 on the arc between two rows.
fn turned(rows: &[Vec<f64>], et_s: f64) -> Matrix3<f64> {
    let (pair, share) = around(rows, et_s);
    let [before, after] =
        pair.map(|row| matrix_of_spice_quaternion([row[0], row[1], row[2], row[3]]));
    matrix_of_rotation_vector(&(rotation_vector(&(after * before.transpose())) * share)) * before
}

/// Place of the camera and its axes on Mars at an instant, from the tables as text: metres, camera to body-fixed.
fn camera(cube: &Path, et_s: f64) -> (Vector3<f64>, Matrix3<f64>) {
    let positions = rows(cube, "InstrumentPosition");
    let ([one, two], u) = around(&positions, et_s);
    let step_s = two[6] - one[6];
    let vector = |row: &[f64], at: usize| 1e3 * Vector3::new(row[at], row[at + 1], row[at + 2]);
    // Hermite's cubic as a blend of both ends.
    let (p, q) = (vector(one, 0), vector(two, 0));
    let (v, w) = (step_s * vector(one, 3), step_s * vector(two, 3));
    let position_m =
        p + u * (v + u * ((3.0 * (q - p) - 2.0 * v - w) + u * (2.0 * (p - q) + v + w)));
    let to_mars = turned(&rows(cube, "BodyRotation"), et_s);
    let to_bus = turned(&rows(cube, "InstrumentPointing"), et_s);
    let to_camera = Matrix3::from_row_slice(&TO_CAMERA);
    (
        to_mars * position_m,
        to_mars * (to_camera * to_bus).transpose(),
    )
}

/// Distance of the shots of most sites from the centre of Mars, metres.
const RADIUS_M: f64 = 3_393_000.0;

/// Where a ray from the camera is at this distance from the centre of Mars.
fn ground(position_m: &Vector3<f64>, look: &Vector3<f64>, radius_m: f64) -> Vector3<f64> {
    let look = look.normalize();
    let along_m = position_m.dot(&look);
    let square = along_m * along_m - position_m.norm_squared() + radius_m.powi(2);
    position_m + look * (-along_m - square.sqrt())
}

#[test]
fn tables_and_first_time_are_those_of_the_cube() {
    let Some(path) = cube() else { return };
    let cube = read_oriented_cube(&path, built_in_instruments()).unwrap();
    let support = &cube.support;
    let times = &support.line_times;
    // To the last bit of an ET, 7e-9 s.
    assert_eq!(times.start().seconds().to_bits(), START_S.to_bits());
    assert!((times.mean_period_s() - PERIOD_S).abs() < 1e-12);
    assert_eq!(
        (times.lines(), support.samples, support.first_detector),
        (8_064, 1_024, 0)
    );
    assert_eq!(cube.projection.as_deref(), Some("Sinusoidal"));
    for row in rows(&path, "InstrumentPosition") {
        let (position_m, velocity_m_s) = support.tables.position.at(row[6]);
        // Metres and metres per second: rounding of kilometres.
        assert!((position_m - 1e3 * Vector3::new(row[0], row[1], row[2])).norm() < 1e-6);
        assert!((velocity_m_s - 1e3 * Vector3::new(row[3], row[4], row[5])).norm() < 1e-9);
    }
    for (table, rotations) in [
        ("InstrumentPointing", &support.tables.pointing),
        ("BodyRotation", &support.tables.body_rotation),
    ] {
        for row in rows(&path, table) {
            let expected = matrix_of_spice_quaternion([row[0], row[1], row[2], row[3]]);
            // Elements: rounding.
            assert!(
                (rotations.at(row[7]).0 - expected).abs().max() < 1e-13,
                "{table}"
            );
        }
    }
}

fn parquet(path: &Path) -> RecordBatch {
    let builder = ParquetRecordBatchReaderBuilder::try_new(File::open(path).unwrap()).unwrap();
    builder.build().unwrap().next().unwrap().unwrap()
}

fn column(table: &RecordBatch, name: &str) -> Vec<f64> {
    let column = table.column_by_name(name).unwrap();
    column.as_primitive::<Float64Type>().values().to_vec()
}

/// A site of the cube with shots at this radius, in the layout of the ODE, where `places` (lines and samples) look.
pub(crate) fn site(path: &Path, places: &[[f64; 2]], radius_m: f64) -> Case {
    let case = Case::empty();
    let detector = Detector::new(usual_instrument(), 2, 0, 1_024);
    let mut table =
        "long_East,lat_North,topography,MOLArange,planet_rad,c,A,Ephermis Time,UTC,Orbit\n"
            .to_owned();
    for (shot, [line, sample]) in places.iter().enumerate() {
        let (position_m, to_mars) = camera(path, START_S + line * PERIOD_S);
        let look = to_mars * detector.look(*sample);
        let at = Spherical::from_xyz_m(&ground(&position_m, &look, radius_m));
        let et_s = -26_269_612.0 + 0.1 * shot as f64;
        writeln!(
            table,
            "{:.13},{:.13},-1000.0,400000.0,{:.7},1,0,{et_s:.5},1999-03-03T10:52:{:06.3},1613",
            at.longitude_rad.to_degrees().rem_euclid(360.0),
            at.latitude.0.to_degrees(),
            at.radius_m,
            3.815 + 0.1 * shot as f64
        )
        .unwrap();
    }
    case.write("shots.csv", table);
    case.write("E0201461.cub", fs::read(path).unwrap());
    let kernel = path
        .ancestors()
        .nth(2)
        .unwrap()
        .join("mgs_text/naif0012.tls");
    case.write("naif0012.tls", fs::read(kernel).unwrap());
    case.write(
        "site.toml",
        "site = \"cube\"\nkernels.files = [\"naif0012.tls\"]\n[[shots]]\nfiles = [\"shots.csv\"]\nlayout = \"ode_pedr\"\n[[windows]]\n\
         id = \"window\"\nlongitude_deg = [141.4, 141.8]\nlatitude_deg = [34.0, 34.7]\n[[images]]\nid = \"E02-01461\"\n\
         cube = \"E0201461.cub\"\n[registration]\nmodel = \"samples\"\n[orientation]\nintervals = 400\n",
    );
    case
}

#[test]
fn ground_seen_by_its_tables_comes_back_to_line_and_sample() {
    let Some(path) = cube() else { return };
    let places: Vec<[f64; 2]> = (0..40)
        .map(|at| [20.5 + 200.0 * f64::from(at), 12.0 + 25.0 * f64::from(at)])
        .collect();
    let case = site(&path, &places, RADIUS_M);
    let outcome = case.outcome(case.run());
    let orientation = case.path("out/cube/images/E02-01461/orientation.json");
    assert!(orientation.exists(), "{outcome}");
    assert!(
        outcome.contains("map-projected (Sinusoidal)")
            || json(&case.path("out/cube/manifest.json"))["notes"]
                .to_string()
                .contains("map-projected (Sinusoidal)")
    );
    let table = parquet(&case.path("out/cube/registration.parquet"));
    assert_eq!(table.num_rows(), places.len(), "{outcome}");
    let (lines, samples) = (column(&table, "line"), column(&table, "sample"));
    for (row, [line, sample]) in places.iter().enumerate() {
        let off_px = (lines[row] - line).hypot(samples[row] - sample);
        // Pixels: samples are 0.02 s apart, beside a row at which the attitude changes its rate by 2e-5 rad/s.
        assert!(
            off_px < 0.05,
            "{row}: {} {} for {line} {sample}",
            lines[row],
            samples[row]
        );
    }
    // Degrees, to the digits of an independent computation: the boresight of the first and the last line on the ellipsoid.
    let samples = parquet(&orientation.with_extension("parquet"));
    let [east_deg, north_deg] =
        ["longitude", "latitude"].map(|name| column(&samples, &format!("boresight_{name}_deg")));
    for (row, [east, north]) in [
        (0, [141.6115, 34.1075]),
        (samples.num_rows() - 1, [141.5378, 34.5465]),
    ] {
        let place = [east_deg[row], north_deg[row]];
        assert!(
            (place[0] - east).abs() < 6e-5 && (place[1] - north).abs() < 6e-5,
            "{place:?}"
        );
    }
}

#[test]
fn its_map_projected_pixels_are_refused_as_samples() {
    let Some(path) = cube() else { return };
    let case = site(&path, &[[4_000.0, 500.0], [4_100.0, 500.0]], RADIUS_M);
    case.replace(
        "site.toml",
        "cube = \"E0201461.cub\"\n",
        "cube = \"E0201461.cub\"\npixels = \"E0201461.cub\"\n",
    );
    let outcome = case.outcome(case.run());
    assert!(
        !outcome.starts_with("exit 0") && outcome.contains("map"),
        "{outcome}"
    );
    // As a label, it is refused for the same reason, with what to do.
    case.replace("site.toml", "cube = \"E0201461.cub\"\npixels", "label");
    let outcome = case.outcome(case.run());
    assert!(
        !outcome.starts_with("exit 0") && outcome.contains("map projection"),
        "{outcome}"
    );
}

/// No model is refused for its residuals.
const SAMPLING: OrientationConfig = OrientationConfig {
    intervals: 400,
    light_time: areograph::geom::light_time::LightTime::Surface,
    position_rmse_max_m: 1e5,
    pointing_rmse_max_rad: 1.0,
};

/// Line times and orientation of the cube by the stages of a site.
fn staged(cube: &Path) -> (ImageTimes, Orientation) {
    let leap_seconds = cube
        .ancestors()
        .nth(2)
        .unwrap()
        .join("mgs_text/naif0012.tls");
    let kernels = KernelView::all(Some(&KernelSet::from_files(&[leap_seconds]).unwrap()));
    let image = ImageConfig {
        id: "E02-01461".to_owned(),
        cube: Some(cube.to_owned()),
        ..ImageConfig::default()
    };
    let times = tag_times(&[image], kernels.session().unwrap())
        .unwrap()
        .remove(0);
    let provenance = Provenance {
        blake3: String::new(),
        fingerprint: String::new(),
    };
    let stage = SampleOrientation {
        image: "E02-01461",
        times: &Output::known("tag_times/E02-01461".to_owned(), times.clone(), provenance),
        kernels: &kernels,
        coverage: &KernelsConfig::default(),
        pointing: &PointingConfig {
            ck_bias: None,
            source: None,
        },
        orientation: &SAMPLING,
    };
    let orientation = stage.run(&AtomicBool::new(false)).unwrap();
    (times, orientation)
}

#[test]
fn its_image_to_ground_and_ground_to_image_are_inverse() {
    let Some(path) = cube() else { return };
    let (times, orientation) = staged(&path);
    let model = fit_sensor_model(&orientation, &SAMPLING, None).unwrap();
    let camera = OrientedImage::of(&times, &orientation, &model).unwrap();
    let projector = camera.projector_of(CameraModel::Samples).unwrap();
    // A place on the ellipsoid, and above or below it by a share of the range.
    let to_ground = |line: f64, sample: f64, share: f64| {
        let pose = camera
            .orientation(CameraModel::Samples)
            .pose(times.line_times.offset_of_line(line));
        let look = pose.mars_to_camera.tr_mul(&camera.detector.look(sample));
        let origin = Position::<BodyFixed>::new(pose.position_m);
        let ground = ray_meets_ellipsoid(Body::Mars.model(), &origin, &look).unwrap();
        pose.position_m + (ground.xyz_m - pose.position_m) * share
    };
    let (mut most_px, mut most_m) = (0.0_f64, 0.0_f64);
    for line in (0..=64).map(|step| 126.0 * f64::from(step)) {
        for sample in (0..=16).map(|step| 64.0 * f64::from(step)) {
            for share in [0.98, 1.0, 1.01] {
                let ground_m = to_ground(line, sample, share);
                let seen = camera.line_and_sample(&projector, &ground_m).unwrap();
                most_px = most_px.max((seen.x - line).hypot(seen.y - sample));
                let again_m = to_ground(seen.x, seen.y, share);
                most_m = most_m.max((again_m - ground_m).norm());
            }
        }
    }
    println!("image to image {most_px:.1e} px, ground to ground {most_m:.1e} m");
    // Pixels, as demanded; metres, a pixel being 3 m.
    assert!(most_px < 1e-6 && most_m < 3e-6, "{most_px} px, {most_m} m");
}

/// A cube of the image of a label, with the state that its support data give.
fn cube_of_state(label: &Path, isd: &Path) -> Vec<u8> {
    let label = read_label(label, all_instruments()).unwrap();
    let isd = json(isd);
    let size = ["image_lines", "image_samples"]
        .map(|key| u32::try_from(isd[key].as_u64().unwrap()).unwrap());
    let fields = &label.fields;
    let groups = format!(
        "  Group = Instrument\n    SpacecraftName = \"MARS GLOBAL SURVEYOR\"\n    InstrumentId = MOC-NA\n    TargetName = Mars\n    \
         StartTime = {}\n    CrosstrackSumming = {}\n    DowntrackSumming = {}\n    LineExposureDuration = {} <milliseconds>\n    \
         SpacecraftClockCount = {}\n    FirstLineSample = 1\n  End_Group\n  Group = Archive\n    ProductId = {}\n  End_Group\n  \
         Group = BandBin\n    FilterName = BROAD_BAND\n  End_Group\n",
        fields.utc_start.as_deref().unwrap(),
        fields.crosstrack_summing.unwrap(),
        fields.downtrack_summing.unwrap(),
        fields.exposure_s.unwrap() * 1e3,
        fields.sclk_start.as_deref().unwrap(),
        label.product_id.as_deref().unwrap(),
    );
    let state = CubeString::state(&state_text(&state_of_isd(&isd)));
    cube_with(&groups, size, (&[], &[state]), false)
}

#[test]
fn a_pair_of_cubes_with_states_is_registered_as_by_its_support_data() {
    let case = pair_with_support_data();
    let outcome = case.outcome(case.run());
    assert!(outcome.starts_with("exit 0"), "{outcome}");
    fs::rename(case.path("out"), case.path("by_isd")).unwrap();
    fs::create_dir(case.path("cubes")).unwrap();
    for image in ["E02-01301", "E02-02016"] {
        let bytes = cube_of_state(
            &case.path(&format!("labels/{image}.lbl")),
            &case.path(&format!("isd/{image}.json")),
        );
        case.write(&format!("cubes/{image}.cub"), bytes);
        case.replace(
            "site.toml",
            &format!("isd = \"isd/{image}.json\""),
            &format!("cube = \"cubes/{image}.cub\""),
        );
    }
    let outcome = case.outcome(case.run());
    assert!(outcome.starts_with("exit 0"), "{outcome}");
    for name in ["registration.parquet", "registration_adjusted.parquet"] {
        let [expected, found] =
            ["by_isd", "out"].map(|out| places(&case.path(out).join("isidis").join(name)));
        assert!(expected.len() > 100);
        assert_eq!(expected.len(), found.len(), "{name}");
        let mut most_px = 0.0_f64;
        for ((row, expected), (same, found)) in expected.iter().zip(&found) {
            assert_eq!(row, same);
            most_px = most_px.max((expected[0] - found[0]).hypot(expected[1] - found[1]));
        }
        println!("{name}: {most_px:.1e} px");
        // Pixels: the rounding of ET, 7e-9 s, is 1e-5 lines, and enters several times.
        assert!(most_px < 1e-4, "{name}: {most_px}");
    }
    let mut info = case.areograph();
    info.args(["image", "info", "cubes/E02-01301.cub", "--json"]);
    let stated = case.outcome(info);
    assert!(
        stated.contains("camera model state from csminit: USGS_ASTRO_LINE_SCANNER_SENSOR_MODEL, UsgsAstroPluginCSM"),
        "{stated}"
    );
}
